//! The external force on the actuator, and its measurement.

use super::config::{self, LoadShape};
use super::rng::{Draws, Purpose};
use super::waves::Waves;

/// Force as a function of the lab time, and the noise of its measurement.
#[derive(Debug, Clone)]
pub(crate) struct AppliedLoad {
    um_per_n: f64,
    profile: Profile,
    cell: Option<LoadCell>,
}

#[derive(Debug, Clone)]
enum Profile {
    Waves(Waves),
    /// Levels (N), each held for `period` (s).
    ///
    /// At lab time 0, `phase` periods of the first level have passed.
    Steps {
        levels: Vec<f64>,
        period: f64,
        phase: f64,
    },
}

#[derive(Debug, Clone)]
struct LoadCell {
    noise: f64,
    draws: Draws,
}

/// Number of random levels; after the last one they repeat.
const LEVELS: usize = 64;

impl AppliedLoad {
    pub(crate) fn new(seed: u64, config: &config::Load) -> Self {
        let &config::Load { newtons, period_s: period, um_per_n, .. } = config;
        let mut draws = Draws::new(seed, Purpose::LoadProfile);
        let profile = match config.shape {
            LoadShape::Sine => Profile::Waves(Waves::sine(&mut draws, newtons, period)),
            LoadShape::Wander => Profile::Waves(Waves::wander(&mut draws, newtons, period)),
            LoadShape::Steps => {
                let phase = draws.unit();
                let levels = (0..LEVELS).map(|_| draws.between(-newtons, newtons)).collect();
                Profile::Steps { levels, period, phase }
            }
        };
        let cell =
            config.recorded.then(|| LoadCell { noise: config.noise_n, draws: Draws::new(seed, Purpose::LoadNoise) });
        Self { um_per_n, profile, cell }
    }

    /// Sets another seed for the force sensor's noise.
    pub(crate) fn with_noise(mut self, seed: u64) -> Self {
        if let Some(cell) = &mut self.cell {
            cell.draws = Draws::new(seed, Purpose::LoadNoise);
        }
        self
    }

    /// Returns the true force at lab time `t` (N).
    pub(crate) fn at(&self, t: f64) -> f64 {
        match &self.profile {
            Profile::Waves(waves) => waves.on(0.0, t),
            Profile::Steps { levels, period, phase } => levels[(t / period + phase) as usize % levels.len()],
        }
    }

    /// Returns the displacement by the force at lab time `t` (µm).
    pub(crate) fn deflection(&self, t: f64) -> f64 {
        self.um_per_n * self.at(t)
    }

    /// Returns the measured force at lab time `t` (N); `None` if it is not recorded.
    pub(crate) fn measure(&mut self, t: f64) -> Option<f64> {
        let truth = self.at(t);
        self.cell.as_mut().map(|cell| truth + cell.noise * cell.draws.normal())
    }

    pub(crate) fn is_recorded(&self) -> bool {
        self.cell.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(shape: LoadShape) -> config::Load {
        config::Load { newtons: 3.0, um_per_n: 0.1, period_s: 5.0, shape, recorded: true, noise_n: 0.0 }
    }

    fn course(load: &AppliedLoad, seconds: u32) -> Vec<f64> {
        (0..seconds * 50).map(|k| load.at(0.02 * f64::from(k))).collect()
    }

    #[test]
    fn every_shape_stays_within_its_amplitude_and_uses_most_of_it() {
        for shape in [LoadShape::Sine, LoadShape::Wander, LoadShape::Steps] {
            for seed in 0..20 {
                let course = course(&AppliedLoad::new(seed, &config(shape)), 200);
                let (low, high) = course.iter().fold((f64::MAX, f64::MIN), |(l, h), f| (l.min(*f), h.max(*f)));
                assert!(low >= -3.0 && high <= 3.0 && high - low > 3.0, "{shape:?} {seed}: {low} {high}");
            }
        }
    }

    #[test]
    fn a_sine_is_periodic_and_steps_hold_their_level() {
        let sine = AppliedLoad::new(4, &config(LoadShape::Sine));
        assert!((sine.at(1.3) - sine.at(6.3)).abs() < 1e-12);
        assert!((sine.deflection(1.3) - 0.1 * sine.at(1.3)).abs() < 1e-15);
        let steps = course(&AppliedLoad::new(4, &config(LoadShape::Steps)), 100);
        let changes: Vec<usize> = (1..steps.len()).filter(|k| steps[*k] != steps[k - 1]).collect();
        assert_eq!(changes.len(), 20);
        assert!(changes.windows(2).all(|pair| (249..=251).contains(&(pair[1] - pair[0]))), "{changes:?}");
    }

    #[test]
    fn a_load_is_measured_with_noise_only_if_it_is_recorded() {
        let hidden = config::Load { recorded: false, ..config(LoadShape::Wander) };
        assert_eq!(AppliedLoad::new(3, &hidden).measure(1.0), None);
        let mut noisy = AppliedLoad::new(3, &config::Load { noise_n: 0.02, ..config(LoadShape::Wander) });
        let read = noisy.measure(7.0).unwrap();
        assert!(read != noisy.at(7.0) && (read - noisy.at(7.0)).abs() < 0.2);
    }
}
