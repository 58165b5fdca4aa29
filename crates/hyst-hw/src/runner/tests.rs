//! Tests of the runner on a device with a queue and on the simulated plant.

use std::collections::VecDeque;

use super::*;
use crate::daq::{Capabilities, OutputUnit, VoltageRange};
use crate::{Plant, PlantConfig, PlantError};

/// A device with a short queue and late measurements, like a device on a serial line.
struct Queued {
    capabilities: Capabilities,
    queue: VecDeque<f64>,
    room: usize,
    present_v: f64,
    count: u32,
    /// Number of the exchange that fails.
    fails_at: Option<u32>,
    stuck: bool,
    exchanges: u32,
    mute: bool,
    running: bool,
    rests: Vec<f64>,
}

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("cable out")]
struct CableOut;

impl Queued {
    fn new(room: usize) -> Self {
        let capabilities = Capabilities {
            device: "queued".to_owned(),
            voltage: VoltageRange { min_v: -10.0, max_v: 10.0, rest_v: 0.0 },
            max_slew_v_per_s: f64::INFINITY,
            min_rate_hz: 1.0,
            max_rate_hz: 1000.0,
            max_block: 8,
            output: OutputUnit::Newton,
            temperature: false,
            load: true,
            queued: true,
        };
        Self {
            capabilities,
            queue: VecDeque::new(),
            room,
            present_v: 0.0,
            count: 0,
            fails_at: None,
            stuck: false,
            exchanges: 0,
            mute: false,
            running: false,
            rests: Vec::new(),
        }
    }
}

impl Daq for Queued {
    type Error = CableOut;

    fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    fn present_v(&self) -> f64 {
        self.present_v
    }

    fn start(&mut self, rate_hz: f64) -> Result<f64, CableOut> {
        self.running = true;
        // A clock of 1 MHz with an integer divider.
        Ok(1e6 / (1e6 / rate_hz).round())
    }

    fn exchange(&mut self, drive_v: &[f64], measured: &mut Vec<Sample>) -> Result<usize, CableOut> {
        assert!(drive_v.len() <= self.capabilities.max_block);
        self.exchanges += 1;
        // At most two samples per call, so that measurements lag behind the drive.
        for _ in 0..2 {
            if !self.mute
                && let Some(volts) = self.queue.pop_front()
            {
                self.count += 1;
                measured.push(Sample {
                    time_s: f64::from(self.count),
                    drive_v: volts,
                    output: 2.0 * volts,
                    temperature_degc: None,
                    load_n: Some(1.0),
                    force_n: None,
                });
            }
        }
        if self.fails_at == Some(self.exchanges) {
            return Err(CableOut);
        }
        let accepted = drive_v.len().min(self.room.saturating_sub(self.queue.len()));
        self.queue.extend(&drive_v[..accepted]);
        self.present_v = self.queue.back().copied().unwrap_or(self.present_v);
        Ok(accepted)
    }

    fn rest(&mut self, seconds: f64) -> Result<(), CableOut> {
        assert!(self.queue.is_empty(), "rest with drive in the queue");
        self.rests.push(seconds);
        Ok(())
    }

    fn stop(&mut self) -> Result<(), CableOut> {
        if self.stuck {
            return Err(CableOut);
        }
        self.running = false;
        Ok(())
    }
}

fn on(_: &Progress<'_>) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn options() -> RecordOptions {
    RecordOptions { slew_v_per_s: 50.0, rest_s: 3.0, ..RecordOptions::at(100.0) }
}

fn drives() -> Vec<Vec<f64>> {
    vec![
        (0..40).map(|k| (f64::from(k) / 5.0).sin() * 9.0).collect(),
        (0..25).map(|k| 4.0 + f64::from(k) / 10.0).collect(),
    ]
}

fn drive_of(samples: &[Sample]) -> Vec<f64> {
    samples.iter().map(|s| s.drive_v).collect()
}

#[test]
fn a_queued_device_measures_every_drive_sample() {
    for (room, block) in [(5, 256), (1, 3), (100, 1)] {
        let mut device = Queued::new(room);
        let (mut reported, mut last) = (0, 0);
        let recording = record(&mut device, &drives(), &RecordOptions { block, ..options() }, |p| {
            assert_eq!((p.segments, p.total), (2, 65));
            reported += p.samples.len();
            last = p.done;
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!(recording.segments.len(), 2);
        for (segment, drive) in recording.segments.iter().zip(&drives()) {
            assert_eq!(&drive_of(&segment.samples), drive);
            assert!(segment.samples.iter().all(|s| s.output == 2.0 * s.drive_v));
        }
        let ramps: usize = recording.segments.iter().map(|s| s.approach.len() + s.retreat.len()).sum();
        assert_eq!((reported, last), (65 + ramps, 65));
        // 0.5 V per sample: from 0.5 to 3.5 V on the ramp to 4 V.
        assert_eq!(drive_of(&recording.segments[1].approach), [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5]);
        assert_eq!(recording.segments[1].retreat.last().unwrap().drive_v, 0.0);
        assert_eq!((device.rests.iter().sum::<f64>(), device.running), (3.0, false));
    }
}

#[test]
fn a_rest_can_be_stopped() {
    let mut device = Queued::new(5);
    let failure = record(&mut device, &drives(), &RecordOptions { rest_s: 600.0, ..options() }, |p| {
        if p.samples.is_empty() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .unwrap_err();
    assert_eq!(failure.cause, Cause::Cancelled);
    assert!(device.rests.iter().sum::<f64>() < 1.0 && !device.running, "{:?}", device.rests);
    assert_eq!((failure.partial.segments.len(), device.present_v), (1, 0.0));
}

#[test]
fn a_panic_in_the_callback_stops_the_device() {
    let mut device = Queued::new(5);
    let looking = std::panic::AssertUnwindSafe(|| {
        record(&mut device, &drives(), &options(), |p| {
            assert!(p.done < 10, "seen enough");
            ControlFlow::Continue(())
        })
    });
    std::panic::catch_unwind(looking).unwrap_err();
    assert!(!device.running);
}

#[test]
fn invalid_requests_are_refused_before_anything_moves() {
    let mut device = Queued::new(5);
    let mut refuse = |segments: &[Vec<f64>], options: &RecordOptions| {
        let failure = record(&mut device, segments, options, on).unwrap_err();
        assert!(!device.running && device.exchanges == 0);
        failure.cause
    };
    assert_eq!(refuse(&[], &options()), Cause::NoSegment);
    assert_eq!(refuse(&[vec![1.0], vec![]], &options()), Cause::EmptySegment { segment: 1 });
    let out = refuse(&[vec![1.0], vec![0.0, 10.5]], &options());
    assert!(matches!(out, Cause::OutOfRange { segment: 1, row: 1, .. }), "{out}");
    let not = refuse(&[vec![f64::INFINITY]], &options());
    assert!(matches!(not, Cause::NonFinite { segment: 0, row: 0, .. }), "{not}");
    let flat = refuse(&drives(), &RecordOptions { slew_v_per_s: 0.0, ..options() });
    assert!(flat.to_string().starts_with("slew_v_per_s = 0"), "{flat}");
}

#[test]
fn a_device_that_runs_at_another_rate_is_stopped() {
    let mut device = Queued::new(5);
    let near = RecordOptions { rate_hz: 750.0, ..options() };
    let recording = record(&mut device, &drives(), &near, on).unwrap();
    assert!((recording.rate_hz - 1e6 / 1333.0).abs() < 1e-9);
    let strict = RecordOptions { rate_tolerance: 1e-6, ..near };
    let failure = record(&mut device, &drives(), &strict, on).unwrap_err();
    assert!(matches!(failure.cause, Cause::Rate { .. }) && !device.running);
}

#[test]
fn after_a_lost_device_the_samples_are_kept_and_a_stop_is_sent() {
    let mut device = Queued::new(5);
    device.fails_at = Some(12);
    let failure = record(&mut device, &drives(), &options(), on).unwrap_err();
    assert_eq!(failure.cause, Cause::Device(CableOut));
    assert_eq!(failure.to_string(), "cable out");
    // Two samples per call after the first, including those that arrived with the error.
    assert_eq!(drive_of(&failure.partial.segments[0].samples), drives()[0][..22]);
    assert!(!device.running);
}

#[test]
fn a_failed_stop_is_reported_in_addition_to_the_cause() {
    let mut device = Queued::new(5);
    device.stuck = true;
    let failure = record(&mut device, &drives(), &options(), on).unwrap_err();
    assert_eq!((failure.cause, failure.not_stopped.is_none()), (Cause::Stop(CableOut), true));
    // The record is complete.
    assert_eq!(drive_of(&failure.partial.segments[1].samples), drives()[1]);
    let cancelled = record(&mut device, &drives(), &options(), |_| ControlFlow::Break(())).unwrap_err();
    assert_eq!((cancelled.cause, cancelled.not_stopped), (Cause::Cancelled, Some(CableOut)));
    assert!(failure.driven && cancelled.driven);
}

#[test]
fn a_device_that_stayed_at_rest_is_not_reported_as_driven() {
    let rest = [[0.0; 20]];
    let stuck = || Queued { stuck: true, ..Queued::new(5) };
    assert!(!record(&mut stuck(), &rest, &options(), on).unwrap_err().driven);
    // The callback may change the requested drive.
    let raise = |revision: &mut Revision<'_>| revision.drive_v.fill(1.0);
    assert!(record_with(&mut stuck(), &rest, &options(), raise, on).unwrap_err().driven);
    // The device may have accepted a drive although nothing was returned.
    let mut lost = Queued { stuck: true, fails_at: Some(1), ..Queued::new(5) };
    assert!(record(&mut lost, &[[3.0; 20]], &options(), on).unwrap_err().driven);
    // The device was not at rest at the start.
    let mut raised = Queued { stuck: true, present_v: 2.0, ..Queued::new(5) };
    assert!(record(&mut raised, &rest, &options(), on).unwrap_err().driven);
    // Refused before anything moved.
    let odd = RecordOptions { rate_tolerance: -1.0, ..options() };
    assert!(!record(&mut stuck(), &[[3.0; 20]], &odd, on).unwrap_err().driven);
}

#[test]
fn a_device_that_returns_no_samples_is_reported_as_stalled() {
    let mut device = Queued::new(5);
    device.mute = true;
    let failure = record(&mut device, &drives(), &options(), on).unwrap_err();
    assert_eq!(failure.cause, Cause::Stalled { outstanding: 5 });
    assert!(!device.running);
}

#[test]
fn a_cancelled_run_ramps_to_rest_and_keeps_its_samples() {
    let mut device = Queued::new(5);
    let failure = record(&mut device, &drives()[1..], &options(), |p| {
        if p.done >= 10 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .unwrap_err();
    assert_eq!(failure.cause, Cause::Cancelled);
    let segment = &failure.partial.segments[0];
    assert!((10..25).contains(&segment.samples.len()));
    assert_eq!(drive_of(&segment.samples), drives()[1][..segment.samples.len()]);
    let way: Vec<f64> = drive_of(&[segment.samples.as_slice(), &segment.retreat].concat());
    assert!(way.windows(2).all(|w| (w[1] - w[0]).abs() <= 0.5 + 1e-12));
    assert_eq!(way.last(), Some(&0.0));
    assert!(!device.running && device.queue.is_empty());
}

#[test]
fn the_block_size_does_not_change_a_record_of_the_simulated_plant() {
    let config = PlantConfig::random_with(8, &["creep", "lag", "temperature"]).unwrap();
    let drives: Vec<Vec<f64>> = vec![(0..300).map(|k| 0.2 * f64::from(k)).collect(), vec![40.0; 100]];
    let run = |block| {
        let mut plant = Plant::new(config.clone()).unwrap();
        record(&mut plant, &drives, &RecordOptions { block, ..RecordOptions::at(1000.0) }, on).unwrap()
    };
    let recording = run(256);
    assert_eq!(recording, run(1));
    assert_eq!(recording, run(33));
    let times: Vec<f64> = recording
        .segments
        .iter()
        .flat_map(|s| [&s.approach, &s.samples, &s.retreat])
        .flatten()
        .map(|s| s.time_s)
        .collect();
    assert!(times.is_sorted_by(|a, b| a < b));
    let pause = recording.segments[1].approach[0].time_s - recording.segments[0].retreat.last().unwrap().time_s;
    assert!((pause - 1.001).abs() < 1e-9, "{pause}");
}

#[test]
fn an_error_of_the_plant_is_returned() {
    let config = PlantConfig::random_with(8, &[]).unwrap();
    let mut plant = Plant::new(config).unwrap();
    let failure = record(&mut plant, &drives()[1..], &RecordOptions::at(1e6), on).unwrap_err();
    assert!(matches!(failure.cause, Cause::Device(PlantError::Rate { .. })), "{failure}");
}

#[test]
fn each_row_is_revised_once_and_the_retreat_begins_at_the_revised_end() {
    let mut daq = Queued::new(3);
    let (mut rows, mut known) = (Vec::new(), false);
    let revise = |r: &mut Revision<'_>| {
        rows.extend(r.rows.clone());
        known |= r.latest.is_some();
        r.drive_v.iter_mut().for_each(|v| *v *= 2.0);
    };
    let drive: Vec<f64> = (0..20).map(|k| f64::from(k) / 10.0).collect();
    let recording =
        record_with(&mut daq, &[&drive], &RecordOptions::at(100.0), revise, |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(rows, (0..20).collect::<Vec<_>>());
    assert!(known, "the last block has a sample of the first");
    let played: Vec<f64> = recording.segments[0].samples.iter().map(|s| s.drive_v).collect();
    assert_eq!(played, drive.iter().map(|v| 2.0 * v).collect::<Vec<_>>());
    let retreat = &recording.segments[0].retreat;
    assert!(retreat[0].drive_v < 3.8 && retreat[0].drive_v > 2.0, "from the revised end, {}", retreat[0].drive_v);
}
