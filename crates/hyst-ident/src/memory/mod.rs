//! The drive history before a segment.
//!
//! A model's memory is virgin at the start of a segment. An actuator that was cycled before the record, or that rests
//! away from 0 V, has another memory. A memory that wipes out keeps only the extremes in force (Mayergoyz, Mathematical
//! Models of Hysteresis, 1991), so a few reversals of the drive describe it. They are the initial condition of the
//! record and are estimated from its first rows.

mod candidates;
mod first_rows;
mod histories;
mod recalled;
mod reversals;
#[cfg(test)]
mod tests;

pub(crate) use candidates::Candidates;
pub(crate) use first_rows::{away, level, standing_out, standing_out_where_followed};
pub(crate) use histories::{continued, kept, with_histories};
pub(crate) use recalled::recalled;
