//! Fuzz tests: random bytes and frames for everything that reads external input.
//!
//! A case is a kind and a seed, which reproduce it. A case that finds a fault panics.

mod board;
mod files;
mod frames;
mod inputs;
mod line;
mod random;
mod requests;
mod sealed;

use random::Random;

/// A kind of case.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// Name on the command line.
    pub name: &'static str,
    case: fn(&mut Random),
}

/// All kinds: host and device over a bad line, a device with a faulty host, then the readers.
pub const KINDS: &[Kind] = &[
    Kind { name: "line", case: line::case },
    Kind { name: "requests", case: requests::case },
    Kind { name: "frames", case: frames::frames },
    Kind { name: "can", case: frames::can },
    Kind { name: "slcan", case: frames::slcan },
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
    /// Returns the kind with this name.
    pub fn named(name: &str) -> Option<Self> {
        KINDS.iter().find(|kind| kind.name == name).copied()
    }

    /// Runs one case.
    ///
    /// # Panics
    /// If it finds a fault.
    pub fn run(self, seed: u64) {
        (self.case)(&mut Random::new(seed));
    }
}
