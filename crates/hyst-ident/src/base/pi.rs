//! The Prandtl-Ishlinskii operator as columns: the identity and its plays.

use std::ops::Range;

use hyst_core::play;
use nalgebra::DMatrix;

use super::Basis;
use crate::Samples;
use crate::lsq::Bounds;

/// Plays whose loops lie inside the record's swing.
const LOOPS: usize = 15;
/// Plays that only the first rise from virgin memory reaches.
const VIRGIN: usize = 5;
/// p₀ is at least this share of the mean gain: the inverse then amplifies by 20 at most.
const FLOOR: f64 = 0.05;

/// Thresholds and the floor of p₀.
#[derive(Clone, Debug)]
pub(crate) struct PiBasis {
    pub(crate) thresholds: Vec<f64>,
    pub(crate) floor: f64,
}

impl PiBasis {
    /// Thresholds spaced evenly over what the record's input can move: loops reach half its swing,
    /// the first rise from rest its largest magnitude.
    pub(crate) fn for_samples(samples: &Samples) -> Self {
        let (low, high) = samples.input_range();
        let (half, reach) = ((high - low) / 2.0, low.abs().max(high.abs()));
        let mut thresholds: Vec<f64> = (1..=LOOPS).map(|i| half * i as f64 / (LOOPS + 1) as f64).collect();
        // Only segments that start below the record's full swing show the virgin curve.
        let starts_at_rest = samples.segments.iter().any(|s| samples.input[s.start].abs() < 0.1 * reach);
        if starts_at_rest && reach > 1.05 * half {
            thresholds.extend((0..VIRGIN).map(|i| half + (reach - half) * i as f64 / VIRGIN as f64));
        }
        let gain = samples.output_span() / (high - low).max(f64::MIN_POSITIVE);
        Self { thresholds, floor: FLOOR * gain }
    }
}

impl Basis for PiBasis {
    fn columns(&self, drive: &[f64], segments: &[Range<usize>]) -> Vec<Vec<f64>> {
        let mut columns = vec![drive.to_vec()];
        columns.extend(self.thresholds.iter().map(|r| plays(drive, segments, *r)));
        columns
    }

    fn bounds(&self) -> Vec<Bounds> {
        let mut bounds = vec![Bounds::above(0.0); self.thresholds.len() + 1];
        bounds[0] = Bounds::above(self.floor);
        bounds
    }

    fn penalty(&self, level: f64) -> Option<DMatrix<f64>> {
        // Thresholds that the record hardly tells apart share their weight instead of alternating.
        let n = self.len();
        Some(DMatrix::from_diagonal_element(n, n, 1e-9 * level))
    }
}

/// The play operator over a drive, virgin at each segment's start.
pub(crate) fn plays(drive: &[f64], segments: &[Range<usize>], r: f64) -> Vec<f64> {
    let mut out = vec![0.0; drive.len()];
    for segment in segments {
        let mut p = 0.0;
        for k in segment.clone() {
            p = play(p, drive[k], r);
            out[k] = p;
        }
    }
    out
}
