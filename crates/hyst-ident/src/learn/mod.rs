//! Iterative learning control: improves the drive of a repeated reference from the measured output.
//!
//! A pass plays a drive u. The model predicts the output v, and the output y is measured. The error is e = r − y. The
//! predicted output is changed by L e, and the model's inverse converts this change to a change of the drive (Moore
//! 1993; Leang and Devasia 2006 for piezo actuators, with a linear inverse). The filter L is computed from the
//! measurements:
//!
//! - D, the response of the measured output to a change of the predicted one, is 1 for an exact model. D contains gain
//!   and delay errors and missing modes. It is estimated from the first pass and from the changes between passes: as a
//!   rational response with a delay, and in narrow frequency bands. Its variance is s², plus a share of |D|² because
//!   the slope of a hysteresis varies. L = D* / (|D|² + s²) is the change with the smallest expected square of the
//!   remaining error. The variance is not exact: the rational response and the bands are estimated from the same
//!   passes.
//! - Each pass plays the drive several times. One more play before them is not used, so the memory of the actuator is
//!   that of this drive. The differences between the plays do not repeat (noise, creep, drift). Their power N in each
//!   band limits the correction of an error E to L (1 − 3 N / |E|²) E, or 0 if that is negative.
//!
//! A change starts from the best pass so far. After a worse pass it is halved. Learning ends at the repeatability, the
//! error between plays of the same drive.

mod bands;
mod inverse;
mod rational;
mod response;
mod spectrum;

use std::ops::Range;

use nalgebra::Complex;
use serde::Serialize;

use crate::compensate::{CompensateError, CompensateOptions, Follower, compensate};
use crate::model::Model;
use crate::range;
use crate::record::{Columns, Record};
use bands::{Bands, Width};
use inverse::Inverse;
pub use inverse::LearnedDrive;
use rational::Pair;
use response::Response;
use spectrum::Spectrum;

/// Options of the learning.
#[derive(Clone, Copy, Debug)]
pub struct LearnOptions {
    /// Limits of the drive.
    pub compensate: CompensateOptions,
    /// Maximum number of passes, with the first one of the model's inverse.
    pub passes: usize,
    /// Error at which learning ends, as a multiple of the repeatability.
    pub floor: f64,
}

impl Default for LearnOptions {
    fn default() -> Self {
        Self { compensate: CompensateOptions::default(), passes: 8, floor: 1.1 }
    }
}

/// The errors of one pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pass {
    /// RMS of reference minus output over all plays \[output unit\].
    pub rmse: f64,
    /// Maximum absolute error \[output unit\].
    pub max_abs: f64,
    /// RMS of the mean error of the plays, without noise: the repeatable part, which can be learned \[output unit\].
    pub repeating: f64,
    /// Repeatability estimated after this pass: RMS difference between plays \[output unit\].
    pub repeatability: f64,
    /// Number of rows at which a limit acted on the drive.
    pub limited_rows: usize,
}

impl Pass {
    /// Returns the error divided by the repeatability; `None` if all plays are equal.
    pub fn over_repeatability(&self) -> Option<f64> {
        (self.repeatability > 0.0).then(|| self.rmse / self.repeatability)
    }
}

/// Reason why learning ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ended {
    /// The error is at the repeatability.
    AtFloor,
    /// The last two passes, or three with worse ones, improved the error by less than 5 %.
    NoGain,
    /// Three passes in a row were worse than the best.
    Worse,
    /// The maximum number of passes was reached.
    Passes,
}

/// Errors of the learning.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LearnError {
    /// The first drive cannot be computed.
    #[error(transparent)]
    Compensate(#[from] CompensateError),
    /// The reference has more than one segment.
    #[error("{record}: the reference has {segments} segments; learn each one from a separate file")]
    Segments {
        /// The reference.
        record: String,
        /// Number of segments.
        segments: usize,
    },
    /// The reference is constant.
    #[error("{record}: the reference does not move: all values are {value}; give a reference that moves")]
    Still {
        /// The reference.
        record: String,
        /// Its value \[output unit\].
        value: f64,
    },
    /// Plays differ in length from the drive, or there are fewer than two.
    #[error(
        "a pass needs at least two plays of {rows} rows each; there are {plays}, one of {other} rows; repeat the whole pass"
    )]
    Plays {
        /// Rows of the drive.
        rows: usize,
        /// Number of plays.
        plays: usize,
        /// Rows of the first play of another length, or of any play.
        other: usize,
    },
    /// A value is not a number.
    #[error("play {play}, row {row}: the output is not a number; check the sensor")]
    NotFinite {
        /// Number of the play, from 1.
        play: usize,
        /// Number of the row, from 1.
        row: usize,
    },
    /// The output hardly follows the reference, or moves in the opposite direction.
    #[error("the output does not follow the reference (correlation {correlation:.2}, gain {gain:.2}): {advice}")]
    NotFollowing {
        /// Correlation of predicted and measured output.
        correlation: f64,
        /// Slope of the measured over the predicted output.
        gain: f64,
        /// What to do.
        advice: &'static str,
    },
}

/// Minimum correlation for learning: below it the change has the wrong sign at too many frequencies.
const MIN_CORRELATION: f64 = 0.5;
/// Maximum power of an error that counts as noise, as a multiple of N: white noise exceeds it at one frequency in
/// twenty.
const NOISE_MULTIPLE: f64 = 3.0;
/// Minimum relative improvement within two passes.
const MIN_IMPROVEMENT: f64 = 0.05;
/// Minimum ratio of a worse pass to the best one; a smaller ratio is scatter.
const WORSE_RATIO: f64 = 1.05;
/// Power of the rounding error of a play, relative to the largest power of the reference at one frequency.
const ROUNDING_POWER: f64 = 1e-18;
/// Minimum hold time of the first and of the last value \[s\].
const HOLD_S: f64 = 0.05;
/// Maximum distance of the predicted output from the range of the model's output, as a share of the range.
const MAX_RANGE_EXCESS: f64 = 0.5;

/// A stored pass.
struct StoredPass {
    pass: Pass,
    plays: f64,
    drive: LearnedDrive,
    /// v, its spectrum, and the spectrum of the mean output.
    predicted: Vec<f64>,
    input: Vec<Complex<f64>>,
    output: Vec<Complex<f64>>,
}

/// Learns the drive of one reference.
pub struct Learner<'a> {
    model: &'a Model,
    /// Reference with a hold before and after it.
    reference: Record,
    /// Rows of the given reference.
    rows: Range<usize>,
    options: LearnOptions,
    inverse: Inverse,
    spectrum: Spectrum,
    bands: Bands,
    wanted: Vec<Complex<f64>>,
    /// Sum over passes of |difference between plays|², scaled to the power of one play.
    scatter: Vec<f64>,
    /// Number of independent differences in that sum.
    differences: f64,
    /// Sum of squared differences between plays, and its degrees of freedom.
    squares: (f64, f64),
    stored: Vec<StoredPass>,
    best: usize,
    /// Number of passes in a row that were worse than the best.
    worse: u32,
    predicted: Vec<f64>,
    drive: LearnedDrive,
}

impl<'a> Learner<'a> {
    /// Starts with the drive of the model's inverse.
    ///
    /// # Errors
    /// As [`compensate`], and if the reference has more than one segment or does not move.
    pub fn new(model: &'a Model, reference: &Record, options: LearnOptions) -> Result<Self, LearnError> {
        let segments = reference.segments().len();
        if segments > 1 {
            return Err(LearnError::Segments { record: reference.name(), segments });
        }
        let lead = Follower::new(model, reference, &options.compensate)?.stated().lead;
        let (low, high) = range(reference.output().unwrap_or_default().iter().copied());
        if low == high {
            return Err(LearnError::Still { record: reference.name(), value: low });
        }
        let hold = (2 * lead).max((HOLD_S / reference.sample_period()).round() as usize);
        let given = reference.rows();
        let reference = with_holds(reference, hold)?;
        let follower = Follower::new(model, &reference, &options.compensate)?;
        let plan = compensate(model, &reference, &options.compensate)?;
        let predicted = follower.predicted(model, &plan.voltage).map_err(CompensateError::from)?;
        let spectrum = Spectrum::new(predicted.len());
        let bands = Bands::new(spectrum.bins());
        let mut limited = [plan.voltage_limited, plan.slew_limited].concat();
        limited.sort_unstable();
        limited.dedup();
        Ok(Self {
            model,
            rows: hold..hold + given,
            options,
            inverse: Inverse::new(model, &reference, options.compensate, &spectrum)?,
            wanted: spectrum.of(reference.output().unwrap_or_default()),
            reference,
            scatter: vec![0.0; spectrum.bins()],
            differences: 0.0,
            squares: (0.0, 0.0),
            spectrum,
            bands,
            stored: Vec::new(),
            best: 0,
            worse: 0,
            predicted,
            drive: LearnedDrive { voltage: plan.voltage, limited },
        })
    }

    /// Returns the rows of the given reference in the drive. Before them its first value is held, so that the drive can
    /// start before the output has to move. After them its last value is held.
    pub fn rows(&self) -> Range<usize> {
        self.rows.clone()
    }

    /// Returns the reference with these holds.
    pub fn reference(&self) -> &Record {
        &self.reference
    }

    /// Returns the drive of the next pass.
    pub fn drive(&self) -> &LearnedDrive {
        &self.drive
    }

    /// Returns the best pass so far, counted from 0, with its errors and its drive; `None` before the first pass.
    pub fn best(&self) -> Option<(usize, Pass, &LearnedDrive)> {
        self.stored.get(self.best).map(|stored| (self.best, stored.pass, &stored.drive))
    }

    /// Returns the errors of the passes, in order.
    pub fn passes(&self) -> impl Iterator<Item = Pass> {
        self.stored.iter().map(|stored| stored.pass)
    }

    /// Returns the learned correction of the best pass, r − v at the rows of the drive \[output unit\]: reference minus
    /// the prediction of the model for the drive. It contains the error of the model, and the effect of the drive
    /// limits and of the band of the inverse.
    pub fn correction(&self) -> Vec<f64> {
        let wanted = self.reference.output().unwrap_or_default();
        self.stored
            .get(self.best)
            .map_or_else(Vec::new, |stored| stored.predicted.iter().zip(wanted).map(|(v, r)| r - v).collect())
    }

    /// Takes the outputs that were measured with [`drive`](Self::drive), one value per row, and computes the next
    /// drive. Leave out the first play after another drive, because it depends on the memory of that drive. Returns the
    /// reason if learning ended.
    ///
    /// # Errors
    /// If the plays do not match the drive, or the output does not follow the reference. The drive then does not
    /// change.
    pub fn take(&mut self, plays: &[Vec<f64>]) -> Result<Option<Ended>, LearnError> {
        self.check(plays)?;
        let rows = self.predicted.len();
        let mean: Vec<f64> = (0..rows).map(|k| plays.iter().map(|y| y[k]).sum::<f64>() / plays.len() as f64).collect();
        // In each pass, because a sensor may fail later.
        check_following(&self.predicted, &mean)?;
        self.add_scatter(plays, &mean);
        let output = self.spectrum.of(&mean);
        let pass = self.errors(plays);
        let input = self.spectrum.of(&self.predicted);
        let plays = plays.len() as f64;
        self.stored.push(StoredPass {
            pass,
            plays,
            drive: self.drive.clone(),
            predicted: self.predicted.clone(),
            input,
            output,
        });
        let last = self.stored.len() - 1;
        let best = self.stored[self.best].pass.rmse;
        self.worse = if pass.rmse > WORSE_RATIO * best { self.worse + 1 } else { 0 };
        if pass.rmse < best {
            self.best = last;
        }
        let ended = self.ended(pass);
        if ended.is_none() {
            self.compute_next_drive();
        }
        Ok(ended)
    }

    fn check(&self, plays: &[Vec<f64>]) -> Result<(), LearnError> {
        let rows = self.predicted.len();
        let other = plays.iter().map(Vec::len).find(|len| *len != rows);
        if plays.len() < 2 || other.is_some() {
            return Err(LearnError::Plays { rows, plays: plays.len(), other: other.unwrap_or(rows) });
        }
        let not_finite = |y: &Vec<f64>| y.iter().position(|y| !y.is_finite());
        match plays.iter().enumerate().find_map(|(play, y)| Some((play + 1, not_finite(y)? + 1))) {
            Some((play, row)) => Err(LearnError::NotFinite { play, row }),
            None => Ok(()),
        }
    }

    /// Adds the differences between the plays to the scatter.
    fn add_scatter(&mut self, plays: &[Vec<f64>], mean: &[f64]) {
        let freedom = plays.len() as f64 - 1.0;
        for play in plays {
            let difference: Vec<f64> = play.iter().zip(mean).map(|(y, mean)| y - mean).collect();
            self.squares.0 += difference[self.rows.clone()].iter().map(|d| d * d).sum::<f64>();
            let spectrum = self.spectrum.of(&difference);
            self.scatter.iter_mut().zip(spectrum).for_each(|(sum, d)| *sum += d.norm_sqr());
        }
        self.squares.1 += freedom * self.rows.len() as f64;
        self.differences += freedom;
    }

    /// Returns the power of the scatter of one play at each frequency, smoothed over its band.
    fn noise(&self) -> Vec<f64> {
        let sums = self.bands.real_sums(Width::Medium, |bin| self.scatter[bin]);
        let counts = self.bands.real_sums(Width::Medium, |_| self.differences);
        // The scatter of a device without noise is the rounding error.
        let wanted = self.wanted.iter().skip(1).map(|r| r.norm_sqr()).fold(0.0, f64::max);
        let rounding = (ROUNDING_POWER * wanted).max(f64::MIN_POSITIVE.sqrt());
        let of = |bin: usize| {
            let band = self.bands.of(bin);
            let power = sums[band] / counts[band].max(f64::MIN_POSITIVE);
            // The mean of a play scatters at least as much as its lowest frequencies.
            let power = if bin == 0 { power.max(self.scatter[0] / self.differences) } else { power };
            power.max(rounding)
        };
        (0..self.scatter.len()).map(of).collect()
    }

    fn errors(&self, plays: &[Vec<f64>]) -> Pass {
        let wanted = self.reference.output().unwrap_or_default();
        let rows = self.rows.clone();
        let errors =
            || plays.iter().flat_map(|y| y[rows.clone()].iter().zip(&wanted[rows.clone()]).map(|(y, r)| r - y));
        let per_play = plays.len() as f64;
        let mean = rows.clone().map(|k| plays.iter().map(|y| y[k]).sum::<f64>() / per_play - wanted[k]);
        let repeating = mean.map(|e| e * e).sum::<f64>() / rows.len() as f64;
        let scatter = self.squares.0 / self.squares.1;
        Pass {
            rmse: (errors().map(|e| e * e).sum::<f64>() / (per_play * rows.len() as f64)).sqrt(),
            max_abs: errors().fold(0.0, |most, e| most.max(e.abs())),
            repeating: (repeating - scatter / per_play).max(0.0).sqrt(),
            repeatability: scatter.sqrt(),
            limited_rows: self.drive.limited.len(),
        }
    }

    fn ended(&self, pass: Pass) -> Option<Ended> {
        let best_of =
            |passes: Range<usize>| self.stored[passes].iter().map(|t| t.pass.rmse).fold(f64::INFINITY, f64::min);
        let count = self.stored.len();
        if pass.rmse <= self.options.floor * pass.repeatability {
            Some(Ended::AtFloor)
        } else if self.worse >= 3 {
            Some(Ended::Worse)
        } else if count > 3 && self.worse == 0 && best_of(0..count) > (1.0 - MIN_IMPROVEMENT) * best_of(0..count - 2)
            || count > 4 && best_of(0..count) > (1.0 - MIN_IMPROVEMENT) * best_of(0..count - 3)
        {
            Some(Ended::NoGain)
        } else if count >= self.options.passes {
            Some(Ended::Passes)
        } else {
            None
        }
    }

    /// Returns the response, from the first pass and from the changes between passes.
    fn response(&self, noise: &[f64]) -> Response {
        let scaled = |factor: f64| noise.iter().map(|n| n * factor).collect::<Vec<f64>>();
        let difference = |a: &[Complex<f64>], b: &[Complex<f64>]| -> Vec<Complex<f64>> {
            a.iter().zip(b).map(|(a, b)| a - b).collect()
        };
        let changes: Vec<_> = self
            .stored
            .windows(2)
            .map(|two| {
                (
                    difference(&two[1].input, &two[0].input),
                    difference(&two[1].output, &two[0].output),
                    1.0 / two[0].plays + 1.0 / two[1].plays,
                )
            })
            .collect();
        let first = &self.stored[0];
        let first = (Pair { from: &first.input, to: &first.output }, scaled(1.0 / first.plays));
        let later = changes.iter().map(|(from, to, share)| (Pair { from, to }, scaled(*share)));
        let pairs: Vec<_> = std::iter::once(first).chain(later).collect();
        Response::of(&self.bands, &pairs, &self.spectrum)
    }

    /// Computes the next drive and the prediction of the model for it.
    fn compute_next_drive(&mut self) {
        let noise = self.noise();
        let response = self.response(&noise);
        let best = &self.stored[self.best];
        let step_size = 0.5_f64.powi(self.worse as i32);
        let change: Vec<Complex<f64>> = (0..noise.len())
            .map(|bin| {
                let error = self.wanted[bin] - best.output[bin];
                let noise = noise[bin] / best.plays;
                let repeatable = (1.0 - NOISE_MULTIPLE * noise / error.norm_sqr().max(f64::MIN_POSITIVE)).max(0.0);
                let change = error * response.step(bin, self.bands.of(bin)) * repeatable * step_size;
                if change.re.is_finite() && change.im.is_finite() { change } else { Complex::new(0.0, 0.0) }
            })
            .collect();
        let (low, high) = (self.model.output.low, self.model.output.high);
        let excess = MAX_RANGE_EXCESS * (high - low);
        let to: Vec<f64> = best
            .predicted
            .iter()
            .zip(self.spectrum.to_time(change))
            .map(|(v, change)| (v + change).max(low - excess).min(high + excess))
            .collect();
        // The inverse exists, because the first drive was computed with it.
        let drive = self.inverse.changed(&self.reference, &best.drive.voltage, [&best.predicted, &to], &self.spectrum);
        if let Ok(drive) = drive
            && let Ok(predicted) = self.predict(&drive.voltage)
        {
            (self.predicted, self.drive) = (predicted, drive);
        }
    }

    /// Returns the prediction of the model for a drive.
    fn predict(&self, drive: &[f64]) -> Result<Vec<f64>, CompensateError> {
        let follower = Follower::new(self.model, &self.reference, &self.options.compensate)?;
        Ok(follower.predicted(self.model, drive)?)
    }
}

/// Returns the reference with its first value held for `rows` rows before it, and its last value for `rows` rows after
/// it.
fn with_holds(reference: &Record, rows: usize) -> Result<Record, CompensateError> {
    let hold = |values: &[f64]| -> Vec<f64> {
        let (first, last) = (values.first().copied().unwrap_or(0.0), values.last().copied().unwrap_or(0.0));
        [&vec![first; rows], values, &vec![last; rows]].concat()
    };
    let period = reference.sample_period();
    let start = reference.time().first().copied().unwrap_or(0.0) - rows as f64 * period;
    let unit = reference.output_unit();
    Ok(Record::from_samples(Columns {
        name: reference.name(),
        time: (0..reference.rows() + 2 * rows).map(|k| start + k as f64 * period).collect(),
        output: unit.zip(reference.output().map(hold)),
        temperature: reference.temperature().map(hold),
        load: reference.load().map(hold),
        ..Columns::default()
    })?)
}

/// Checks that the output moves as predicted.
fn check_following(predicted: &[f64], output: &[f64]) -> Result<(), LearnError> {
    let n = predicted.len() as f64;
    let mean = |x: &[f64]| x.iter().sum::<f64>() / n;
    let (mean_v, mean_y) = (mean(predicted), mean(output));
    let (mut own, mut cross, mut all) = (0.0, 0.0, 0.0);
    for (v, y) in predicted.iter().zip(output) {
        let (v, y) = (v - mean_v, y - mean_y);
        own += v * v;
        cross += v * y;
        all += y * y;
    }
    let correlation = cross / (own * all).sqrt().max(f64::MIN_POSITIVE);
    let gain = cross / own.max(f64::MIN_POSITIVE);
    if correlation >= MIN_CORRELATION {
        return Ok(());
    }
    let advice = if correlation < -MIN_CORRELATION {
        "the model has the wrong sign for this actuator; fit a model to a record of this actuator"
    } else {
        "check the sensor, the amplifier, and that the model is of this actuator"
    };
    Err(LearnError::NotFollowing { correlation, gain, advice })
}
