//! Limits of a run that this computer checks, in addition to those that a device checks.

use hyst_hw::Sample;
use hyst_hw::wire::{Fault, Lasting, PATIENCE_S};

/// Duration of a tracking error that ends a run, as a share of a short segment.
/// In long segments it is [`PATIENCE_S`].
const SHARE_OF_SEGMENT: f32 = 0.25;

/// Limits that end a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guard {
    hottest_degc: f64,
    error: f64,
    patience: f32,
    exceeded: Lasting,
}

impl Guard {
    /// Creates limits on temperature \[°C\] and tracking error \[output unit\]; `None` for no limit.
    ///
    /// A tracking error ends the run after [`PATIENCE_S`] or a quarter of `shortest_s`, the duration of the shortest
    /// segment.
    pub(super) fn new(hottest_degc: Option<f64>, error: Option<f64>, rate_hz: f64, shortest_s: f64) -> Self {
        Self {
            hottest_degc: hottest_degc.unwrap_or(f64::INFINITY),
            error: error.unwrap_or(f64::INFINITY),
            patience: PATIENCE_S.min(SHARE_OF_SEGMENT * shortest_s as f32) * rate_hz as f32,
            exceeded: Lasting::default(),
        }
    }

    /// Checks a sample against the limits; returns the fault that ends the run.
    pub(super) fn check(&mut self, sample: &Sample, reference: Option<f64>) -> Option<Fault> {
        let values = [Some(sample.output), sample.temperature_degc, sample.load_n];
        if values.into_iter().flatten().any(|x| !x.is_finite()) {
            return Some(Fault::Sensor);
        }
        if sample.temperature_degc.is_some_and(|degc| degc > self.hottest_degc) {
            return Some(Fault::Temperature);
        }
        let away = reference.is_some_and(|wanted| (sample.output - wanted).abs() > self.error);
        self.exceeded.step(away, self.patience).then_some(Fault::TrackingError)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(output: f64, degc: f64) -> Sample {
        Sample { time_s: 0.0, drive_v: 1.0, output, temperature_degc: Some(degc), load_n: None, force_n: None }
    }

    #[test]
    fn temperature_and_sensor_faults_end_a_run_at_once_and_tracking_errors_after_a_time() {
        let mut guard = Guard::new(Some(60.0), Some(0.5), 100.0, 10.0);
        assert_eq!(guard.check(&sample(1.0, 20.0), None), None);
        assert_eq!(guard.check(&sample(1.0, 60.1), None), Some(Fault::Temperature));
        assert_eq!(guard.check(&sample(f64::NAN, 20.0), None), Some(Fault::Sensor));
        let mut away = |wanted| guard.check(&sample(1.0, 20.0), Some(wanted));
        assert!((0..50).all(|_| away(1.6).is_none()));
        assert!((0..11).all(|_| away(1.4).is_none()));
        assert!((0..50).all(|_| away(1.6).is_none()));
        assert_eq!(away(1.6), Some(Fault::TrackingError));
        let mut short = Guard::new(None, Some(0.5), 100.0, 0.4);
        assert!((0..10).all(|_| short.check(&sample(1.0, 20.0), Some(1.6)).is_none()));
        assert_eq!(short.check(&sample(1.0, 20.0), Some(1.6)), Some(Fault::TrackingError));
        let mut none = Guard::new(None, None, 100.0, 10.0);
        assert!((0..1000).all(|_| none.check(&sample(1e9, 1e9), Some(0.0)).is_none()));
    }
}
