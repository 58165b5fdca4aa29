//! Inverse of the model over a whole reference, at all frequencies.
//!
//! A running device needs an inverse with a short preview, whose band ends below a quarter of the sample rate. Here the
//! whole reference is known in advance. Delay, lag and modes are divided out of the spectrum; the remaining inverse is
//! exact and is computed row by row.

use hyst_core::{Limits, PiParams, Sampling, Stage};
use nalgebra::Complex;

use super::spectrum::Spectrum;
use crate::compensate::{CompensateError, CompensateOptions, Follower};
use crate::model::{Base, Effect, Effects, Model, Operator};
use crate::record::Record;

/// Response at which the gain of the inverse is limited. Without a limit, a reference that is much faster than a mode
/// causes impulses at its corners, which change the state of the hysteresis.
const LEAST_RESPONSE: f64 = 0.1;

/// A drive and the rows at which a limit acted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LearnedDrive {
    /// Voltage \[V\].
    pub voltage: Vec<f64>,
    /// Rows at which the voltage or the slew was limited.
    pub limited: Vec<usize>,
}

pub(super) struct Inverse {
    /// Model without the effects that are divided out.
    rest: Model,
    /// Inverse responses of the effects after and before the hysteresis.
    output_side: Vec<Complex<f64>>,
    input_side: Vec<Complex<f64>>,
    options: CompensateOptions,
    limits: Limits<f64>,
}

impl Inverse {
    pub(super) fn new(
        model: &Model,
        reference: &Record,
        options: CompensateOptions,
        spectrum: &Spectrum,
    ) -> Result<Self, CompensateError> {
        let period = reference.sample_period();
        let before = Effects { delay: model.effects.delay, lag: model.effects.lag, ..Effects::default() };
        let after = Effects { resonances: model.effects.resonances.clone(), ..Effects::default() };
        let inverse = |effects: &Effects| -> Result<Vec<Complex<f64>>, hyst_core::Error> {
            let response = spectrum.whole(&impulse(effects, period, spectrum.length())?);
            let least = LEAST_RESPONSE * LEAST_RESPONSE;
            Ok(response.into_iter().map(|g| g.conj() * (1.0 + least) / (g.norm_sqr() + least)).collect())
        };
        let effects = [Effect::Delay, Effect::Lag, Effect::Resonance, Effect::Resonance];
        let rest = effects.into_iter().fold(model.effects.clone(), |effects, e| effects.without(e));
        let (low, high) = options.voltage.unwrap_or((model.input.low, model.input.high));
        Ok(Self {
            rest: Model { effects: rest, ..model.clone() },
            output_side: inverse(&after)?,
            input_side: inverse(&before)?,
            options,
            limits: Limits::new(low, high, options.slew, &Sampling { period })?,
        })
    }

    /// Returns the drive changed such that the output of the model changes from `from` to `to`, at the rows of
    /// `reference`.
    pub(super) fn changed(
        &self,
        reference: &Record,
        drive: &[f64],
        [from, to]: [&[f64]; 2],
        spectrum: &Spectrum,
    ) -> Result<LearnedDrive, CompensateError> {
        let (before, after) = (self.drive_for(reference, from, spectrum)?, self.drive_for(reference, to, spectrum)?);
        let mut changed = LearnedDrive::default();
        let mut last = None;
        for (row, ((u, before), after)) in drive.iter().zip(before).zip(after).enumerate() {
            let required = u + after - before;
            let limited = self.limits.apply(last.unwrap_or(required), required);
            if limited.voltage || limited.slew {
                changed.limited.push(row);
            }
            changed.voltage.push(limited.drive);
            last = Some(limited.drive);
        }
        Ok(changed)
    }

    /// Returns the drive for which the output of the model is `values`, without limits.
    fn drive_for(&self, reference: &Record, values: &[f64], spectrum: &Spectrum) -> Result<Vec<f64>, CompensateError> {
        let filtered = |values: &[f64], factors: &[Complex<f64>]| {
            spectrum.to_time(spectrum.of(values).iter().zip(factors).map(|(x, f)| x * f).collect())
        };
        let inner = filtered(values, &self.output_side);
        let rest = Follower::new(&self.rest, reference, &self.options)?.along(&inner)?;
        Ok(filtered(&rest, &self.input_side))
    }
}

/// Returns the unit impulse response of linear stages.
fn impulse(effects: &Effects, period: f64, rows: usize) -> Result<Vec<f64>, hyst_core::Error> {
    let cx = Sampling { period };
    let identity = Base::Pi(PiParams { gain: 1.0, thresholds: Vec::new(), weights: Vec::new() });
    let operator = Operator::new(&identity, [0.0, 1.0], &cx)?;
    let chain: crate::model::HostChain = effects.to_params().around(operator, &cx)?;
    let chain = Box::new(chain);
    let mut state = Box::new(chain.state());
    let env = hyst_core::Env::default();
    chain.reset(&mut state, &env, 0.0);
    Ok((0..rows).map(|k| chain.step(&mut state, &env, if k == 0 { 1.0 } else { 0.0 })).collect())
}
