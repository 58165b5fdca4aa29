//! The rate-independent Bouc-Wen operator and its inverse.

use super::branch::Branch;
use super::{BoucWenClassicParams, BoucWenParams};
use crate::error::{coefficient, finite, within};
use crate::{Build, Env, Error, Probe, Real, Search, Stage};

/// Bouc-Wen operator `y = k₀ u + g`, `ġ = α u̇ − β |u̇| |g|ⁿ⁻¹ g − γ u̇ |g|ⁿ` (Xie et al., eq. 6, 7), from
/// [`BoucWenParams`] or [`BoucWenClassicParams`] (Zhu et al., eq. 18).
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

impl<T: Real> Build<BoucWen<T>> for BoucWenParams {
    type Context = ();
    fn build(&self, (): &()) -> Result<BoucWen<T>, Error> {
        finite("bouc-wen.k0", self.k0)?;
        finite("bouc-wen.alpha", self.alpha)?;
        within("bouc-wen.beta", self.beta, self.beta >= 0.0, "zero or positive")?;
        within("bouc-wen.gamma", self.gamma, self.gamma.abs() <= self.beta, "from -beta to beta")?;
        within("bouc-wen.n", self.n, (1.0..=20.0).contains(&self.n), "from 1 to 20")?;
        BoucWen::new(self)
    }
}

impl<T: Real> Build<BoucWen<T>> for BoucWenClassicParams {
    type Context = ();
    fn build(&self, (): &()) -> Result<BoucWen<T>, Error> {
        finite("bouc-wen.d", self.d)?;
        finite("bouc-wen.a", self.a)?;
        within("bouc-wen.b", self.b, self.b >= 0.0, "zero or positive")?;
        within("bouc-wen.gamma", self.gamma, self.gamma.abs() <= self.b, "from -b to b")?;
        BoucWen::new(&self.general())
    }
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
    fn new(p: &BoucWenParams) -> Result<Self, Error> {
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
mod tests;
