//! Plays drive segments on any device and brings it back to rest in every case.

mod failure;
mod plan;
mod recording;

use std::ops::ControlFlow;

use crate::daq::{Daq, Sample};
pub use failure::{Cause, Failure};
use plan::{Plan, RevisionContext};
pub use recording::{Phase, Progress, RecordOptions, Recording, Revision, SegmentRecord};

/// Time between two stop checks during a rest on a device with a queue \[s\], rounded to whole periods.
pub(crate) const STOP_CHECK_S: f64 = 0.25;

/// Plays drive segments (V) on a device and returns the measured samples.
///
/// The same as [`record_with`], without changes to the drive.
///
/// # Errors
/// As [`record_with`].
pub fn record<D: Daq + ?Sized>(
    daq: &mut D,
    segments: &[impl AsRef<[f64]>],
    options: &RecordOptions,
    progress: impl FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Recording, Failure<D::Error>> {
    record_with(daq, segments, options, |_| {}, progress)
}

/// Plays drive segments (V) on a device, with a callback before each block; returns the measured samples.
///
/// `revise` may change the planned drive, for example depending on the measured temperature. Its
/// result is not checked here; the device refuses values outside its range.
///
/// All drives are checked against the device's range before anything moves. Then the sample clock
/// starts, and every segment is played: a ramp from the present voltage to the drive's first value
/// and the hold there (`approach`), the drive (`samples`, one per drive sample), a ramp back to the
/// rest voltage (`retreat`). Between segments the device rests for `rest_s`. At the end it is stopped.
///
/// `progress` is called with all received samples. If it returns [`ControlFlow::Break`], the
/// device is ramped to rest and the recording ends as [`Cause::Cancelled`].
///
/// # Errors
/// A [`Failure`] with the cause and the samples measured until then. The device is stopped in every
/// case, also after an error of the device. Only if the request is refused before anything moves, nothing is sent.
pub fn record_with<D: Daq + ?Sized>(
    daq: &mut D,
    segments: &[impl AsRef<[f64]>],
    options: &RecordOptions,
    revise: impl FnMut(&mut Revision<'_>),
    progress: impl FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Recording, Failure<D::Error>> {
    let mut recording = Recording::default();
    if let Err(cause) = plan::check(segments, daq.capabilities().voltage, options) {
        return Err(Failure { cause, partial: recording, not_stopped: None, driven: false });
    }
    let daq = StopOnPanic(daq);
    let mut driven = daq.0.present_v() != daq.0.capabilities().voltage.rest_v;
    let played = start_and_play(&mut *daq.0, segments, options, revise, progress, (&mut recording, &mut driven));
    match (played, daq.0.stop()) {
        (Ok(()), Ok(())) => Ok(recording),
        (Ok(()), Err(error)) => {
            Err(Failure { cause: Cause::Stop(error), partial: recording, not_stopped: None, driven })
        }
        // The first error is the cause. The failed stop is reported too, because the device may still be driven.
        (Err(cause), stopped) => Err(Failure { cause, partial: recording, not_stopped: stopped.err(), driven }),
    }
}

/// Stops the device even if a callback panics.
struct StopOnPanic<'a, D: Daq + ?Sized>(&'a mut D);

impl<D: Daq + ?Sized> Drop for StopOnPanic<'_, D> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            // If this fails too, the watchdog of the device stops it.
            let _ = self.0.stop();
        }
    }
}

fn start_and_play<D: Daq + ?Sized>(
    daq: &mut D,
    segments: &[impl AsRef<[f64]>],
    options: &RecordOptions,
    revise: impl FnMut(&mut Revision<'_>),
    progress: impl FnMut(&Progress<'_>) -> ControlFlow<()>,
    (recording, driven): (&mut Recording, &mut bool),
) -> Result<(), Cause<D::Error>> {
    let rest_v = daq.capabilities().voltage.rest_v;
    let actual_hz = daq.start(options.rate_hz).map_err(Cause::Device)?;
    let difference = (actual_hz / options.rate_hz - 1.0).abs();
    // Also refuses a rate that is NaN.
    if !difference.le(&options.rate_tolerance) {
        return Err(Cause::Rate { asked_hz: options.rate_hz, actual_hz });
    }
    recording.rate_hz = actual_hz;
    let total = segments.iter().map(|drive| drive.as_ref().len()).sum();
    let mut run = Run {
        daq,
        options,
        revise,
        progress,
        recording,
        driven,
        rest_v,
        segments: segments.len(),
        done: 0,
        total,
        latest: None,
    };
    segments.iter().enumerate().try_for_each(|(k, drive)| run.segment(k, drive.as_ref()))
}

/// State of a recording.
struct Run<'a, D: ?Sized, R, F> {
    daq: &'a mut D,
    options: &'a RecordOptions,
    revise: R,
    progress: F,
    recording: &'a mut Recording,
    /// Whether the device was sent any drive other than the rest voltage, accepted or not.
    driven: &'a mut bool,
    /// Rest voltage before the start \[V\].
    rest_v: f64,
    segments: usize,
    done: usize,
    total: usize,
    latest: Option<Sample>,
}

impl<D, R, F> Run<'_, D, R, F>
where
    D: Daq + ?Sized,
    R: FnMut(&mut Revision<'_>),
    F: FnMut(&Progress<'_>) -> ControlFlow<()>,
{
    fn segment(&mut self, segment: usize, drive: &[f64]) -> Result<(), Cause<D::Error>> {
        if segment > 0 {
            self.rest(segment)?;
        }
        let rest_v = self.daq.capabilities().voltage.rest_v;
        let block = self.options.block.min(self.daq.capabilities().max_block).max(1);
        let mut plan = Plan::new(drive, self.daq.present_v(), rest_v, self.options);
        self.recording.segments.push(SegmentRecord::default());
        let (mut sent, mut received, mut cancelled) = (0, 0, false);
        let mut fresh = Vec::with_capacity(block);
        while received < plan.drive_v.len() {
            if !cancelled {
                let segment = RevisionContext { segment, latest: self.latest.as_ref() };
                plan.revise(sent + block, segment, rest_v, self.options, &mut self.revise);
            }
            let end = plan.drive_v.len().min(sent + block);
            let offered = &plan.drive_v[sent..end];
            // A device that follows references computes the drive itself, and its rest value is a reference.
            *self.driven |= rest_v != self.rest_v || offered.iter().any(|u| *u != self.rest_v);
            let outcome = self.daq.exchange(offered, &mut fresh);
            let accepted = *outcome.as_ref().unwrap_or(&0);
            if accepted > offered.len() || (outcome.is_ok() && received + fresh.len() > sent + accepted) {
                return Err(Cause::Surplus);
            }
            sent += accepted;
            self.latest = fresh.last().copied().or(self.latest);
            let flow = self.deliver(segment, &plan, received, &fresh);
            received += fresh.len();
            let idle = accepted == 0 && fresh.is_empty();
            fresh.clear();
            outcome.map_err(Cause::Device)?;
            if idle {
                return Err(Cause::Stalled { outstanding: sent - received });
            }
            if flow.is_break() && !cancelled {
                cancelled = true;
                plan.cut(sent, rest_v, self.options);
            }
        }
        if cancelled { Err(Cause::Cancelled) } else { Ok(()) }
    }

    /// Rests before a segment; the samples of the rest are discarded.
    fn rest(&mut self, segment: usize) -> Result<(), Cause<D::Error>> {
        let mut left = self.options.rest_s;
        // On a real device the rest takes time, so check for a stop request in between.
        let rate_hz = self.recording.rate_hz;
        let longest = if self.daq.capabilities().queued {
            (STOP_CHECK_S * rate_hz).round().max(1.0) / rate_hz
        } else {
            f64::INFINITY
        };
        loop {
            let now = left.min(longest);
            self.daq.rest(now).map_err(Cause::Device)?;
            left -= now;
            let &mut Self { segments, done, total, .. } = self;
            let news = Progress { segment, segments, phase: Phase::Approach, samples: &[], done, total };
            if (self.progress)(&news).is_break() {
                return Err(Cause::Cancelled);
            }
            if left <= 0.0 {
                return Ok(());
            }
        }
    }

    /// Adds new samples to the recording; the first of them is number `first` of the plan.
    fn deliver(&mut self, segment: usize, plan: &Plan, first: usize, fresh: &[Sample]) -> ControlFlow<()> {
        let (mut rest, mut index) = (fresh, first);
        let mut flow = ControlFlow::Continue(());
        while !rest.is_empty() {
            let (phase, end) = plan.phase(index);
            let (samples, later) = rest.split_at(rest.len().min(end.saturating_sub(index).max(1)));
            if let Some(record) = self.recording.segments.last_mut() {
                match phase {
                    Phase::Approach => record.approach.extend_from_slice(samples),
                    Phase::Record => record.samples.extend_from_slice(samples),
                    Phase::Retreat => record.retreat.extend_from_slice(samples),
                }
            }
            self.done += if phase == Phase::Record { samples.len() } else { 0 };
            let &mut Self { segments, done, total, .. } = self;
            let request = (self.progress)(&Progress { segment, segments, phase, samples, done, total });
            flow = if request.is_break() { request } else { flow };
            (rest, index) = (later, index + samples.len());
        }
        flow
    }
}

#[cfg(test)]
mod tests;
