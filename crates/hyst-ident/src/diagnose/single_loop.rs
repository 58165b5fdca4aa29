//! What a record of a single loop cannot show.

use crate::nested::Problem;

/// Returns why a record that repeats one loop hides an effect that changes the shape of the loop. A late output can be
/// separated from the hysteresis, but not one late effect from another: the simplest represents all of them.
pub(super) fn only_one_loop(problem: &Problem<'_>) -> Option<&'static str> {
    let why = "the record repeats one loop, which does not separate the effect from the shape of the hysteresis";
    problem.only_loop.map(|_| why)
}
