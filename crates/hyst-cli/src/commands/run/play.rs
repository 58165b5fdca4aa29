//! Plays a job on a device, with log, view and Ctrl-C.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use hyst_hw::wire::Fault;
use hyst_hw::{Cause, Daq, Failure, Recording, Revision, record_with};

use super::gaps::{GapFinder, Gaps};
use super::guard::Guard;
use super::interrupt::{self, Interrupt};
use super::job::Job;
use super::monitor::Monitor;
use super::parallel::Watched;
use super::view::View;
use crate::exit::{Classified, CommandError, CommandResult, Exit};
use crate::hosted;
use crate::log::{LogError, RunLog, RunStream};
use crate::output::say;
use crate::text;

/// Result of a run.
pub(in crate::commands) struct Played {
    pub(in crate::commands) recording: Recording,
    /// Estimated force at each row of each segment \[N\]; empty without an estimate.
    pub(super) forces: Vec<Vec<f64>>,
    /// `None` if no model was monitored.
    pub(super) watched: Option<Watched>,
    pub(in crate::commands) gaps: Gaps,
    /// Error that ended the run early.
    pub(in crate::commands) error: Option<CommandError>,
}

/// Plays all segments; writes each sample to `log` when it arrives.
pub(in crate::commands) fn play<D: Daq>(daq: &mut D, job: &mut Job, log: Option<&mut RunLog>) -> CommandResult<Played>
where
    D::Error: Classified,
{
    let host_stop = hosted::stop();
    let path = log.as_ref().map(|log| log.path().to_owned());
    let current = Interrupt::new(host_stop.clone().unwrap_or_default(), path, job.recorded);
    let stop = Arc::clone(&current.stop);
    // A host handles Ctrl-C itself.
    if host_stop.is_none() {
        current.watch();
    }
    let shortest = job.segments.iter().map(Vec::len).min().unwrap_or(0) as f64 / job.options.rate_hz;
    let guard = Guard::new(job.hottest_degc, job.greatest_error, job.options.rate_hz, shortest);
    let stream = job.live.map(|address| RunStream::at(address, job.symbol)).transpose();
    let stream = stream.map_err(|error| CommandError::new(Exit::Failed, error))?;
    if let Some(stream) = &stream {
        say(&format!("note: viewers (Foxglove, Lichtblick) connect to {}", stream.url()));
    }
    let mut monitor = Monitor {
        log,
        stream,
        log_error: None,
        model: job.parallel_model()?,
        guard,
        gaps: GapFinder::new(job.options.rate_hz),
        view: View::new(job.segments.iter().map(Vec::len).sum(), job.symbol, job.plain || host_stop.is_some()),
        wanted: &job.wanted,
        unit: job.symbol,
        fault: None,
        detail: String::new(),
        forces: Vec::new(),
        now_s: 0.0,
    };
    // In a command that plays several times, Ctrl-C may have been pressed between two plays.
    if monitor.view.interrupted() || stop.load(Ordering::Relaxed) || (host_stop.is_none() && interrupt::pressed()) {
        return Err(CommandError::failed("stopped on request before anything moved"));
    }
    let (mut live, mut closed) = match &mut job.followed {
        Some(followed) => (followed.live.as_mut(), followed.closed.as_mut()),
        None => (None, None),
    };
    let saturated = AtomicBool::new(false);
    let revise = |revision: &mut Revision<'_>| {
        live.iter_mut().for_each(|live| live.revise(revision));
        if let Some(closed) = &mut closed {
            closed.running.revise(revision);
            saturated.fetch_or(closed.running.limited_too_long(), Ordering::Relaxed);
        }
    };
    let played = record_with(daq, &job.segments, &job.options, revise, |news| {
        let flow = monitor.take(news);
        let has_logged = monitor.log.as_ref().is_some_and(|log| log.samples() > 0);
        current.logged.store(has_logged, Ordering::Relaxed);
        if saturated.load(Ordering::Relaxed) {
            monitor.end(Fault::Saturation);
        }
        let ended = monitor.fault.is_some() || monitor.view.interrupted() || stop.load(Ordering::Relaxed);
        if ended { ControlFlow::Break(()) } else { flow }
    });
    current.over.store(true, Ordering::Relaxed);
    match &played {
        Err(Failure { not_stopped: Some(error), driven, .. }) => {
            let what = if *driven { "the device may still be driven" } else { "the device did not confirm the stop" };
            monitor.note("fault", format!("{what}: {error}"));
        }
        Err(Failure { cause: Cause::Cancelled, driven, .. })
            if monitor.fault.is_none() && monitor.log_error.is_none() =>
        {
            let how = if *driven { "the device was ramped to rest" } else { "the device was always at rest" };
            monitor.note("cancelled", format!("stopped on request; {how}"));
        }
        Err(Failure { cause: Cause::Device(error), .. }) => monitor.note("fault", error.to_string()),
        _ => {}
    }
    let watched = monitor.watched();
    let gaps = monitor.gaps.gaps();
    let Monitor { log, log_error, fault, detail, forces, view, .. } = monitor;
    // Removes the view; later lines are printed in its place.
    drop(view);
    match played {
        Ok(recording) => Ok(Played { recording, forces, watched, gaps, error: None }),
        Err(mut failure) => {
            let recording = std::mem::take(&mut failure.partial);
            let error = Some(failed(
                failure,
                &recording,
                log_error,
                fault.map(|fault| (fault, detail)),
                (log.map(|log| &*log), job.recorded, job.log_option),
            ));
            Ok(Played { recording, forces, watched, gaps, error })
        }
    }
}

/// Returns the error of a run that ended early, and prints notes about the measured data.
fn failed<E: Classified>(
    failure: Failure<E>,
    partial: &Recording,
    log_error: Option<LogError>,
    fault: Option<(Fault, String)>,
    (log, recorded, log_option): (Option<&RunLog>, bool, &str),
) -> CommandError {
    let measured: usize = partial.segments.iter().map(|s| s.approach.len() + s.samples.len() + s.retreat.len()).sum();
    let many = text::count(measured, "sample");
    let cancelled = matches!(failure.cause, Cause::Cancelled) && failure.not_stopped.is_none();
    match (log, log_error) {
        // The log is the reason for the end and becomes the error.
        (Some(_), Some(error)) if cancelled => {
            say(&format!("note: the device was ramped to rest ({many} measured)"));
            return error.into();
        }
        (Some(_), Some(error)) => say(&format!("note: {error}")),
        _ if measured == 0 => {}
        (Some(log), None) => {
            say(&format!("note: all measured data ({many}) are in {}", log.path().display()));
        }
        (None, _) if recorded => {}
        (None, _) => {
            say(&format!("note: the measured data ({many}) are lost; give {log_option} to save them next time"));
        }
    }
    match fault {
        Some((fault, detail)) if cancelled => CommandError::new(
            Exit::DeviceLost,
            anyhow::anyhow!(
                "the run was ended and the device ramped to rest (fault {}): {fault}{detail}",
                fault.code()
            ),
        ),
        None if cancelled => {
            let how = if failure.driven { "the device was ramped to rest" } else { "the device was always at rest" };
            CommandError::new(exit(&failure), anyhow::anyhow!("stopped on request; {how}"))
        }
        _ => CommandError::new(exit(&failure), failure),
    }
}

fn exit<E: Classified>(failure: &Failure<E>) -> Exit {
    if failure.not_stopped.is_some() {
        return Exit::DeviceLost;
    }
    match &failure.cause {
        Cause::Cancelled => Exit::Failed,
        Cause::NoSegment
        | Cause::EmptySegment { .. }
        | Cause::NonFinite { .. }
        | Cause::OutOfRange { .. }
        | Cause::Option { .. }
        | Cause::Rate { .. } => Exit::BadInput,
        Cause::Device(error) => error.exit(),
        _ => Exit::DeviceLost,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use hyst_hw::PlantError;

    fn code(cause: Cause<PlantError>) -> Exit {
        exit(&Failure { cause, partial: Recording::default(), not_stopped: None, driven: true })
    }

    #[test]
    fn a_lost_device_and_a_refused_request_have_different_exit_codes() {
        let refused = PlantError::Rate { asked_hz: 1e9, min_hz: 1.0, max_hz: 2e4 };
        let lost = PlantError::SensorRange { time_s: 1.0, value_um: 99.0 };
        assert_eq!(code(Cause::Device(lost.clone())), Exit::DeviceLost);
        assert_eq!(code(Cause::Device(refused.clone())), Exit::BadInput);
        assert_eq!(code(Cause::Stop(refused)), Exit::DeviceLost);
        assert_eq!(code(Cause::Stalled { outstanding: 3 }), Exit::DeviceLost);
        assert_eq!(code(Cause::EmptySegment { segment: 1 }), Exit::BadInput);
        assert_eq!(code(Cause::Cancelled), Exit::Failed);
        let partial = Recording::default();
        let failure = Failure { cause: Cause::Cancelled, partial, not_stopped: Some(lost), driven: true };
        assert_eq!(exit(&failure), Exit::DeviceLost);
    }
}
