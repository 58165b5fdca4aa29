//! Structure of the sources: files that import each other around a loop, and files that are too long.
//!
//! A file imports another if a `use` declaration or a path that begins with `crate`, `self` or `super` names something
//! that is defined there. A `pub use` is no import: the path is followed to the file of the definition. Modules and
//! functions that are compiled only for tests are left out.

mod graph;
mod imports;
mod modules;
mod sources;

pub use graph::loops;
pub use sources::{Crate, Source, crates, long_files};
