//! `hystctl`: command line to identify, diagnose and compensate actuators with hysteresis.

use std::process::ExitCode;

fn main() -> ExitCode {
    hyst_cli::main(std::env::args_os())
}
