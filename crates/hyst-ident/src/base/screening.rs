//! A rich base for the search for effects.
//!
//! Every Preisach operator is `∫ ψ_r(play_r(u)) dr` with one curve ψ_r per threshold; a
//! Prandtl-Ishlinskii operator is the case of straight lines. Here ψ_r is a polynomial of degree 3:
//! enough that what is left of a fit is not the base's own shape, which would otherwise be taken for
//! an effect. An operator that is kept as it is stands beside them: it may ring, lag or follow the temperature by itself.

use std::ops::Range;

use nalgebra::DMatrix;

use super::pi::plays;
use super::{Basis, Drag, FixedBasis, PiBasis};
use crate::Samples;
use crate::lsq::Bounds;

/// Plays with quadratic and cubic curves.
#[derive(Clone, Debug)]
pub(crate) struct ScreeningBasis {
    linear: PiBasis,
    curved: Vec<f64>,
    middle: f64,
    half: f64,
    drags: bool,
    kept: Option<Box<FixedBasis>>,
}

impl ScreeningBasis {
    /// For the input range of a record; with drag only where the base that is extended in the end has one too, and with that base
    /// if it is kept as it is.
    pub(crate) fn for_samples(samples: &Samples, drags: bool, kept: Option<Box<FixedBasis>>) -> Self {
        let linear = PiBasis::for_samples(samples);
        let (low, high) = samples.input_range();
        // The identity (r = 0) and every second play.
        let curved = std::iter::once(0.0).chain(linear.thresholds.iter().copied().skip(1).step_by(2)).collect();
        Self { linear, curved, middle: 0.5 * (low + high), half: 0.5 * (high - low), drags, kept }
    }
}

impl Basis for ScreeningBasis {
    fn columns(&self, drive: &[f64], segments: &[Range<usize>], drag: &Drag, each: &mut dyn FnMut(usize, &mut [f64])) {
        self.linear.columns(drive, segments, drag, each);
        let scale = 1.0 / self.half;
        let x0 = -self.middle * scale;
        let cubic = |x: f64| x * (x * x - 0.6);
        let (square0, cubic0) = (x0 * x0, cubic(x0));
        for (i, r) in self.curved.iter().enumerate() {
            let p = if *r == 0.0 { drive.to_vec() } else { plays(drive, segments, *r, drag) };
            let x = |p: &f64| (p - self.middle) * scale;
            let first = self.linear.len() + 2 * i;
            each(first, &mut p.iter().map(|p| self.half * (x(p) * x(p) - square0)).collect::<Vec<_>>());
            each(first + 1, &mut p.iter().map(|p| self.half * (cubic(x(p)) - cubic0)).collect::<Vec<_>>());
        }
        if let Some(kept) = &self.kept {
            // In volts like the others, whatever its unit: one penalty is for all.
            let size = |column: &[f64]| column.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
            kept.columns(drive, segments, drag, &mut |_, column| {
                let scale = size(drive) / size(column);
                column.iter_mut().filter(|_| scale.is_finite()).for_each(|y| *y *= scale);
                each(self.linear.len() + 2 * self.curved.len(), column);
            });
        }
    }

    fn drags(&self) -> bool {
        self.drags
    }

    fn bounds(&self) -> Vec<Bounds> {
        vec![Bounds::FREE; self.linear.len() + 2 * self.curved.len() + usize::from(self.kept.is_some())]
    }

    fn penalty(&self, level: f64) -> Option<DMatrix<f64>> {
        let n = self.len();
        Some(DMatrix::from_diagonal_element(n, n, 1e-8 * level))
    }
}
