//! Arguments of `export`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use hyst_ident::export::CName;

use crate::output::Target;

/// Export a model's parameters for firmware
///
/// postcard is a versioned block of bytes with a checksum; firmware loads it without a heap (`hyst_core::read_block`).
/// rust is source code with constants for `hyst-core`. c is a C99 header with the block and every parameter with its
/// unit. No format depends on a sample period.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  hystctl export extended.json --format postcard -o model.bin\n  \
    hystctl export extended.json --format c --name x_axis -o x_axis.h")]
pub(crate) struct ExportArgs {
    /// Model file
    pub(crate) model: PathBuf,
    /// Format to write
    #[arg(long, value_enum)]
    pub(crate) format: ExportFormat,
    /// Prefix of the symbols in a C header; two models in one program need two prefixes; hyst if not given
    #[arg(long)]
    pub(crate) name: Option<CName>,
    /// File to write; stdout if not given. A postcard block is not written to a terminal
    #[arg(short, long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub(crate) output: Target,
}

/// Format of an exported model.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum ExportFormat {
    /// A C99 header
    C,
    /// Rust source
    Rust,
    /// A block of bytes
    Postcard,
}
