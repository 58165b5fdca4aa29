//! The report of a diagnosis: one self-contained HTML file.
//!
//! Tables and sentences are plain HTML. uPlot draws the plots; its source and the data are part of the page. The page
//! loads nothing, and its content security policy forbids loading.

mod effects;
pub(crate) mod figures;
mod files;
pub(crate) mod html;
pub mod next;
mod remainder;
mod summary;
pub mod words;

use hyst_ident::diagnose::{Diagnosis, Picture};
use hyst_ident::model::Model;
use hyst_ident::record::Record;

use html::Page;

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
    fn unit(&self) -> &str {
        crate::text::symbol(&self.diagnosis.findings.unit)
    }
}

/// Returns the report as one self-contained HTML page.
///
/// # Errors
/// When the data of a plot cannot be written as JSON; this does not happen with the data of a diagnosis.
pub fn page(c: &Contents<'_>) -> serde_json::Result<String> {
    let mut page = Page::new(&format!("Diagnosis of {} on {}", c.model_file, c.train.name()));
    summary::write(&mut page, c);
    let whole: Vec<(usize, &Picture)> = figures::of(&c.diagnosis.pictures, None);
    page.section("model", "The model before and after");
    figures::write(&mut page, &whole);
    effects::write(&mut page, c);
    remainder::write(&mut page, c);
    next::write(&mut page, c);
    files::write(&mut page, c);
    page.finish(&figures::data(&c.diagnosis.pictures)?)
}
