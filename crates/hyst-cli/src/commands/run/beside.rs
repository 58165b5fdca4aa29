//! The model beside the device: what it expects, the force that what it does not expect may be, and whether it still explains what is measured.

use hyst_core::{Build, Env, ForceObservation, ForceParams, Stage, Watch, WatchState};
use hyst_hw::{Phase, Sample};
use hyst_ident::BetweenSamples;
use hyst_ident::model::{Effect, HostChain, Model};

use super::adapt::{Adapting, Change};
use super::sweep::Sweep;
use crate::exit::{CommandError, CommandResult};

/// Length of a block of the watch \[s\], longer than what a residual remembers, and fewest samples of one.
const BLOCK_S: f64 = 0.5;
const FEWEST: f64 = 20.0;
/// Residuals so many times as large as in the training are taken as usual.
const USUAL: f64 = 2.0;
/// Blocks of twice that size until it is told.
const PATIENCE: f64 = 3.0;

/// A model that is run with what is applied.
pub(super) struct Beside {
    chain: Box<HostChain>,
    state: Box<<HostChain as Stage<f64>>::State>,
    /// Temperature where none is measured \[°C\].
    degc: f64,
    /// When the run began, by the device's clock \[s\].
    began_s: Option<f64>,
    segment: Option<usize>,
    /// Whether nothing of this segment's record has come yet.
    fresh: bool,
    /// What was put out last \[V\].
    last_v: f64,
    /// What the sensor shows beyond the model before the reference begins: its zero of today.
    zero: Mean,
    /// Whether the actuator still remembers what the model does not know of.
    sweep: Sweep,
    /// Samples of this segment's record until it did not any more, and the next ones, which tell the zero from then on.
    before: usize,
    anew: Mean,
    watch: Option<Watch<f64>>,
    watched: WatchState<f64>,
    /// Whether anything was watched.
    looked: bool,
    block: u32,
    force: Option<ForceObservation<f64>>,
    /// What the model left of its own record \[output unit\].
    trained_to: Option<f64>,
    lost_at: Option<f64>,
    now_lost: bool,
    /// Of a model that is adapted.
    adapting: Option<Adapting>,
}

/// What the model says of one sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expected {
    /// Output \[output unit\].
    pub(super) output: f64,
    /// Estimated force \[N\].
    pub(super) force: Option<f64>,
    /// Whether that has just changed: the model explains the device, or does not.
    pub(super) explains: Option<bool>,
}

/// How the watch has ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watched {
    /// When the model stopped explaining the device for the first time, by the device's clock \[s\].
    pub(super) lost_at: Option<f64>,
    /// Residual of the last block \[output unit\].
    pub(super) residual: f64,
    /// What the model left of its own record \[output unit\].
    pub(super) trained_to: f64,
}

/// Where an external force is estimated.
#[derive(Clone, Copy, Debug)]
pub(super) enum Force {
    /// Here, with the output's stiffness \[N/output unit\].
    Here(f64),
    /// By the device.
    OnDevice,
}

/// A mean under way.
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

impl Beside {
    /// Beside a device that runs at `rate_hz`. `None` for a model that has to know the whole drive.
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
        // What a compliance explains is what an observer is to find.
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
        let block = (BLOCK_S * rate_hz).max(FEWEST).round() as u32;
        // Under a force that is looked for, a residual is no news.
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
            anew: Mean::default(),
            looked: false,
            block,
            watch: sigma
                .map(|sigma| Watch::new(sigma, USUAL, PATIENCE, block))
                .transpose()
                .map_err(CommandError::failed)?,
            watched: WatchState::default(),
            force: stiffness.map(observer).transpose().map_err(CommandError::bad_input)?,
            trained_to: model.rmse,
            lost_at: None,
            now_lost: false,
            adapting,
        }))
    }

    /// Takes the next sample of a segment, before which so many periods are missing: the device has held its last value in these.
    pub(super) fn take(&mut self, segment: usize, phase: Phase, sample: &Sample, missing: usize) -> Expected {
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
            (self.zero, self.anew, self.sweep, self.before) = (Mean::default(), Mean::default(), Sweep::new(), 0);
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
            self.looked = true;
            let lost = watch.step(&mut self.watched, sample.output - output);
            explains = (lost != self.now_lost).then_some(!lost);
            self.now_lost = lost;
            if lost {
                self.lost_at.get_or_insert(sample.time_s);
            }
        }
        Expected { output, force: self.force.map(|force| force.force(sample.output, output)), explains }
    }

    /// Whether model and actuator have the same history. An actuator that remembers earlier runs stands elsewhere than the model until the drive has gone
    /// over its range both ways; the zero is found anew then, over as long a time as that took.
    fn known(&mut self, drive_v: f64, beyond: f64) -> bool {
        // A force would be taken for a zero.
        if self.watch.is_none() {
            return true;
        }
        if !self.sweep.take(drive_v) {
            self.before += 1;
            self.anew = Mean::default();
            return false;
        }
        let enough = self.before.max(self.block as usize);
        if (self.anew.count as usize) < enough {
            self.anew.add(beyond);
            if self.anew.count as usize == enough {
                (self.zero, self.before) = (self.anew, 0);
            }
            return false;
        }
        true
    }

    /// What was learned, if it has changed.
    pub(super) fn adapted(&self) -> Option<Change> {
        self.adapting.as_ref()?.news()
    }

    /// How the watch has ended; `None` where nothing was watched.
    pub(super) fn watched(&self) -> Option<Watched> {
        self.watch?;
        if !self.looked {
            return None;
        }
        Some(Watched { lost_at: self.lost_at, residual: self.watched.last_rms(), trained_to: self.trained_to? })
    }
}
