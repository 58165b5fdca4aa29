//! Structural modes: differential equations integrated on the fine grid.

use super::config;

/// Modal sum `y = Σ gᵢ qᵢ + (1 - Σ gᵢ) x` with `q'' + 2ζω q' + ω² q = ω² x`.
///
/// The integration is classical Runge-Kutta. For `ω·step ≤ 0.05` its numerical damping is `(ω·step)⁵/144 ≈ 2·10⁻⁹` and
/// its frequency error `(ω·step)⁴/120 ≈ 5·10⁻⁸`, both negligible.
#[derive(Debug, Clone)]
pub(crate) struct Structure {
    modes: Vec<Mode>,
    direct: f64,
}

#[derive(Debug, Clone)]
struct Mode {
    /// `ω · step`: the step in radians of this mode.
    step: f64,
    twice_damping: f64,
    gain: f64,
    position: f64,
    /// Velocity divided by ω, so that it has the unit of a position.
    velocity: f64,
}

impl Structure {
    /// Returns modes at rest, for the fine step `step_s` (s).
    pub(crate) fn new(modes: &[config::Mode], step_s: f64) -> Self {
        let direct = 1.0 - modes.iter().map(|mode| mode.gain).sum::<f64>();
        let modes = modes
            .iter()
            .map(|mode| Mode {
                step: std::f64::consts::TAU * mode.hz * step_s,
                twice_damping: 2.0 * mode.damping,
                gain: mode.gain,
                position: 0.0,
                velocity: 0.0,
            })
            .collect();
        Self { modes, direct }
    }

    /// Computes one fine step with the input from `from` to `to` and returns the output at its end.
    pub(crate) fn advance(&mut self, from: f64, to: f64) -> f64 {
        self.modes.iter_mut().fold(self.direct * to, |sum, mode| {
            mode.advance(from, to);
            sum + mode.gain * mode.position
        })
    }

    /// Sets all modes to the equilibrium with the constant input `input`.
    pub(crate) fn rest_at(&mut self, input: f64) {
        for mode in &mut self.modes {
            mode.position = input;
            mode.velocity = 0.0;
        }
    }
}

impl Mode {
    fn advance(&mut self, from: f64, to: f64) {
        let (h, half) = (self.step, 0.5 * self.step);
        let middle = 0.5 * (from + to);
        let (q, v) = (self.position, self.velocity);
        let pull = |x: f64, q: f64, v: f64| x - q - self.twice_damping * v;
        let (q1, v1) = (v, pull(from, q, v));
        let (q2, v2) = (v + half * v1, pull(middle, q + half * q1, v + half * v1));
        let (q3, v3) = (v + half * v2, pull(middle, q + half * q2, v + half * v2));
        let (q4, v4) = (v + h * v3, pull(to, q + h * q3, v + h * v3));
        self.position = q + h / 6.0 * (q1 + 2.0 * (q2 + q3) + q4);
        self.velocity = v + h / 6.0 * (v1 + 2.0 * (v2 + v3) + v4);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the frequency of the damped motion and the logarithmic decrement of a ring-down.
    ///
    /// Both follow from the upward zero crossings of the position, and from the velocity there.
    fn ring_down(hz: f64, damping: f64, step_s: f64) -> (f64, f64) {
        let mode = config::Mode { hz, damping, gain: 1.0 };
        let mut structure = Structure::new(&[mode], step_s);
        structure.modes[0].position = 1.0;
        let mut crossings = Vec::new();
        let mut before = (1.0, 0.0);
        for k in 0_u32.. {
            structure.advance(0.0, 0.0);
            let now = (structure.modes[0].position, structure.modes[0].velocity);
            if before.0 < 0.0 && now.0 >= 0.0 {
                let part = before.0 / (before.0 - now.0);
                crossings.push((f64::from(k) + part, before.1 + part * (now.1 - before.1)));
                if crossings.len() == 16 {
                    break;
                }
            }
            before = now;
        }
        let (first, last) = (crossings[0], crossings[15]);
        let period = (last.0 - first.0) * step_s / 15.0;
        (1.0 / period, (first.1 / last.1).ln() / 15.0)
    }

    #[test]
    fn the_ring_down_has_the_declared_frequency_and_damping() {
        for (hz, damping) in [(100.0, 0.01), (100.0, 0.02), (350.0, 0.06), (80.0, 0.2)] {
            // The coarsest step of the plant.
            let step = 0.05 / (std::f64::consts::TAU * hz);
            let (measured_hz, decrement) = ring_down(hz, damping, step);
            let root = (1.0 - damping * damping).sqrt();
            let expected = std::f64::consts::TAU * damping / root;
            assert!((measured_hz / (hz * root) - 1.0).abs() < 1e-5, "{hz}: {measured_hz}");
            assert!((decrement / expected - 1.0).abs() < 1e-3, "{damping}: {decrement} {expected}");
        }
    }

    #[test]
    fn the_static_gain_is_one_and_the_rest_of_the_gain_acts_at_once() {
        let modes =
            [config::Mode { hz: 100.0, damping: 0.3, gain: 0.7 }, config::Mode { hz: 300.0, damping: 0.3, gain: 0.1 }];
        let mut structure = Structure::new(&modes, 1e-5);
        let at_once = structure.advance(1.0, 1.0);
        assert!((at_once - 0.2).abs() < 1e-3, "{at_once}");
        let settled = (0..100_000).map(|_| structure.advance(1.0, 1.0)).last().unwrap();
        assert!((settled - 1.0).abs() < 1e-12, "{settled}");
    }

    #[test]
    fn without_modes_the_output_equals_the_input() {
        assert_eq!(Structure::new(&[], 1e-4).advance(0.2, 0.7), 0.7);
    }
}
