//! A diagnosis as a page: one HTML file that needs nothing else, to read, to check and to hand on.
//!
//! Tables and sentences are plain HTML. The plots are drawn by uPlot, whose text stands in the page, from numbers that stand
//! in it too; nothing is loaded from anywhere, and the page forbids it to itself.

mod effects;
mod figures;
mod files;
mod html;
mod left;
pub(crate) mod next;
mod summary;
pub(crate) mod words;

use hyst_ident::diagnose::{Diagnosis, Picture};
use hyst_ident::model::Model;
use hyst_ident::record::Record;

use crate::exit::CommandResult;
use html::Page;

/// What a report is about.
pub(crate) struct Contents<'a> {
    pub(crate) diagnosis: &'a Diagnosis,
    /// The model as it was given, and the name of its file.
    pub(crate) model: &'a Model,
    pub(crate) model_file: &'a str,
    /// The same file as it was given.
    pub(crate) model_path: &'a str,
    pub(crate) model_sha256: &'a str,
    /// The file of the extended model, if it is written to one.
    pub(crate) extended_file: Option<&'a str>,
    pub(crate) train: &'a Record,
    pub(crate) test: Option<&'a Record>,
    /// Options with which the records were read.
    pub(crate) reading: Vec<String>,
    /// Seed of the bootstrap.
    pub(crate) seed: u64,
}

impl Contents<'_> {
    /// The output's unit as a person writes it.
    fn unit(&self) -> &str {
        crate::text::symbol(&self.diagnosis.findings.unit)
    }
}

/// The page.
pub(crate) fn page(c: &Contents<'_>) -> CommandResult<String> {
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
