//! `hystctl`: identify, diagnose and compensate actuators with hysteresis from the command line.
//!
//! Every command is thin: it reads files, calls the library, writes files and says what happened. Results go to
//! stdout or to the file of `-o`, everything else to stderr; the exit code tells scripts how it ended ([`exit::Exit`]).

mod canvas;
mod chart;
mod cli;
mod commands;
mod demo;
mod device;
mod exit;
mod input;
mod output;
mod progress;
mod recording;
mod tracking;

use std::process::ExitCode;

use clap::Parser;

use exit::Exit;
use hyst_cli::{log, report, text};

fn main() -> ExitCode {
    // Bad arguments end here: clap prints what is wrong and exits with 2.
    let cli = cli::Cli::parse();
    let exit = match commands::dispatch(cli.command) {
        Ok(()) => Exit::Done,
        Err(error) => error.print(),
    };
    exit.into()
}
