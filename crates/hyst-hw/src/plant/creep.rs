//! Creep: a broad, nearly continuous spectrum of exponentials.

use super::config;

/// State of the creep on the fine grid.
///
/// The integration is the trapezoidal rule. Its error `(step/τ)²/12` is small, because `step/τ ≤ 0.05` on the fine
/// grid.
#[derive(Debug, Clone)]
pub(crate) struct Creep {
    /// For each element: the share of the difference to the input that disappears in a step.
    rate: Vec<f64>,
    weight: Vec<f64>,
    value: Vec<f64>,
}

/// Number of interleaved sums. The order is fixed, and the compiler can vectorise it.
const LANES: usize = 4;

impl Creep {
    /// Returns elements at rest, for the fine step `step_s` (s).
    pub(crate) fn new(config: &config::Creep, step_s: f64) -> Self {
        let spectrum = spectrum(config);
        let padded = spectrum.len().next_multiple_of(LANES);
        let mut rate: Vec<f64> = spectrum.iter().map(|(tau, _)| step_s / (tau + 0.5 * step_s)).collect();
        let mut weight: Vec<f64> = spectrum.iter().map(|(_, weight)| *weight).collect();
        // Elements that never move fill the last group.
        rate.resize(padded, 0.0);
        weight.resize(padded, 0.0);
        Self { rate, weight, value: vec![0.0; padded] }
    }

    /// Computes one fine step with the input from `from` to `to` and returns the creep at its end.
    pub(crate) fn advance(&mut self, from: f64, to: f64) -> f64 {
        let middle = 0.5 * (from + to);
        let mut sums = [0.0; LANES];
        let groups = self.value.chunks_exact_mut(LANES).zip(self.rate.chunks_exact(LANES));
        for ((value, rate), weight) in groups.zip(self.weight.chunks_exact(LANES)) {
            for lane in 0..LANES {
                value[lane] += rate[lane] * (middle - value[lane]);
                sums[lane] += weight[lane] * value[lane];
            }
        }
        (sums[0] + sums[1]) + (sums[2] + sums[3])
    }

    pub(crate) fn reset(&mut self) {
        self.value.fill(0.0);
    }
}

/// Returns time constants (s) and weights.
fn spectrum(config: &config::Creep) -> Vec<(f64, f64)> {
    let (low, high) = (libm::log(config.tau_min_s), libm::log(config.tau_max_s));
    let last = (config.elements - 1) as f64;
    let raw: Vec<(f64, f64)> = (0..config.elements)
        .map(|i| {
            let log_tau = low + (high - low) * i as f64 / last;
            (libm::exp(log_tau), libm::exp(config.exponent * log_tau))
        })
        .collect();
    let sum: f64 = raw.iter().map(|(_, weight)| weight).sum();
    raw.into_iter().map(|(tau, weight)| (tau, config.strength * weight / sum)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config() -> config::Creep {
        config::Creep { strength: 0.09, tau_min_s: 0.05, tau_max_s: 80.0, exponent: 0.2, elements: 61 }
    }

    #[test]
    fn the_step_response_is_a_sum_of_exponentials() {
        let step = 0.05 * 0.05;
        let mut creep = Creep::new(&config(), step);
        let spectrum = spectrum(&config());
        for k in 1..40_000 {
            let out = creep.advance(2.0, 2.0);
            let t = step * f64::from(k);
            if k % 97 == 0 {
                let exact: f64 = spectrum.iter().map(|(tau, w)| -2.0 * w * (-t / tau).exp_m1()).sum();
                assert!((out - exact).abs() < 1e-6, "{t}: {out} {exact}");
            }
        }
    }

    #[test]
    fn weights_follow_the_exponent_and_have_the_strength_as_sum() {
        let spectrum = spectrum(&config());
        let sum: f64 = spectrum.iter().map(|(_, w)| w).sum();
        assert!((sum - 0.09).abs() < 1e-12);
        let (first, last) = (spectrum[0], spectrum[60]);
        assert!((first.0 - 0.05).abs() < 1e-12 && (last.0 - 80.0).abs() < 1e-9);
        assert!((last.1 / first.1 - (80.0_f64 / 0.05).powf(0.2)).abs() < 1e-9);
    }

    #[test]
    fn creep_converges_to_the_strength() {
        let mut creep = Creep::new(&config::Creep { tau_max_s: 1.0, ..config() }, 0.0025);
        let out = (0..10_000).map(|_| creep.advance(1.0, 1.0)).last().unwrap();
        assert!((out - 0.09).abs() < 1e-8, "{out}");
    }
}
