//! The Preisach operator as columns: one per cell of the triangle, and one per interval of the virgin strip.

use std::ops::Range;

use hyst_core::{Build, Env, Everett, Grid, PreisachParams, Stage, preisach_cell};
use nalgebra::DMatrix;

use super::{Basis, Drag, with_sign};
use crate::Samples;
use crate::lsq::Bounds;
use crate::model::capacity::NODES;

/// Minimum reversible slope of a diagonal cell, as a share of the mean gain.
const MIN_SLOPE_SHARE: f64 = 0.05;
/// Maximum of a cell of the strip, in mean cells of the whole stroke: a first rise is steeper, but does not jump.
const MAX_STRIP_CELL: f64 = 2.0;
/// Margin of the grid around the record's input, as a share of its swing.
const MARGIN: f64 = 0.02;
/// Weight of the differences between neighbouring cells, relative to the record.
const SMOOTHNESS: f64 = 3e-6;

/// A grid over the record's input.
#[derive(Clone, Debug)]
pub(crate) struct PreisachBasis {
    pub(crate) grid: Grid,
    pub(crate) rest: f64,
    pub(crate) floor: f64,
    /// Whether the output falls while the operator rises: weights stay positive, columns change their sign.
    pub(crate) falls: bool,
}

impl PreisachBasis {
    /// Returns a grid of `cells` cells over the record's input with a small margin. Rest is 0 V, or the end of the
    /// range closest to it.
    pub(crate) fn for_samples(samples: &Samples, cells: usize) -> Self {
        let (low, high) = samples.input_range();
        let margin = MARGIN * (high - low);
        // A device that is driven to one side only rests on the edge of the triangle, even if an offset moves the
        // measured drive past 0 V.
        let near_zero = |edge: f64| edge.abs() <= 0.2 * (high - low);
        let one_sided_up = near_zero(low) && low >= -margin;
        let one_sided_down = !one_sided_up && near_zero(high) && high <= margin;
        let (low, high) = match (one_sided_up, one_sided_down) {
            (true, _) => (low.min(0.0), high + margin),
            (_, true) => (low - margin, high.max(0.0)),
            _ => (low - margin, high + margin),
        };
        let rest = if one_sided_up {
            low
        } else if one_sided_down {
            high
        } else {
            0.0f64.clamp(low, high)
        };
        let gain = samples.output_span() / (high - low).max(f64::MIN_POSITIVE);
        let width = (high - low) / cells as f64;
        Self { grid: Grid { low, high, cells }, rest, floor: MIN_SLOPE_SHARE * gain * width, falls: samples.falls }
    }

    fn triangle(&self) -> usize {
        self.grid.cells * (self.grid.cells + 1) / 2
    }

    /// Returns whether there are relays that only the first rise from rest switches.
    fn has_strip(&self) -> bool {
        self.rest <= self.grid.low
    }

    /// Returns the operator with these weights.
    pub(crate) fn spec(&self, weights: &[f64]) -> PreisachParams<Vec<f64>> {
        let (density, once) = weights.split_at(self.triangle());
        let once = if self.has_strip() { once.to_vec() } else { vec![0.0; self.grid.cells] };
        PreisachParams {
            low: self.grid.low,
            high: self.grid.high,
            cells: self.grid.cells,
            rest: self.rest,
            density: density.to_vec(),
            once,
        }
    }

    /// Adds `sign` times the fraction of every cell between β and α to the columns `of` of a row.
    fn add_between(&self, row: &mut [f64], of: &Range<usize>, alpha: f64, beta: f64, sign: f64) {
        let width = (self.grid.high - self.grid.low) / self.grid.cells as f64;
        let place = |u: f64| ((u - self.grid.low) / width).clamp(0.0, self.grid.cells as f64);
        let (a, b) = (place(alpha), place(beta));
        let last = self.grid.cells - 1;
        let (top, bottom) = ((a as usize).min(last), (b as usize).min(last));
        let below = |cell: usize| (a - cell as f64).clamp(0.0, 1.0);
        let above = |cell: usize| (cell as f64 + 1.0 - b).clamp(0.0, 1.0);
        for i in bottom..=top {
            let rows = sign * below(i);
            // The cells (i, 0) to (i, i) are consecutive.
            let first = preisach_cell(i, 0);
            let inside = of.start.max(first + bottom)..of.end.min(first + i);
            for c in inside {
                row[c - of.start] += rows * above(c - first);
            }
            let diagonal = first + i;
            if of.contains(&diagonal) {
                row[diagonal - of.start] += sign * (below(i) + above(i) - 1.0).max(0.0);
            }
        }
    }

    /// Adds the virgin curve at `u` to the columns `of` of a row.
    fn add_virgin(&self, row: &mut [f64], of: &Range<usize>, u: f64) {
        self.add_between(row, of, u, self.grid.low, 1.0);
        if self.has_strip() {
            let width = (self.grid.high - self.grid.low) / self.grid.cells as f64;
            let a = (u - self.grid.low) / width;
            for c in of.start.max(self.triangle())..of.end {
                row[c - of.start] += (a - (c - self.triangle()) as f64).clamp(0.0, 1.0);
            }
        }
    }

    /// Returns the columns with the indices `of` in these rows, which ascend.
    fn some(
        &self,
        of: &Range<usize>,
        drive: &[f64],
        segments: &[Range<usize>],
        rows: impl ExactSizeIterator<Item = usize>,
    ) -> Vec<Vec<f64>> {
        let n = of.len();
        let mut columns = vec![vec![0.0; rows.len()]; n];
        let mut rows = rows.enumerate().peekable();
        // The operator itself, with an empty map, tracks the memory, so that the same wiping-out rule applies
        // everywhere.
        let Ok(map) = Everett::<f64, NODES>::new(self.grid, self.rest, |_, _| 0.0, |_| 0.0) else {
            return columns;
        };
        let map = Box::new(map);
        let env = Env::default();
        let mut state = map.state();
        for segment in segments {
            // Rows at the reversals in memory, each computed from the previous one.
            let mut levels: Vec<(f64, Vec<f64>)> = Vec::new();
            let mut at_rest: Option<Vec<f64>> = None;
            let mut row_now = |memory: &[f64], now: f64| -> Vec<f64> {
                let same = levels.iter().zip(memory).take_while(|((u, _), m)| u == *m).count();
                levels.truncate(same);
                let branch = |levels: &[(f64, Vec<f64>)], to: f64| match levels.last() {
                    None => {
                        let mut row = vec![0.0; n];
                        self.add_virgin(&mut row, of, to);
                        row
                    }
                    Some((from, row)) => {
                        let mut row = row.clone();
                        if levels.len() % 2 == 1 {
                            self.add_between(&mut row, of, *from, to, -1.0);
                        } else {
                            self.add_between(&mut row, of, to, *from, 1.0);
                        }
                        row
                    }
                };
                for m in &memory[same..] {
                    let row = branch(&levels, *m);
                    levels.push((*m, row));
                }
                branch(&levels, now)
            };
            for k in segment.clone() {
                if k == segment.start {
                    map.reset(&mut state, &env, self.rest);
                    at_rest = Some(row_now(state.memory().in_force(), self.rest));
                }
                map.step(&mut state, &env, drive[k]);
                let Some((place, _)) = rows.next_if(|(_, row)| *row == k) else { continue };
                let row = row_now(state.memory().in_force(), drive[k]);
                for (c, (x, zero)) in columns.iter_mut().zip(row.iter().zip(at_rest.as_deref().unwrap_or_default())) {
                    c[place] = x - zero;
                }
            }
        }
        columns
    }
}

impl Basis for PreisachBasis {
    fn columns(&self, of: Range<usize>, drive: &[f64], segments: &[Range<usize>], _drag: &Drag) -> Vec<Vec<f64>> {
        with_sign(self.falls, self.some(&of, drive, segments, 0..drive.len()))
    }

    /// Only these rows are computed; the memory follows every row.
    fn columns_at(
        &self,
        of: Range<usize>,
        drive: &[f64],
        segments: &[Range<usize>],
        _drag: &Drag,
        rows: &[usize],
    ) -> Vec<Vec<f64>> {
        with_sign(self.falls, self.some(&of, drive, segments, rows.iter().copied()))
    }

    fn together(&self) -> usize {
        64
    }

    /// Evaluates the operator itself: its map holds all columns at once.
    fn combined(&self, weights: &[f64], drive: &[f64], segments: &[Range<usize>], _drag: &Drag) -> Option<Vec<f64>> {
        let map: Box<Everett<f64, NODES>> = Box::new(self.spec(weights).build(&()).ok()?);
        let env = Env::default();
        let mut state = map.state();
        let mut out = Vec::with_capacity(drive.len());
        for segment in segments {
            let zero = map.reset(&mut state, &env, self.rest);
            out.extend(drive[segment.clone()].iter().map(|u| map.step(&mut state, &env, *u) - zero));
        }
        Some(with_sign(self.falls, vec![out]).swap_remove(0))
    }

    fn drags(&self) -> bool {
        false
    }

    fn bounds(&self) -> Vec<Bounds> {
        let mut bounds = vec![Bounds::above(0.0); self.triangle()];
        if self.has_strip() {
            // The minimum is a share of the same mean cell.
            let steepest = MAX_STRIP_CELL * self.floor / MIN_SLOPE_SHARE;
            bounds.extend(std::iter::repeat_n(Bounds { lower: 0.0, upper: steepest }, self.grid.cells));
        }
        for i in 0..self.grid.cells {
            bounds[preisach_cell(i, i)] = Bounds::above(self.floor);
        }
        bounds
    }

    /// Returns a smoothness penalty: neighbouring cells inside the triangle, on its diagonal and in the strip differ
    /// little. The record overrules it; cells that it never visits follow their neighbours.
    fn penalty(&self, level: f64) -> Option<DMatrix<f64>> {
        let n = self.len();
        let weight = SMOOTHNESS * level;
        let mut p = DMatrix::from_diagonal_element(n, n, 1e-3 * weight);
        let mut tie = |i: usize, j: usize| {
            p[(i, i)] += weight;
            p[(j, j)] += weight;
            p[(i, j)] -= weight;
            p[(j, i)] -= weight;
        };
        for i in 1..self.grid.cells {
            tie(preisach_cell(i, i), preisach_cell(i - 1, i - 1));
            for j in 0..i {
                if i - 1 > j {
                    tie(preisach_cell(i, j), preisach_cell(i - 1, j));
                }
                if j > 0 {
                    tie(preisach_cell(i, j), preisach_cell(i, j - 1));
                }
            }
            if self.has_strip() {
                tie(self.triangle() + i, self.triangle() + i - 1);
            }
        }
        Some(p)
    }
}
