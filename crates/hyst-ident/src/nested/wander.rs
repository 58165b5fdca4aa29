//! Hat functions: a wander in time is a weighted sum of them.

/// Number of hat functions of a wander over a record.
pub(crate) const HATS: usize = 32;

/// Returns the value of hat function `j` of a wander at a fraction of the record's rows.
pub(crate) fn hat(j: usize, share: f64) -> f64 {
    (1.0 - (share * (HATS - 1) as f64 - j as f64).abs()).max(0.0)
}
