//! What is done with each sample of a run as it comes: log, limits, the model beside it, what a person sees.

use std::ops::ControlFlow;

use hyst_hw::wire::Fault;
use hyst_hw::{Phase, Progress, Sample};

use super::beside::{Beside, Watched};
use super::gaps::GapFinder;
use super::guard::Guard;
use super::view::{Seen, View};
use crate::log::{LogError, LoggedEvent, LoggedSample, RunLog, RunStream};
use crate::text;

/// Everything that looks at a run.
pub(super) struct Lookout<'a> {
    pub(super) log: Option<&'a mut RunLog>,
    /// Viewers that look on.
    pub(super) stream: Option<RunStream>,
    /// Why the log could not be written; from then on nothing is.
    pub(super) log_error: Option<LogError>,
    pub(super) beside: Option<Beside>,
    pub(super) guard: Guard,
    pub(super) gaps: GapFinder,
    pub(super) view: View,
    /// What was wanted at each row of the record.
    pub(super) wanted: &'a [Option<f64>],
    /// Symbol of the output's unit.
    pub(super) unit: &'a str,
    /// Why the run is ended from here.
    pub(super) fault: Option<Fault>,
    /// More about it.
    pub(super) detail: String,
    /// Estimated force at each row of each segment \[N\]; empty where none is estimated.
    pub(super) forces: Vec<Vec<f64>>,
    /// Time of the newest sample \[s\].
    pub(super) now_s: f64,
}

impl Lookout<'_> {
    /// Takes samples as they come; whether the run goes on.
    pub(super) fn take(&mut self, news: &Progress<'_>) -> ControlFlow<()> {
        let recorded = news.phase == Phase::Record;
        let first = news.done - if recorded { news.samples.len() } else { 0 };
        for (k, sample) in news.samples.iter().enumerate() {
            let wanted = self.wanted.get(first + k).copied().flatten().filter(|_| recorded);
            self.one(news, sample, wanted);
        }
        self.view.show(news.done, news.total);
        if self.fault.is_some() || self.log_error.is_some() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    fn one(&mut self, news: &Progress<'_>, sample: &Sample, wanted: Option<f64>) {
        self.now_s = sample.time_s;
        let missing = self.gaps.take(news.segment, sample).unwrap_or(0);
        if missing > 0 && self.gaps.gaps().times == 1 {
            let now = text::short(sample.time_s);
            self.event("gap", format!("before {now} s the device held its last value for {missing} periods: the line is too slow for this rate"));
        }
        let expected = self.beside.as_mut().map(|beside| beside.take(news.segment, news.phase, sample, missing));
        let force = expected.and_then(|e| e.force).or(sample.force_n);
        if news.phase == Phase::Record {
            self.forces.resize_with(self.forces.len().max(news.segment + 1), Vec::new);
            self.forces[news.segment].extend(force);
        }
        if self.log.is_some() || self.stream.is_some() {
            let mut logged = LoggedSample::new(news.segment + self.gaps.gaps().times, news.phase, sample, wanted);
            logged.predicted = expected.map(|e| e.output);
            logged.estimated_force_n = force;
            if self.log_error.is_none()
                && let Some(log) = &mut self.log
            {
                self.log_error = log.sample(&logged).err();
            }
            self.stream.iter_mut().for_each(|stream| stream.sample(&logged));
        }
        self.view.add(Seen { sample: *sample, wanted, predicted: expected.map(|e| e.output), force });
        if let Some(change) = self.beside.as_ref().and_then(Beside::adapted) {
            self.note("adapted", change.text(self.unit));
        }
        if let Some(explains) = expected.and_then(|e| e.explains) {
            let (kind, text) = self.told(explains);
            self.event(kind, text);
        }
        if self.fault.is_none()
            && let Some(fault) = self.guard.look(sample, wanted)
        {
            self.detail = match (fault, wanted, sample.temperature_degc) {
                (Fault::TrackingError, Some(wanted), _) => {
                    let away = text::short((sample.output - wanted).abs());
                    format!(" ({away} {} away at {} s)", self.unit, text::short(sample.time_s))
                }
                (Fault::Temperature, _, Some(degc)) => format!(" ({} °C)", text::short(degc)),
                _ => String::new(),
            };
            self.end(fault);
        }
    }

    /// Ends the run.
    pub(super) fn end(&mut self, fault: Fault) {
        if self.fault.is_none() {
            self.fault = Some(fault);
            self.event("fault", format!("fault {}: {fault}{}", fault.code(), self.detail));
        }
    }

    /// How the watch stands, in words.
    fn told(&self, explains: bool) -> (&'static str, String) {
        let (now, unit) = (text::short(self.now_s), self.unit);
        match self.watched() {
            Some(Watched { residual, trained_to, .. }) if !explains => {
                let (residual, usual) = (text::short(residual), text::short(trained_to));
                let what = format!(
                    "at {now} s the model has stopped explaining the device: {residual} {unit} of residual, {usual} {unit} where it was fitted"
                );
                ("model-lost", what)
            }
            _ => ("model-found", format!("at {now} s the model explains the device again")),
        }
    }

    /// How the watch stands.
    pub(super) fn watched(&self) -> Option<Watched> {
        self.beside.as_ref().and_then(Beside::watched)
    }

    /// Tells and logs what has happened.
    pub(super) fn event(&mut self, kind: &'static str, text: String) {
        self.view.tell(&format!("{}: {text}", if kind == "model-found" { "note" } else { "warning" }));
        self.note(kind, text);
    }

    /// Logs what has happened, and shows it to viewers.
    pub(super) fn note(&mut self, kind: &'static str, text: String) {
        let event = LoggedEvent { time_s: self.now_s, kind, text };
        if self.log_error.is_none()
            // A run that is refused before anything moves leaves no log.
            && let Some(log) = self.log.as_mut().filter(|log| log.samples() > 0)
        {
            self.log_error = log.event(&event).err();
        }
        self.stream.iter().for_each(|stream| stream.event(&event));
    }
}
