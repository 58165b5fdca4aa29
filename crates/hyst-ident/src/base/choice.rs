//! Elements chosen by the record: thresholds of play operators, widths of slipping elements.
//!
//! Non-negative weights over many even candidates are sparse, so one convex problem shows roughly where the elements
//! are. Then the two neighbours whose merging costs least are merged until there are few enough. Finally the elements
//! slide to the best fit: Gauss-Newton in places and weights together, as in the sliding Frank-Wolfe algorithm
//! (Denoyelle et al. 2019).

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::SIDE_BY_SIDE;
use crate::Samples;
use crate::lsq::{Blocks, Bounds, Gram, folds_interleaved, solve};
use crate::statistics::range;

/// Minimum motion of a candidate, as a share of the largest one.
const MIN_MOTION_SHARE: f64 = 0.02;
/// Number of candidates over the range in which elements can be separated.
pub(crate) const CANDIDATES: usize = 64;
/// Maximum number of rows of a choice; the last slide uses more.
pub(crate) const ROWS: usize = 12_000;
/// Number of pieces of a record, and number of folds, for the error on left-out parts.
const BLOCKS: usize = 64;
const FOLDS: usize = 8;
/// Weights below this share of their sum count as zero.
const MIN_WEIGHT_SHARE: f64 = 1e-9;
/// Minimum place, as a share of the first candidate.
const MIN_PLACE_SHARE: f64 = 0.05;
/// Step of the difference quotients along a place, as a share of the range.
const STEP: f64 = 1e-6;
/// Maximum number of steps of a slide, and the relative fall of the squares at which it ends.
const MAX_SLIDES: usize = 12;
const SETTLED: f64 = 1e-4;
/// Maximum ratio of the RMS on left-out parts to that of other places, at which places are clearly better.
const MAX_RMS_RATIO: f64 = 0.8;
/// Maximum ratio of the RMS at which fewer places are as good.
const RMS_TOLERANCE: f64 = 1.01;

/// Elements of one kind that differ in one number, their place: the threshold of a play operator, the width of a
/// backlash or spring.
pub(crate) struct Bank<'a> {
    samples: &'a Samples,
    /// Outputs of elements at given places over all rows.
    elements: &'a Elements<'a>,
    /// Columns of every model, over the rows that count: those of the caller, then one zero for each file.
    always: Vec<Vec<f64>>,
    bounds: Vec<Bounds>,
    candidates: Vec<f64>,
    rows: Vec<usize>,
    /// Indices into `rows` of each block.
    blocks: Vec<Range<usize>>,
    folds: Vec<Vec<usize>>,
}

/// Outputs of elements at given places over all rows of a record.
pub(crate) type Elements<'a> = dyn Fn(&[f64]) -> Vec<Vec<f64>> + Sync + 'a;

/// Elements at their places.
#[derive(Clone)]
struct Placed {
    places: Vec<f64>,
    /// Normal equations: columns of every model, the elements, their derivatives with respect to the place, the output.
    gram: Gram,
    weights: Vec<f64>,
    squares: f64,
}

impl<'a> Bank<'a> {
    /// Builds a bank over about `rows` of the rows that count. `always` are columns over all rows that every such model
    /// has, with their bounds. Each file has its own zero, which does not affect the loops.
    pub(crate) fn new(
        samples: &'a Samples,
        always: Vec<(Vec<f64>, Bounds)>,
        candidates: Vec<f64>,
        elements: &'a Elements<'a>,
        rows: usize,
    ) -> Self {
        let cut = Blocks::new(samples, BLOCKS, rows);
        let (mut rows, mut blocks) = (Vec::new(), Vec::new());
        for b in 0..cut.rows.len() {
            let from = rows.len();
            rows.extend(cut.used(b, samples));
            blocks.push(from..rows.len());
        }
        let zero = |file: usize| -> Vec<f64> {
            let mut zero = vec![0.0; samples.len()];
            let own = samples.segments.iter().zip(&samples.file_of_segment).filter(|(_, f)| **f == file);
            own.for_each(|(s, _)| zero[s.clone()].fill(1.0));
            zero
        };
        let (mut columns, mut bounds): (Vec<_>, Vec<_>) = always.into_iter().unzip();
        columns.extend((0..samples.files()).map(zero));
        bounds.resize(columns.len(), Bounds::FREE);
        let always = columns.iter().map(|c| rows.iter().map(|k| c[*k]).collect()).collect();
        let folds = folds_interleaved(&cut, FOLDS);
        // A candidate that hardly moves in the rows that count cannot be separated from the sensor's zero.
        let moves = |column: Vec<f64>| {
            let (low, high) = range(column.into_iter());
            high - low
        };
        let moves: Vec<f64> = over(&rows, elements, &candidates).into_par_iter().map(moves).collect();
        let enough = MIN_MOTION_SHARE * moves.iter().fold(0.0, |m: f64, x| m.max(*x));
        let candidates =
            candidates.into_iter().zip(moves).filter(|(_, moves)| *moves > enough).map(|(c, _)| c).collect();
        Self { samples, elements, always, bounds, candidates, rows, blocks, folds }
    }

    /// Returns at most `most` places in increasing order, fewer if fewer suffice; `None` if the equations cannot be
    /// solved.
    pub(crate) fn at_most(&self, most: usize) -> Option<Vec<f64>> {
        let (places, weights) = self.sparse()?;
        Some(self.fewer(places, weights, most)?.places)
    }

    /// Returns places that predict left-out parts of the record clearly better than the `given` ones, and at most as
    /// many. Among such places, returns the fewest that are as good. Returns `None` if there are none.
    pub(crate) fn better_than(&self, given: &[f64]) -> Option<Vec<f64>> {
        let enough = MAX_RMS_RATIO * MAX_RMS_RATIO * self.left_out(given)?;
        let (places, weights) = self.sparse()?;
        let mut best = self.fewer(places, weights, given.len())?;
        let mut least = self.left_out(&best.places)?;
        if least > enough {
            return None;
        }
        while best.places.len() > 1 {
            let fewer = self.fewer(best.places.clone(), best.weights.clone(), best.places.len() - 1)?;
            let squares = self.left_out(&fewer.places)?;
            if squares > RMS_TOLERANCE * RMS_TOLERANCE * least {
                break;
            }
            (best, least) = (fewer, least.min(squares));
        }
        Some(best.places)
    }

    /// Returns the places after a slide from given ones to the best fit.
    pub(crate) fn from(&self, places: Vec<f64>) -> Option<Vec<f64>> {
        Some(self.slid(places)?.places)
    }

    /// Returns Σ residual² of left-out parts of the record, predicted with weights fitted to the other parts.
    fn left_out(&self, places: &[f64]) -> Option<f64> {
        let columns = self.columns(places);
        let of_fold =
            |fold: &Vec<usize>| self.gram(&columns, fold.iter().flat_map(|b| self.blocks[*b].clone()).collect());
        let grams: Vec<Gram> = self.folds.iter().map(of_fold).collect();
        let total = Gram::sum(grams.first()?.matrix.ncols(), grams.iter());
        let error = |own: &Gram| {
            let others = Gram { matrix: &total.matrix - &own.matrix, rows: total.rows - own.rows };
            Some(own.error(&self.solved(&others, places.len())?))
        };
        grams.iter().map(error).sum()
    }

    /// Returns the candidates with a positive weight; two neighbours on the grid are merged into one element.
    fn sparse(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let n = self.candidates.len();
        let z = self.solved(&self.gram_of(&self.columns(&self.candidates)), n)?;
        let weights = self.weights(&z, n);
        let smallest = MIN_WEIGHT_SHARE * weights.iter().sum::<f64>();
        let (mut places, mut kept, mut i) = (Vec::new(), Vec::new(), 0);
        while i < n {
            let pair = if i + 1 < n && weights[i] > smallest && weights[i + 1] > smallest { 2 } else { 1 };
            let (place, weight) = middle(&self.candidates[i..i + pair], &weights[i..i + pair]);
            if weight > smallest {
                places.push(place);
                kept.push(weight);
            }
            i += pair;
        }
        Some((places, kept))
    }

    /// Removes elements until at most `most` remain, and then further ones as long as the gain of an element with its
    /// place and weight is within the noise (Schwarz's criterion). The remaining elements slide.
    fn fewer(&self, mut places: Vec<f64>, mut weights: Vec<f64>, most: usize) -> Option<Placed> {
        while places.len() > most {
            (places, weights) = self.one_less(&places, &weights)?;
        }
        let rows = self.rows.len() as f64;
        let mut here = self.slid(places)?;
        while here.places.len() > 1 {
            let less = self.slid(self.one_less(&here.places, &here.weights)?.0)?;
            if less.squares > here.squares * (1.0 + 2.0 * rows.ln() / rows) {
                break;
            }
            here = less;
        }
        Some(here)
    }

    /// Returns places and weights with one element merged with its neighbour or left out, whichever costs least.
    fn one_less(&self, places: &[f64], weights: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let n = places.len();
        let between: Vec<f64> = (1..n).map(|i| middle(&places[i - 1..=i], &weights[i - 1..=i]).0).collect();
        let all = [places, &between].concat();
        let gram = self.gram_of(&self.columns(&all));
        let without = |i: usize| (0..n).filter(|j| *j != i).collect::<Vec<_>>();
        let merging = |i: usize| (0..n).map(|j| if j == i { n + i } else { j }).filter(|j| *j != i + 1).collect();
        let trials: Vec<Vec<usize>> = (0..n).map(without).chain((0..n - 1).map(merging)).collect();
        let tried = |trial: &Vec<usize>| {
            let own = self.only(&gram, trial);
            let z = self.solved(&own, trial.len())?;
            Some((own.error(&z), self.weights(&z, trial.len())))
        };
        let tried: Vec<Option<_>> = trials.par_iter().map(tried).collect();
        let done = trials.iter().zip(tried).filter_map(|(trial, t)| t.map(|(squares, w)| (squares, trial, w)));
        let (_, kept, weights) = done.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((kept.iter().map(|i| all[*i]).collect(), weights))
    }

    /// Slides the elements to the best fit and drops those that end without weight.
    fn slid(&self, places: Vec<f64>) -> Option<Placed> {
        let mut here = self.at(places)?;
        for _ in 0..MAX_SLIDES {
            let Some(step) = self.step(&here) else { break };
            let moved = |share: f64| {
                let to: Vec<f64> = here.places.iter().zip(step.iter()).map(|(place, d)| place + share * d).collect();
                self.at(to).filter(|there| there.squares < here.squares)
            };
            let Some(there) = [1.0, 0.5, 0.25, 0.1].into_iter().find_map(moved) else { break };
            let fall = here.squares - there.squares;
            let settled = fall <= SETTLED * here.squares;
            here = there;
            if settled {
                break;
            }
        }
        let smallest = MIN_WEIGHT_SHARE * here.weights.iter().sum::<f64>();
        if here.weights.iter().all(|w| *w > smallest) {
            return Some(here);
        }
        let kept = here.places.iter().zip(&here.weights).filter(|(_, w)| **w > smallest);
        self.at(kept.map(|(place, _)| *place).collect())
    }

    /// Returns the step of each place: least squares in weights and steps, at most half of the distance to the next
    /// place.
    fn step(&self, here: &Placed) -> Option<Vec<f64>> {
        let (m, n) = (self.always.len(), here.places.len());
        let mut gram = here.gram.clone();
        for (i, w) in here.weights.iter().enumerate() {
            gram.matrix.column_mut(m + n + i).scale_mut(*w);
            gram.matrix.row_mut(m + n + i).scale_mut(*w);
        }
        let (low, high) = self.limits();
        let mut bounds = self.bounds.clone();
        bounds.resize(m + n, Bounds::above(0.0));
        bounds.extend((0..n).map(|i| {
            let place = here.places[i];
            let below = i.checked_sub(1).map_or(low, |i| 0.5 * (place + here.places[i]));
            let above = here.places.get(i + 1).map_or(high, |next| 0.5 * (place + next));
            Bounds { lower: (below - place).min(0.0), upper: (above - place).max(0.0) }
        }));
        let z = solve(&gram, None, &bounds)?;
        Some(z.iter().skip(m + n).copied().collect())
    }

    /// Returns the range of places: from a small value to the last candidate.
    fn limits(&self) -> (f64, f64) {
        let (first, last) = range(self.candidates.iter().copied());
        (MIN_PLACE_SHARE * first, last)
    }

    fn at(&self, places: Vec<f64>) -> Option<Placed> {
        let n = places.len();
        let (low, high) = self.limits();
        let step = STEP * (high - low);
        let beside = |sign: f64| self.columns(&places.iter().map(|p| p + sign * step).collect::<Vec<_>>());
        let (up, down) = (beside(1.0), beside(-1.0));
        let slope = |(up, down): (&Vec<f64>, &Vec<f64>)| -> Vec<f64> {
            up.iter().zip(down).map(|(a, b)| 0.5 * (a - b) / step).collect()
        };
        let mut columns = self.columns(&places);
        columns.extend(up.iter().zip(&down).map(slope));
        let gram = self.gram_of(&columns);
        let own = self.only(&gram, &(0..n).collect::<Vec<_>>());
        let z = self.solved(&own, n)?;
        Some(Placed { weights: self.weights(&z, n), squares: own.error(&z), places, gram })
    }

    /// Returns the outputs of elements over the rows that count.
    fn columns(&self, places: &[f64]) -> Vec<Vec<f64>> {
        over(&self.rows, self.elements, places)
    }

    fn gram_of(&self, columns: &[Vec<f64>]) -> Gram {
        self.gram(columns, (0..self.rows.len()).collect())
    }

    /// Returns the normal equations over some of the rows that count.
    fn gram(&self, columns: &[Vec<f64>], rows: Vec<usize>) -> Gram {
        let m = self.always.len();
        let x = DMatrix::from_fn(rows.len(), m + columns.len() + 1, |r, c| {
            let k = rows[r];
            let own = self.always.get(c).or_else(|| columns.get(c - m));
            own.map_or_else(|| self.samples.output[self.rows[k]], |column| column[k])
        });
        Gram::of(&x)
    }

    /// Returns the normal equations with only these elements.
    fn only(&self, gram: &Gram, elements: &[usize]) -> Gram {
        let m = self.always.len();
        let kept: Vec<usize> =
            (0..m).chain(elements.iter().map(|i| m + i)).chain(std::iter::once(gram.unknowns())).collect();
        Gram { matrix: gram.matrix.select_rows(&kept).select_columns(&kept), rows: gram.rows }
    }

    fn solved(&self, gram: &Gram, elements: usize) -> Option<DVector<f64>> {
        let mut bounds = self.bounds.clone();
        bounds.resize(self.always.len() + elements, Bounds::above(0.0));
        solve(gram, None, &bounds)
    }

    fn weights(&self, z: &DVector<f64>, elements: usize) -> Vec<f64> {
        z.iter().skip(self.always.len()).take(elements).copied().collect()
    }
}

/// Returns the outputs of elements at given places over some rows.
fn over(rows: &[usize], elements: &Elements<'_>, places: &[f64]) -> Vec<Vec<f64>> {
    let thinned = |column: Vec<f64>| rows.iter().map(|k| column[*k]).collect();
    let some = |places: &[f64]| elements(places).into_iter().map(thinned).collect::<Vec<Vec<f64>>>();
    let all: Vec<_> = places.par_chunks(SIDE_BY_SIDE).map(some).collect();
    all.into_iter().flatten().collect()
}

/// Returns the weighted mean place of neighbours, and the sum of their weights.
fn middle(places: &[f64], weights: &[f64]) -> (f64, f64) {
    let weight: f64 = weights.iter().sum();
    let moment: f64 = places.iter().zip(weights).map(|(p, w)| p * w).sum();
    let mean = places.iter().sum::<f64>() / places.len() as f64;
    (if weight > 0.0 { moment / weight } else { mean }, weight)
}

#[cfg(test)]
mod tests;
