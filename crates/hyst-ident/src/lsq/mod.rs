//! Least squares by normal equations, for the whole record and for each block; and the closest values in a given order.

mod blocks;
mod gram;
mod ordered;
mod quadratic;

pub(crate) use blocks::{BLOCKS, Blocks, ROWS, folds_interleaved};
pub(crate) use gram::{Bordered, Gram, Share};
pub(crate) use ordered::{Order, nearest_ordered};
pub(crate) use quadratic::{Bounds, held, solve, solve_near};
