//! A base whose loops change with the rate in any way: the rival of what is named beside a law of the rate.
//!
//! No formula of a rate is an actuator's to the last digit: coercive voltages grow with a power of the rate, with its logarithm, or otherwise. Beside a
//! base stand its plays times hat functions of the logarithm of the rate: weights and thresholds that depend on it in any smooth way, to first order. And
//! plays whose thresholds grow with several powers of the rate, which remember at what rate they were moved.

use std::ops::Range;

use hyst_core::{Build, MAX_WIDENING, Sampling, Widening, WideningParams};
use nalgebra::DMatrix;

use super::pi::plays;
use super::{Basis, Drag};
use crate::Samples;
use crate::lsq::Bounds;
use crate::widened;

/// Shares of the moving rows whose rates are the knots; at the first the base has all of its own.
const KNOTS: [f64; 4] = [0.05, 0.35, 0.65, 0.95];
/// Thresholds, as shares of half the range; the first is that of the drive itself.
const THRESHOLDS: [f64; 6] = [0.0, 0.08, 0.2, 0.35, 0.55, 0.75];

/// Exponents of thresholds that grow, and their growth at the median rate.
const EXPONENTS: [f64; 3] = [0.15, 0.4, 1.0];
const GROWTH: f64 = 0.3;

/// Another base, and plays that change with the rate.
pub(crate) struct RatedBasis<'a> {
    base: &'a dyn Basis,
    /// Logarithms of rates, rising.
    knots: Vec<f64>,
    thresholds: Vec<f64>,
    /// Sample period of each segment \[s\].
    periods: Vec<f64>,
    /// Median rate \[V/s\], and the time over which thresholds that grow feel it \[s\].
    median: f64,
    felt_over: f64,
    /// Whether columns fall where the plays rise.
    falls: bool,
}

impl<'a> RatedBasis<'a> {
    /// Around a base; none where the drive has one rate only. Thresholds that grow feel the rate over a time \[s\].
    pub(crate) fn around(base: &'a dyn Basis, samples: &Samples, felt_over: f64) -> Option<Self> {
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
        let median = moving.get(moving.len() / 2).copied()?;
        let falls = samples.falls;
        (knots.len() > 1).then_some(Self { base, knots, thresholds, periods, median, felt_over, falls })
    }

    /// Columns of the hats, and of thresholds that grow: the first threshold is zero, which does not.
    fn counts(&self) -> (usize, usize) {
        ((self.knots.len() - 1) * self.thresholds.len(), EXPONENTS.len() * (self.thresholds.len() - 1))
    }

    /// What each play adds whose threshold grows with this exponent; nothing where a stage cannot be built.
    fn grown(&self, exponent: f64, drive: &[f64], segments: &[Range<usize>]) -> Vec<Vec<f64>> {
        let thresholds = &self.thresholds[1..];
        let widening = WideningParams {
            growth: GROWTH,
            exponent,
            reference_rate: self.median,
            seconds: self.felt_over,
            thresholds,
            weights: &[1.0; MAX_WIDENING][..thresholds.len()],
        };
        let stages: Vec<Option<Widening<f64>>> =
            self.periods.iter().map(|period| widening.build(&Sampling { period: *period }).ok()).collect();
        let stage = |i: usize| stages.get(i).and_then(Option::as_ref);
        widened::columns(thresholds.len(), stage, drive, segments, &[], self.falls)
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
        let hats = own + self.counts().0;
        for column in of.start.max(own)..of.end.min(hats) {
            let (knot, threshold) = ((column - own) / self.thresholds.len(), (column - own) % self.thresholds.len());
            let hat = self.hat(knot + 1, &rates);
            columns.push(plays[threshold].iter().zip(hat).map(|(p, hat)| p * hat).collect());
        }
        let wanted = of.start.max(hats)..of.end.max(hats);
        let plays = self.thresholds.len() - 1;
        for (i, exponent) in EXPONENTS.into_iter().enumerate() {
            let here = hats + i * plays..hats + (i + 1) * plays;
            let (from, to) = (wanted.start.max(here.start), wanted.end.min(here.end));
            if from < to {
                let grown = self.grown(exponent, drive, segments);
                columns.extend(grown.into_iter().take(to - here.start).skip(from - here.start));
            }
        }
        columns
    }

    fn may_widen(&self) -> bool {
        self.base.may_widen()
    }

    fn drags(&self) -> bool {
        self.base.drags()
    }

    fn is_odd(&self) -> bool {
        self.base.is_odd()
    }

    fn bounds(&self) -> Vec<Bounds> {
        let mut bounds = self.base.bounds();
        let (hats, grown) = self.counts();
        bounds.resize(bounds.len() + hats + grown, Bounds::FREE);
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

#[cfg(test)]
mod tests {
    use hyst_core::play;

    use super::*;
    use crate::base::PiBasis;
    use crate::criteria::DOMINANT_SHARE;
    use crate::lsq::Blocks;
    use crate::nested::{Hypothesis, Problem};

    /// Thresholds that grow with the logarithm of the rate as it is felt over 5 ms, which is no power of it.
    #[test]
    fn it_takes_a_law_of_the_rate_that_has_no_name() {
        let drive = |t: f64| 50.0 + 45.0 * (5.0 * t * (1.0 + 0.8 * t)).sin() * (0.7 + 0.3 * (1.7 * t).cos());
        let input: Vec<f64> = (0..8000).map(|k| drive(1e-3 * f64::from(k))).collect();
        let (mut rate, mut last, mut plays) = (0.0, input[0], [0.0; 12]);
        let output = input.iter().map(|u| {
            let wider = 1.0 + 0.1 * (1.0_f64 + rate / 30.0).ln();
            plays.iter_mut().zip(1..).for_each(|(p, i)| *p = play(*p, *u, 3.4 * f64::from(i) * wider));
            rate += 0.18 * ((u - last).abs() / 1e-3 - rate);
            last = *u;
            0.1 * u + 0.01 * plays.iter().sum::<f64>()
        });
        let output: Vec<f64> = output.collect();
        let samples = Samples::of_columns(1e-3, input, output);
        let base = PiBasis::for_samples(&samples);
        let rated = RatedBasis::around(&base, &samples, 5e-3).unwrap();
        let blocks = Blocks::new(&samples, 40, 4000);
        let left = |basis: &dyn Basis| {
            Problem::new(&samples, basis, &blocks, false).fit(&Hypothesis::default()).unwrap().unwrap().rmse()
        };
        let (without, with) = (left(&base), left(&rated));
        assert!(1.0 - (with / without).powi(2) > DOMINANT_SHARE, "{with} {without}");
        // However many columns are made at a time.
        let all = rated.columns(0..rated.len(), &samples.input, &samples.segments, &Drag::NONE);
        for (at, column) in all.iter().enumerate() {
            assert_eq!(rated.columns(at..at + 1, &samples.input, &samples.segments, &Drag::NONE)[0], *column);
        }
    }
}
