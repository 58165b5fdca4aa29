//! Least squares by normal equations, of the whole record and of each of its blocks, and the nearest values in an order.

mod gram;
mod ordered;
mod quadratic;

pub(crate) use gram::{Blocks, Bordered, Gram, Share};
pub(crate) use ordered::{Order, nearest_ordered};
pub(crate) use quadratic::{Bounds, held, solve, solve_near};
