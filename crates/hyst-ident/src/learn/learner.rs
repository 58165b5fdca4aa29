//! Learns the drive of one reference, pass by pass.

use std::ops::Range;

use nalgebra::Complex;

use super::bands::{Bands, Width};
use super::error::LearnError;
use super::following::check_following;
use super::holds::with_holds;
use super::inverse::{Inverse, LearnedDrive};
use super::pass::{Ended, Pass};
use super::rational::Pair;
use super::response::Response;
use super::spectrum::Spectrum;
use crate::compensate::{CompensateError, CompensateOptions, Follower, compensate};
use crate::model::Model;
use crate::record::Record;
use crate::statistics::range;

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
