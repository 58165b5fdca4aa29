//! Tests of a device over a line: complete runs, faults, messages, and slow and real lines.

mod bench;
mod faults;
mod lines;
mod messages;
mod slow;

use std::ops::ControlFlow;

use proptest::prelude::*;

use super::Remote;
use crate::runner::STOP_CHECK_S;
use crate::wire::{Ask, Exchange, Fault, MOST_DRIVES, Mode, Request, Start, State};
use crate::{RecordOptions, record};
use bench::{Bench, Luck, options, wave};

/// Plays two segments and compares the samples with the drives.
fn check_complete_run(bench: &mut Bench) {
    let mut remote = Remote::open(&mut *bench, "bench", options()).unwrap();
    let drive = [wave(700), wave(300)];
    let recording = record(&mut remote, &drive, &RecordOptions { rest_s: 0.1, ..RecordOptions::at(1000.0) }, |_| {
        ControlFlow::Continue(())
    });
    let recording = recording.unwrap();
    for (segment, drive) in recording.segments.iter().zip(&drive) {
        assert_eq!(segment.samples.len(), drive.len());
        for (sample, volts) in segment.samples.iter().zip(drive) {
            assert_eq!(sample.drive_v, f64::from(*volts as f32));
            // The output is measured one period after the drive.
            assert_eq!(sample.output, f64::from(0.5 * *volts as f32));
            assert_eq!(sample.temperature_degc, Some(20.0));
        }
        assert!(segment.samples.windows(2).all(|w| w[1].time_s > w[0].time_s));
    }
    assert_eq!(bench.device.state(), State::Idle);
    assert_eq!(bench.board.volts, 0.0);
    assert!(bench.board.put_out.iter().all(|v| (-10.0..=100.0).contains(v)));
}

#[test]
fn a_run_over_a_line_without_faults_is_complete() {
    check_complete_run(&mut Bench::new(0, 1));
}

#[test]
fn a_run_over_a_line_with_faults_is_complete() {
    for seed in 0..20 {
        check_complete_run(&mut Bench::new(4, seed));
    }
}

/// The slices of a rest are whole periods, even if a period is longer than the nominal slice.
#[test]
fn a_rest_is_as_long_as_asked_for_at_any_rate() {
    for (rate_hz, rest_s) in [(1.0, 20.0), (3.0, 7.0), (10.0, 5.0), (1000.0, 2.0)] {
        let mut bench = Bench::new(0, 1);
        let mut remote = Remote::open(&mut bench, "bench", options()).unwrap();
        let drive = [vec![0.0; 3], vec![0.0; 3]];
        let options = RecordOptions { rest_s, ..RecordOptions::at(rate_hz) };
        let recording = record(&mut remote, &drive, &options, |_| ControlFlow::Continue(())).unwrap();
        let [first, second] = [0, 1].map(|k| &recording.segments[k].samples);
        let rested = second[0].time_s - first[2].time_s;
        // Each exchange advances the time of the bench.
        let talk = 10.0 * (1.0 + rest_s / STOP_CHECK_S.max(1.0 / rate_hz)) / rate_hz;
        assert!((rest_s..rest_s + talk).contains(&rested), "{rate_hz} Hz: {rested} s for {rest_s}");
    }
}

proptest! {
    /// Arbitrary requests do not move the output beyond its range or slew limit.
    #[test]
    fn arbitrary_requests_keep_the_output_within_its_limits(seed in any::<u64>()) {
        let mut luck = Luck(seed);
        let mut bench = Bench::new(0, seed);
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, 0.0, 50.0, 99.0, 101.0, -11.0];
        for _ in 0..200 {
            let mut value = || odd[luck.below(odd.len() as u64) as usize];
            let start = Start {
                session: 1, mode: Mode::Voltage, rate_hz: 1000.0, low_v: value().min(0.0), high_v: value().max(1.0),
                slew_v_per_s: value(), hottest_degc: value(), error: value(), silence_s: 1.0, force: false,
            };
            let drives: heapless::Vec<f32, MOST_DRIVES> = (0..5).map(|_| value()).collect();
            let sound = Start { low_v: 0.0, high_v: 99.0, slew_v_per_s: 5000.0, hottest_degc: 50.0, error: 1.0, ..start };
            let session = luck.below(4) as u32;
            let ask = match luck.below(8) {
                0 => Ask::Start(Start { session, ..start }),
                1 => Ask::Start(Start { session, ..sound }),
                2 if luck.below(4) == 0 => Ask::Stop,
                3 if luck.below(4) == 0 => Ask::Emergency,
                4 => Ask::Clear(if let State::Fault(fault) = bench.device.state() { fault } else { Fault::Silence }),
                _ => {
                    let have = bench.device.status().received;
                    let (heard, first) = (luck.below(20) as u32, (have + 2).saturating_sub(luck.below(5) as u32));
                    Ask::Exchange(Exchange { session, heard, first, drives })
                }
            };
            bench.device.answer(&Request { number: 1, ask });
            let periods = luck.below(4) as u32;
            bench.pass(periods);
        }
        prop_assert!(bench.board.put_out.iter().all(|v| (-10.0..=100.0).contains(v)));
        let steepest = 50_000.0 / 1000.0 * 1.001;
        let from_rest = std::iter::once(0.0).chain(bench.board.put_out.iter().copied());
        prop_assert!(from_rest.zip(&bench.board.put_out).all(|(a, b)| (b - a).abs() <= steepest));
    }
}
