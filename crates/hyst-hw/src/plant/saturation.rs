//! Mechanical stops, hard or with a rounded corner, and limits of the amplifier.

use std::f64::consts::SQRT_2;

use super::config;

/// Two stops; a missing stop is at infinity.
#[derive(Debug, Clone)]
pub(crate) struct Stops {
    low: f64,
    high: f64,
    /// Distance before a stop at which its corner begins (µm).
    knee: f64,
    /// Radius of the corner (µm): an arc that is tangent to the line of slope 1 and to the stop.
    radius: f64,
}

impl Stops {
    pub(crate) fn new(config: &config::Saturation) -> Self {
        // Half the angle between the two lines is 67.5°; its tangent is 1 + √2.
        let radius = SQRT_2 * config.knee_um * (1.0 + SQRT_2);
        Self {
            low: config.low_um.unwrap_or(f64::NEG_INFINITY),
            high: config.high_um.unwrap_or(f64::INFINITY),
            knee: config.knee_um,
            radius,
        }
    }

    /// Returns the displacement for the free displacement `y` (µm).
    pub(crate) fn at(&self, y: f64) -> f64 {
        if y > self.high - self.knee {
            self.high - self.short_of_stop(self.high - y)
        } else if y < self.low + self.knee {
            self.low + self.short_of_stop(y - self.low)
        } else {
            y
        }
    }

    /// Returns the distance to a stop for a free displacement at the distance `free < knee`.
    ///
    /// Negative values are beyond the stop.
    fn short_of_stop(&self, free: f64) -> f64 {
        // The arc ends √2 knees beyond the stop.
        let before_end = free + SQRT_2 * self.knee;
        if before_end <= 0.0 {
            0.0
        } else {
            self.radius - libm::sqrt(self.radius * self.radius - before_end * before_end)
        }
    }
}

/// Limits of the voltage that the amplifier gives; a missing limit is at infinity.
#[derive(Debug, Clone)]
pub(crate) struct Rails {
    low: f64,
    high: f64,
}

impl Rails {
    pub(crate) fn new(config: &config::Saturation) -> Self {
        Self { low: config.low_v.unwrap_or(f64::NEG_INFINITY), high: config.high_v.unwrap_or(f64::INFINITY) }
    }

    /// Returns the voltage for the commanded voltage `drive_v` (V).
    pub(crate) fn at(&self, drive_v: f64) -> f64 {
        drive_v.max(self.low).min(self.high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stops(low_um: Option<f64>, high_um: Option<f64>, knee_um: f64) -> Stops {
        Stops::new(&config::Saturation { low_um, high_um, knee_um, ..Default::default() })
    }

    #[test]
    fn rails_limit_the_voltage() {
        let rails = |low_v, high_v| Rails::new(&config::Saturation { low_v, high_v, ..Default::default() });
        assert_eq!([-30.0, 5.0, 130.0].map(|v| rails(None, Some(100.0)).at(v)), [-30.0, 5.0, 100.0]);
        assert_eq!([-30.0, 5.0, 130.0].map(|v| rails(Some(-10.0), None).at(v)), [-10.0, 5.0, 130.0]);
    }

    #[test]
    fn hard_stops_limit_the_displacement() {
        let stops = stops(Some(-1.0), Some(7.0), 0.0);
        assert_eq!([-3.0, -1.0, 2.5, 7.0, 9.0].map(|y| stops.at(y)), [-1.0, -1.0, 2.5, 7.0, 7.0]);
    }

    #[test]
    fn a_single_stop_does_not_limit_the_other_side() {
        assert_eq!([-1e6, 3.0, 1e6].map(|y| stops(None, Some(7.0), 0.5).at(y)), [-1e6, 3.0, 7.0]);
        assert_eq!([-1e6, 3.0, 1e6].map(|y| stops(Some(-1.0), None, 0.5).at(y)), [-1.0, 3.0, 1e6]);
    }

    #[test]
    fn soft_stops_begin_at_their_knee_with_a_continuous_slope() {
        let stops = stops(Some(-2.0), Some(7.0), 1.5);
        assert_eq!([-0.5, 0.0, 3.0, 5.5].map(|y| stops.at(y)), [-0.5, 0.0, 3.0, 5.5]);
        // A rounded corner is inside the sharp one and reaches the stop.
        assert!(stops.at(7.0) < 6.8 && stops.at(7.0) > 6.0);
        assert_eq!([-20.0, 20.0].map(|y| stops.at(y)), [-2.0, 7.0]);
        let slope = |y: f64| (stops.at(y + 1e-6) - stops.at(y - 1e-6)) / 2e-6;
        let slopes: Vec<f64> = (0..=2000).map(|k| slope(-5.0 + 0.0075 * f64::from(k))).collect();
        // The slope has no steps. On the arc it changes by at most 2.9/r per micrometre, where it meets the line.
        assert!(slopes.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 0.01), "{slopes:?}");
        assert!(slopes.iter().all(|s| (-1e-6..=1.0 + 1e-6).contains(s)));
        assert!((stops.at(5.0 + 1.0) - (5.0 - stops.at(-1.0))).abs() < 1e-12);
    }
}
