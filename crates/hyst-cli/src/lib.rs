//! The command line `hystctl` as a library.
//! [`main`] is the program; [`host::command`] runs one command inside another program, as the Python package does.
//! Other programs also use the [`log`] of a run and the [`report`] of a diagnosis.
//!
//! Each command reads files, calls the libraries, writes files and prints a report. Results go to stdout or to the file
//! of `-o`, all other text goes to stderr. The exit code reports success or the kind of failure.
//!
//! ```
//! use hyst_cli::log::{LoggedSample, RunInfo, RunLog};
//! use hyst_hw::{Phase, Sample};
//! use hyst_ident::record::OutputUnit;
//!
//! let folder = tempfile::tempdir()?;
//! let info = RunInfo { device: "bench", output: OutputUnit::Micrometre, sample_rate_hz: 1000.0, model: None };
//! let mut log = RunLog::create(&folder.path().join("run.mcap"), &info)?;
//! let (temperature_degc, load_n, force_n) = (None, None, None);
//! let sample = Sample { time_s: 0.001, drive_v: 1.0, output: 0.2, temperature_degc, load_n, force_n };
//! log.sample(&LoggedSample::new(0, Phase::Record, &sample, None))?;
//! log.finish()?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod auto_model;
mod canvas;
mod chart;
mod cli;
mod commands;
mod demo;
mod device;
mod exit;
pub mod fleet;
pub mod host;
mod hosted;
mod input;
pub mod log;
mod output;
mod progress;
mod recording;
pub mod report;
pub mod text;
mod tracking;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Parser;

use exit::Exit;

/// Runs `hystctl` with these arguments; the first one is the name of the program.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    run(arguments).into()
}

/// Runs `hystctl` as [`main`] does and returns the exit code as a number.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let exit = match cli::Cli::try_parse_from(arguments) {
        Ok(cli) => commands::dispatch(cli.command).map_or_else(|error| error.print(), |()| Exit::Done),
        Err(message) => {
            // Help and version come this way, too. A closed terminal is not an error.
            let _ = message.print();
            if message.use_stderr() { Exit::BadInput } else { Exit::Done }
        }
    };
    exit as u8
}
