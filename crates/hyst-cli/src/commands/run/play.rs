//! Playing a job on a device while log, progress and Ctrl-C are looked after.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use hyst_hw::{Cause, Daq, Failure, Phase, Recording, Revision, record_with};

use super::job::Job;
use crate::exit::{Classified, CommandError, CommandResult, Exit};
use crate::log::{LogError, LoggedSample, RunLog};
use crate::output::say;
use crate::progress::Progress;
use crate::text;

/// Plays all segments; every sample goes to `log` as it comes in.
pub(super) fn play<D: Daq>(daq: &mut D, job: &mut Job, mut log: Option<&mut RunLog>) -> CommandResult<Recording>
where
    D::Error: Classified,
{
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    if let Err(error) = ctrlc::set_handler(move || asked.store(true, Ordering::Relaxed)) {
        say(&format!("note: Ctrl-C will not ramp the device to rest: {error}"));
    }
    let mut log_error = None;
    let bar = Progress::bar("playing", job.segments.iter().map(Vec::len).sum());
    let told = &job.wanted;
    let (mut live, mut closed) = match &mut job.followed {
        Some(followed) => (followed.live.as_mut(), followed.closed.as_mut()),
        None => (None, None),
    };
    let revise = |revision: &mut Revision<'_>| {
        live.iter_mut().for_each(|live| live.revise(revision));
        closed.iter_mut().for_each(|closed| closed.running.revise(revision));
    };
    let played = record_with(daq, &job.segments, &job.options, revise, |news| {
        bar.at(news.done);
        let first = news.done - if news.phase == Phase::Record { news.samples.len() } else { 0 };
        let asked_for = news.phase == Phase::Record;
        if let (Some(log), None) = (&mut log, &log_error) {
            let mut samples = news.samples.iter().enumerate().map(|(k, sample)| {
                let wanted = told.get(first + k).copied().flatten().filter(|_| asked_for);
                LoggedSample::new(news.segment, news.phase, sample, wanted)
            });
            log_error = samples.try_for_each(|sample| log.sample(&sample)).err();
        }
        let on = log_error.is_none() && !stop.load(Ordering::Relaxed);
        if on { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    drop(bar);
    played.map_err(|failure| failed(failure, log_error, log.map(|log| &*log)))
}

/// What to say about a run that did not come to its end, and about what was measured until then.
fn failed<E: Classified>(failure: Failure<E>, log_error: Option<LogError>, log: Option<&RunLog>) -> CommandError {
    let measured: usize =
        failure.partial.segments.iter().map(|s| s.approach.len() + s.samples.len() + s.retreat.len()).sum();
    let many = text::count(measured, "sample");
    let cancelled = matches!(failure.cause, Cause::Cancelled) && failure.not_stopped.is_none();
    match (log, log_error) {
        (Some(_), Some(error)) if cancelled => {
            say(&format!("note: the device was brought to rest; {many} had been measured"));
            return error.into();
        }
        (Some(_), Some(error)) => say(&format!("note: {error}")),
        _ if measured == 0 => {}
        (Some(log), None) => {
            say(&format!("note: {many}, all that was measured, can be read in {}", log.path().display()));
        }
        (None, _) => say(&format!("note: {many} that had been measured are lost; give --log to keep them next time")),
    }
    CommandError::new(exit(&failure), failure)
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
        exit(&Failure { cause, partial: Recording::default(), not_stopped: None })
    }

    #[test]
    fn exit_codes_tell_a_lost_device_from_a_refused_request() {
        let refused = PlantError::Rate { asked_hz: 1e9, min_hz: 1.0, max_hz: 2e4 };
        let lost = PlantError::SensorRange { time_s: 1.0, value_um: 99.0 };
        assert_eq!(code(Cause::Device(lost.clone())), Exit::DeviceLost);
        assert_eq!(code(Cause::Device(refused.clone())), Exit::BadInput);
        assert_eq!(code(Cause::Stop(refused)), Exit::DeviceLost);
        assert_eq!(code(Cause::Stalled { outstanding: 3 }), Exit::DeviceLost);
        assert_eq!(code(Cause::EmptySegment { segment: 1 }), Exit::BadInput);
        assert_eq!(code(Cause::Cancelled), Exit::Failed);
        let driven = Failure { cause: Cause::Cancelled, partial: Recording::default(), not_stopped: Some(lost) };
        assert_eq!(exit(&driven), Exit::DeviceLost);
    }
}
