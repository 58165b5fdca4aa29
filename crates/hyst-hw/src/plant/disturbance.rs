//! Disturbances of the reading that are not effects.

use super::config::{Disturbance, PlantConfig};
use super::rng::{Draws, Purpose};
use super::waves::Waves;

/// All disturbances of the reading, in the order of the file.
#[derive(Debug, Clone)]
pub(crate) struct Disturbances(Vec<Active>);

#[derive(Debug, Clone)]
enum Active {
    Jump { um: f64, at_s: f64 },
    Bursts(Bursts),
    Wander(Waves),
    Slip(Slip),
}

#[derive(Debug, Clone)]
struct Bursts {
    noise: f64,
    seconds: f64,
    every_s: f64,
    /// Begin of each burst within its interval `every_s` (s); after the last one they repeat.
    begins: Vec<f64>,
    draws: Draws,
}

#[derive(Debug, Clone)]
struct Slip {
    um: f64,
    at_v: f64,
    /// Position of the mount (µm).
    position: f64,
    draws: Draws,
}

/// Number of bursts with different times; after the last one the times repeat.
const BURSTS: usize = 64;

impl Disturbances {
    pub(crate) fn new(config: &PlantConfig) -> Self {
        let numbered = (0..).zip(&config.disturbances);
        Self(numbered.filter_map(|(k, disturbance)| Active::new(config, k, disturbance)).collect())
    }

    /// Returns the sum of the disturbances at lab time `t` (µm).
    ///
    /// The drive has just changed from `from_v` to `to_v`.
    pub(crate) fn advance(&mut self, t: f64, from_v: f64, to_v: f64) -> f64 {
        self.0.iter_mut().map(|active| active.advance(t, from_v, to_v)).sum()
    }
}

impl Active {
    /// Returns disturbance number `k`; `None` if it does not act on the reading.
    fn new(config: &PlantConfig, k: u32, disturbance: &Disturbance) -> Option<Self> {
        let draws = |purpose| Draws::numbered(config.seed, purpose, k);
        Some(match *disturbance {
            Disturbance::Jump { um, at_s } => Self::Jump { um, at_s },
            Disturbance::GainStep { .. } | Disturbance::SlewLimit { .. } => return None,
            Disturbance::Bursts { um, seconds, every_s } => {
                let mut moments = draws(Purpose::BurstMoments);
                let begins = (0..BURSTS).map(|_| moments.between(0.0, every_s - seconds)).collect();
                Self::Bursts(Bursts {
                    noise: um,
                    seconds,
                    every_s,
                    begins,
                    draws: Draws::numbered(config.noise(), Purpose::BurstNoise, k),
                })
            }
            Disturbance::Wander { um, period_s } => {
                Self::Wander(Waves::walk(&mut draws(Purpose::SensorWander), um, period_s))
            }
            Disturbance::Slip { um, at_v } => Self::Slip(Slip { um, at_v, position: 0.0, draws: draws(Purpose::Slip) }),
        })
    }

    fn advance(&mut self, t: f64, from_v: f64, to_v: f64) -> f64 {
        match self {
            Self::Jump { um, at_s } => {
                if t >= *at_s {
                    *um
                } else {
                    0.0
                }
            }
            Self::Bursts(bursts) => bursts.advance(t),
            Self::Wander(waves) => waves.on(0.0, t),
            Self::Slip(slip) => slip.advance(from_v, to_v),
        }
    }
}

impl Bursts {
    fn advance(&mut self, t: f64) -> f64 {
        let interval = (t / self.every_s).floor();
        let since = t - interval * self.every_s - self.begins[interval as usize % BURSTS];
        if (0.0..self.seconds).contains(&since) { self.noise * self.draws.normal() } else { 0.0 }
    }
}

impl Slip {
    fn advance(&mut self, from_v: f64, to_v: f64) -> f64 {
        if from_v < self.at_v && to_v >= self.at_v {
            self.position = self.draws.between(-self.um, self.um);
        }
        self.position
    }
}

#[cfg(test)]
mod tests {
    use super::super::config::tests::clean;
    use super::*;

    fn disturbances(of: &[Disturbance]) -> Disturbances {
        Disturbances::new(&PlantConfig { disturbances: of.to_vec(), ..clean() })
    }

    /// Returns a disturbance over `seconds` at 1 kHz, with a constant drive.
    fn course(of: Disturbance, seconds: u32) -> Vec<f64> {
        let mut disturbances = disturbances(&[of]);
        (0..seconds * 1000).map(|k| disturbances.advance(0.001 * f64::from(k), 0.0, 0.0)).collect()
    }

    #[test]
    fn a_step_is_permanent() {
        let course = course(Disturbance::Jump { um: -0.3, at_s: 1.5 }, 3);
        assert!(course[..1500].iter().all(|y| *y == 0.0) && course[1500..].iter().all(|y| *y == -0.3));
    }

    #[test]
    fn each_interval_has_one_burst_with_the_declared_duration_and_noise() {
        let course = course(Disturbance::Bursts { um: 0.2, seconds: 0.25, every_s: 2.0 }, 200);
        for interval in course.chunks(2000) {
            let noisy = interval.iter().filter(|y| **y != 0.0).count();
            assert!((249..=251).contains(&noisy), "{noisy}");
            let first = interval.iter().position(|y| *y != 0.0).unwrap();
            assert!(interval[first..first + noisy].iter().all(|y| *y != 0.0));
        }
        let rms = (course.iter().map(|y| y * y).sum::<f64>() / 25_000.0).sqrt();
        assert!((rms / 0.2 - 1.0).abs() < 0.02, "{rms}");
        let begins: Vec<_> = course.chunks(2000).map(|interval| interval.iter().position(|y| *y != 0.0)).collect();
        assert!(begins.windows(2).filter(|pair| pair[0] != pair[1]).count() > 90);
    }

    #[test]
    fn a_random_walk_stays_within_its_amplitude_and_is_not_periodic() {
        let course = course(Disturbance::Wander { um: 0.5, period_s: 10.0 }, 300);
        let (low, high) = course.iter().fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(*y), h.max(*y)));
        assert!(low >= -0.5 && high <= 0.5 && high - low > 0.4, "{low} {high}");
        // A periodic signal equals itself after a shift by its period; here no shift does.
        let rms = |v: &mut dyn Iterator<Item = f64>| v.map(|y| y * y).sum::<f64>().sqrt();
        let whole = rms(&mut course.iter().copied());
        for shift in (5_000..20_000).step_by(500) {
            let differences = rms(&mut course.iter().zip(&course[shift..]).map(|(a, b)| a - b));
            assert!(differences > 0.4 * whole, "{shift}: {differences} {whole}");
        }
    }

    #[test]
    fn a_mount_slips_when_the_drive_rises_above_its_voltage() {
        let mut slip = disturbances(&[Disturbance::Slip { um: 0.4, at_v: 50.0 }]);
        let mut places = Vec::new();
        for _ in 0..50 {
            let before = slip.advance(0.0, 0.0, 49.9);
            let after = slip.advance(0.0, 49.9, 50.0);
            assert!(after.abs() <= 0.4 && after != before);
            assert_eq!([slip.advance(0.0, 50.0, 80.0), slip.advance(0.0, 80.0, 0.0)], [after; 2]);
            places.push(after);
        }
        assert!(places.iter().any(|p| *p > 0.2) && places.iter().any(|p| *p < -0.2));
    }

    #[test]
    fn two_disturbances_of_a_kind_differ_and_add_up() {
        let wander = Disturbance::Wander { um: 0.5, period_s: 10.0 };
        let one = disturbances(std::slice::from_ref(&wander)).advance(3.0, 0.0, 0.0);
        let two = disturbances(&[wander.clone(), wander]).advance(3.0, 0.0, 0.0);
        assert!((two - 2.0 * one).abs() > 1e-3, "{one} {two}");
    }
}
