//! The approximate inverse of the dynamic model by Chen et al.

use super::{Dpm, DpmState, MirrorParams};
use crate::preisach::{InverseSurface, Mirror};
use crate::{Env, Error, Real, Sampling, Stage};

/// The dynamic inverse of Chen et al. (eq. 23–29): an inverse Everett surface, whose branches are weighted by a mirror
/// function ξ(F, N) of the average rate F \[output unit/s\] and the change N \[output unit\] of the reference since its
/// last reversal (eq. 26 and 27).
///
/// There are two approximations: the inverse surface ([`InverseSurface`]), and ξ(F, N), which depends on the change of
/// the reference but not on its start. RMSE of the output of the test model on a reference of four sines, relative to
/// the span, with the mirror function calibrated from the model ([`calibrated`](Self::calibrated)):
///
/// | inverse | ξ even in P | ξ larger on rising branches |
/// |---|---|---|
/// | classical, exact ([`EverettInverse`](crate::EverettInverse)) | 2.1 % | 1.9 % |
/// | this one | 0.4 % | 1.9 % |
/// | this one as published ([`drifting`](Self::drifting)), after 2 s | 15 % | 19 % |
/// | [`Search`](crate::Search) on the [`Dpm`] | its tolerance | its tolerance |
#[derive(Clone, Debug, PartialEq)]
pub struct DpmSurfaceInverse<T, const N: usize, const R: usize, const C: usize> {
    inner: Dpm<T, N, R, C>,
    /// The input at rest \[input unit\].
    rest: T,
}

/// Number of bisections of a calibration: more than the bits of a number.
const HALVINGS: usize = 64;

impl<T: Real, const N: usize, const R: usize, const C: usize> DpmSurfaceInverse<T, N, R, C> {
    /// Creates the inverse from an inverse surface and a mirror function of force rate and force change. `fade` is as
    /// in [`Dpm::new`], in output units of the actuator.
    ///
    /// # Errors
    /// As [`Dpm::new`].
    pub fn new(
        surface: InverseSurface<T, N>,
        mirror: Mirror<T, R, C>,
        fade: f64,
        cx: &Sampling,
    ) -> Result<Self, Error> {
        let rest = surface.rest();
        Ok(Self { inner: Dpm::new(surface.into_map(), mirror, fade, cx)?, rest })
    }

    /// Creates the inverse with a mirror function that is calibrated from a model, as from an experiment. At each node
    /// (F, N) of `grid` the reference changes by N at the rate F from rest (N > 0) or from the highest output (N < 0).
    /// ξ is the change of the input for the model divided by that for its classical part (eq. 26). Node N = 0 has the
    /// mean of ξ for a small change to both sides.
    ///
    /// # Errors
    /// As [`new`](Self::new), [`InverseSurface::new`] and [`Mirror::from_fn`].
    pub fn calibrated<L, const M: usize, const S: usize, const D: usize>(
        model: &Dpm<T, M, S, D>,
        cells: usize,
        grid: &MirrorParams<L>,
        fade: f64,
        cx: &Sampling,
    ) -> Result<Self, Error> {
        let surface = InverseSurface::new(model.map(), cells)?;
        let h = cx.checked()?;
        let span = model.map().virgin(model.map().high()).to_f64();
        let mirror = Mirror::from_fn(grid, |rate, change| {
            let ratio = |change: f64| {
                let samples = (change.abs() / (rate * h)).at_least(1.0).at_most(f64::from(u32::MAX)) as u32;
                model.gain_ratio(change.at_most(span).at_least(-span), samples)
            };
            let small = 1e-3 * span;
            if change.abs() < small { 0.5 * (ratio(small) + ratio(-small)) } else { ratio(change) }
        })?;
        Self::new(surface, mirror, fade, cx)
    }

    /// Returns the inverse with the published recursion (eq. 25), which drifts; see [`Dpm::drifting`].
    #[must_use]
    pub fn drifting(self) -> Self {
        Self { inner: self.inner.drifting(), ..self }
    }
}

impl<T: Real, const N: usize, const R: usize, const C: usize> Dpm<T, N, R, C> {
    /// Returns the ratio of the input changes of this and of the classical model for an output change of `change` in
    /// `samples` samples, from the lowest or from the highest input.
    fn gain_ratio(&self, change: f64, samples: u32) -> f64 {
        let (low, high, e) = (self.map.low, self.map.high(), Env::default());
        let (from, to) = if change > 0.0 { (low, high) } else { (high, low) };
        let mut rested = self.state();
        let at_rest = self.reset(&mut rested, &e, from).to_f64();
        // One sample starts the new branch. Then its age is set to the duration.
        self.step(&mut rested, &e, from + (to - from) * T::from_f64(1e-4));
        rested.age = samples.saturating_sub(1);
        let needed = |output: &dyn Fn(T) -> f64| {
            // The range is twice the grid: with ξ < 1 the output on the grid is smaller than in the classical model.
            let (mut a, mut b) = (from.to_f64(), 2.0 * to.to_f64() - from.to_f64());
            for _ in 0..HALVINGS {
                let middle = 0.5 * (a + b);
                if (output(T::from_f64(middle)) - at_rest).abs() < change.abs() { a = middle } else { b = middle }
            }
            0.5 * (a + b) - from.to_f64()
        };
        let dynamic = needed(&|u| self.output_at(&rested, u));
        let classical = needed(&|u| {
            let mut s = self.map.state();
            self.map.reset(&mut s, &e, from);
            self.map.step(&mut s, &e, u).to_f64()
        });
        dynamic / classical
    }

    fn output_at(&self, s: &DpmState<T, N>, u: T) -> f64 {
        let t = self.trial(s, u);
        (t.output + t.offset - s.zero).to_f64()
    }
}

impl<T: Real, const N: usize, const R: usize, const C: usize> Stage<T> for DpmSurfaceInverse<T, N, R, C> {
    type State = DpmState<T, N>;

    fn state(&self) -> Self::State {
        self.inner.state()
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        self.rest + self.inner.reset(s, e, u0)
    }

    #[inline]
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        self.rest + self.inner.step(s, e, u)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{HIGH, Model, PERIOD, Random, model, soft};
    use super::*;
    use crate::{Invert, Search};
    use proptest::prelude::*;
    use std::boxed::Box;
    use std::vec::Vec;

    /// Range of inputs for the search: the grid and half of it on each side.
    const INPUTS: (f64, f64) = (-0.5 * HIGH, 1.5 * HIGH);
    const TOLERANCE: f64 = 1e-11;

    fn exact(m: &Model) -> Box<Search<f64, Model>> {
        Box::new(Search::new(m.clone(), INPUTS.0, INPUTS.1, TOLERANCE).unwrap())
    }

    /// Returns the error of the output of the model with the drive of an inverse, and the drive.
    fn errors<S: Stage<f64>>(m: &Model, rest: f64, reference: &[f64], inverse: &S) -> Vec<(f64, f64)> {
        let (mut s, mut i, e) = (m.state(), inverse.state(), Env::default());
        inverse.reset(&mut i, &e, 0.0);
        m.reset(&mut s, &e, rest);
        reference
            .iter()
            .map(|y| {
                let u = inverse.step(&mut i, &e, *y);
                (m.step(&mut s, &e, u) - y, u)
            })
            .collect()
    }

    /// Returns sines of 20, 50, 110 and 3 Hz between 0.6 and 10.4 N, from rest; `shift` changes their phases.
    fn multi_frequency(n: usize, shift: f64) -> Vec<f64> {
        let sine = |hz: f64, t: f64| libm::sin(2.0 * core::f64::consts::PI * hz * t + shift * hz);
        (0..n)
            .map(|k| {
                let t = k as f64 * PERIOD.period;
                let rise = (t / 0.02).min(1.0);
                rise * (5.5 + 2.0 * sine(20.0, t) + 1.4 * sine(50.0, t) + 0.7 * sine(110.0, t) + 0.8 * sine(3.0, t))
            })
            .collect()
    }

    #[test]
    fn approximate_inverse_has_the_stated_errors() {
        let even = |d: f64, p: f64| 1.0 - 0.25 * d / (d + 8e3) * (1.0 - 0.3 * p.abs() / 80.0);
        let reference = multi_frequency(20_000, 0.0);
        let grid = MirrorParams {
            rate_low: 0.36e3,
            rate_high: 2.88e3,
            rates: 8,
            change_low: -14.4,
            change_high: 14.4,
            changes: 9,
            weights: (),
        };
        // RMSE of the span [%]: classical exact inverse, inverse surface, with mirror, with mirror by eq. 25, exact.
        let percent = |m: &Model| {
            fn rmse<S: Stage<f64>>(m: &Model, reference: &[f64], inverse: &S) -> f64 {
                let errors = errors(m, 0.0, reference, inverse);
                100.0 / 14.4 * (errors.iter().map(|(x, _)| x * x).sum::<f64>() / reference.len() as f64).sqrt()
            }
            let surface = Box::new(InverseSurface::<f64, 33>::new(&m.map, 32).unwrap());
            let paper = Box::new(DpmSurfaceInverse::<f64, 33, 8, 9>::calibrated(m, 32, &grid, 3.6, &PERIOD).unwrap());
            [
                rmse(m, &reference, &m.map.invert().unwrap()),
                rmse(m, &reference, &*surface),
                rmse(m, &reference, &*paper),
                rmse(m, &reference, &paper.clone().drifting()),
                rmse(m, &reference, &*exact(m)),
            ]
        };
        let (a, b) = (percent(&model(0.0, 20.0, even)), percent(&model(0.0, 20.0, soft)));
        std::println!("even mirror: {a:.3?} %");
        std::println!("larger mirror on rising branches: {b:.3?} %");
        assert!(a[2] < 0.3 * a[0] && a[2] > 0.1, "{a:?}");
        assert!(b[2] < 1.1 * b[0] && b[2] > 0.5 * b[0], "{b:?}");
        for [.., drifting, exact] in [a, b] {
            assert!(drifting > 5.0 && exact < 1e-8, "{a:?} {b:?}");
        }
    }

    /// Generates models whose mirror falls with the rate, with a difference between rising and falling branches and a
    /// random part at each node.
    fn any_model(rest: f64) -> impl Strategy<Value = Box<Model>> {
        let nodes = prop::collection::vec(-1.0..1.0f64, 72);
        (0.0..0.4f64, 2e3..2e4f64, -0.1..0.1f64, 0.0..0.02f64, nodes, 10.0..80.0f64).prop_map(
            move |(strength, middle, tilt, rough, nodes, fade)| {
                let at = |d: f64, p: f64| nodes[(d / 2e3) as usize * 9 - 9 + ((p + 80.0) / 20.0) as usize];
                model(rest, fade, |d, p| 1.0 - strength * d / (d + middle) * (1.0 + tilt * p / 80.0) + rough * at(d, p))
            },
        )
    }

    fn lines(turns: &[(f64, usize)]) -> Vec<f64> {
        let mut all = Vec::new();
        let mut from = 0.0;
        for (to, n) in turns {
            all.extend((1..=*n).map(|k| from + (to - from) * k as f64 / *n as f64));
            from = *to;
        }
        all
    }

    proptest! {

        /// References are outputs of the model. If the output provably rises with the input, the input is found too.
        #[test]
        fn search_reaches_outputs_of_the_model(
            m in any_model(0.0), turns in prop::collection::vec((0.0..80.0f64, 1usize..30), 2..20),
        ) {
            prop_assume!(m.least_slope() > 0.0);
            let u = lines(&turns);
            let (mut s, e) = (m.state(), Env::default());
            m.reset(&mut s, &e, 0.0);
            let mut offset = 0.0f64;
            let reference: Vec<f64> = u
                .iter()
                .map(|u| {
                    let y = m.step(&mut s, &e, *u);
                    offset = offset.max(s.offset().abs());
                    y
                })
                .collect();
            let fade = 1.0 / m.per_fade.unwrap();
            let unique = offset < 0.9 * fade * m.least_slope();
            for ((error, drive), u) in errors(&m, 0.0, &reference, &*exact(&m)).iter().zip(&u) {
                prop_assert!(error.abs() < 1e-9, "{error}");
                prop_assert!(!unique || (drive - u).abs() < 1e-7, "{drive} {u}");
            }
        }

        #[test]
        fn search_reaches_multi_frequency_references(m in any_model(40.0), shift in 0.0..1.0f64, offset in -1.0..1.0f64) {
            // About rest in the middle: −4 to 4 N.
            let reference: Vec<f64> = multi_frequency(3000, shift).iter().map(|y| 0.7 * (y - 5.5) + offset).collect();
            for (error, drive) in errors(&m, 40.0, &reference, &*exact(&m)) {
                prop_assert!(error.abs() < 1e-9 || drive == INPUTS.0 || drive == INPUTS.1, "{error} at {drive}");
                prop_assert!((-20.0..100.0).contains(&drive), "{drive}");
            }
        }

        #[test]
        fn search_reaches_minor_loops(m in any_model(0.0), turns in prop::collection::vec((3.0..9.0f64, 1usize..30), 2..40)) {
            for (error, drive) in errors(&m, 0.0, &lines(&turns), &*exact(&m)) {
                prop_assert!(error.abs() < 1e-9, "{error} at {drive}");
            }
        }
    }

    /// Random mirrors that are not monotone: the input may jump, and the output is still reached.
    #[test]
    fn a_fold_is_crossed() {
        let mut random = Random(11);
        let nodes: Vec<f64> = (0..72).map(|_| 0.6 + 0.6 * random.next()).collect();
        let m = model(0.0, 20.0, |d, p| nodes[(d / 2e3) as usize * 9 - 9 + ((p + 80.0) / 20.0) as usize]);
        assert!(m.least_slope() < 0.0);
        for (error, drive) in errors(&m, 0.0, &multi_frequency(20_000, 0.0), &*exact(&m)) {
            assert!(error.abs() < 1e-9 || drive == INPUTS.0 || drive == INPUTS.1, "{error} at {drive}");
        }
    }
}
