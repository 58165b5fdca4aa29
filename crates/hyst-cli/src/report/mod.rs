//! The report of a diagnosis: one self-contained HTML file.
//!
//! Tables and sentences are plain HTML. Scripts draw the plots; they and the data are part of the page. The page loads
//! nothing, and its content security policy forbids loading.

mod contents;
mod effects;
pub(crate) mod figures;
mod files;
pub(crate) mod html;
pub mod next;
mod remainder;
mod summary;
pub mod words;

use hyst_ident::diagnose::Picture;

pub use contents::Contents;
use html::Page;

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
