//! An actuator of a fleet, the options of its diagnosis, and its row of results.

use std::collections::BTreeMap;
use std::path::PathBuf;

use hyst_ident::record::ColumnMap;
use serde::{Deserialize, Serialize};

use crate::auto_model::kind_of;

/// An actuator of the fleet.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Entry {
    /// File of its record as it was given; it names the row.
    pub file: String,
    /// Test record: its errors are reported, it is never fitted.
    #[serde(default)]
    pub test: Option<String>,
    /// Serial number.
    #[serde(default)]
    pub serial: Option<String>,
    /// Date of the measurement, as in the list.
    #[serde(default)]
    pub date: Option<String>,
}

/// Version of the program that computes rows. Another version may compute other results.
pub(super) const VERSION: &str = env!("HYST_VERSION");

/// Options of the fit and the diagnosis of each actuator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Options {
    /// Kind of model to fit; `auto` takes pi or preisach.
    pub model: String,
    /// Whether one sensor zero per file is estimated.
    pub zero_per_record: bool,
    /// Seed of the bootstrap.
    pub seed: u64,
    /// Columns, as `--map` names them.
    pub map: Vec<String>,
    /// Sample rate of files without times \[Hz\].
    pub rate: Option<f64>,
    /// Folder for a report of each actuator.
    #[serde(skip)]
    pub reports: Option<PathBuf>,
}

impl Options {
    /// Checks kind of model and columns.
    ///
    /// # Errors
    /// A message with the wrong value.
    pub fn check(&self) -> Result<(), String> {
        kind_of(&self.model).map_err(|error| error.text())?;
        ColumnMap::parse(&self.map).map(|_| ()).map_err(|error| error.to_string())
    }

    /// Returns version and options as text. Rows with another text are processed again.
    pub fn fingerprint(&self) -> String {
        // Numbers and strings can always be written as JSON.
        format!("{VERSION} {}", serde_json::to_string(self).unwrap_or_default())
    }
}

/// A parameter of an effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Value \[unit\].
    pub value: f64,
    /// Standard error \[unit\], if it was estimated.
    pub std_error: Option<f64>,
    /// Unit.
    pub unit: String,
}

/// A named effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NamedEffect {
    /// Name.
    pub name: String,
    /// Probability that the name, or one that the record cannot distinguish from it, is right.
    pub probability: f64,
    /// Parameters by name.
    pub parameters: BTreeMap<String, Parameter>,
}

/// Results of the diagnosis of an actuator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Rows of its record.
    pub rows: usize,
    /// Kind of the model that was fitted.
    pub model: String,
    /// Unit of the errors.
    pub unit: String,
    /// `explained`, `nothing-missing`, `base-too-coarse` or `unexplained`.
    pub verdict: String,
    /// White noise of the output, standard deviation \[unit\].
    pub noise: f64,
    /// RMS error of the fitted model on the training record \[unit\].
    pub rmse_before: Option<f64>,
    /// RMS error of the extended model on the training record \[unit\].
    pub rmse_after: Option<f64>,
    /// RMS error of the fitted model on the test record \[unit\].
    pub test_rmse_before: Option<f64>,
    /// RMS error of the extended model on the test record \[unit\].
    pub test_rmse_after: Option<f64>,
    /// Named effects.
    pub effects: Vec<NamedEffect>,
    /// Probabilities of suspected effects by name.
    pub suspects: BTreeMap<String, f64>,
    /// Path of the report, if one was written.
    pub report: Option<String>,
    /// Error of a report that could not be written.
    #[serde(default)]
    pub report_error: Option<String>,
}

/// The row of one actuator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The actuator.
    #[serde(flatten)]
    pub entry: Entry,
    /// SHA-256 of its files, in hexadecimal digits; `None` if a file could not be read.
    pub sha256: Option<String>,
    /// Version and options ([`Options::fingerprint`]).
    pub options: String,
    /// Computing time \[s\]; the only value that is not reproducible.
    pub took_s: f64,
    /// Results, or the reason of a failure.
    pub outcome: Result<Found, String>,
}
