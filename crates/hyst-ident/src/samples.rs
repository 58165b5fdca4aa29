//! The data of a fit: columns of numbers, segments, and the rows that are fitted.

use std::ops::Range;

use hyst_core::Env;
use nalgebra::{DMatrix, DVector};

use crate::clipping::clipped_rows;
use crate::frozen::frozen_rows;
use crate::record::Record;
use crate::spikes::{spiked_residual, spiked_rows};
use crate::statistics::range;
use crate::stop::Stop;

/// Columns of one or more records with the same units.
#[derive(Clone, Debug)]
pub struct Samples {
    /// Shortest sample period \[s\].
    pub period: f64,
    /// Sample period of each segment \[s\]; empty if all segments have the same.
    pub(crate) periods: Vec<f64>,
    /// Time \[s\].
    pub time: Vec<f64>,
    /// Input \[V\].
    pub input: Vec<f64>,
    /// Measured output \[output unit\]; empty if there is none.
    pub output: Vec<f64>,
    /// Temperature \[°C\], if it was recorded.
    pub temperature: Option<Vec<f64>>,
    /// Load \[N\], if it was recorded.
    pub load: Option<Vec<f64>>,
    /// Whether the output falls when the input rises.
    pub(crate) falls: bool,
    /// The rows of each segment.
    pub segments: Vec<Range<usize>>,
    /// The number of the file of each segment.
    pub file_of_segment: Vec<usize>,
    /// The estimated drive before each segment \[V\]; empty if the segment begins at rest.
    pub(crate) pasts: Vec<Vec<f64>>,
    /// True for rows that are not fitted and not part of the error: rows without a valid output, and start-up rows.
    pub settling: Vec<bool>,
    /// True for rows without a valid output: missing, at the end of the sensor range, frozen, or spikes.
    pub(crate) blind: Vec<bool>,
    /// Stops a fit of these samples early.
    pub(crate) stop: Stop,
}

impl Samples {
    /// Makes samples of the columns of a record. Start-up rows are not detected yet.
    pub fn from_record(record: &Record) -> Self {
        let blind = record.output().map_or_else(|| vec![false; record.rows()], |y| blind_rows(record, y));
        Self {
            period: record.sample_period(),
            periods: own_periods(record.sample_periods()),
            time: record.time().to_vec(),
            input: record.input().to_vec(),
            output: record.output().unwrap_or_default().to_vec(),
            temperature: record.temperature().map(<[f64]>::to_vec),
            load: record.load().map(<[f64]>::to_vec),
            falls: falls_where(record.input(), record.output().unwrap_or_default(), &blind),
            segments: record.segments().to_vec(),
            pasts: vec![Vec::new(); record.segments().len()],
            file_of_segment: record.file_of_segment().to_vec(),
            settling: blind.clone(),
            blind,
            stop: Stop::default(),
        }
    }

    /// Sets a constant temperature \[°C\], if no temperature was recorded.
    pub fn at_temperature(mut self, degc: Option<f64>) -> Self {
        if let (None, Some(degc)) = (&self.temperature, degc) {
            self.temperature = Some(vec![degc; self.len()]);
        }
        self
    }

    /// Returns the beginnings of all segments, the same share of each, together about `rows` rows at most.
    pub(crate) fn beginnings(&self, rows: usize) -> Self {
        let share = (rows as f64 / self.len().max(1) as f64).min(1.0);
        let mut cut = self.clone();
        for s in &mut cut.segments {
            s.end = s.start + ((share * s.len() as f64).ceil() as usize).min(s.len());
        }
        let all: Vec<usize> = (0..cut.segments.len()).collect();
        cut.segments_only(&all)
    }

    /// Returns only these segments, in the given order.
    pub(crate) fn segments_only(&self, keep: &[usize]) -> Self {
        let column = |c: &[f64]| keep.iter().flat_map(|s| c[self.segments[*s].clone()].iter().copied()).collect();
        let mut end = 0;
        let length = |s: &usize| {
            end += self.segments[*s].len();
            end - self.segments[*s].len()..end
        };
        let periods: Vec<f64> = keep.iter().map(|s| self.period_of(*s)).collect();
        Self {
            period: periods.iter().copied().reduce(f64::min).unwrap_or(self.period),
            periods: own_periods(periods),
            segments: keep.iter().map(length).collect(),
            pasts: keep.iter().map(|s| self.pasts.get(*s).cloned().unwrap_or_default()).collect(),
            time: column(&self.time),
            input: column(&self.input),
            output: column(&self.output),
            temperature: self.temperature.as_deref().map(column),
            load: self.load.as_deref().map(column),
            falls: self.falls,
            file_of_segment: keep.iter().map(|s| self.file_of_segment[*s]).collect(),
            settling: keep.iter().flat_map(|s| self.settling[self.segments[*s].clone()].iter().copied()).collect(),
            blind: keep.iter().flat_map(|s| self.blind[self.segments[*s].clone()].iter().copied()).collect(),
            stop: self.stop.clone(),
        }
    }

    /// Returns only the first rows of a segment.
    pub(crate) fn beginning(&self, segment: usize, rows: usize) -> Self {
        let mut cut = self.clone();
        let own = &mut cut.segments[segment];
        own.end = own.end.min(own.start + rows);
        cut.segments_only(&[segment])
    }

    /// Makes one segment from time 0, without temperature and load, whose rows are all fitted. For unit tests.
    #[cfg(test)]
    pub(crate) fn of_columns(period: f64, input: Vec<f64>, output: Vec<f64>) -> Self {
        let rows = input.len();
        Self {
            period,
            periods: Vec::new(),
            time: (0..rows).map(|k| k as f64 * period).collect(),
            falls: falls(&input, &output),
            input,
            output,
            temperature: None,
            load: None,
            segments: std::iter::once(0..rows).collect(),
            pasts: vec![Vec::new()],
            file_of_segment: vec![0],
            settling: vec![false; rows],
            blind: vec![false; rows],
            stop: Stop::default(),
        }
    }

    /// Marks the spikes in the residual of a fit. Returns whether there are new ones.
    pub(crate) fn mark_spikes(&mut self, residual: &[f64]) -> bool {
        let spiked = spiked_residual(&self.input, &self.output, residual, &self.segments);
        let new = spiked.iter().zip(&self.blind).any(|(spiked, known)| *spiked && !known);
        for rows in [&mut self.blind, &mut self.settling] {
            rows.iter_mut().zip(&spiked).for_each(|(row, spiked)| *row |= spiked);
        }
        new
    }

    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        self.time.len()
    }

    /// Returns whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }

    /// Returns time, temperature and load at row `k`.
    pub fn env(&self, k: usize) -> Env<f64> {
        let at = |column: &Option<Vec<f64>>| column.as_ref().and_then(|c| c.get(k)).copied().unwrap_or(0.0);
        Env { time: self.time[k], temperature: at(&self.temperature), load: at(&self.load) }
    }

    /// Returns the minimum and maximum input.
    pub fn input_range(&self) -> (f64, f64) {
        range(self.input.iter().copied())
    }

    /// Returns the output in the fitted rows \[output unit\].
    pub(crate) fn settled_output(&self) -> impl Iterator<Item = f64> + '_ {
        self.output.iter().zip(&self.settling).filter(|(_, settling)| !**settling).map(|(y, _)| *y)
    }

    /// Returns the span of the output (maximum minus minimum) over the fitted rows \[output unit\].
    pub fn output_span(&self) -> f64 {
        let (low, high) = range(self.settled_output());
        (high - low).max(0.0)
    }

    /// Returns the fitted rows and the hysteresis in them: the residual of the best cubic of the drive \[output unit\].
    pub(crate) fn hysteresis(&self) -> (Vec<usize>, Vec<f64>) {
        let (low, high) = self.input_range();
        let rows: Vec<usize> = (0..self.len()).filter(|k| !self.settling[*k]).collect();
        let scaled = |k: usize| (2.0 * self.input[k] - low - high) / (high - low).max(f64::MIN_POSITIVE);
        let powers = DMatrix::from_fn(rows.len(), 4, |i, power| scaled(rows[i]).powi(power as i32));
        let output = DVector::from_iterator(rows.len(), rows.iter().map(|k| self.output[*k]));
        let curve = powers.tr_mul(&powers).cholesky().map(|c| c.solve(&powers.tr_mul(&output)));
        let residual = curve.map_or_else(|| vec![0.0; rows.len()], |c| (output - powers * c).iter().copied().collect());
        (rows, residual)
    }

    /// Returns the number of files that the rows come from.
    pub fn files(&self) -> usize {
        self.file_of_segment.iter().max().map_or(0, |m| m + 1)
    }

    /// Returns the length of the longest segment \[s\].
    pub fn longest_segment(&self) -> f64 {
        let lengths = self.segments.iter().enumerate().map(|(i, rows)| rows.len() as f64 * self.period_of(i));
        lengths.fold(0.0, f64::max)
    }

    /// Returns the length of all segments together, without the pauses between them \[s\].
    pub(crate) fn duration(&self) -> f64 {
        self.segments.iter().enumerate().map(|(i, rows)| rows.len() as f64 * self.period_of(i)).sum()
    }

    /// Returns the sample period of a segment \[s\].
    pub(crate) fn period_of(&self, segment: usize) -> f64 {
        self.periods.get(segment).copied().unwrap_or(self.period)
    }

    /// Returns the sample period of the segment that contains `row` \[s\].
    pub(crate) fn period_at(&self, row: usize) -> f64 {
        if self.periods.is_empty() {
            return self.period;
        }
        self.period_of(self.segments.iter().position(|rows| rows.contains(&row)).unwrap_or(0))
    }

    /// Returns the sample period of most rows \[s\].
    pub(crate) fn usual_period(&self) -> f64 {
        let of = |period: f64| (0..self.segments.len()).filter(move |i| self.period_of(*i) == period);
        let rows = |period: &f64| of(*period).map(|i| self.segments[i].len()).sum::<usize>();
        self.periods.iter().copied().max_by_key(rows).unwrap_or(self.period)
    }

    /// Removes the segments that have another sample period than most rows. The columns are not changed.
    pub(crate) fn of_one_period(mut self) -> Self {
        let usual = self.usual_period();
        let other: Vec<bool> = (0..self.segments.len()).map(|i| self.period_of(i) != usual).collect();
        fn keep<T>(column: &mut Vec<T>, other: &[bool]) {
            let mut other = other.iter();
            column.retain(|_| other.next() != Some(&true));
        }
        keep(&mut self.segments, &other);
        keep(&mut self.pasts, &other);
        keep(&mut self.file_of_segment, &other);
        (self.period, self.periods) = (usual, Vec::new());
        self
    }
}

/// Objects that depend on the sample period, one per segment of a record.
#[derive(Debug)]
pub(crate) struct PerSegment<S>(Vec<S>);

impl<S> PerSegment<S> {
    /// Builds one object per segment for its sample period \[s\], or a single one if all segments have the same period.
    pub(crate) fn new<E>(samples: &Samples, build: impl Fn(f64) -> Result<S, E>) -> Result<Self, E> {
        match samples.periods.as_slice() {
            [] => Ok(Self(vec![build(samples.period)?])),
            periods => periods.iter().map(|period| build(*period)).collect::<Result<_, _>>().map(Self),
        }
    }

    /// Returns the object of a segment.
    pub(crate) fn of(&self, segment: usize) -> &S {
        self.0.get(segment).unwrap_or(&self.0[0])
    }
}

/// Returns the sample periods of the segments; empty if all are equal.
fn own_periods(periods: Vec<f64>) -> Vec<f64> {
    if periods.windows(2).all(|w| w[0] == w[1]) { Vec::new() } else { periods }
}

/// Marks rows without a valid output: missing, at the end of the sensor range, frozen, or spikes.
fn blind_rows(record: &Record, output: &[f64]) -> Vec<bool> {
    let mut blind = clipped_rows(output, record.segments());
    // Spikes and frozen rows are detected by comparison with the drive, which a reference does not have.
    if record.input().len() == output.len() {
        let spiked = spiked_rows(record.input(), output, record.segments());
        let frozen = frozen_rows(record.input(), output, record.segments());
        blind.iter_mut().zip(spiked).zip(frozen).for_each(|((blind, spiked), frozen)| *blind |= spiked || frozen);
    }
    blind.iter_mut().zip(record.missing()).for_each(|(blind, missing)| *blind |= missing);
    blind
}

/// Returns whether the output falls when the input rises, using only rows with a valid output.
fn falls_where(input: &[f64], output: &[f64], blind: &[bool]) -> bool {
    let seen = |x: &[f64]| -> Vec<f64> { x.iter().zip(blind).filter(|(_, blind)| !**blind).map(|(x, _)| *x).collect() };
    falls(&seen(input), &seen(output))
}

/// Returns whether the output falls when the input rises: the sign of their covariance.
fn falls(input: &[f64], output: &[f64]) -> bool {
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
    let (u, y) = (mean(input), mean(output));
    input.iter().zip(output).map(|(a, b)| (a - u) * (b - y)).sum::<f64>() < 0.0
}
