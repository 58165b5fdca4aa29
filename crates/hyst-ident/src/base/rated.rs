//! A base whose loops change with the rate in any way: the rival of what is named beside a law of the rate.
//!
//! No formula of a rate is an actuator's to the last digit: coercive voltages grow with a power of the rate, with its logarithm, or otherwise. Beside a
//! base stand its plays times hat functions of the logarithm of the rate: weights and thresholds that depend on it in any smooth way, to first order.

use std::ops::Range;

use nalgebra::DMatrix;

use super::pi::plays;
use super::{Basis, Drag};
use crate::Samples;
use crate::lsq::Bounds;

/// Shares of the moving rows whose rates are the knots; at the first the base has all of its own.
const KNOTS: [f64; 4] = [0.05, 0.35, 0.65, 0.95];
/// Thresholds, as shares of half the range; the first is that of the drive itself.
const THRESHOLDS: [f64; 5] = [0.0, 0.08, 0.2, 0.4, 0.7];

/// Another base, and plays that change with the rate.
pub(crate) struct RatedBasis<'a> {
    base: &'a dyn Basis,
    /// Logarithms of rates, rising.
    knots: Vec<f64>,
    thresholds: Vec<f64>,
    /// Sample period of each segment \[s\].
    periods: Vec<f64>,
}

impl<'a> RatedBasis<'a> {
    /// Around a base; none where the drive has one rate only.
    pub(crate) fn around(base: &'a dyn Basis, samples: &Samples) -> Option<Self> {
        let (low, high) = samples.input_range();
        let periods: Vec<f64> = (0..samples.segments.len()).map(|i| samples.period_of(i)).collect();
        let mut moving: Vec<f64> = rates(&samples.input, &samples.segments, &periods);
        moving.retain(|rate| *rate > 1e-6 * (high - low));
        moving.sort_by(f64::total_cmp);
        let at =
            |share: f64| moving.get((share * moving.len().saturating_sub(1) as f64) as usize).map(|rate| rate.ln());
        let mut knots: Vec<f64> = KNOTS.iter().filter_map(|share| at(*share)).collect();
        knots.dedup_by(|a, b| *a - *b < 0.1);
        let thresholds = THRESHOLDS.iter().map(|share| 0.5 * share * (high - low)).collect();
        (knots.len() > 1).then_some(Self { base, knots, thresholds, periods })
    }

    /// The hat of a knot over the rows.
    fn hat(&self, knot: usize, rates: &[f64]) -> Vec<f64> {
        let (before, own, after) = (self.knots[knot - 1], self.knots[knot], self.knots.get(knot + 1));
        let of = |rate: &f64| {
            let x = rate.max(f64::MIN_POSITIVE).ln();
            match after {
                _ if x <= own => ((x - before) / (own - before)).max(0.0),
                Some(after) => ((after - x) / (after - own)).max(0.0),
                None => 1.0,
            }
        };
        rates.iter().map(of).collect()
    }
}

/// Rate at which each row is reached, 0 where a segment begins.
fn rates(drive: &[f64], segments: &[Range<usize>], periods: &[f64]) -> Vec<f64> {
    let mut rates = vec![0.0; drive.len()];
    for (rows, period) in segments.iter().zip(periods) {
        for k in rows.clone().skip(1) {
            rates[k] = (drive[k] - drive[k - 1]).abs() / period;
        }
    }
    rates
}

impl Basis for RatedBasis<'_> {
    fn columns(&self, of: Range<usize>, drive: &[f64], segments: &[Range<usize>], drag: &Drag) -> Vec<Vec<f64>> {
        let own = self.base.len();
        let mut columns = self.base.columns(of.start.min(own)..of.end.min(own), drive, segments, drag);
        if of.end <= own {
            return columns;
        }
        let rates = rates(drive, segments, &self.periods);
        let plays = plays(drive, segments, &self.thresholds, &Drag::NONE);
        for column in of.start.max(own)..of.end {
            let (knot, threshold) = ((column - own) / self.thresholds.len(), (column - own) % self.thresholds.len());
            let hat = self.hat(knot + 1, &rates);
            columns.push(plays[threshold].iter().zip(hat).map(|(p, hat)| p * hat).collect());
        }
        columns
    }

    fn remembers(&self) -> bool {
        self.base.remembers()
    }

    fn drags(&self) -> bool {
        self.base.drags()
    }

    fn is_odd(&self) -> bool {
        self.base.is_odd()
    }

    fn bounds(&self) -> Vec<Bounds> {
        let mut bounds = self.base.bounds();
        bounds.resize(bounds.len() + (self.knots.len() - 1) * self.thresholds.len(), Bounds::FREE);
        bounds
    }

    fn penalty(&self, level: f64) -> Option<DMatrix<f64>> {
        let (own, n) = (self.base.len(), self.len());
        let mut penalty = DMatrix::from_diagonal_element(n, n, 1e-8 * level);
        if let Some(base) = self.base.penalty(level) {
            penalty.view_mut((0, 0), (own, own)).copy_from(&base);
        }
        Some(penalty)
    }
}
