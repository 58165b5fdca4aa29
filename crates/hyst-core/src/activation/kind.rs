//! The five activation functions.

use crate::Real;

/// Activation function f(x) (Xie et al., eq. 1, i = 1…5). Files and commands use the [`name`](Self::name).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "lowercase"))]
pub enum ActivationKind {
    /// atan x.
    Atan,
    /// 1 / (1 + e⁻ˣ).
    Sigmoid,
    /// ln(1 + eˣ).
    Softplus,
    /// x / (1 + |x|).
    Softsign,
    /// tanh x.
    Tanh,
}

impl ActivationKind {
    /// All five, in the order of the paper.
    pub const ALL: [Self; 5] = [Self::Atan, Self::Sigmoid, Self::Softplus, Self::Softsign, Self::Tanh];

    /// Returns `atan`, `sigmoid`, `softplus`, `softsign` or `tanh`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Atan => "atan",
            Self::Sigmoid => "sigmoid",
            Self::Softplus => "softplus",
            Self::Softsign => "softsign",
            Self::Tanh => "tanh",
        }
    }

    /// Returns the function with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Computes f(x) without intermediate overflow, for any finite or infinite x.
    #[inline]
    pub fn value<T: Real>(self, x: T) -> T {
        match self {
            Self::Atan => x.atan(),
            Self::Sigmoid => logistic(x),
            // ln(1 + eˣ) = max(x, 0) + ln(1 + e^(−|x|))
            Self::Softplus => x.at_least(T::ZERO) + (-x.abs()).exp().ln_1p(),
            Self::Softsign => {
                let size = x.abs();
                let y = if size > T::ONE { T::ONE / (T::ONE + T::ONE / size) } else { size / (T::ONE + size) };
                if x < T::ZERO { -y } else { y }
            }
            Self::Tanh => x.tanh(),
        }
    }

    /// Computes f′(x), from 0 to 1 (sigmoid: to 1/4).
    #[inline]
    pub fn slope<T: Real>(self, x: T) -> T {
        match self {
            Self::Atan => T::ONE / (T::ONE + x * x),
            Self::Sigmoid => {
                // s (1 − s), with 1 − s = s(−x) where s is near 1.
                logistic(x) * logistic(-x)
            }
            Self::Softplus => logistic(x),
            Self::Softsign => {
                let d = T::ONE + x.abs();
                T::ONE / d / d
            }
            Self::Tanh => {
                let y = x.tanh();
                (T::ONE - y) * (T::ONE + y)
            }
        }
    }

    /// Returns the maximum of f′: at x = 0, or for softplus at x → ∞.
    pub(super) fn steepest(self) -> f64 {
        if self == Self::Sigmoid { 0.25 } else { 1.0 }
    }

    /// Returns the range of f(x) − max(0, x) for softplus, and of f(x) for the others, which saturate.
    pub(super) fn range(self) -> (f64, f64) {
        match self {
            Self::Atan => (-core::f64::consts::FRAC_PI_2, core::f64::consts::FRAC_PI_2),
            Self::Sigmoid => (0.0, 1.0),
            Self::Softplus => (0.0, core::f64::consts::LN_2),
            Self::Softsign | Self::Tanh => (-1.0, 1.0),
        }
    }

    /// Returns the |x| beyond which f′ < `slope`, for the four that saturate; 0 if f′ is nowhere that steep.
    pub(super) fn steep_until(self, slope: f64) -> f64 {
        if slope >= self.steepest() {
            return 0.0;
        }
        match self {
            Self::Atan => libm::sqrt(1.0 / slope - 1.0),
            Self::Sigmoid => {
                let s = 0.5 + libm::sqrt(0.25 - slope);
                libm::log(s / (1.0 - s))
            }
            Self::Softplus => f64::INFINITY,
            Self::Softsign => 1.0 / libm::sqrt(slope) - 1.0,
            Self::Tanh => libm::atanh(libm::sqrt(1.0 - slope)),
        }
    }
}

/// Computes 1 / (1 + e⁻ˣ) without overflow.
#[inline]
fn logistic<T: Real>(x: T) -> T {
    let e = (-x.abs()).exp();
    let low = e / (T::ONE + e);
    if x < T::ZERO { low } else { T::ONE - low }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ActivationKind::*;

    #[test]
    fn known_values() {
        for (kind, x, y) in [
            (Atan, 1.0, core::f64::consts::FRAC_PI_4),
            (Sigmoid, 0.0, 0.5),
            (Sigmoid, 3f64.ln(), 0.75),
            (Softplus, 0.0, core::f64::consts::LN_2),
            (Softplus, 2f64.ln(), 3f64.ln()),
            (Softsign, 3.0, 0.75),
            (Softsign, -0.25, -0.2),
            (Tanh, 0.5 * 3f64.ln(), 0.5),
        ] {
            assert!((kind.value(x) - y).abs() < 1e-15, "{kind:?}({x}) = {}", kind.value(x));
        }
    }

    #[test]
    fn functions_saturate_at_large_x_without_overflow() {
        for x in [1e3, 1e30, f64::MAX, f64::INFINITY] {
            for kind in ActivationKind::ALL {
                let (low, high) = kind.range();
                let asymptote = if kind == Softplus { x } else { 0.0 };
                let (up, down) = (kind.value(x), kind.value(-x));
                let expected = if kind == Softplus { x } else { high };
                assert!((up - expected).abs() <= 2e-3 || up == expected, "{kind:?} {x} {up}");
                assert!((down - low).abs() <= 2e-3 && down.is_finite(), "{kind:?} {down}");
                assert!((0.0..=1e-6).contains(&(kind.slope(x) - if asymptote > 0.0 { 1.0 } else { 0.0 })), "{kind:?}");
                assert!((0.0..=1e-6).contains(&kind.slope(-x)));
            }
        }
        for kind in ActivationKind::ALL {
            assert!(kind.value(-3e38f32).is_finite() && (kind == Softplus || kind.value(3e38f32).is_finite()));
        }
    }

    #[test]
    fn slopes_are_the_derivatives_and_stay_below_the_steepest() {
        for kind in ActivationKind::ALL {
            for k in -400..=400 {
                let (x, h) = (0.05 * f64::from(k) + 0.013, 1e-5);
                let numeric = (kind.value(x + h) - kind.value(x - h)) / (2.0 * h);
                assert!((kind.slope(x) - numeric).abs() < 1e-8, "{kind:?} {x}");
                assert!(kind.slope(x) <= kind.steepest());
            }
        }
    }

    #[test]
    fn steep_range_ends_at_the_given_slope() {
        for kind in [Atan, Sigmoid, Softsign, Tanh] {
            for slope in [1e-9, 1e-3, 0.2] {
                let x = kind.steep_until(slope);
                assert!((kind.slope(x) / slope - 1.0).abs() < 1e-6, "{kind:?} {slope}");
            }
            assert_eq!(kind.steep_until(1.5), 0.0);
        }
    }

    #[test]
    fn every_function_is_found_by_its_name() {
        for kind in ActivationKind::ALL {
            assert_eq!(ActivationKind::from_name(kind.name()), Some(kind));
        }
        assert_eq!(ActivationKind::from_name("relu"), None);
    }
}
