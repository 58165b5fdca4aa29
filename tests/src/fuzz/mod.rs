//! Bytes and frames by chance, against everything that takes them from outside.
//!
//! Each case is a kind and a seed; the same two make the same case. A case that finds something panics.

mod files;
mod inputs;
mod line;
mod luck;
mod requests;
mod watched;

use luck::Luck;

/// A kind of case.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// What it is called.
    pub name: &'static str,
    case: fn(&mut Luck),
}

/// All kinds: first a host and a device with a bad line between them, then a device with a host out of its mind, then what reads.
pub const KINDS: &[Kind] = &[
    Kind { name: "line", case: line::case },
    Kind { name: "requests", case: requests::case },
    Kind { name: "frames", case: inputs::frames },
    Kind { name: "can", case: inputs::can },
    Kind { name: "slcan", case: inputs::slcan },
    Kind { name: "controllers", case: inputs::controllers },
    Kind { name: "blocks", case: inputs::blocks },
    Kind { name: "models", case: inputs::model_files },
    Kind { name: "records", case: inputs::records },
    Kind { name: "logs", case: inputs::logs },
    Kind { name: "plants", case: inputs::plants },
    Kind { name: "tables", case: files::tables },
    Kind { name: "matlab", case: files::matlab },
    Kind { name: "hdf5", case: files::hdf5 },
    Kind { name: "labview", case: files::labview },
    Kind { name: "numpy", case: files::numpy },
    Kind { name: "parquet", case: files::parquet },
    Kind { name: "arrow", case: files::arrow },
    Kind { name: "excel", case: files::excel },
    Kind { name: "messages", case: files::messages },
];

impl Kind {
    /// The kind of this name.
    pub fn named(name: &str) -> Option<Self> {
        KINDS.iter().find(|kind| kind.name == name).copied()
    }

    /// Runs one case.
    ///
    /// # Panics
    /// When it finds something.
    pub fn run(self, seed: u64) {
        (self.case)(&mut Luck::new(seed));
    }
}
