//! Asymmetry: a smooth curve after the hysteresis, steeper at one end of the stroke than at the other.

use std::f64::consts::PI;

use super::config::{self, Actuator};

/// Curve with the slope `k e^(kξ) / sinh k − hook/2 cos πξ`, where `k = bend/2`.
///
/// ξ is the position in the stroke, −1 at its lower and 1 at its upper end. The mean slope is 1. It is larger by `bend`
/// at the upper end than at the lower one, and by `hook` at the ends than in the middle.
#[derive(Debug, Clone)]
pub(crate) struct Curve {
    half_stroke: f64,
    /// Position of the virgin rest in the stroke, where the curve is 0.
    rest: f64,
    half_bend: f64,
    hook: f64,
}

impl Curve {
    pub(crate) fn new(config: &config::Asymmetry, actuator: &Actuator) -> Self {
        let &Actuator { min_v, max_v, rest_v, gain_um_per_v, .. } = actuator;
        let half_span = 0.5 * (max_v - min_v);
        Self {
            half_stroke: gain_um_per_v * half_span,
            rest: (rest_v - (min_v + half_span)) / half_span,
            half_bend: 0.5 * config.bend,
            hook: config.hook,
        }
    }

    /// Returns the displacement for the displacement `v` of the hysteresis (µm).
    pub(crate) fn at(&self, v: f64) -> f64 {
        let k = self.half_bend;
        let travel = v / self.half_stroke;
        let bent = if k == 0.0 { travel } else { libm::exp(k * self.rest) * libm::expm1(k * travel) / libm::sinh(k) };
        let hooked = 0.5 * self.hook / PI * (libm::sin(PI * (self.rest + travel)) - libm::sin(PI * self.rest));
        self.half_stroke * (bent - hooked)
    }
}

#[cfg(test)]
mod tests {
    use super::super::config::tests::clean;
    use super::*;

    /// Returns a curve for 0 to 100 V and 10 µm, at rest at `rest_v`.
    fn curve(bend: f64, hook: f64, rest_v: f64) -> Curve {
        Curve::new(&config::Asymmetry { bend, hook }, &Actuator { rest_v, ..clean().actuator })
    }

    fn slope(curve: &Curve, v: f64) -> f64 {
        (curve.at(v + 1e-4) - curve.at(v - 1e-4)) / 2e-4
    }

    #[test]
    fn slopes_differ_as_declared_and_have_a_mean_of_one() {
        for (bend, hook) in [(0.06, 0.0), (-0.3, 0.0), (0.0, 0.05), (0.05, -0.02)] {
            let curve = curve(bend, hook, 0.0);
            let [low, middle, high] = [0.0, 5.0, 10.0].map(|v| slope(&curve, v));
            assert!((high - low - bend).abs() < 1e-8, "{bend} {hook}: {low} {high}");
            assert!((0.5 * (low + high) - middle - hook).abs() < 0.13 * bend * bend + 1e-8, "{low} {middle} {high}");
            assert!((curve.at(10.0) - curve.at(0.0) - 10.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_curve_is_zero_at_rest_anywhere_in_the_stroke() {
        let at_the_bottom = curve(0.08, 0.03, 0.0);
        for rest_v in [0.0, 30.0, 100.0] {
            let curve = curve(0.08, 0.03, rest_v);
            assert_eq!(curve.at(0.0), 0.0);
            // The same curve with another zero.
            let shift = at_the_bottom.at(0.1 * rest_v);
            assert!((curve.at(2.0 - 0.1 * rest_v) - (at_the_bottom.at(2.0) - shift)).abs() < 1e-12);
        }
    }

    #[test]
    fn the_strongest_curves_also_increase_beyond_the_stroke() {
        for (bend, hook) in [(1.0, 0.5), (1.0, -0.5), (-1.0, 0.5), (-1.0, -0.5)] {
            let curve = curve(bend, hook, 0.0);
            let values: Vec<f64> = (-50..=150).map(|k| curve.at(0.1 * f64::from(k))).collect();
            assert!(values.is_sorted_by(|a, b| a < b), "{bend} {hook}");
        }
    }
}
