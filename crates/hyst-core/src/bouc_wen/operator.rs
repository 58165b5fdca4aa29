//! The rate-independent Bouc-Wen operator and its inverse.

use super::BoucWenParams;
use super::branch::Branch;
use crate::error::coefficient;
use crate::{Env, Error, Probe, Real, Search, Stage};

/// Bouc-Wen operator `y = k₀ u + g`, `ġ = α u̇ − β |u̇| |g|ⁿ⁻¹ g − γ u̇ |g|ⁿ` (Xie et al., eq. 6, 7), from
/// [`BoucWenParams`] or [`BoucWenClassicParams`](crate::BoucWenClassicParams) (Zhu et al., eq. 18).
///
/// The equations do not depend on time. With σ = sgn u̇ and q = σ sgn(α) g, every branch is
/// `dq/d|u| = |α| − (β + γ′) qⁿ` for q ≥ 0 and `|α| + (β − γ′) |q|ⁿ` for q < 0, with γ′ = sgn(α)γ. The input is linear
/// between samples, so one sample is one motion along a branch, at any sample period. It is exact for n = 1
/// (exponentials) and n = 2 (tan, tanh). Any other n takes at most 64 Runge-Kutta substeps on each side of q = 0. For
/// any jump of the input, the error of one sample is below 1e-5 of g∞ for n ≤ 10 and β − γ′ ≤ 100 (β + γ′). For samples
/// of a hundredth of a loop it is below 1e-7.
///
/// The slope dy/du is between [`slopes`](Self::slopes) in every state. For α > 0 it is never below k₀. For α < 0 the
/// minimum is `k₀ − 2|α|β / (β + γ′)`, just after a reversal from saturation, for any n. If it is negative the branch
/// *folds*: the output first moves against the input. [`inverse`](Self::inverse) describes the inverse in this case.
///
/// ```
/// use hyst_core::{BoucWen, BoucWenParams, Build, Env, Stage};
/// let params = BoucWenParams { k0: 0.12, alpha: 0.05, beta: 0.02, gamma: 0.01, n: 1.5 };
/// let (model, e) = (Build::<BoucWen<f64>>::build(&params, &())?, Env::default());
/// let inverse = model.inverse(-100.0, 100.0, 1e-9)?;
/// let (mut forward, mut backward) = (model.state(), inverse.state());
/// model.reset(&mut forward, &e, 0.0);
/// inverse.reset(&mut backward, &e, 0.0);
/// for reference in [1.0, 5.0, 3.0, 4.0, -2.0] {
///     let drive = inverse.step(&mut backward, &e, reference);
///     assert!((model.step(&mut forward, &e, drive) - reference).abs() < 1e-9);
/// }
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoucWen<T> {
    k0: T,
    /// g = scale · v, where v is the memory that [`Branch`] moves.
    scale: T,
    /// Distance on the branch per unit of input.
    rate: T,
    alpha: T,
    branch: Branch<T>,
}

/// History of the operator: the last input and the memory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoucWenState<T> {
    u: T,
    /// g divided by its scale.
    v: T,
}

impl<T: Real> BoucWen<T> {
    /// Creates the operator from parameters that are finite and in range.
    pub(super) fn new(p: &BoucWenParams) -> Result<Self, Error> {
        let sign = if p.alpha < 0.0 { -1.0 } else { 1.0 };
        let (plus, minus) = (p.beta + sign * p.gamma, p.beta - sign * p.gamma);
        let larger = plus.at_least(minus);
        // The g at which the larger of the two terms equals |α|. Any unit is valid if both are zero, or without memory.
        let unit = if larger > 0.0 && p.alpha != 0.0 { libm::pow(p.alpha.abs() / larger, 1.0 / p.n) } else { 1.0 };
        let (scale, rate) = (T::from_f64(unit), T::from_f64(p.alpha.abs() / unit));
        if !(rate.is_finite() && scale > T::ZERO && scale.is_finite()) {
            return Err(Error::OutOfRange {
                name: "bouc-wen.beta",
                must: "of the order of |alpha| over a power of the output",
            });
        }
        let share = |x: f64| if larger > 0.0 { x / larger } else { 0.0 };
        Ok(Self {
            k0: coefficient("bouc-wen.k0", p.k0)?,
            scale: T::from_f64(if p.alpha == 0.0 { 0.0 } else { sign * unit }),
            rate,
            alpha: coefficient("bouc-wen.alpha", p.alpha)?,
            branch: Branch::new(share(plus), share(minus), p.n),
        })
    }

    /// Returns the largest |g| \[y\]: g∞. Infinite without saturation.
    pub fn bound(&self) -> T {
        if self.scale == T::ZERO { T::ZERO } else { self.scale.abs() * self.branch.limit() }
    }

    /// Returns minimum and maximum of the slope dy/du over all states \[y/u\]; infinite without saturation and with
    /// β > 0.
    pub fn slopes(&self) -> (T, T) {
        let (flattest, steepest) = self.branch.slopes();
        let (a, b) = (self.alpha * flattest, self.alpha * steepest);
        // α = 0 times an infinite slope is NaN; α = 0 means no memory.
        if self.alpha == T::ZERO { (self.k0, self.k0) } else { (self.k0 + a.at_most(b), self.k0 + a.at_least(b)) }
    }

    /// Returns whether y rises with u on every branch: `k₀ > max(0, −2α β / (β + sgn(α)γ))`. Then inverse ∘ operator is
    /// also the identity. For Zhu et al. the condition is `d > 2AB / (B + Γ)`. The published parameters miss it by
    /// 1.7 % (d = 1.910, 2A = 1.942).
    pub fn rises(&self) -> bool {
        self.slopes().0 > T::ZERO
    }

    /// Returns the largest |g| at which a reversal gives no fold \[y\]: `((k₀ − |α|) / (β − sgn(α)γ))^(1/n)` for α < 0.
    /// For the published parameters of Zhu et al. it is 0.632, and [`bound`](Self::bound) is 0.653. Zero if also the
    /// virgin curve falls (k₀ ≤ |α|); at least `bound` if no branch folds.
    pub fn rises_within(&self) -> T {
        if self.rises() {
            return self.bound();
        }
        let excess = self.k0 / self.alpha.abs() - T::ONE;
        if self.alpha < T::ZERO && excess > T::ZERO {
            self.scale.abs() * self.branch.memory_at_excess(excess)
        } else {
            T::ZERO
        }
    }

    /// Builds the inverse by search for inputs from `low` to `high`, to within `tolerance` \[all in u\]. There is no
    /// elementary closed form.
    ///
    /// On every branch the slope approaches k₀ > 0 monotonically. So each output has one input on the branch from the
    /// present state, and operator ∘ inverse is the identity to within `tolerance` times the maximum of
    /// [`slopes`](Self::slopes). If a branch folds, this input is beyond the fold. The drive jumps over the fold and
    /// the output is still reached, but a drive that stopped inside the fold is not recovered from its output. There is
    /// no fold if [`rises`](Self::rises), nor while |g| stays below [`rises_within`](Self::rises_within).
    ///
    /// # Errors
    /// [`Error::NotInvertible`] if the final slope of a branch is not positive: k₀, or k₀ + α without saturation. Else
    /// as [`Search::new`].
    pub fn inverse(&self, low: f64, high: f64, tolerance: f64) -> Result<Search<T, Self>, Error> {
        let settled = if self.branch.limit().is_finite() { self.k0 } else { self.k0 + self.alpha };
        if settled > T::ZERO {
            Search::new(*self, low, high, tolerance)
        } else {
            Err(Error::NotInvertible("bouc-wen.k0 must be positive, or the output saturates"))
        }
    }

    /// Returns the memory after the input has moved to `u`.
    #[inline]
    fn moved(&self, s: &BoucWenState<T>, u: T) -> T {
        let change = u - s.u;
        if change > T::ZERO {
            self.branch.advance(s.v, change * self.rate)
        } else if change < T::ZERO {
            -self.branch.advance(-s.v, -change * self.rate)
        } else {
            s.v
        }
    }

    #[inline]
    fn output(&self, u: T, v: T) -> T {
        self.k0 * u + self.scale * v
    }
}

impl<T: Real> BoucWenState<T> {
    /// Returns virgin memory at the input 0.
    pub fn virgin() -> Self {
        Self { u: T::ZERO, v: T::ZERO }
    }
}

impl<T: Real> Stage<T> for BoucWen<T> {
    type State = BoucWenState<T>;

    fn state(&self) -> Self::State {
        BoucWenState::virgin()
    }

    /// Sets virgin memory (u = 0, g = 0), then applies `u0`.
    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        *s = BoucWenState::virgin();
        self.step(s, e, u0)
    }

    /// An input that is not finite, or so large that the memory would not be finite, does not change the state.
    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let v = self.moved(s, u);
        if u.is_finite() && v.is_finite() {
            *s = BoucWenState { u, v };
        }
        self.output(s.u, s.v)
    }
}

impl<T: Real> Probe<T> for BoucWen<T> {
    #[inline]
    fn probe(&self, s: &Self::State, _: &Env<T>, u: T) -> T {
        let v = self.moved(s, u);
        if u.is_finite() && v.is_finite() { self.output(u, v) } else { self.output(s.u, s.v) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BoucWenClassicParams, Build};
    use std::vec::Vec;

    const PRINTED: BoucWenClassicParams = BoucWenClassicParams::PRINTED;

    fn env() -> Env<f64> {
        Env::default()
    }

    fn built(p: BoucWenParams) -> BoucWen<f64> {
        p.build(&()).unwrap()
    }

    /// Integrates eq. 18 of Zhu et al. as published, with `parts` Heun steps per sample.
    fn classic(p: &BoucWenClassicParams, u: &[f64], parts: usize) -> Vec<f64> {
        let (mut h, mut at) = (0.0f64, 0.0f64);
        u.iter()
            .map(|to| {
                let du = (to - at) / parts as f64;
                let slope = |h: f64| p.a * du - p.b * du.abs() * h - p.gamma * du * h.abs();
                for _ in 0..parts {
                    let first = slope(h);
                    h += 0.5 * (first + slope(h + first));
                }
                at = *to;
                p.d * to - h
            })
            .collect()
    }

    /// Integrates eq. 6 and 7 of Xie et al. as published, in the same way.
    fn general(p: &BoucWenParams, u: &[f64], parts: usize) -> Vec<f64> {
        let (mut g, mut at) = (0.0f64, 0.0f64);
        u.iter()
            .map(|to| {
                let du = (to - at) / parts as f64;
                let slope = |g: f64| {
                    p.alpha * du
                        - p.beta * du.abs() * libm::pow(g.abs(), p.n - 1.0) * g
                        - p.gamma * du * libm::pow(g.abs(), p.n)
                };
                for _ in 0..parts {
                    let first = slope(g);
                    g += 0.5 * (first + slope(g + first));
                }
                at = *to;
                p.k0 * to + g
            })
            .collect()
    }

    fn run(m: &BoucWen<f64>, u: &[f64]) -> Vec<f64> {
        let mut s = m.state();
        u.iter().map(|u| m.step(&mut s, &env(), *u)).collect()
    }

    /// Minor loops inside major loops, and jumps between small steps.
    fn drive(k: usize) -> f64 {
        let t = k as f64;
        2.0 * libm::sin(0.11 * t) + 0.8 * libm::sin(0.83 * t) + if k.is_multiple_of(17) { 1.5 } else { 0.0 }
    }

    #[test]
    fn operator_agrees_with_the_published_equation_of_zhu() {
        let u: Vec<f64> = (0..150).map(drive).collect();
        for p in
            [PRINTED, BoucWenClassicParams { gamma: -0.9, ..PRINTED }, BoucWenClassicParams { gamma: 1.2, ..PRINTED }]
        {
            let y = run(&p.build(&()).unwrap(), &u);
            for (y, expected) in y.iter().zip(classic(&p, &u, 2000)) {
                assert!((y - expected).abs() < 1e-6, "Γ = {}: {y} {expected}", p.gamma);
            }
        }
    }

    #[test]
    fn operator_agrees_with_the_published_equation_of_xie() {
        let u: Vec<f64> = (0..150).map(drive).collect();
        for alpha in [0.7, -0.7] {
            for n in [1.0, 1.4, 2.0, 3.0] {
                for gamma in [-0.6, 0.0, 0.5, 1.1] {
                    let p = BoucWenParams { k0: 0.4, alpha, beta: 1.1, gamma, n };
                    let y = run(&built(p), &u);
                    for (y, expected) in y.iter().zip(general(&p, &u, 3000)) {
                        assert!((y - expected).abs() < 4e-6, "α = {alpha}, γ = {gamma}, n = {n}: {y} {expected}");
                    }
                }
            }
        }
    }

    #[test]
    fn branches_of_the_published_parameters_fold() {
        let m: BoucWen<f64> = PRINTED.build(&()).unwrap();
        assert!(!m.rises());
        assert!((m.bound() - 0.971 / 1.486).abs() < 1e-6);
        assert!((m.slopes().0 - (1.910 - 2.0 * 0.971)).abs() < 1e-6);
        assert!((m.rises_within() - (1.910 - 0.971) / 1.486).abs() < 1e-6, "{}", m.rises_within());
        // A step back from saturation first raises the output. A step back from inside the limit does not.
        let mut s = m.state();
        let top = m.reset(&mut s, &env(), 50.0);
        assert!(m.probe(&s, &env(), 50.0 - 1e-3) > top);
        let mut s = m.state();
        let inside = m.reset(&mut s, &env(), 2.2);
        assert!(1.910 * 2.2 - inside < m.rises_within());
        assert!(m.probe(&s, &env(), 2.2 - 1e-3) < inside);
        // With 2A < d no branch folds.
        let steeper: BoucWen<f64> = BoucWenClassicParams { d: 1.95, ..PRINTED }.build(&()).unwrap();
        assert!(steeper.rises() && steeper.rises_within() == steeper.bound());
    }

    #[test]
    fn slopes_are_the_extremes_that_occur() {
        for alpha in [0.6, -0.6] {
            for n in [1.0, 1.5, 2.0, 4.0] {
                let m = built(BoucWenParams { k0: 1.0, alpha, beta: 0.8, gamma: 0.3, n });
                let (least, greatest) = m.slopes();
                let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
                let mut s = m.state();
                for u in [30.0, -30.0, 30.0] {
                    let from = s.u;
                    let mut last = m.step(&mut s, &env(), from);
                    for k in 1..=200_000 {
                        let to = from + (u - from) * f64::from(k) / 200_000.0;
                        let before = s.u;
                        let y = m.step(&mut s, &env(), to);
                        let slope = (y - last) / (to - before);
                        (low, high, last) = (low.min(slope), high.max(slope), y);
                    }
                }
                assert!(
                    (low - least).abs() < 2e-3 && (high - greatest).abs() < 2e-3,
                    "{low} {least} {high} {greatest}"
                );
                assert!(low > least - 1e-9 && high < greatest + 1e-9);
            }
        }
    }

    #[test]
    fn a_million_samples_stay_bounded() {
        for n in [1.0, 2.0, 2.7] {
            let m = built(BoucWenParams { k0: 0.1, alpha: 0.05, beta: 0.3, gamma: 0.1, n });
            let mut s = m.state();
            for k in 0..1_000_000 {
                let u = drive(k);
                assert!((m.step(&mut s, &env(), u) - 0.1 * u).abs() <= m.bound() * (1.0 + 1e-12));
            }
        }
    }

    #[test]
    fn a_reset_clears_the_state() {
        let m = built(BoucWenParams { k0: 0.1, alpha: 0.05, beta: 0.3, gamma: 0.1, n: 1.7 });
        let (mut used, mut fresh) = (m.state(), m.state());
        (0..500).for_each(|k| {
            m.step(&mut used, &env(), drive(k));
        });
        assert_eq!(m.reset(&mut used, &env(), 1.25), m.reset(&mut fresh, &env(), 1.25));
        assert_eq!(used, fresh);
    }

    #[test]
    fn a_non_finite_input_does_not_change_the_state() {
        let m = built(BoucWenParams { k0: 0.1, alpha: 0.05, beta: 0.3, gamma: 0.1, n: 1.7 });
        let mut s = m.state();
        let y = m.step(&mut s, &env(), 2.0);
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(m.step(&mut s, &env(), bad), y);
            assert_eq!(m.probe(&s, &env(), bad), y);
        }
    }

    #[test]
    fn degenerate_parameters_are_linear() {
        for (alpha, beta, gamma, slope) in [(0.0, 0.0, 0.0, 0.3), (0.0, 1.0, 0.5, 0.3), (0.2, 0.0, 0.0, 0.5)] {
            for n in [1.0, 2.0, 3.3] {
                let m = built(BoucWenParams { k0: 0.3, alpha, beta, gamma, n });
                assert!(m.rises());
                for (u, y) in [4.0, -3.0, 1.0, 1e6].iter().zip(run(&m, &[4.0, -3.0, 1.0, 1e6])) {
                    assert!((y - slope * u).abs() <= 1e-12 * u.abs());
                }
            }
        }
    }

    #[test]
    fn bad_parameters_are_named() {
        let good = BoucWenParams { k0: 0.3, alpha: 0.1, beta: 0.5, gamma: 0.2, n: 1.0 };
        let error = |p: BoucWenParams| Build::<BoucWen<f64>>::build(&p, &()).unwrap_err();
        assert_eq!(error(BoucWenParams { k0: f64::NAN, ..good }), Error::NonFinite("bouc-wen.k0"));
        for (p, field) in [
            (BoucWenParams { beta: -0.1, ..good }, "bouc-wen.beta"),
            (BoucWenParams { gamma: 0.6, ..good }, "bouc-wen.gamma"),
            (BoucWenParams { n: 0.9, ..good }, "bouc-wen.n"),
        ] {
            assert!(matches!(error(p), Error::OutOfRange { name, .. } if name == field));
        }
        let classic: Result<BoucWen<f64>, _> = BoucWenClassicParams { gamma: 2.0, ..PRINTED }.build(&());
        assert!(matches!(classic, Err(Error::OutOfRange { name: "bouc-wen.gamma", .. })));
        let flat = built(BoucWenParams { k0: 0.0, ..good });
        assert!(matches!(flat.inverse(-1.0, 1.0, 1e-9), Err(Error::NotInvertible(_))));
    }
}
