//! `hystctl`: identify, diagnose and compensate actuators with hysteresis from the command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    hyst_cli::main(std::env::args_os())
}
