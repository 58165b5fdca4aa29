//! What a report is made of.

use hyst_ident::diagnose::Diagnosis;
use hyst_ident::model::Model;
use hyst_ident::record::Record;

use crate::text::symbol;

/// Contents of a report.
pub struct Contents<'a> {
    /// The diagnosis.
    pub diagnosis: &'a Diagnosis,
    /// The model that was diagnosed.
    pub model: &'a Model,
    /// Name of the model file.
    pub model_file: &'a str,
    /// Path of the model file as it was given.
    pub model_path: &'a str,
    /// SHA-256 of the model file, in hexadecimal digits.
    pub model_sha256: &'a str,
    /// File of the extended model, if it is written to a file.
    pub extended_file: Option<&'a str>,
    /// Training record.
    pub train: &'a Record,
    /// Test record, which is only simulated.
    pub test: Option<&'a Record>,
    /// Options that the records were read with, as arguments of a command.
    pub reading: Vec<String>,
    /// Seed of the bootstrap.
    pub seed: u64,
}

impl Contents<'_> {
    /// Returns the symbol of the output unit, for example `µm`.
    pub(super) fn unit(&self) -> &str {
        symbol(&self.diagnosis.findings.unit)
    }
}
