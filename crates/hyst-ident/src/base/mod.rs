//! Hysteresis bases as columns: each is linear in its weights, `v = Σᵢ wᵢ φᵢ(u)`.

mod drag;
mod fixed;
mod pi;
mod preisach;
mod screening;

pub(crate) use drag::{Drag, DragParams};
pub(crate) use fixed::FixedBasis;
pub(crate) use pi::{PiBasis, SlidingPlays, play_column};
pub(crate) use preisach::PreisachBasis;
pub(crate) use screening::ScreeningBasis;

use std::ops::Range;

use nalgebra::DMatrix;

use crate::lsq::Bounds;

/// A family of operators, linear in their weights.
///
/// Every column is zero for the device at rest at 0 V with virgin memory, so that stages behind it
/// scale the motion and not an arbitrary zero.
pub(crate) trait Basis: Sync {
    /// Gives `each` the number and the values of every column φᵢ over the rows of `drive`, in order, memory reset at the start of
    /// each segment; few of them are in memory at a time, and `each` may change the one that it is given. A base that
    /// [cannot drag](Self::drags) does not look at `drag`.
    fn columns(&self, drive: &[f64], segments: &[Range<usize>], drag: &Drag, each: &mut dyn FnMut(usize, &mut [f64]));
    /// Whether there is a drag: a rate-dependent form of the operator.
    fn drags(&self) -> bool {
        true
    }
    /// Bounds of the weights.
    fn bounds(&self) -> Vec<Bounds>;
    /// What regularises the weights, as a matrix to be added to normal equations whose mean
    /// diagonal (over the columns) is `level`; `None` if nothing has to.
    fn penalty(&self, level: f64) -> Option<DMatrix<f64>>;
    /// Number of columns.
    fn len(&self) -> usize {
        self.bounds().len()
    }
}
