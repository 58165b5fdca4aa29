//! Loops that widen with the rate of the drive, each in proportion to its own width.
//!
//! Beside any operator stand plays whose thresholds grow with the rate,
//!
//! ```text
//! y = H(u) + Σᵢ wᵢ (P(u; rᵢ g) − P(u; rᵢ)),   g = 1 + k (v / s)ᵖ,   τ v̇ + v = |u̇|,
//! ```
//!
//! so that with wᵢ the weights of a Prandtl-Ishlinskii operator its thresholds are rᵢ g (Al Janaideh, Su and Rakheja 2008, whose thresholds are all
//! multiplied by one function of the rate). A coercive voltage that grows with the rate does that: a wide loop gains more than a narrow one, which no
//! overdrive common to all does. v is the rate as the material feels it, over a time τ: with τ = 0 every loop would be as narrow at the turns of the drive as
//! on a slow one, since there the rate passes through zero.

use crate::error::{coefficient, within};
use crate::stage::finite_or;
use crate::{Build, Env, Error, Meta, Params, Real, Sampling, Stage, play};

/// Plays that one widening can hold.
pub const MAX_WIDENING: usize = 8;

/// Parameters of a widening; weights of zero are none. `L` is any list of numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct WideningParams<L> {
    /// Relative growth k of the thresholds at the reference rate \[ratio\]; a convention, not identified: of a small growth the weights take the size.
    pub growth: f64,
    /// Exponent p.
    pub exponent: f64,
    /// Reference rate s \[input unit/s\]; a convention, not identified.
    pub reference_rate: f64,
    /// Time τ over which the rate is felt \[s\].
    pub seconds: f64,
    /// Thresholds rᵢ \[input unit\]; a grid, not identified.
    pub thresholds: L,
    /// Weights wᵢ \[output unit/input unit\].
    pub weights: L,
}

/// Smallest exponent: below it the growth is the same at all rates, and belongs to the operator.
const LEAST_EXPONENT: f64 = 0.05;

impl<L: AsRef<[f64]>> WideningParams<L> {
    /// By how much the branches of a loop that moves all plays are farther from its middle at the reference rate than when it is slow: `Σ k wᵢ rᵢ` \[output unit\].
    pub fn extra_half_width(&self) -> f64 {
        let plays = self.thresholds.as_ref().iter().zip(self.weights.as_ref());
        self.growth * plays.fold(0.0, |sum, (r, w)| sum + r * w)
    }
}

impl<L: AsMut<[f64]>> Params for WideningParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        f(&Meta { name: "exponent", unit: "", lower: LEAST_EXPONENT, upper: 1.0 }, &mut self.exponent);
        f(&Meta { name: "seconds", unit: "s", lower: 0.0, upper: f64::INFINITY }, &mut self.seconds);
        for w in self.weights.as_mut() {
            f(&Meta { name: "weights", unit: "y/u", lower: 0.0, upper: f64::INFINITY }, w);
        }
    }
}

/// Coefficients of a widening at one sample period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Widening<T> {
    growth: T,
    exponent: T,
    /// 1 / (s h): reference rates in a unit of the input per sample.
    per_step: T,
    /// Share of a new rate that is felt after one sample.
    felt: T,
    thresholds: [T; MAX_WIDENING],
    weights: [T; MAX_WIDENING],
    len: usize,
}

impl<T: Real, L: AsRef<[f64]>> Build<Widening<T>> for WideningParams<L> {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<Widening<T>, Error> {
        let h = cx.checked()?;
        let (thresholds, weights) = (self.thresholds.as_ref(), self.weights.as_ref());
        if thresholds.len() != weights.len() {
            return Err(Error::Lengths("widening.thresholds and widening.weights"));
        }
        if thresholds.len() > MAX_WIDENING {
            return Err(Error::Capacity { name: "plays that widen", needed: thresholds.len(), holds: MAX_WIDENING });
        }
        within("widening.growth", self.growth, self.growth >= 0.0, "zero or positive")?;
        let sensible = (LEAST_EXPONENT..=1.0).contains(&self.exponent);
        within("widening.exponent", self.exponent, sensible, "between 0.05 and 1")?;
        within("widening.reference_rate", self.reference_rate, self.reference_rate > 0.0, "positive")?;
        within("widening.seconds", self.seconds, self.seconds >= 0.0, "zero or positive")?;
        // Exact for a rate that stays the same over a sample.
        let felt = if self.seconds > 0.0 { -libm::expm1(-h / self.seconds) } else { 1.0 };
        let mut widening = Widening {
            growth: coefficient("widening.growth", self.growth)?,
            exponent: coefficient("widening.exponent", self.exponent)?,
            per_step: coefficient("widening.reference_rate", 1.0 / (self.reference_rate * h))?,
            felt: coefficient("widening.seconds", felt)?,
            thresholds: [T::ZERO; MAX_WIDENING],
            weights: [T::ZERO; MAX_WIDENING],
            len: thresholds.len(),
        };
        let slots = widening.thresholds.iter_mut().zip(&mut widening.weights);
        for ((threshold, weight), (r, w)) in slots.zip(thresholds.iter().zip(weights)) {
            within("widening.thresholds", *r, *r >= 0.0, "zero or positive")?;
            *threshold = coefficient("widening.thresholds", *r)?;
            *weight = coefficient("widening.weights", *w)?;
        }
        Ok(widening)
    }
}

/// History of a widening: the last input, the rate that is felt, in reference rates, and the plays with grown and with plain thresholds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WideningState<T> {
    pub(super) u: T,
    rate: T,
    grown: [T; MAX_WIDENING],
    plain: [T; MAX_WIDENING],
}

impl<T: Real> Default for WideningState<T> {
    fn default() -> Self {
        Self { u: T::ZERO, rate: T::ZERO, grown: [T::ZERO; MAX_WIDENING], plain: [T::ZERO; MAX_WIDENING] }
    }
}

impl<T: Real> Widening<T> {
    /// By which the thresholds are multiplied.
    #[inline]
    fn factor(&self, s: &WideningState<T>) -> T {
        if s.rate > T::ZERO { T::ONE + self.growth * s.rate.powf(self.exponent) } else { T::ONE }
    }

    /// What [`step`](Stage::step) would return for `u`, the history left as it is.
    #[inline]
    pub fn at(&self, s: &WideningState<T>, u: T) -> T {
        let factor = self.factor(s);
        let plays = s.grown.iter().zip(&s.plain).zip(self.thresholds.iter().zip(&self.weights)).take(self.len);
        plays.fold(T::ZERO, |y, ((grown, plain), (r, w))| y + *w * (play(*grown, u, *r * factor) - play(*plain, u, *r)))
    }

    /// Number of plays.
    pub fn plays(&self) -> usize {
        self.len
    }

    /// What each play adds after the last sample, before it is weighed: P(u; rᵢ g) − P(u; rᵢ) \[input unit\].
    pub fn parts<'a>(&self, s: &'a WideningState<T>) -> impl Iterator<Item = T> + 'a {
        s.grown.iter().zip(&s.plain).take(self.len).map(|(grown, plain)| *grown - *plain)
    }

    /// Moves the plays as a drive does that is slow enough to be felt as none.
    pub fn rest(&self, s: &mut WideningState<T>, u: T) {
        let u = finite_or(u, s.u);
        for ((grown, plain), r) in s.grown.iter_mut().zip(&mut s.plain).zip(&self.thresholds).take(self.len) {
            *grown = play(*grown, u, *r);
            *plain = play(*plain, u, *r);
        }
        s.u = u;
    }
}

impl<T: Real> Stage<T> for Widening<T> {
    type State = WideningState<T>;

    fn state(&self) -> WideningState<T> {
        WideningState::default()
    }

    /// At rest nothing is wider: zero.
    fn reset(&self, s: &mut WideningState<T>, _: &Env<T>, u0: T) -> T {
        *s = WideningState::default();
        self.rest(s, finite_or(u0, T::ZERO));
        T::ZERO
    }

    /// What the widening adds to the output of the operator. The rate is that which was felt before this sample, so that an inverse knows it.
    #[inline]
    fn step(&self, s: &mut WideningState<T>, _: &Env<T>, u: T) -> T {
        let u = finite_or(u, s.u);
        let factor = self.factor(s);
        let mut y = T::ZERO;
        let plays = s.grown.iter_mut().zip(&mut s.plain).zip(self.thresholds.iter().zip(&self.weights)).take(self.len);
        for ((grown, plain), (r, w)) in plays {
            *grown = play(*grown, u, *r * factor);
            *plain = play(*plain, u, *r);
            y += *w * (*grown - *plain);
        }
        // A step beyond what the precision holds is not felt.
        s.rate = finite_or(s.rate + self.felt * ((u - s.u).abs() * self.per_step - s.rate), s.rate);
        s.u = u;
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const CX: Sampling = Sampling { period: 1e-3 };

    fn params() -> WideningParams<[f64; 2]> {
        WideningParams {
            growth: 0.5,
            exponent: 0.5,
            reference_rate: 100.0,
            seconds: 5e-3,
            thresholds: [4.0, 10.0],
            weights: [0.02, 0.03],
        }
    }

    fn run(p: &WideningParams<[f64; 2]>, drive: &[f64]) -> Vec<f64> {
        let stage: Widening<f64> = p.build(&CX).unwrap();
        let mut s = stage.state();
        stage.reset(&mut s, &Env::default(), drive[0]);
        drive.iter().map(|u| stage.step(&mut s, &Env::default(), *u)).collect()
    }

    /// On a long ramp at four times the reference rate the thresholds are twice as large, so that the plays are `Σ wᵢ rᵢ` behind: twice what
    /// they are at the reference rate.
    #[test]
    fn on_a_ramp_loops_are_wider_by_the_law() {
        let up: Vec<f64> = (0..400).map(|k| 0.4 * f64::from(k)).collect();
        let last = run(&params(), &up)[399];
        assert!((last + 2.0 * params().extra_half_width()).abs() < 1e-9, "{last}");
        let down: Vec<f64> = up.iter().rev().copied().collect();
        let last = run(&params(), &down)[399];
        assert!((last - 2.0 * params().extra_half_width()).abs() < 1e-9, "{last}");
    }

    #[test]
    fn a_slow_drive_is_as_without() {
        let slow: Vec<f64> = (0..4000).map(|k| 1e-9 * f64::from(k)).collect();
        assert!(run(&params(), &slow).iter().all(|y| y.abs() < 1e-9));
        let weightless = WideningParams { weights: [0.0; 2], ..params() };
        let drive: Vec<f64> = (0..900).map(|k| 40.0 * libm::sin(0.05 * f64::from(k))).collect();
        assert!(run(&weightless, &drive).iter().all(|y| *y == 0.0));
    }

    /// A rate felt over a time survives the turns of a sine.
    #[test]
    fn the_rate_is_felt_over_its_time() {
        let drive: Vec<f64> = (0..2000).map(|k| 30.0 * libm::sin(0.05 * f64::from(k))).collect();
        let largest = |seconds: f64| {
            let y = run(&WideningParams { seconds, ..params() }, &drive);
            y[1000..].iter().fold(0.0, |m: f64, y| m.max(y.abs()))
        };
        // At the turn of a sine the rate is zero, and what has widened at once has narrowed there again: the next branch begins as a slow one does.
        let turn = |seconds: f64| run(&WideningParams { seconds, ..params() }, &drive)[1000 + 4 * 31].abs();
        assert!(largest(20e-3) > 0.5 * params().extra_half_width());
        assert!(turn(20e-3) > 1.2 * turn(0.0), "{} {}", turn(20e-3), turn(0.0));
    }

    #[test]
    fn what_a_step_would_return_leaves_no_trace() {
        let stage: Widening<f64> = params().build(&CX).unwrap();
        let mut s = stage.state();
        stage.reset(&mut s, &Env::default(), 0.0);
        for k in 0..600 {
            let u = 25.0 * libm::sin(0.04 * f64::from(k));
            let expected = stage.at(&s, u);
            assert_eq!(stage.step(&mut s, &Env::default(), u), expected);
        }
    }

    #[test]
    fn a_step_beyond_the_precision_leaves_the_law_as_it_was() {
        let stage: Widening<f32> = params().build(&CX).unwrap();
        let run = |jump: f32| {
            let mut s = stage.state();
            stage.reset(&mut s, &Env::default(), 0.0);
            stage.step(&mut s, &Env::default(), jump);
            stage.step(&mut s, &Env::default(), 0.0);
            (0..400).map(|k| stage.step(&mut s, &Env::default(), 0.4 * k as f32)).last().unwrap()
        };
        assert!((run(3e38) - run(0.0)).abs() < 1e-3, "{} {}", run(3e38), run(0.0));
    }

    #[test]
    fn what_makes_no_law_is_refused_by_name() {
        let refused = |p: WideningParams<[f64; 2]>| {
            matches!(Build::<Widening<f64>>::build(&p, &CX), Err(Error::OutOfRange { .. }))
        };
        assert!(refused(WideningParams { growth: -0.1, ..params() }));
        assert!(refused(WideningParams { exponent: 0.0, ..params() }));
        assert!(refused(WideningParams { reference_rate: 0.0, ..params() }));
        assert!(refused(WideningParams { seconds: -1.0, ..params() }));
        assert!(refused(WideningParams { thresholds: [-1.0, 2.0], ..params() }));
        let many = WideningParams {
            thresholds: [1.0; 9],
            weights: [0.1; 9],
            growth: 0.3,
            exponent: 0.5,
            reference_rate: 1.0,
            seconds: 0.0,
        };
        assert!(matches!(Build::<Widening<f64>>::build(&many, &CX), Err(Error::Capacity { .. })));
    }
}
