//! Errors of the identification of an Everett surface or of a dynamic model.

/// Errors of the identification of an Everett surface or of a dynamic model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EverettError {
    /// Not enough first-order descent curves.
    #[error(
        "{record}: {found} of the {needed} first-order descent curves that a surface needs are in the record ({passed_over} other excursions of the input reverse on the way); drive single peaks of increasing height from the lowest input and back, e.g. with `hystctl excite forc`"
    )]
    TooFewCurves {
        /// The record.
        record: String,
        /// Number of curves of different heights.
        found: usize,
        /// Required number of curves.
        needed: usize,
        /// Excursions from the lowest input that are not such curves.
        passed_over: usize,
    },
    /// No curve contains data at a node.
    #[error(
        "{record}: no curve has a row near α = {alpha}, β = {beta} of the grid; sample faster, or use longer peaks"
    )]
    Unseen {
        /// The record.
        record: String,
        /// Upper input of the node.
        alpha: f64,
        /// Lower input of the node.
        beta: f64,
    },
    /// The measured surface was requested, but is not an Everett surface.
    #[error(
        "{record}: the measured surface falls at {nodes} of its nodes, {beyond} of them by more than 3 standard errors, so no Preisach model has this surface; omit --as-measured to use the nearest valid surface"
    )]
    NotMonotone {
        /// The record.
        record: String,
        /// Nodes that break a rule, however little.
        nodes: usize,
        /// Nodes that break it by more than the noise.
        beyond: usize,
    },
    /// The rate dependence of the output cannot be determined.
    #[error(
        "{record}: every segment, and every branch over half of the range, moves at about the same rate ({slowest:.4} to {fastest:.4} input units/s), so the rate dependence cannot be determined; add records at other rates or a drive of several rates, or fit preisach"
    )]
    OneRate {
        /// The record.
        record: String,
        /// Mean rate of the slowest segment, or of its slowest branch \[input unit/s\].
        slowest: f64,
        /// The same of the fastest one \[input unit/s\].
        fastest: f64,
    },
    /// The quadratic program has no solution.
    #[error("{record}: no valid surface near the measured one was found; check the record for outliers")]
    Unsolvable {
        /// The record.
        record: String,
    },
}
