//! Rate-dependent widening of the loops, in proportion to the width of each loop.
//!
//! Play operators with rate-dependent thresholds are in parallel with any hysteresis operator H:
//!
//! ```text
//! y = H(u) + Σᵢ wᵢ (P(u; rᵢ g) − P(u; rᵢ)),   g = 1 + k (v / s)ᵖ,   τ v̇ + v = |u̇|,
//! ```
//!
//! If the wᵢ are the weights of a Prandtl-Ishlinskii operator, its thresholds become rᵢ g (Al Janaideh, Su and Rakheja
//! 2008: all thresholds are multiplied by one function of the rate). A coercive voltage that grows with rate has this
//! effect: a wide loop widens more than a narrow one. A common overdrive cannot do that. v is the rate after a
//! first-order lag with time constant τ. With τ = 0 all loops would be as narrow at the reversals as with a slow drive,
//! because the rate is zero there.

use crate::error::{coefficient, within};
use crate::stage::finite_or;
use crate::{Build, Env, Error, Meta, Params, Real, Sampling, Stage, play};

/// Maximum number of play operators of a widening.
pub const MAX_WIDENING: usize = 8;

/// Parameters of a widening. With weights of zero there is no widening. `L` is any list of numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct WideningParams<L> {
    /// Relative growth k of the thresholds at the reference rate \[ratio\]; a convention, not identified, because the
    /// weights scale the effect of a small growth.
    pub growth: f64,
    /// Exponent p.
    pub exponent: f64,
    /// Reference rate s \[input unit/s\]; a convention, not identified.
    pub reference_rate: f64,
    /// Time constant τ of the lag of the rate \[s\].
    pub seconds: f64,
    /// Thresholds rᵢ \[input unit\]; a fixed grid, not identified.
    pub thresholds: L,
    /// Weights wᵢ \[output unit/input unit\].
    pub weights: L,
}

/// Minimum exponent. Below it the growth is almost the same at all rates and indistinguishable from the operator.
const MIN_EXPONENT: f64 = 0.05;

impl<L: AsRef<[f64]>> WideningParams<L> {
    /// Returns the growth of the half-width of a loop that moves all play operators, at the reference rate: `Σ k wᵢ rᵢ`
    /// \[output unit\].
    pub fn extra_half_width(&self) -> f64 {
        let plays = self.thresholds.as_ref().iter().zip(self.weights.as_ref());
        self.growth * plays.fold(0.0, |sum, (r, w)| sum + r * w)
    }
}

impl<L: AsMut<[f64]>> Params for WideningParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        f(&Meta { name: "exponent", unit: "", lower: MIN_EXPONENT, upper: 1.0 }, &mut self.exponent);
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
    /// 1 / (s h): converts a step of one sample to reference rates.
    per_step: T,
    /// Share of a change of the rate that passes the lag in one sample.
    rate_share: T,
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
            return Err(Error::Capacity { name: "widening plays", needed: thresholds.len(), holds: MAX_WIDENING });
        }
        within("widening.growth", self.growth, self.growth >= 0.0, "zero or positive")?;
        let in_range = (MIN_EXPONENT..=1.0).contains(&self.exponent);
        within("widening.exponent", self.exponent, in_range, "between 0.05 and 1")?;
        within("widening.reference_rate", self.reference_rate, self.reference_rate > 0.0, "positive")?;
        within("widening.seconds", self.seconds, self.seconds >= 0.0, "zero or positive")?;
        // Exact for a rate that is constant over a sample.
        let rate_share = if self.seconds > 0.0 { -libm::expm1(-h / self.seconds) } else { 1.0 };
        let mut widening = Widening {
            growth: coefficient("widening.growth", self.growth)?,
            exponent: coefficient("widening.exponent", self.exponent)?,
            per_step: coefficient("widening.reference_rate", 1.0 / (self.reference_rate * h))?,
            rate_share: coefficient("widening.seconds", rate_share)?,
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

/// History of a widening: the last input, the rate after the lag \[reference rates\], and the play operators with grown
/// and with plain thresholds.
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
    /// Returns the factor of the thresholds, g.
    #[inline]
    fn factor(&self, s: &WideningState<T>) -> T {
        if s.rate > T::ZERO { T::ONE + self.growth * s.rate.powf(self.exponent) } else { T::ONE }
    }

    /// Returns what [`step`](Stage::step) would return for `u`, without changing the history.
    #[inline]
    pub fn at(&self, s: &WideningState<T>, u: T) -> T {
        let factor = self.factor(s);
        let plays = s.grown.iter().zip(&s.plain).zip(self.thresholds.iter().zip(&self.weights)).take(self.len);
        plays.fold(T::ZERO, |y, ((grown, plain), (r, w))| y + *w * (play(*grown, u, *r * factor) - play(*plain, u, *r)))
    }

    /// Returns the number of play operators.
    pub fn plays(&self) -> usize {
        self.len
    }

    /// Returns the contribution of each play operator after the last sample, without its weight: P(u; rᵢ g) − P(u; rᵢ)
    /// \[input unit\].
    pub fn parts<'a>(&self, s: &'a WideningState<T>) -> impl Iterator<Item = T> + 'a {
        s.grown.iter().zip(&s.plain).take(self.len).map(|(grown, plain)| *grown - *plain)
    }

    /// Moves the play operators as an infinitely slow drive to `u` does.
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

    /// Returns zero: at rest there is no widening.
    fn reset(&self, s: &mut WideningState<T>, _: &Env<T>, u0: T) -> T {
        *s = WideningState::default();
        self.rest(s, finite_or(u0, T::ZERO));
        T::ZERO
    }

    /// Returns the addition to the output of the operator. It uses the rate before this sample, which an inverse knows.
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
        // A step that overflows does not change the rate.
        s.rate = finite_or(s.rate + self.rate_share * ((u - s.u).abs() * self.per_step - s.rate), s.rate);
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

    /// At four times the reference rate the thresholds of this law are doubled. The additional half-width is then
    /// `Σ wᵢ rᵢ`, twice that at the reference rate.
    #[test]
    fn the_half_width_on_a_ramp_is_that_of_the_law() {
        let up: Vec<f64> = (0..400).map(|k| 0.4 * f64::from(k)).collect();
        let last = run(&params(), &up)[399];
        assert!((last + 2.0 * params().extra_half_width()).abs() < 1e-9, "{last}");
        let down: Vec<f64> = up.iter().rev().copied().collect();
        let last = run(&params(), &down)[399];
        assert!((last - 2.0 * params().extra_half_width()).abs() < 1e-9, "{last}");
    }

    #[test]
    fn a_slow_drive_has_no_widening() {
        let slow: Vec<f64> = (0..4000).map(|k| 1e-9 * f64::from(k)).collect();
        assert!(run(&params(), &slow).iter().all(|y| y.abs() < 1e-9));
        let weightless = WideningParams { weights: [0.0; 2], ..params() };
        let drive: Vec<f64> = (0..900).map(|k| 40.0 * libm::sin(0.05 * f64::from(k))).collect();
        assert!(run(&weightless, &drive).iter().all(|y| *y == 0.0));
    }

    /// With the lag the rate is not zero at the reversals of a sine.
    #[test]
    fn the_lag_keeps_the_widening_at_a_reversal() {
        let drive: Vec<f64> = (0..2000).map(|k| 30.0 * libm::sin(0.05 * f64::from(k))).collect();
        let largest = |seconds: f64| {
            let y = run(&WideningParams { seconds, ..params() }, &drive);
            y[1000..].iter().fold(0.0, |m: f64, y| m.max(y.abs()))
        };
        // At a reversal the rate is zero. Without the lag the loop is narrow there, as with a slow drive.
        let at_reversal = |seconds: f64| run(&WideningParams { seconds, ..params() }, &drive)[1000 + 4 * 31].abs();
        assert!(largest(20e-3) > 0.5 * params().extra_half_width());
        assert!(at_reversal(20e-3) > 1.2 * at_reversal(0.0), "{} {}", at_reversal(20e-3), at_reversal(0.0));
    }

    #[test]
    fn at_returns_the_next_step_without_changing_the_history() {
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
    fn an_overflowing_step_does_not_change_the_rate() {
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
    fn parameters_out_of_range_are_rejected() {
        let rejected = |p: WideningParams<[f64; 2]>| {
            matches!(Build::<Widening<f64>>::build(&p, &CX), Err(Error::OutOfRange { .. }))
        };
        assert!(rejected(WideningParams { growth: -0.1, ..params() }));
        assert!(rejected(WideningParams { exponent: 0.0, ..params() }));
        assert!(rejected(WideningParams { reference_rate: 0.0, ..params() }));
        assert!(rejected(WideningParams { seconds: -1.0, ..params() }));
        assert!(rejected(WideningParams { thresholds: [-1.0, 2.0], ..params() }));
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
