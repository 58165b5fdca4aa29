//! Plays drive segments on any device and brings it back to rest, whatever happens.

mod failure;
mod plan;

use std::ops::{ControlFlow, Range};

use crate::daq::{Daq, Sample};
pub use failure::{Cause, Failure};
use plan::{Place, Plan};

/// How long a device rests without asking whether the run is still wanted, in whole periods \[s\].
pub(crate) const STOPPABLE_S: f64 = 0.25;

/// How to play segments.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordOptions {
    /// Sample rate (Hz).
    pub rate_hz: f64,
    /// Steepness of the ramps to the first value of a drive and from its last value to rest (V/s).
    pub slew_v_per_s: f64,
    /// Hold at the first value of a drive before its record begins (s).
    pub settle_s: f64,
    /// Rest between two segments (s).
    pub rest_s: f64,
    /// Drive samples per exchange; the device's own limit holds too.
    pub block: usize,
    /// Greatest relative difference between the rate asked for and the one that the device runs at.
    pub rate_tolerance: f64,
}

impl RecordOptions {
    /// Ramps of 100 V/s, no settling, rests of 1 s, blocks of 256 samples, rate true to 0.1 %.
    #[must_use]
    pub fn at(rate_hz: f64) -> Self {
        Self { rate_hz, slew_v_per_s: 100.0, settle_s: 0.0, rest_s: 1.0, block: 256, rate_tolerance: 1e-3 }
    }
}

/// What a sample is part of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// On the way to the first value of the drive, and settling there; not part of the record.
    Approach,
    /// The drive as asked for.
    Record,
    /// On the way back to rest; not part of the record.
    Retreat,
}

/// News for the progress callback: samples that have come in, all of one phase.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// Running segment, from 0.
    pub segment: usize,
    /// Number of segments.
    pub segments: usize,
    /// What the new samples are part of.
    pub phase: Phase,
    /// The new samples, in order: a log that takes them all is complete whatever happens later. None during a rest.
    pub samples: &'a [Sample],
    /// Record samples so far, over all segments.
    pub done: usize,
    /// Record samples in all.
    pub total: usize,
}

/// One segment as measured.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SegmentRecord {
    /// One sample per drive sample, time on the device's clock: the first one period after what came before it, because the
    /// drive moves to a sample within one period and is measured there.
    pub samples: Vec<Sample>,
    /// Ramp and settling before the record; the device's history, but not part of the record.
    pub approach: Vec<Sample>,
    /// Ramp to rest after the record; not part of it.
    pub retreat: Vec<Sample>,
}

/// All segments as measured.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// Rate that the device really ran at (Hz); 0 when it never started.
    pub rate_hz: f64,
    /// Segments in the order played.
    pub segments: Vec<SegmentRecord>,
}

/// A piece of drive about to be sent, with what is known by now.
#[derive(Debug)]
pub struct Revision<'a> {
    /// Running segment, from 0.
    pub segment: usize,
    /// Rows of the segment's drive that the piece covers; each row comes exactly once, in order.
    pub rows: Range<usize>,
    /// The drive of those rows (V), to be changed at will.
    pub drive_v: &'a mut [f64],
    /// The newest sample measured, approach included.
    pub latest: Option<&'a Sample>,
}

/// Plays drive segments (V) on a device and returns what was measured.
///
/// As [`record_with`], the drive being played as it stands.
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

/// Plays drive segments (V) on a device, each block revised just before it is sent, and returns what was
/// measured.
///
/// `revise` may change what was planned, by what has been measured since (temperature, …). What it
/// gives is not checked again here: the device refuses what is outside its range.
///
/// All drives are checked against the device's range before anything moves. Then the sample clock
/// starts, and every segment is played: a ramp of the stated slew from the present voltage to the drive's
/// first value and the settling time there (`approach`), the drive (`samples`, one per drive
/// sample), a ramp back to the rest voltage (`retreat`). Between segments the device rests for
/// `rest_s`. At the end it is stopped.
///
/// `progress` is called with all samples as they come in. When it returns [`ControlFlow::Break`], the
/// device is ramped to rest and the recording ends as [`Cause::Cancelled`].
///
/// # Errors
/// A [`Failure`] with the cause and what was measured until then. The device is stopped in any
/// case, also after an error of its own; only a request that was refused before anything moved leaves it alone.
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
    let daq = Driven(daq);
    let mut driven = daq.0.present_v() != daq.0.capabilities().voltage.rest_v;
    let played = start_and_play(&mut *daq.0, segments, options, revise, progress, (&mut recording, &mut driven));
    match (played, daq.0.stop()) {
        (Ok(()), Ok(())) => Ok(recording),
        (Ok(()), Err(error)) => {
            Err(Failure { cause: Cause::Stop(error), partial: recording, not_stopped: None, driven })
        }
        // The first error says what happened; that the device is still driven must not be lost over it.
        (Err(cause), stopped) => Err(Failure { cause, partial: recording, not_stopped: stopped.err(), driven }),
    }
}

/// A device that is stopped even if what looks at its samples panics.
struct Driven<'a, D: Daq + ?Sized>(&'a mut D);

impl<D: Daq + ?Sized> Drop for Driven<'_, D> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            // What goes wrong here as well, its watchdog finds.
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
    // A rate that is not a number is refused as well.
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

/// A recording under way.
struct Run<'a, D: ?Sized, R, F> {
    daq: &'a mut D,
    options: &'a RecordOptions,
    revise: R,
    progress: F,
    recording: &'a mut Recording,
    /// Whether anything but rest was put to the device, taken or not.
    driven: &'a mut bool,
    /// Where it rested before it was started \[V\].
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
                let segment = Place { segment, latest: self.latest.as_ref() };
                plan.revise(sent + block, segment, rest_v, self.options, &mut self.revise);
            }
            let end = plan.drive_v.len().min(sent + block);
            let offered = &plan.drive_v[sent..end];
            // A device that is given references rests at one, and makes the drive itself.
            *self.driven |= rest_v != self.rest_v || offered.iter().any(|u| *u != self.rest_v);
            let outcome = self.daq.exchange(offered, &mut fresh);
            let accepted = *outcome.as_ref().unwrap_or(&0);
            if accepted > offered.len() || (outcome.is_ok() && received + fresh.len() > sent + accepted) {
                return Err(Cause::Surplus);
            }
            sent += accepted;
            self.latest = fresh.last().copied().or(self.latest);
            let wish = self.deliver(segment, &plan, received, &fresh);
            received += fresh.len();
            let idle = accepted == 0 && fresh.is_empty();
            fresh.clear();
            outcome.map_err(Cause::Device)?;
            if idle {
                return Err(Cause::Stalled { outstanding: sent - received });
            }
            if wish.is_break() && !cancelled {
                cancelled = true;
                plan.cut(sent, rest_v, self.options);
            }
        }
        if cancelled { Err(Cause::Cancelled) } else { Ok(()) }
    }

    /// Rests before a segment; its samples are nobody's.
    fn rest(&mut self, segment: usize) -> Result<(), Cause<D::Error>> {
        let mut left = self.options.rest_s;
        // On a device that takes its time somebody may change their mind.
        let rate_hz = self.recording.rate_hz;
        let longest = if self.daq.capabilities().queued {
            (STOPPABLE_S * rate_hz).round().max(1.0) / rate_hz
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

    /// Sorts new samples, the first of which is number `first` of the plan, into the recording.
    fn deliver(&mut self, segment: usize, plan: &Plan, first: usize, fresh: &[Sample]) -> ControlFlow<()> {
        let (mut rest, mut index) = (fresh, first);
        let mut wish = ControlFlow::Continue(());
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
            let said = (self.progress)(&Progress { segment, segments, phase, samples, done, total });
            wish = if said.is_break() { said } else { wish };
            (rest, index) = (later, index + samples.len());
        }
        wish
    }
}

#[cfg(test)]
mod tests;
