//! Least squares by normal equations that are kept per block of the record.

mod gram;
mod quadratic;

pub(crate) use gram::{Blocks, Gram};
pub(crate) use quadratic::{Bounds, solve};
