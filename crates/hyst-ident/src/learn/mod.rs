//! Iterative learning control: the drive of a reference that repeats, improved by what was measured while it was played.
//!
//! A pass plays a drive u; the model predicts the output v, and y is measured. The error e = r − y is to vanish, so the predicted output has to change by L e,
//! and the model's inverse turns that change into one of the drive (Moore 1993; Leang and Devasia 2006 for piezo actuators, with a linear inverse).
//! The filter L follows from what was measured:
//!
//! - D, the response of the measured output to a change of the predicted one, is 1 where the model is true. A gain or a delay that is off and a mode that the
//!   model lacks are in D: it is estimated from the first pass and from the changes between passes as a rational response with a delay, and in
//!   narrow bands of frequency, with a variance s², to which a share of |D|² is added because the slope of a hysteresis is not one number. Then
//!   L = D* / (|D|² + s²), the change with the least expected square of the remaining error. The variance is no exact one: the rational
//!   response and the bands are estimated from the same passes.
//! - Each pass plays the drive several times, after one more play that is left out, so that the actuator remembers this drive and no other. What differs
//!   between these plays does not repeat (noise, creep, drift); its power N in each band limits what is learned of an error E: L (1 − 3 N / |E|²) E, and
//!   nothing where that is negative.
//!
//! A change starts from the best pass so far; after a pass that was worse it is half as large. Learning ends at the repeatability: the error
//! that the same drive has in another play.

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

/// How long to learn.
#[derive(Clone, Copy, Debug)]
pub struct LearnOptions {
    /// Limits of the drive.
    pub compensate: CompensateOptions,
    /// Passes after which it ends in any case, the one without anything learned included.
    pub passes: usize,
    /// Error at which it ends, over the repeatability.
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
    /// Root mean square of reference less output, over all plays \[output unit\].
    pub rmse: f64,
    /// The largest \[output unit\].
    pub max_abs: f64,
    /// Root mean square of the error's mean over the plays, noise taken away: what repeats, and can be learned \[output unit\].
    pub repeating: f64,
    /// Repeatability as known after this pass: root mean square of what differs from play to play \[output unit\].
    pub repeatability: f64,
    /// Rows at which a limit acted on the drive.
    pub limited_rows: usize,
}

impl Pass {
    /// The error over the repeatability; none where each play gave the same, or only one was played.
    pub fn over_repeatability(&self) -> Option<f64> {
        (self.repeatability > 0.0).then(|| self.rmse / self.repeatability)
    }
}

/// Why learning ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ended {
    /// The error is that of playing the same drive again.
    AtFloor,
    /// Two passes brought less than a twentieth, or three of which some were worse.
    NoGain,
    /// Three passes in a row were worse than the best.
    Worse,
    /// As many passes as were asked for.
    Passes,
}

/// Why nothing is learned.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LearnError {
    /// The first drive cannot be made.
    #[error(transparent)]
    Compensate(#[from] CompensateError),
    /// More than one segment.
    #[error("{record}: the reference has {segments} segments; learn one after the other, each from a file of its own")]
    Segments {
        /// The reference.
        record: String,
        /// Its segments.
        segments: usize,
    },
    /// Nothing to follow.
    #[error("{record}: the reference does not move: it is {value} throughout; give one that does")]
    Still {
        /// The reference.
        record: String,
        /// Its value \[output unit\].
        value: f64,
    },
    /// Plays have other lengths than the reference, or there are fewer than two.
    #[error(
        "a pass is at least two plays of {rows} rows each; there are {plays}, one of {other} rows: play the drive again, whole"
    )]
    Plays {
        /// Rows of the reference.
        rows: usize,
        /// Plays that were given.
        plays: usize,
        /// Rows of the first that is too short or too long, or of any.
        other: usize,
    },
    /// A value is no number.
    #[error("play {play}, row {row}: the output is no number; look at the sensor")]
    NotFinite {
        /// From 1.
        play: usize,
        /// From 1.
        row: usize,
    },
    /// The output hardly follows, or moves the other way.
    #[error("the output does not follow the reference (correlation {correlation:.2}, gain {gain:.2}): {advice}")]
    NotFollowing {
        /// Between predicted and measured output.
        correlation: f64,
        /// Slope of the output over it.
        gain: f64,
        /// What to do.
        advice: &'static str,
    },
}

/// A correlation below which nothing can be learned: the change would have the wrong sign in too many frequencies.
const LEAST_CORRELATION: f64 = 0.5;
/// Error that is taken for noise, over N: of white noise one frequency in twenty has more.
const NOISE_MULTIPLE: f64 = 3.0;
/// A pass that brings less than this share twice ends it.
const LEAST_IMPROVEMENT: f64 = 0.05;
/// A pass is worse from this ratio to the best on; below that it is scatter.
const WORSE_RATIO: f64 = 1.05;
/// Power of what rounding makes of a play, over the largest of the reference at one frequency.
const ROUNDING_POWER: f64 = 1e-18;
/// How long the first and the last value are held at least \[s\].
const HOLD_S: f64 = 0.05;
/// How far the predicted output may leave the range of the model's output, as a share of that.
const BEYOND_RANGE: f64 = 0.5;

/// A pass as it is kept.
struct Taken {
    pass: Pass,
    plays: f64,
    drive: LearnedDrive,
    /// v, its spectrum, and that of the mean output.
    predicted: Vec<f64>,
    input: Vec<Complex<f64>>,
    output: Vec<Complex<f64>>,
}

/// Learns the drive of one reference.
pub struct Learner<'a> {
    model: &'a Model,
    /// With the holds before and behind it.
    reference: Record,
    /// Rows of the reference that was given.
    rows: Range<usize>,
    options: LearnOptions,
    inverse: Inverse,
    spectrum: Spectrum,
    bands: Bands,
    wanted: Vec<Complex<f64>>,
    /// Sum over passes of |difference between plays|², scaled to the power of one play, and of the number of differences.
    scatter: Vec<f64>,
    differences: f64,
    /// Sum of squares of what differs, and its degrees of freedom.
    squares: (f64, f64),
    taken: Vec<Taken>,
    best: usize,
    /// Passes in a row that were worse than the best.
    worse: u32,
    predicted: Vec<f64>,
    drive: LearnedDrive,
}

impl<'a> Learner<'a> {
    /// Begins with the drive of the model's inverse.
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
        let reference = held(reference, hold)?;
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
            taken: Vec::new(),
            best: 0,
            worse: 0,
            predicted,
            drive: LearnedDrive { voltage: plan.voltage, limited },
        })
    }

    /// Rows of the drive at which the reference runs: before them its first value is held, so that a drive can begin before the output has to move, and
    /// behind them its last one.
    pub fn rows(&self) -> Range<usize> {
        self.rows.clone()
    }

    /// The reference with these holds.
    pub fn reference(&self) -> &Record {
        &self.reference
    }

    /// The drive of the next pass.
    pub fn drive(&self) -> &LearnedDrive {
        &self.drive
    }

    /// The best pass so far, counted from 0: what it left, and its drive. None before the first one.
    pub fn best(&self) -> Option<(usize, Pass, &LearnedDrive)> {
        self.taken.get(self.best).map(|taken| (self.best, taken.pass, &taken.drive))
    }

    /// What the passes left, in order.
    pub fn passes(&self) -> impl Iterator<Item = Pass> {
        self.taken.iter().map(|taken| taken.pass)
    }

    /// The learned correction of the best pass, r − v at the rows of the drive \[output unit\]: reference less what the model predicts for the drive. It is
    /// what the model had wrong, and, where limits held the drive or the inverse has a band, what these keep from the reference.
    pub fn correction(&self) -> Vec<f64> {
        let wanted = self.reference.output().unwrap_or_default();
        self.taken
            .get(self.best)
            .map_or_else(Vec::new, |taken| taken.predicted.iter().zip(wanted).map(|(v, r)| r - v).collect())
    }

    /// Takes the outputs that were measured while [`drive`](Self::drive) was played, a value for each of its rows, and makes the next drive. The play that
    /// comes first after another drive should not be among them: what the actuator remembers of that one does not repeat.
    /// Gives why it ended, if it did.
    ///
    /// # Errors
    /// If the plays are not those of the reference, or the output does not follow it. Then nothing is learned, and the drive stays.
    pub fn take(&mut self, plays: &[Vec<f64>]) -> Result<Option<Ended>, LearnError> {
        self.check(plays)?;
        let rows = self.predicted.len();
        let mean: Vec<f64> = (0..rows).map(|k| plays.iter().map(|y| y[k]).sum::<f64>() / plays.len() as f64).collect();
        // In each pass: a sensor may fail on the way.
        follows(&self.predicted, &mean)?;
        self.compare(plays, &mean);
        let output = self.spectrum.of(&mean);
        let pass = self.judge(plays);
        let input = self.spectrum.of(&self.predicted);
        let plays = plays.len() as f64;
        self.taken.push(Taken {
            pass,
            plays,
            drive: self.drive.clone(),
            predicted: self.predicted.clone(),
            input,
            output,
        });
        let last = self.taken.len() - 1;
        let best = self.taken[self.best].pass.rmse;
        self.worse = if pass.rmse > WORSE_RATIO * best { self.worse + 1 } else { 0 };
        if pass.rmse < best {
            self.best = last;
        }
        let ended = self.ended(pass);
        if ended.is_none() {
            self.step();
        }
        Ok(ended)
    }

    fn check(&self, plays: &[Vec<f64>]) -> Result<(), LearnError> {
        let rows = self.predicted.len();
        let other = plays.iter().map(Vec::len).find(|len| *len != rows);
        if plays.len() < 2 || other.is_some() {
            return Err(LearnError::Plays { rows, plays: plays.len(), other: other.unwrap_or(rows) });
        }
        let bad = |y: &Vec<f64>| y.iter().position(|y| !y.is_finite());
        match plays.iter().enumerate().find_map(|(play, y)| Some((play + 1, bad(y)? + 1))) {
            Some((play, row)) => Err(LearnError::NotFinite { play, row }),
            None => Ok(()),
        }
    }

    /// Adds what differs between the plays to what is known of it.
    fn compare(&mut self, plays: &[Vec<f64>], mean: &[f64]) {
        let freedom = plays.len() as f64 - 1.0;
        for play in plays {
            let off: Vec<f64> = play.iter().zip(mean).map(|(y, mean)| y - mean).collect();
            self.squares.0 += off[self.rows.clone()].iter().map(|d| d * d).sum::<f64>();
            let spectrum = self.spectrum.of(&off);
            self.scatter.iter_mut().zip(spectrum).for_each(|(sum, d)| *sum += d.norm_sqr());
        }
        self.squares.1 += freedom * self.rows.len() as f64;
        self.differences += freedom;
    }

    /// Power of one play's scatter at each frequency, smoothed over its band.
    fn noise(&self) -> Vec<f64> {
        let sums = self.bands.real_sums(Width::Medium, |bin| self.scatter[bin]);
        let counts = self.bands.real_sums(Width::Medium, |_| self.differences);
        // A device without noise repeats to the rounding of its numbers.
        let wanted = self.wanted.iter().skip(1).map(|r| r.norm_sqr()).fold(0.0, f64::max);
        let rounding = (ROUNDING_POWER * wanted).max(f64::MIN_POSITIVE.sqrt());
        let of = |bin: usize| {
            let band = self.bands.of(bin);
            let power = sums[band] / counts[band].max(f64::MIN_POSITIVE);
            // The mean of a play differs at least as much as its slowest frequencies do.
            let power = if bin == 0 { power.max(self.scatter[0] / self.differences) } else { power };
            power.max(rounding)
        };
        (0..self.scatter.len()).map(of).collect()
    }

    fn judge(&self, plays: &[Vec<f64>]) -> Pass {
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
            |passes: Range<usize>| self.taken[passes].iter().map(|t| t.pass.rmse).fold(f64::INFINITY, f64::min);
        let now = self.taken.len();
        if pass.rmse <= self.options.floor * pass.repeatability {
            Some(Ended::AtFloor)
        } else if self.worse >= 3 {
            Some(Ended::Worse)
        } else if now > 3 && self.worse == 0 && best_of(0..now) > (1.0 - LEAST_IMPROVEMENT) * best_of(0..now - 2)
            || now > 4 && best_of(0..now) > (1.0 - LEAST_IMPROVEMENT) * best_of(0..now - 3)
        {
            Some(Ended::NoGain)
        } else if now >= self.options.passes {
            Some(Ended::Passes)
        } else {
            None
        }
    }

    /// The response, from the first pass and from the changes since.
    fn response(&self, noise: &[f64]) -> Response {
        let scaled = |factor: f64| noise.iter().map(|n| n * factor).collect::<Vec<f64>>();
        let difference = |a: &[Complex<f64>], b: &[Complex<f64>]| -> Vec<Complex<f64>> {
            a.iter().zip(b).map(|(a, b)| a - b).collect()
        };
        let changes: Vec<_> = self
            .taken
            .windows(2)
            .map(|two| {
                (
                    difference(&two[1].input, &two[0].input),
                    difference(&two[1].output, &two[0].output),
                    1.0 / two[0].plays + 1.0 / two[1].plays,
                )
            })
            .collect();
        let begun = &self.taken[0];
        let first = (Pair { from: &begun.input, to: &begun.output }, scaled(1.0 / begun.plays));
        let since = changes.iter().map(|(from, to, share)| (Pair { from, to }, scaled(*share)));
        let pairs: Vec<_> = std::iter::once(first).chain(since).collect();
        Response::of(&self.bands, &pairs, &self.spectrum)
    }

    /// Makes the next drive, and what the model predicts of it.
    fn step(&mut self) {
        let noise = self.noise();
        let response = self.response(&noise);
        let best = &self.taken[self.best];
        let trust = 0.5_f64.powi(self.worse as i32);
        let change: Vec<Complex<f64>> = (0..noise.len())
            .map(|bin| {
                let error = self.wanted[bin] - best.output[bin];
                let noise = noise[bin] / best.plays;
                let sure = (1.0 - NOISE_MULTIPLE * noise / error.norm_sqr().max(f64::MIN_POSITIVE)).max(0.0);
                let change = error * response.step(bin, self.bands.of(bin)) * sure * trust;
                if change.re.is_finite() && change.im.is_finite() { change } else { Complex::new(0.0, 0.0) }
            })
            .collect();
        let (low, high) = (self.model.output.low, self.model.output.high);
        let beyond = BEYOND_RANGE * (high - low);
        let to: Vec<f64> = best
            .predicted
            .iter()
            .zip(self.spectrum.back(change))
            .map(|(v, change)| (v + change).max(low - beyond).min(high + beyond))
            .collect();
        // The inverse exists: the first drive was made with it.
        let drive = self.inverse.changed(&self.reference, &best.drive.voltage, [&best.predicted, &to], &self.spectrum);
        if let Ok(drive) = drive
            && let Ok(predicted) = self.predict(&drive.voltage)
        {
            (self.predicted, self.drive) = (predicted, drive);
        }
    }

    /// What the model says that a drive does.
    fn predict(&self, drive: &[f64]) -> Result<Vec<f64>, CompensateError> {
        let follower = Follower::new(self.model, &self.reference, &self.options.compensate)?;
        Ok(follower.predicted(self.model, drive)?)
    }
}

/// The reference with its first value held for `rows` rows before it, and its last one as long behind it.
fn held(reference: &Record, rows: usize) -> Result<Record, CompensateError> {
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

/// Whether the output moves as predicted.
fn follows(wanted: &[f64], output: &[f64]) -> Result<(), LearnError> {
    let n = wanted.len() as f64;
    let mean = |x: &[f64]| x.iter().sum::<f64>() / n;
    let (mean_v, mean_y) = (mean(wanted), mean(output));
    let (mut own, mut cross, mut all) = (0.0, 0.0, 0.0);
    for (v, y) in wanted.iter().zip(output) {
        let (v, y) = (v - mean_v, y - mean_y);
        own += v * v;
        cross += v * y;
        all += y * y;
    }
    let correlation = cross / (own * all).sqrt().max(f64::MIN_POSITIVE);
    let gain = cross / own.max(f64::MIN_POSITIVE);
    if correlation >= LEAST_CORRELATION {
        return Ok(());
    }
    let advice = if correlation < -LEAST_CORRELATION {
        "the model has the wrong sign for this actuator; fit one to a record of it"
    } else {
        "look at sensor and amplifier, and whether the model is of this actuator"
    };
    Err(LearnError::NotFollowing { correlation, gain, advice })
}
