//! The data of a fit: a record, a basis, the rows that count, the bounds and the penalty of the linear unknowns.

use std::borrow::Cow;
use std::sync::OnceLock;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::columns::{BaseColumns, may_be_kept, passes};
use super::{Hypothesis, Layout, SignalPath, initial};
use crate::Samples;
use crate::base::{Basis, Drag, past};
use crate::lsq::{Blocks, Bounds, Gram};
use crate::repetition::only_loop;
use crate::settle;

/// A record, a basis and the division of the rows into blocks.
pub(crate) struct Problem<'a> {
    pub(crate) samples: &'a Samples,
    pub(crate) basis: &'a dyn Basis,
    pub(crate) blocks: &'a Blocks,
    /// The rows of each block that count.
    pub(super) used: Vec<Vec<usize>>,
    /// One zero for each file instead of one for all.
    pub(crate) zero_per_file: bool,
    /// Whether load, temperature (but its gain), drift and tone keep the values of the hypothesis instead of being
    /// solved.
    linear_effects_fixed: bool,
    /// Whether a widening may be tried. Next to an operator without play operators its weights would take up misfit.
    pub(crate) may_widen: bool,
    /// Columns of the basis for the recorded drive, if they fit into memory.
    pub(super) raw: Option<Vec<Vec<f64>>>,
    /// Columns of the basis for the recorded drive in the rows that count, if they fit into memory; computed on first
    /// use.
    used_columns: OnceLock<Vec<Vec<f64>>>,
    /// Number of columns of the basis.
    pub(super) width: usize,
    /// Whether the weight of each column is zero because no row moves it; the start-up windows of segments with
    /// start-up rows do not count.
    resting: Vec<bool>,
    penalty: Option<DMatrix<f64>>,
    /// Frequency of the loop \[Hz\], if the record only repeats one loop.
    pub(crate) only_loop: Option<f64>,
    /// Blocks that the other folds cannot predict; computed on first use.
    pub(super) unpredictable: OnceLock<Vec<bool>>,
}

/// Highest frequency of a harmonic, in sample rates.
const MAX_HARMONIC_FREQUENCY: f64 = 0.475;
/// Weight of the assumption of rest, relative to the rows that show the initial deviations.
const INITIAL_PENALTY: f64 = 1e-3;

impl<'a> Problem<'a> {
    pub(crate) fn new(samples: &'a Samples, basis: &'a dyn Basis, blocks: &'a Blocks, zero_per_file: bool) -> Self {
        let width = basis.len();
        let used: Vec<Vec<usize>> = (0..blocks.rows.len()).map(|b| blocks.used(b, samples).collect()).collect();
        let kept = may_be_kept(samples.len(), width);
        let rows = || used.iter().flatten();
        // The first rise of a segment with start-up rows does not show the weight of an operator that only this rise
        // moves.
        let unknown = basis.is_zero_unless_moved().then(|| settle::unknown_beginnings(samples));
        let rests = |c: &Vec<f64>| {
            unknown.as_ref().is_some_and(|unknown| {
                let mut shown = rows().filter(|k| !unknown[**k]).map(|k| c[*k]);
                shown.next().is_some_and(|first| shown.all(|x| x == first))
            })
        };
        let made: Vec<(f64, Vec<bool>, Vec<Vec<f64>>)> = passes(basis, samples.len())
            .into_par_iter()
            .map(|of| {
                let Samples { input, segments, pasts, .. } = samples;
                let columns = past::columns(basis, of, input, segments, pasts, &Drag::NONE);
                let squares = columns.iter().flat_map(|c| rows().map(|k| c[*k] * c[*k])).sum();
                let resting = columns.iter().map(rests).collect();
                (squares, resting, if kept { columns } else { Vec::new() })
            })
            .collect();
        let squares: f64 = made.iter().map(|(squares, ..)| squares).sum();
        let resting = made.iter().flat_map(|(_, resting, _)| resting).copied().collect();
        let raw = kept.then(|| made.into_iter().flat_map(|(.., columns)| columns).collect());
        let penalty = basis.penalty(squares / width.max(1) as f64);
        let only_loop = only_loop(samples);
        let unpredictable = OnceLock::new();
        Self {
            samples,
            basis,
            blocks,
            used,
            zero_per_file,
            linear_effects_fixed: false,
            may_widen: basis.may_widen(),
            raw,
            used_columns: OnceLock::new(),
            width,
            resting,
            penalty,
            only_loop,
            unpredictable,
        }
    }

    /// Fixes load, temperature (but its gain), drift and tone at the values of the hypothesis. On a coarse base they
    /// would take up its misfit.
    pub(crate) fn with_linear_effects_fixed(self) -> Self {
        Self { linear_effects_fixed: true, ..self }
    }

    /// Allows a widening only if another problem of the same model does.
    pub(crate) fn widening_as(self, other: &Self) -> Self {
        Self { may_widen: other.may_widen, ..self }
    }

    /// Returns the number of zeros of the sensor.
    pub(super) fn zeros(&self) -> usize {
        if self.zero_per_file { self.samples.files() } else { 1 }
    }

    /// Returns the positions of the linear unknowns of a hypothesis.
    pub(super) fn layout(&self, h: &Hypothesis) -> Layout {
        Layout::of(h, self.width, self.zeros(), initial::count(self.samples, h))
    }

    /// Returns the bounds of the linear unknowns.
    pub(super) fn bounds(&self, h: &Hypothesis) -> Vec<Bounds> {
        let mut bounds = self.basis.bounds();
        // Nothing separates the weight of an operator that rests from the sensor's zero.
        let resting = bounds.iter_mut().zip(&self.resting).filter(|(_, rests)| **rests);
        resting.for_each(|(bound, _)| *bound = Bounds::fixed(0.0));
        let layout = self.layout(h);
        bounds.resize(layout.len(), Bounds::FREE);
        // A loop that narrows with rate is another effect.
        bounds[layout.widening.clone()].fill(Bounds::above(0.0));
        // A decreasing curve has no inverse.
        bounds[layout.zones.clone()].fill(Bounds::above(-0.9));
        if h.initial_state {
            let farthest = initial::farthest(self.samples);
            bounds[layout.initial.clone()].fill(Bounds { lower: -farthest, upper: farthest });
        }
        if h.effects.drift.is_some_and(|p| p.seconds > 0.0 && p.per_second == 0.0) {
            // A law that only settles has no slope.
            bounds[layout.drift.start] = Bounds::fixed(0.0);
        }
        if let Some(tone) = &h.effects.interference {
            // Frequencies above half the sample rate would alias.
            for (i, bound) in bounds[layout.tone.clone()].iter_mut().enumerate() {
                let order = 1 + i / 2;
                if order > 1 && order as f64 * tone.hz > MAX_HARMONIC_FREQUENCY / self.samples.period {
                    *bound = Bounds::fixed(0.0);
                }
            }
        }
        if self.linear_effects_fixed {
            let e = &h.effects;
            let load = e.load.iter().map(|p| p.per_newton);
            let drift = e.drift.iter().flat_map(|p| [p.per_second, p.settling]);
            let tone = e.interference.iter().flat_map(|p| {
                [p.phase.cos(), p.phase.sin()].map(|part| p.amplitude * part).into_iter().chain(p.harmonics)
            });
            let held = [
                (layout.load, load.collect::<Vec<f64>>()),
                (layout.expansion, e.temperature.iter().map(|p| p.expansion).collect()),
                (layout.direct, e.temperature.iter().map(|p| p.direct).collect()),
                (layout.drift, drift.collect()),
                (layout.tone, tone.collect()),
            ];
            for (at, values) in held {
                bounds[at].iter_mut().zip(values).for_each(|(b, value)| *b = Bounds::fixed(value));
            }
        }
        bounds
    }

    /// Returns the penalty: that of the basis, one that keeps initial deviations at zero where no row shows them, and
    /// zero for everything else.
    pub(super) fn penalty(&self, h: &Hypothesis, total: &Gram, unknowns: usize) -> DMatrix<f64> {
        let mut p = DMatrix::zeros(unknowns, unknowns);
        if let Some(own) = &self.penalty {
            p.view_mut((0, 0), own.shape()).copy_from(own);
        }
        for c in self.layout(h).initial {
            p[(c, c)] = INITIAL_PENALTY * total.matrix[(c, c)];
        }
        p
    }

    /// Returns the columns of the basis in the rows that count. Those for the recorded drive are kept if they fit into
    /// memory.
    pub(super) fn columns_at_used_rows(&self, h: &Hypothesis, base: &BaseColumns<'_>) -> Cow<'_, [Vec<f64>]> {
        let used: Vec<usize> = self.used.iter().flatten().copied().collect();
        if h.changes_the_base() || !may_be_kept(used.len(), self.width) {
            return Cow::Owned(base.at_rows(&used));
        }
        // Computed outside of the cell, because a thread that waits inside may execute another job that enters here
        // again.
        if self.used_columns.get().is_none() {
            let _ = self.used_columns.set(base.at_rows(&used));
        }
        Cow::Borrowed(self.used_columns.get().map_or(&[], Vec::as_slice))
    }

    /// Returns the columns of the basis for the drive of the hysteresis.
    pub(super) fn columns<'b>(&'b self, path: &SignalPath<'b>, h: &Hypothesis) -> BaseColumns<'b> {
        if let (false, Some(raw)) = (h.changes_the_base(), &self.raw) {
            return BaseColumns::Kept(Cow::Borrowed(raw));
        }
        let made = self.made(path, h);
        if !may_be_kept(self.samples.len(), self.width) {
            return made;
        }
        BaseColumns::Kept(Cow::Owned(made.map(|columns| columns).into_iter().flatten().collect()))
    }

    /// Returns the same columns without keeping them.
    fn made<'b>(&'b self, path: &SignalPath<'b>, h: &Hypothesis) -> BaseColumns<'b> {
        let drag = h.drag.map_or(Drag::NONE, |p| p.over(self.samples));
        let (samples, basis) = (self.samples, self.basis);
        BaseColumns::Made { samples, basis, drive: path.input_side().to_vec(), pasts: path.pasts(), drag }
    }

    /// Returns the output of the operator with these weights, if its columns are not needed otherwise.
    pub(super) fn operator(&self, path: &SignalPath<'_>, h: &Hypothesis, weights: &[f64]) -> Vec<f64> {
        match &self.raw {
            Some(_) if !h.changes_the_base() => self.columns(path, h),
            _ => self.made(path, h),
        }
        .combined(weights, self.samples.len())
    }

    /// Returns the values of `of` in the rows that count, block by block.
    pub(super) fn at_used_rows<T>(&self, of: impl Fn(usize) -> T) -> Vec<T> {
        self.used.iter().flatten().map(|k| of(*k)).collect()
    }

    /// Divides columns over the rows that count into blocks.
    pub(super) fn in_blocks(&self, columns: &[Vec<f64>]) -> impl Iterator<Item = DMatrix<f64>> {
        let mut next = 0;
        self.used.iter().map(move |rows| {
            let first = next;
            next += rows.len();
            DMatrix::from_fn(rows.len(), columns.len(), |k, c| columns[c][first + k])
        })
    }

    /// Returns the same problem over other rows, for the motion of a fit that is already known: nothing is solved
    /// there.
    pub(super) fn in_rows<'b>(&self, samples: &'b Samples, basis: &'b dyn Basis) -> Problem<'b>
    where
        'a: 'b,
    {
        Problem {
            samples,
            basis,
            used: Vec::new(),
            raw: None,
            used_columns: OnceLock::new(),
            resting: Vec::new(),
            penalty: None,
            only_loop: None,
            unpredictable: OnceLock::new(),
            ..*self
        }
    }
}
