//! What counts as alike, as far apart and as nearly all, for every decision of the search and of what follows it.

/// Relative difference of two errors (RMSE) up to which they are alike: another draw of the blocks changes one by some per cent. An effect has to lower
/// the error by more, a richer base as well.
pub(super) const DIFFERS: f64 = 0.1;
/// Ratio of two errors from which on they are far apart, however few parts of the record show it.
pub(super) const FAR_APART: f64 = 1.3;
/// Share of a variance that is nearly all of it.
pub(super) const NEARLY_ALL: f64 = 0.9;
