//! Comparison of a device's clock with this computer's clock.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::daq::ClockFit;

/// Maximum number of stored readings: the one with the shortest round trip of each time interval.
const MAX_READINGS: usize = 64;
/// First length of an interval \[s\]. It doubles whenever there are too many readings.
const FIRST_INTERVAL_S: f64 = 0.05;

/// A reading of the device's clock, from an answer.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Reading {
    /// Middle between request and answer, since the start \[s\].
    host_s: f64,
    /// Time from request to answer \[s\].
    round_trip_s: f64,
    /// Device's clock \[s\].
    device_s: f64,
}

/// Readings of a device's clock during a run.
///
/// The device is assumed to answer halfway between request and answer (Mills 1991). The error is at most half the round
/// trip.
#[derive(Debug, Clone)]
pub(super) struct Clock {
    began: Instant,
    wall: SystemTime,
    period_s: f64,
    interval_s: f64,
    readings: Vec<Reading>,
}

impl Clock {
    /// Returns the clock of a run with this sample period \[s\].
    ///
    /// `began` is the begin of the run on the line's clock.
    pub(super) fn new(period_s: f64, began: Instant) -> Self {
        Self {
            began,
            wall: SystemTime::now(),
            period_s,
            interval_s: FIRST_INTERVAL_S,
            readings: Vec::with_capacity(MAX_READINGS + 1),
        }
    }

    /// Adds a reading: the device has counted this many periods.
    pub(super) fn add_reading(&mut self, asked: Instant, answered: Instant, periods: u64) {
        let since = |then: Instant| then.saturating_duration_since(self.began).as_secs_f64();
        let (asked, answered) = (since(asked), since(answered));
        // On average, half of the present period has passed.
        let device_s = (periods as f64 + 0.5) * self.period_s;
        self.keep(Reading { host_s: 0.5 * (asked + answered), round_trip_s: answered - asked, device_s });
    }

    /// Adds a reading, or keeps the better one of its interval.
    fn keep(&mut self, reading: Reading) {
        let interval = |reading: &Reading| (reading.host_s / self.interval_s).floor();
        match self.readings.last_mut() {
            Some(last) if interval(last) == interval(&reading) => *last = shorter_round_trip(*last, reading),
            _ => self.readings.push(reading),
        }
        if self.readings.len() > MAX_READINGS {
            self.interval_s *= 2.0;
            let all = std::mem::take(&mut self.readings);
            all.into_iter().for_each(|reading| self.keep(reading));
        }
    }

    /// Fits a straight line to the readings; `None` without readings.
    pub(super) fn fit(&self) -> Option<ClockFit> {
        let count = self.readings.len() as f64;
        let mean = |of: &dyn Fn(&Reading) -> f64| self.readings.iter().map(of).sum::<f64>() / count;
        let quickest = self.readings.iter().map(|t| t.round_trip_s).fold(f64::INFINITY, f64::min);
        let uncertainty_s = 0.5 * (quickest + self.period_s);
        let (host, device) = (mean(&|t| t.host_s), mean(&|t| t.device_s));
        let spread = mean(&|t| (t.host_s - host).powi(2));
        let slope = mean(&|t| (t.host_s - host) * (t.device_s - device)) / spread;
        // The slope is significant only if the run is much longer than the uncertainty of a reading.
        let long = spread.sqrt() > 100.0 * uncertainty_s;
        let slope = if long { slope } else { 1.0 };
        let began_s = host - device / slope;
        let wall = self.wall.duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO).as_secs_f64();
        (count > 0.0).then_some(ClockFit {
            began_unix_s: wall + began_s,
            faster_ppm: long.then_some((slope - 1.0) * 1e6),
            uncertainty_s,
        })
    }
}

fn shorter_round_trip(a: Reading, b: Reading) -> Reading {
    if b.round_trip_s < a.round_trip_s { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns readings of a clock of 1 kHz that began after 20 ms and is 150 ppm fast.
    ///
    /// There are 200 requests per second, over a line with some late answers.
    fn readings(seconds: f64) -> Clock {
        let mut clock = Clock::new(1e-3, Instant::now());
        let mut luck = 1u32;
        for k in 0..(200.0 * seconds) as u32 {
            luck = luck.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let chance = f64::from(luck >> 8) / f64::from(1 << 24);
            let (there, back) = (0.4e-3, 0.4e-3 + 8e-3 * chance.powi(4));
            let asked = f64::from(k) * 5e-3;
            let device = (asked + there - 0.02) * (1.0 + 150e-6);
            if device < 0.0 {
                continue;
            }
            let at = |s: f64| clock.began + Duration::from_secs_f64(s);
            clock.add_reading(at(asked), at(asked + there + back), (device / 1e-3) as u64);
        }
        clock
    }

    #[test]
    fn begin_and_rate_are_found_over_a_line_with_late_answers() {
        let clock = readings(60.0);
        let fit = clock.fit().unwrap();
        let wall = clock.wall.duration_since(UNIX_EPOCH).unwrap().as_secs_f64();
        assert!((fit.faster_ppm.unwrap() - 150.0).abs() < 10.0, "{fit:?}");
        assert!((fit.began_unix_s - wall - 0.02).abs() < fit.uncertainty_s, "{fit:?}");
        assert!(fit.uncertainty_s < 1e-3 && clock.readings.len() <= MAX_READINGS, "{fit:?}");
    }

    #[test]
    fn a_short_run_has_no_rate_and_an_empty_one_has_no_fit() {
        let fit = readings(0.1).fit().unwrap();
        assert_eq!(fit.faster_ppm, None);
        assert_eq!(Clock::new(1e-3, Instant::now()).fit(), None);
    }
}
