//! `hystctl`, the command line, as a library: [`main`] is the program, [`host::command`] runs one command within another program (as the
//! Python package does). Beside them what other programs use too: the log of a run, the page of a diagnosis.
//!
//! Every command is thin: it reads files, calls the library, writes files and says what happened. Results go to
//! stdout or to the file of `-o`, everything else to stderr; the exit code tells scripts how it ended.
//!
//! ```
//! use hyst_cli::log::{LoggedSample, RunInfo, RunLog};
//! use hyst_hw::{Phase, Sample};
//! use hyst_ident::record::OutputUnit;
//!
//! let folder = tempfile::tempdir()?;
//! let info = RunInfo { device: "bench", output: OutputUnit::Micrometre, sample_rate_hz: 1000.0, model: None };
//! let mut log = RunLog::create(&folder.path().join("run.mcap"), &info)?;
//! let sample = Sample { time_s: 0.001, drive_v: 1.0, output: 0.2, temperature_degc: None, load_n: None, force_n: None };
//! log.sample(&LoggedSample::new(0, Phase::Record, &sample, None))?;
//! log.finish()?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod canvas;
mod chart;
mod cli;
mod commands;
mod demo;
mod device;
mod exit;
pub mod fleet;
pub mod host;
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

/// The program `hystctl` with these arguments, the first of which is its own name.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    run(arguments).into()
}

/// As [`main`]; the exit code as a number.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let exit = match cli::Cli::try_parse_from(arguments) {
        Ok(cli) => commands::dispatch(cli.command).map_or_else(|error| error.print(), |()| Exit::Done),
        Err(asked) => {
            // Help and versions come this way too; where the terminal is closed there is nobody to tell.
            let _ = asked.print();
            if asked.use_stderr() { Exit::BadInput } else { Exit::Done }
        }
    };
    exit as u8
}
