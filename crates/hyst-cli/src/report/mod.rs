//! A diagnosis as a page: one HTML file that needs nothing else, to read, to check and to hand on.
//!
//! Tables and sentences are plain HTML. The plots are drawn by uPlot, whose text stands in the page, from numbers that stand
//! in it too; nothing is loaded from anywhere, and the page forbids it to itself.

mod effects;
pub(crate) mod figures;
mod files;
pub(crate) mod html;
mod left;
pub mod next;
mod summary;
pub mod words;

use hyst_ident::diagnose::{Diagnosis, Picture};
use hyst_ident::model::Model;
use hyst_ident::record::Record;

use html::Page;

/// What a report is about.
pub struct Contents<'a> {
    /// What was found.
    pub diagnosis: &'a Diagnosis,
    /// The model as it was given.
    pub model: &'a Model,
    /// The name of the model's file.
    pub model_file: &'a str,
    /// Its path as it was given.
    pub model_path: &'a str,
    /// SHA-256 of the file, in hexadecimal digits.
    pub model_sha256: &'a str,
    /// The file of the extended model, if it is written to one.
    pub extended_file: Option<&'a str>,
    /// The record that was searched.
    pub train: &'a Record,
    /// The record that was simulated alone.
    pub test: Option<&'a Record>,
    /// Options with which the records were read.
    pub reading: Vec<String>,
    /// Seed of the bootstrap.
    pub seed: u64,
}

impl Contents<'_> {
    /// The output's unit as a person writes it.
    fn unit(&self) -> &str {
        crate::text::symbol(&self.diagnosis.findings.unit)
    }
}

/// The page: HTML that loads nothing.
///
/// # Errors
/// When a number of its plots has no JSON, which none of a diagnosis is.
pub fn page(c: &Contents<'_>) -> serde_json::Result<String> {
    let mut page = Page::new(&format!("Diagnosis of {} on {}", c.model_file, c.train.name()));
    summary::write(&mut page, c);
    let whole: Vec<(usize, &Picture)> = figures::of(&c.diagnosis.pictures, None);
    page.section("model", "The model before and after");
    figures::write(&mut page, &whole);
    effects::write(&mut page, c);
    left::write(&mut page, c);
    next::write(&mut page, c);
    files::write(&mut page, c);
    page.finish(&figures::data(&c.diagnosis.pictures)?)
}
