//! The two published forms of the Bouc-Wen operator.

use crate::{Meta, Params};

/// Parameters of `y = k₀ u + g`, `ġ = α u̇ − β |u̇| |g|ⁿ⁻¹ g − γ u̇ |g|ⁿ` (Xie et al., eq. 6, 7).
///
/// n must be from 1 to 20 (for larger n the loop is that of the [`stop`](crate::stop)). |γ| ≤ β: then every cycle
/// dissipates (Erlicher and Point 2004), and the slope on the way back to zero is at least α. The memory saturates
/// where the terms cancel α u̇, at `g∞ = (|α| / (β + sgn(α)γ))^(1/n)`, so |g| ≤ g∞ for every input. With |γ| > β this
/// sum could be negative, and g would grow with every cycle. At γ = −sgn(α)β there is no saturation, and |g| stays
/// below |α| times the range of the input.
///
/// The gain k₀ may have either sign. The inverse needs a positive one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BoucWenParams {
    /// Gain k₀ of the part without memory \[y/u\].
    pub k0: f64,
    /// α: slope of the memory at zero \[y/u\].
    pub alpha: f64,
    /// β: dissipation \[y^(1−n)/u\].
    pub beta: f64,
    /// γ: difference between loading and unloading \[y^(1−n)/u\].
    pub gamma: f64,
    /// n: sharpness of the knee.
    pub n: f64,
}

impl Params for BoucWenParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        const ANY: f64 = f64::INFINITY;
        f(&Meta { name: "k0", unit: "y/u", lower: 0.0, upper: ANY }, &mut self.k0);
        f(&Meta { name: "alpha", unit: "y/u", lower: -ANY, upper: ANY }, &mut self.alpha);
        f(&Meta { name: "beta", unit: "y^(1-n)/u", lower: 0.0, upper: ANY }, &mut self.beta);
        f(&Meta { name: "gamma", unit: "y^(1-n)/u", lower: -ANY, upper: ANY }, &mut self.gamma);
        f(&Meta { name: "n", unit: "", lower: 1.0, upper: 20.0 }, &mut self.n);
    }
}

/// Parameters of `y = d u − h`, `ḣ = A u̇ − B |u̇| h − Γ u̇ |h|`: the form with n = 1 and subtracted hysteresis (Zhu et
/// al., eq. 18).
///
/// With g = −h it is [`BoucWenParams`] with k₀ = d, α = −A, β = B, γ = −Γ, so B ≥ 0 and |Γ| ≤ B.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BoucWenClassicParams {
    /// Gain d of the part without memory \[y/u\].
    pub d: f64,
    /// A: slope of the memory at zero \[y/u\].
    pub a: f64,
    /// B: dissipation \[1/u\].
    pub b: f64,
    /// Γ: difference between loading and unloading \[1/u\].
    pub gamma: f64,
}

impl BoucWenClassicParams {
    /// The published parameters of Zhu et al. (output µm, input V). 2 A > d: branches fold just after a reversal.
    pub const PRINTED: Self = Self { d: 1.910, a: 0.971, b: 1.486, gamma: 1.97e-7 };

    /// Converts the parameters to the form of Xie et al.
    pub fn general(&self) -> BoucWenParams {
        BoucWenParams { k0: self.d, alpha: -self.a, beta: self.b, gamma: -self.gamma, n: 1.0 }
    }
}

impl Params for BoucWenClassicParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        const ANY: f64 = f64::INFINITY;
        f(&Meta { name: "d", unit: "y/u", lower: 0.0, upper: ANY }, &mut self.d);
        f(&Meta { name: "a", unit: "y/u", lower: -ANY, upper: ANY }, &mut self.a);
        f(&Meta { name: "b", unit: "1/u", lower: 0.0, upper: ANY }, &mut self.b);
        f(&Meta { name: "gamma", unit: "1/u", lower: -ANY, upper: ANY }, &mut self.gamma);
    }
}
