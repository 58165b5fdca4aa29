//! The Prandtl-Ishlinskii operator as columns: the identity and its plays.

use std::ops::Range;

use hyst_core::play;
use nalgebra::DMatrix;

use super::{Basis, Drag};
use crate::Samples;
use crate::fit;
use crate::identify::choice::{self, Bank, CANDIDATES};
use crate::lsq::Bounds;

/// Plays whose loops lie inside the record's swing.
const LOOPS: usize = 15;
/// Plays that only the first rise from virgin memory reaches.
const VIRGIN: usize = 5;
/// p₀ is at least this share of the mean gain: the inverse then amplifies by 20 at most.
const FLOOR: f64 = 0.05;
/// Step of the difference quotients along a threshold, as a share of the input.
const STEP: f64 = 1e-6;

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
        let gain = samples.output_span() / (high - low).max(f64::MIN_POSITIVE);
        Self { thresholds: even(samples, LOOPS, VIRGIN), floor: FLOOR * gain }
    }

    /// At most `most` thresholds where the record calls for them; without a number those, if they predict parts of the record that
    /// are left out clearly better than these do and are no more. `None` if there are none. The output shows a play as what `through`
    /// makes of it.
    pub(crate) fn chosen(
        &self,
        samples: &Samples,
        drag: &Drag,
        through: &(dyn Fn(Vec<f64>) -> Vec<f64> + Sync),
        most: Option<usize>,
    ) -> Option<Self> {
        let element = |r: f64| through(plays(&samples.input, &samples.segments, r, drag));
        let bank = |rows| {
            let identity = (through(samples.input.clone()), Bounds::above(self.floor));
            Bank::new(samples, vec![identity], even(samples, CANDIDATES, CANDIDATES / 4), &element, rows)
        };
        let quick = bank(choice::ROWS);
        let thresholds = most.map_or_else(|| quick.better_than(&self.thresholds), |most| quick.at_most(most))?;
        let thresholds = bank(fit::ROWS).from(thresholds)?;
        Some(Self { thresholds, ..*self })
    }
}

/// Even thresholds: `loops` inside the swing of a record and, where it shows a first rise from rest beyond that, `virgin` there.
fn even(samples: &Samples, loops: usize, virgin: usize) -> Vec<f64> {
    let (low, high) = samples.input_range();
    let (half, reach) = ((high - low) / 2.0, low.abs().max(high.abs()));
    let mut thresholds: Vec<f64> = (1..=loops).map(|i| half * i as f64 / (loops + 1) as f64).collect();
    // Only segments that start below the record's full swing show the virgin curve.
    let starts_at_rest = samples.segments.iter().any(|s| samples.input[s.start].abs() < 0.1 * reach);
    if starts_at_rest && reach > 1.05 * half {
        thresholds.extend((0..virgin).map(|i| half + (reach - half) * i as f64 / virgin as f64));
    }
    thresholds
}

impl Basis for PiBasis {
    fn columns(&self, drive: &[f64], segments: &[Range<usize>], drag: &Drag, each: &mut dyn FnMut(usize, &mut [f64])) {
        each(0, &mut drive.to_vec());
        for (i, r) in self.thresholds.iter().enumerate() {
            each(i + 1, &mut plays(drive, segments, *r, drag));
        }
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

/// Plays with weights, and how their output changes where their thresholds do: the columns of a fit of both around an optimum.
pub(crate) struct SlidingPlays<'a> {
    pub(crate) plays: &'a PiBasis,
    /// p₀, then the weights.
    pub(crate) weights: &'a [f64],
}

impl Basis for SlidingPlays<'_> {
    fn columns(&self, drive: &[f64], segments: &[Range<usize>], drag: &Drag, each: &mut dyn FnMut(usize, &mut [f64])) {
        let step = STEP * drive.iter().fold(0.0, |m: f64, u| m.max(u.abs()));
        let slope = |(r, w): (&f64, &f64)| -> Vec<f64> {
            let (up, down) = (plays(drive, segments, r + step, drag), plays(drive, segments, r - step, drag));
            up.iter().zip(down).map(|(up, down)| 0.5 * w * (up - down) / step).collect()
        };
        self.plays.columns(drive, segments, drag, each);
        for (i, play) in self.plays.thresholds.iter().zip(&self.weights[1..]).enumerate() {
            each(self.plays.len() + i, &mut slope(play));
        }
    }

    fn bounds(&self) -> Vec<Bounds> {
        let mut bounds = self.plays.bounds();
        bounds.extend(vec![Bounds::FREE; self.plays.thresholds.len()]);
        bounds
    }

    fn penalty(&self, level: f64) -> Option<DMatrix<f64>> {
        let n = self.len();
        Some(DMatrix::from_diagonal_element(n, n, 1e-9 * level))
    }
}

/// The play operator over a drive, virgin at each segment's start.
pub(crate) fn play_column(drive: &[f64], segments: &[Range<usize>], r: f64) -> Vec<f64> {
    plays(drive, segments, r, &Drag::NONE)
}

/// The play operator with drag over a drive, virgin at each segment's start.
pub(super) fn plays(drive: &[f64], segments: &[Range<usize>], r: f64, drag: &Drag) -> Vec<f64> {
    let mut out = vec![0.0; drive.len()];
    for segment in segments {
        let mut p = 0.0;
        for k in segment.clone() {
            let to = play(p, drive[k], r);
            // The device has rested at its first input.
            p = if k == segment.start { to } else { drag.towards(p, to) };
            out[k] = p;
        }
    }
    out
}
