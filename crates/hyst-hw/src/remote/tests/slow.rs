//! Runs over a slow serial line, with and without faults.

use std::collections::VecDeque;
use std::io;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::super::{Line, Remote, RemoteOptions};
use super::bench::{Bench, wave};
use crate::{RecordOptions, record};

/// A serial line that is slow in both directions.
///
/// Bytes wait in a queue until all earlier bytes are transmitted.
pub(super) struct Slow {
    pub(super) bench: Bench,
    bytes_per_s: f64,
    now: Duration,
    began: Instant,
    /// Time of the device's last period.
    lived: Duration,
    /// Bytes in transmission, and their times of arrival.
    there: VecDeque<(Duration, Vec<u8>)>,
    back: VecDeque<(Duration, u8)>,
    busy: [Duration; 2],
    asked: Vec<u8>,
    repeats: usize,
}

impl Slow {
    fn pass(&mut self, time: Duration) {
        let (end, period) = (self.now + time, Duration::from_secs_f64(1.0 / f64::from(self.bench.device.rate_hz())));
        while self.now < end {
            self.now = end.min(self.now + Duration::from_micros(500));
            while self.lived + period <= self.now {
                self.lived += period;
                self.bench.pass(1);
            }
            while self.there.front().is_some_and(|(at, _)| *at <= self.now) {
                let (_, bytes) = self.there.pop_front().unwrap();
                let carried = if bytes.len() > 1 { self.bench.carried(&bytes) } else { bytes };
                self.bench.take(&carried);
                for byte in self.bench.answers.drain(..) {
                    self.busy[1] = self.busy[1].max(self.now) + Duration::from_secs_f64(1.0 / self.bytes_per_s);
                    self.back.push_back((self.busy[1], byte));
                }
            }
        }
    }
}

impl Line for &mut Slow {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if bytes.len() > 1 {
            self.repeats += usize::from(self.asked == bytes);
            self.asked = bytes.to_vec();
        }
        self.busy[0] = self.busy[0].max(self.now) + Duration::from_secs_f64(bytes.len() as f64 / self.bytes_per_s);
        self.there.push_back((self.busy[0], bytes.to_vec()));
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        let give_up = self.now + patience;
        while self.now < give_up && self.back.front().is_none_or(|(at, _)| *at > self.now) {
            self.pass(Duration::from_micros(500));
        }
        let now = self.now;
        let count = self.back.iter().take_while(|(at, _)| *at <= now).count().min(bytes.len());
        self.back.drain(..count).zip(bytes).for_each(|((_, from), to)| *to = from);
        Ok(count)
    }

    fn now(&mut self) -> Instant {
        self.began + self.now
    }

    fn pause(&mut self, time: Duration) {
        self.pass(time);
    }
}

impl Slow {
    pub(super) fn new(baud: f64, fault_interval: u64, seed: u64) -> Self {
        Self {
            bench: Bench::new(fault_interval, seed),
            bytes_per_s: baud / 10.0,
            now: Duration::ZERO,
            began: Instant::now(),
            lived: Duration::ZERO,
            there: VecDeque::new(),
            back: VecDeque::new(),
            busy: [Duration::ZERO; 2],
            asked: Vec::new(),
            repeats: 0,
        }
    }

    /// Runs for 10 s and returns the number of periods in gaps.
    fn run(&mut self, rate_hz: f64, lost_s: f64) -> f64 {
        let options = RemoteOptions {
            lost: Duration::from_secs_f64(4.0 * lost_s),
            silence_s: lost_s,
            ..RemoteOptions::with_session(7)
        };
        let mut remote = Remote::open(self, "slow", options).unwrap();
        let drive = wave((10.0 * rate_hz) as usize);
        // The host measures the answer times during the first second.
        let options = RecordOptions { settle_s: 1.0, ..RecordOptions::at(rate_hz) };
        let recording = record(&mut remote, &[&drive], &options, |_| ControlFlow::Continue(()));
        let samples = &recording.unwrap().segments[0].samples;
        let periods = (samples[samples.len() - 1].time_s - samples[0].time_s) * rate_hz;
        periods.round() - (drive.len() - 1) as f64
    }
}

#[test]
fn a_slow_line_is_not_filled_with_requests() {
    // The largest rates for lines of 19,200 and 38,400 baud.
    for (baud, rate_hz) in [(19_200.0, 50.0), (38_400.0, 100.0)] {
        let mut slow = Slow::new(baud, 0, 1);
        assert_eq!(slow.run(rate_hz, 0.5), 0.0, "{baud}");
        assert!(slow.repeats < 20, "{baud}: {} requests were repeated", slow.repeats);
    }
}

#[test]
fn faults_on_a_slow_line_cause_gaps_but_do_not_end_the_run() {
    for seed in 0..10 {
        let mut slow = Slow::new(38_400.0, 20, seed);
        let gaps = slow.run(50.0, 0.5);
        assert!(gaps < 50.0, "seed {seed}: {gaps} periods of 500");
    }
}

/// The line is nearly too slow for the rate: an answer takes most of the watchdog time.
#[test]
fn lost_frames_on_a_nearly_too_slow_line_do_not_end_the_run() {
    for seed in 0..10 {
        Slow::new(19_200.0, 30, seed).run(50.0, 0.5);
    }
}

/// Lost frames must not lengthen the wait for answers.
///
/// Otherwise each lost frame would cost more time, until the connection counts as lost.
#[test]
fn lost_frames_do_not_lengthen_the_wait_for_answers() {
    for seed in 0..20 {
        let mut lossy = Slow::new(1e6, 2, seed);
        lossy.run(100.0, 5.0);
        assert!(lossy.now.as_secs_f64() < 60.0, "seed {seed}: {:?} for ten seconds", lossy.now);
    }
}
