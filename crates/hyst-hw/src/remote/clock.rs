//! A device's clock against this computer's.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Round trips that are kept: the quickest one of each of so many stretches of time.
const STRETCHES: usize = 64;
/// How long a stretch is at first \[s\]; twice as long whenever there are too many.
const SHORTEST_S: f64 = 0.05;

/// When a run began by this computer's clock, and how fast the device's is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockFit {
    /// When period 0 of the run began \[s since 1970-01-01 UTC\].
    pub began_unix_s: f64,
    /// By how much the device's clock is faster than this computer's; `None` for a run that was too short to tell \[ppm\].
    pub faster_ppm: Option<f64>,
    /// To what the beginning is known: half of the quickest round trip and half a period \[s\].
    pub uncertainty_s: f64,
}

/// A period that a device told in an answer.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Told {
    /// Middle between question and answer, after the start \[s\].
    host_s: f64,
    /// From question to answer \[s\].
    round_trip_s: f64,
    /// Device's clock \[s\].
    device_s: f64,
}

/// What was told of a device's clock during a run: of a question and its answer, the device answered about halfway (as in Mills 1991), the more
/// surely the quicker the answer was.
#[derive(Debug, Clone)]
pub(super) struct Clock {
    began: Instant,
    wall: SystemTime,
    period_s: f64,
    stretch_s: f64,
    told: Vec<Told>,
}

impl Clock {
    /// Of a run that begins now, as the line has it, with this sample period \[s\].
    pub(super) fn new(period_s: f64, began: Instant) -> Self {
        Self {
            began,
            wall: SystemTime::now(),
            period_s,
            stretch_s: SHORTEST_S,
            told: Vec::with_capacity(STRETCHES + 1),
        }
    }

    /// A device has said how many periods had passed.
    pub(super) fn tell(&mut self, asked: Instant, answered: Instant, periods: u64) {
        let since = |then: Instant| then.saturating_duration_since(self.began).as_secs_f64();
        let (asked, answered) = (since(asked), since(answered));
        // The period that runs is half over, on the average.
        let device_s = (periods as f64 + 0.5) * self.period_s;
        self.take(Told { host_s: 0.5 * (asked + answered), round_trip_s: answered - asked, device_s });
    }

    fn take(&mut self, told: Told) {
        let stretch = |told: &Told| (told.host_s / self.stretch_s).floor();
        match self.told.last_mut() {
            Some(last) if stretch(last) == stretch(&told) => *last = quicker(*last, told),
            _ => self.told.push(told),
        }
        if self.told.len() > STRETCHES {
            self.stretch_s *= 2.0;
            let all = std::mem::take(&mut self.told);
            all.into_iter().for_each(|told| self.take(told));
        }
    }

    /// The line through what was told; `None` if nothing was.
    pub(super) fn fit(&self) -> Option<ClockFit> {
        let count = self.told.len() as f64;
        let mean = |of: &dyn Fn(&Told) -> f64| self.told.iter().map(of).sum::<f64>() / count;
        let quickest = self.told.iter().map(|t| t.round_trip_s).fold(f64::INFINITY, f64::min);
        let uncertainty_s = 0.5 * (quickest + self.period_s);
        let (host, device) = (mean(&|t| t.host_s), mean(&|t| t.device_s));
        let spread = mean(&|t| (t.host_s - host).powi(2));
        let slope = mean(&|t| (t.host_s - host) * (t.device_s - device)) / spread;
        // A slope is worth something once the run was much longer than what its ends are known to.
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

fn quicker(a: Told, b: Told) -> Told {
    if b.round_trip_s < a.round_trip_s { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A device whose clock of 1 kHz began after 20 ms and is 150 ppm fast, asked 200 times a second over a line with a tail.
    fn told(seconds: f64) -> Clock {
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
            clock.tell(at(asked), at(asked + there + back), (device / 1e-3) as u64);
        }
        clock
    }

    #[test]
    fn beginning_and_rate_are_found_behind_a_line_that_is_sometimes_slow() {
        let clock = told(60.0);
        let fit = clock.fit().unwrap();
        let wall = clock.wall.duration_since(UNIX_EPOCH).unwrap().as_secs_f64();
        assert!((fit.faster_ppm.unwrap() - 150.0).abs() < 10.0, "{fit:?}");
        assert!((fit.began_unix_s - wall - 0.02).abs() < fit.uncertainty_s, "{fit:?}");
        assert!(fit.uncertainty_s < 1e-3 && clock.told.len() <= STRETCHES, "{fit:?}");
    }

    #[test]
    fn a_short_run_tells_no_rate_and_an_empty_one_nothing() {
        let fit = told(0.1).fit().unwrap();
        assert_eq!(fit.faster_ppm, None);
        assert_eq!(Clock::new(1e-3, Instant::now()).fit(), None);
    }
}
