//! Errors of fits and simulations.

use super::everett::EverettError;
use crate::metrics::MetricsError;
use crate::model::ModelError;
use crate::optimize::{SearchError, SpaceError};
use crate::record::RecordError;

/// Reason why a fit is impossible.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// The record cannot be used as it is.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The fit was stopped by the caller.
    #[error("{record}: stopped before the result was complete")]
    Stopped {
        /// The record.
        record: String,
    },
    /// Not enough rows.
    #[error(
        "{record}: {rows} rows (without start-up rows) are too few for {unknowns} unknowns; record at least {needed} rows or fit a smaller model"
    )]
    TooShort {
        /// The record.
        record: String,
        /// Number of rows without start-up rows.
        rows: usize,
        /// Number of unknowns of the model.
        unknowns: usize,
        /// Minimum number of rows.
        needed: usize,
    },
    /// The input is constant.
    #[error(
        "{record}: column {column}: the input is constant ({value}), so the record shows no hysteresis; drive the actuator, e.g. with \
         `hystctl excite identification`"
    )]
    ConstantInput {
        /// The record.
        record: String,
        /// The input's column.
        column: String,
        /// Its value.
        value: f64,
    },
    /// The output is constant.
    #[error(
        "{record}: column {column}: the output is constant ({value}) while the input moves; check the sensor and `--map`"
    )]
    ConstantOutput {
        /// The record.
        record: String,
        /// The output's column.
        column: String,
        /// Its value.
        value: f64,
    },
    /// The output has the opposite sign to that of the model.
    #[error(
        "{record}: the output has the opposite sign to the model's; invert it with --map {column}=-COLUMN (COLUMN is its name in the file), \
         remove the minus sign of an existing --map, or refit the model to this record"
    )]
    Falling {
        /// The record.
        record: String,
        /// The output's name in the record format.
        column: &'static str,
    },
    /// A required column is missing.
    #[error("{record}: column {column} is missing; {advice}")]
    Missing {
        /// The record.
        record: String,
        /// The column.
        column: String,
        /// What to do.
        advice: String,
    },
    /// The equations could not be solved.
    #[error("{record}: the equations of the fit could not be solved; look for outliers in the record")]
    Unsolvable {
        /// The record.
        record: String,
    },
    /// A stage cannot be built.
    #[error("{record}: {source}")]
    Stage {
        /// The record.
        record: String,
        /// Reason.
        source: hyst_core::Error,
    },
    /// Prediction and measurement cannot be compared.
    #[error("{record}: {source}")]
    Compare {
        /// The record.
        record: String,
        /// Reason.
        source: MetricsError,
    },
    /// Invalid bounds.
    #[error("{record}: {source}")]
    Space {
        /// The record.
        record: String,
        /// Reason.
        source: SpaceError,
    },
    /// A search that cannot be run or that finds nothing.
    #[error("{record}: {source}")]
    Search {
        /// The record.
        record: String,
        /// Reason.
        source: SearchError,
    },
    /// Bounds for a variable that is not searched.
    #[error("bounds of {name}: {kind} has no such variable; it searches {names}")]
    UnknownBounds {
        /// The name given.
        name: String,
        /// The kind of model.
        kind: &'static str,
        /// The searched variables.
        names: String,
    },
    /// An optimizer that the model does not support.
    #[error("{kind} does not support {optimizer}; {advice}")]
    Optimizer {
        /// The kind of model.
        kind: &'static str,
        /// The requested optimizer.
        optimizer: String,
        /// Available optimizers.
        advice: &'static str,
    },
    /// A drive that is band-limited between samples, for a model that does not support it.
    #[error(
        "{kind}: only bouc-wen-oscillator supports a drive that is band-limited between samples; use --between-samples linear"
    )]
    BandLimited {
        /// The kind of model.
        kind: &'static str,
    },
    /// A number of thresholds for a model without selectable thresholds.
    #[error("{kind}: a number of thresholds applies only to the convex fit of pi; {advice}")]
    Thresholds {
        /// The kind of model.
        kind: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// A number of elements for a model without a selectable number.
    #[error(
        "{kind}: a number of elements applies only to gpi, td-pi, td-em, maxwell-slip and a search of pi; {advice}"
    )]
    NoElements {
        /// The kind of model.
        kind: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// A number of elements outside of the allowed range.
    #[error("{elements} elements; expected 1 to {most}")]
    Elements {
        /// The requested number.
        elements: usize,
        /// The maximum.
        most: usize,
    },
    /// First-order descent curves without a valid surface.
    #[error(transparent)]
    Everett(#[from] EverettError),
    /// A model that does not suit the record.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A base that is not linear in its weights.
    #[error("{kind} is not linear in its weights: its parameters are searched")]
    NoBasis {
        /// The kind of model.
        kind: &'static str,
    },
}
