//! A model in parallel with the device: predicted output, force estimate, monitored residual.

use hyst_core::{Build, Env, ForceObservation, ForceParams, Stage, Watch, WatchState};
use hyst_hw::{Phase, Sample};
use hyst_ident::BetweenSamples;
use hyst_ident::model::{Effect, HostChain, Model};

use super::adapt::{Adapting, Change};
use super::sweep::Sweep;
use crate::exit::{CommandError, CommandResult};

/// Length of a block of monitored residuals \[s\], and its minimum length \[samples\].
/// A block is longer than the correlation time of a residual.
const BLOCK_S: f64 = 0.5;
const MIN_BLOCK_SAMPLES: f64 = 20.0;
/// Accepted RMS residual, as a multiple of the RMS residual of the training record.
const ACCEPTED_RATIO: f64 = 2.0;
/// Number of blocks with twice the accepted residual after which the model is reported as lost.
const BLOCKS_TO_LOST: f64 = 3.0;

/// A model that runs with the applied voltages.
pub(super) struct ParallelModel {
    chain: Box<HostChain>,
    state: Box<<HostChain as Stage<f64>>::State>,
    /// Temperature if none is measured \[°C\].
    degc: f64,
    /// Start of the run by the device's clock \[s\].
    began_s: Option<f64>,
    segment: Option<usize>,
    /// Whether no sample of this segment has arrived (ramp samples do not count).
    fresh: bool,
    /// Last voltage \[V\].
    last_v: f64,
    /// Mean of output minus model before the reference: the present sensor zero.
    zero: Mean,
    /// Whether the history of earlier drives still acts.
    sweep: Sweep,
    /// Number of samples of this segment until the history of earlier drives was erased.
    /// `new_zero` is estimated from as many samples after that.
    before: usize,
    new_zero: Mean,
    watch: Option<Watch<f64>>,
    watched: WatchState<f64>,
    /// Whether any sample was monitored.
    has_watched: bool,
    block: u32,
    force: Option<ForceObservation<f64>>,
    /// RMSE of the model on its training record \[output unit\].
    fitted_rmse: Option<f64>,
    lost_at: Option<f64>,
    now_lost: bool,
    /// `None` without `--adapt`.
    adapting: Option<Adapting>,
}

/// Prediction of the model for one sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prediction {
    /// Output \[output unit\].
    pub(super) output: f64,
    /// Estimated force \[N\].
    pub(super) force: Option<f64>,
    /// Whether the model explains the output; `None` if that has not changed with this sample.
    pub(super) explains: Option<bool>,
}

/// Result of the monitoring of a model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watched {
    /// First time at which the model did not explain the output, by the device's clock \[s\].
    pub(super) lost_at: Option<f64>,
    /// RMS residual of the last block \[output unit\].
    pub(super) residual: f64,
    /// RMSE of the model on its training record \[output unit\].
    pub(super) fitted_rmse: f64,
}

/// Place of the force estimate.
#[derive(Clone, Copy, Debug)]
pub(super) enum Force {
    /// On this computer, with the stiffness of the output \[N/output unit\].
    Here(f64),
    /// On the device.
    OnDevice,
}

/// A running mean.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f64,
    count: u32,
}

impl Mean {
    fn add(&mut self, x: f64) {
        self.sum += x;
        self.count += 1;
    }

    fn value(self) -> f64 {
        if self.count == 0 { 0.0 } else { self.sum / f64::from(self.count) }
    }
}

impl ParallelModel {
    /// Creates the model for a device that runs at `rate_hz`.
    /// `None` for a model that needs the whole drive.
    pub(super) fn new(
        model: &Model,
        rate_hz: f64,
        degc: Option<f64>,
        force: Option<Force>,
        adapting: Option<Adapting>,
    ) -> CommandResult<Option<Self>> {
        if model.between_samples != BetweenSamples::Linear {
            return Ok(None);
        }
        // The compliance of the model is removed, because it would explain the force that the observer estimates.
        let stiffness = match force {
            Some(Force::Here(stiffness)) => Some(stiffness),
            _ => None,
        };
        let free = match force {
            Some(_) => Model { effects: model.effects.without(Effect::Load), ..model.clone() },
            None => model.clone(),
        };
        let chain = Box::new(free.build(1.0 / rate_hz).map_err(CommandError::bad_input)?);
        let observer = |stiffness| ForceParams { stiffness, kappa: 1.0, chi: 0.0 }.build(&());
        let block = (BLOCK_S * rate_hz).max(MIN_BLOCK_SAMPLES).round() as u32;
        // During a force estimate the residual contains the force and is not monitored.
        let sigma = model.rmse.filter(|rmse| *rmse > 0.0 && force.is_none());
        Ok(Some(Self {
            state: Box::new(chain.state()),
            chain,
            degc: degc.or(model.effects.temperature.map(|t| t.reference_degc)).unwrap_or_default(),
            began_s: None,
            segment: None,
            fresh: true,
            last_v: 0.0,
            zero: Mean::default(),
            sweep: Sweep::new(),
            before: 0,
            new_zero: Mean::default(),
            has_watched: false,
            block,
            watch: sigma
                .map(|sigma| Watch::new(sigma, ACCEPTED_RATIO, BLOCKS_TO_LOST, block))
                .transpose()
                .map_err(CommandError::failed)?,
            watched: WatchState::default(),
            force: stiffness.map(observer).transpose().map_err(CommandError::bad_input)?,
            fitted_rmse: model.rmse,
            lost_at: None,
            now_lost: false,
            adapting,
        }))
    }

    /// Takes the next sample of a segment.
    /// In the `missing` periods before it the device held its last value.
    pub(super) fn take(&mut self, segment: usize, phase: Phase, sample: &Sample, missing: usize) -> Prediction {
        let began_s = *self.began_s.get_or_insert(sample.time_s);
        let env = Env {
            time: sample.time_s - began_s,
            temperature: sample.temperature_degc.unwrap_or(self.degc),
            load: sample.load_n.unwrap_or_default(),
        };
        let free = if self.segment == Some(segment) {
            for _ in 0..missing {
                self.chain.step(&mut self.state, &env, self.last_v);
            }
            self.chain.step(&mut self.state, &env, sample.drive_v)
        } else {
            self.segment = Some(segment);
            (self.zero, self.new_zero, self.sweep, self.before) = (Mean::default(), Mean::default(), Sweep::new(), 0);
            self.fresh = true;
            self.adapting.iter().for_each(Adapting::begin_segment);
            self.chain.reset(&mut self.state, &env, sample.drive_v)
        };
        self.last_v = sample.drive_v;
        if phase == Phase::Approach {
            self.zero.add(sample.output - free);
        }
        let known = phase == Phase::Record && self.known(sample.drive_v, sample.output - free);
        if phase == Phase::Record && self.fresh {
            self.fresh = false;
            self.adapting.iter().for_each(|adapting| adapting.zero(self.zero.value()));
        }
        let output = match &self.adapting {
            Some(adapting) => adapting.take(free, sample.output, known),
            None => free + self.zero.value(),
        };
        let mut explains = None;
        if let (Some(watch), true) = (&self.watch, known) {
            self.has_watched = true;
            let lost = watch.step(&mut self.watched, sample.output - output);
            explains = (lost != self.now_lost).then_some(!lost);
            self.now_lost = lost;
            if lost {
                self.lost_at.get_or_insert(sample.time_s);
            }
        }
        Prediction { output, force: self.force.map(|force| force.force(sample.output, output)), explains }
    }

    /// Whether model and actuator have the same history and the zero is known.
    ///
    /// The history of earlier runs acts until the drive has covered its range in both directions. Then the zero is
    /// estimated again, over as many samples as that took. `residual` is output minus model.
    fn known(&mut self, drive_v: f64, residual: f64) -> bool {
        // During a force estimate the zero is not estimated again, because it would contain the force.
        if self.watch.is_none() {
            return true;
        }
        if !self.sweep.take(drive_v) {
            self.before += 1;
            self.new_zero = Mean::default();
            return false;
        }
        let enough = self.before.max(self.block as usize);
        if (self.new_zero.count as usize) < enough {
            self.new_zero.add(residual);
            if self.new_zero.count as usize == enough {
                (self.zero, self.before) = (self.new_zero, 0);
            }
            return false;
        }
        true
    }

    /// Returns the adaptation if it has changed noticeably.
    pub(super) fn adapted(&self) -> Option<Change> {
        self.adapting.as_ref()?.new_change()
    }

    /// Returns the result of the monitoring; `None` if no sample was monitored.
    pub(super) fn watched(&self) -> Option<Watched> {
        self.watch?;
        if !self.has_watched {
            return None;
        }
        Some(Watched { lost_at: self.lost_at, residual: self.watched.last_rms(), fitted_rmse: self.fitted_rmse? })
    }
}
