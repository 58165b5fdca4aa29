//! Handles each sample of a run when it arrives: log, limits, parallel model, view.

use std::ops::ControlFlow;

use hyst_hw::wire::Fault;
use hyst_hw::{Phase, Progress, Sample};

use super::gaps::GapFinder;
use super::guard::Guard;
use super::parallel::{ParallelModel, Watched};
use super::values::Values;
use super::view::View;
use crate::log::{LogError, LoggedEvent, LoggedSample, RunLog, RunStream};
use crate::text;

/// Monitors a run.
pub(super) struct Monitor<'a> {
    pub(super) log: Option<&'a mut RunLog>,
    /// Stream for viewers.
    pub(super) stream: Option<RunStream>,
    /// First error of the log; nothing is written to the log after it.
    pub(super) log_error: Option<LogError>,
    /// Model that runs in parallel with the device.
    pub(super) model: Option<ParallelModel>,
    pub(super) guard: Guard,
    pub(super) gaps: GapFinder,
    pub(super) view: View,
    /// Wanted output at each row of the record.
    pub(super) wanted: &'a [Option<f64>],
    /// Symbol of the output unit.
    pub(super) unit: &'a str,
    /// Fault with which this computer ends the run.
    pub(super) fault: Option<Fault>,
    /// Details of the fault.
    pub(super) detail: String,
    /// Estimated force at each row of each segment \[N\]; empty without an estimate.
    pub(super) forces: Vec<Vec<f64>>,
    /// Time of the latest sample \[s\].
    pub(super) now_s: f64,
}

impl Monitor<'_> {
    /// Takes new samples; returns whether the run continues.
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
            self.event(
                "gap",
                format!(
                    "before {now} s the device held its last value for {missing} periods: the line is too slow for this \
                     sample rate"
                ),
            );
        }
        let predicted = self.model.as_mut().map(|model| model.take(news.segment, news.phase, sample, missing));
        let force = predicted.and_then(|p| p.force).or(sample.force_n);
        if news.phase == Phase::Record {
            self.forces.resize_with(self.forces.len().max(news.segment + 1), Vec::new);
            self.forces[news.segment].extend(force);
        }
        if self.log.is_some() || self.stream.is_some() {
            let mut logged = LoggedSample::new(news.segment + self.gaps.gaps().times, news.phase, sample, wanted);
            logged.predicted = predicted.map(|p| p.output);
            logged.estimated_force_n = force;
            if self.log_error.is_none()
                && let Some(log) = &mut self.log
            {
                self.log_error = log.sample(&logged).err();
            }
            self.stream.iter_mut().for_each(|stream| stream.sample(&logged));
        }
        self.view.add(Values { sample: *sample, wanted, predicted: predicted.map(|p| p.output), force });
        if let Some(change) = self.model.as_ref().and_then(ParallelModel::adapted) {
            self.note("adapted", change.text(self.unit));
        }
        if let Some(explains) = predicted.and_then(|p| p.explains) {
            let (kind, text) = self.change_of_model(explains);
            self.event(kind, text);
        }
        if self.fault.is_none()
            && let Some(fault) = self.guard.check(sample, wanted)
        {
            self.detail = match (fault, wanted, sample.temperature_degc) {
                (Fault::TrackingError, Some(wanted), _) => {
                    let away = text::short((sample.output - wanted).abs());
                    format!(" (error {away} {} at {} s)", self.unit, text::short(sample.time_s))
                }
                (Fault::Temperature, _, Some(degc)) => format!(" ({} °C)", text::short(degc)),
                _ => String::new(),
            };
            self.end(fault);
        }
    }

    /// Ends the run with a fault.
    pub(super) fn end(&mut self, fault: Fault) {
        if self.fault.is_none() {
            self.fault = Some(fault);
            // The error of the command prints it.
            self.note("fault", format!("fault {}: {fault}{}", fault.code(), self.detail));
        }
    }

    /// Returns kind and text of the event that the model stopped or started to explain the output.
    fn change_of_model(&self, explains: bool) -> (&'static str, String) {
        let (now, unit) = (text::short(self.now_s), self.unit);
        match self.watched() {
            Some(Watched { residual, fitted_rmse, .. }) if !explains => {
                let (residual, fitted) = (text::short(residual), text::short(fitted_rmse));
                let what = format!(
                    "at {now} s the model has stopped explaining the output: RMS residual {residual} {unit}, {fitted} {unit} \
                     on the training record"
                );
                ("model-lost", what)
            }
            _ => ("model-found", format!("at {now} s the model explains the output again")),
        }
    }

    /// Returns the state of the monitoring of the model.
    pub(super) fn watched(&self) -> Option<Watched> {
        self.model.as_ref().and_then(ParallelModel::watched)
    }

    /// Prints and logs an event.
    pub(super) fn event(&mut self, kind: &'static str, text: String) {
        self.view.print_above(&format!("{}: {text}", if kind == "model-found" { "note" } else { "warning" }));
        self.note(kind, text);
    }

    /// Logs an event and sends it to viewers.
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
