//! The commands and their dispatch.

mod close_loop;
mod compare;
mod compensate;
mod convert;
mod devices;
mod diagnose;
mod excite;
mod export;
mod fit;
mod fleet;
mod force;
mod gain;
mod hysteresis_loop;
mod info;
mod learn;
mod log;
mod plot;
mod record;
mod response;
mod run;
mod simulate;
mod status;
mod stop;

use clap::CommandFactory;

use crate::cli::{Cli, Command};
use crate::demo;
use crate::exit::CommandResult;
use crate::output::Target;

/// Runs one command.
pub(crate) fn dispatch(command: Command) -> CommandResult {
    match command {
        Command::Fit(args) => fit::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Force(args) => force::run(&args),
        Command::Diagnose(args) => diagnose::run(&args),
        Command::Fleet(args) => fleet::run(&args),
        Command::CloseLoop(args) => close_loop::run(&args),
        Command::Learn(args) => learn::run(&args),
        Command::Compensate(args) => compensate::run(&args),
        Command::Excite(args) => excite::run(&args),
        Command::Response(args) => response::run(&args),
        Command::Gain(args) => gain::run(&args),
        Command::Loop(args) => hysteresis_loop::run(&args),
        Command::Run(args) => run::run(&args),
        Command::Record(args) => record::run(&args),
        Command::Stop(args) => stop::run(&args),
        Command::Status(args) => status::run(&args),
        Command::Devices(args) => devices::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Plot(args) => plot::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Log(args) => log::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Demo(args) => demo::run(&args),
        Command::Completions { shell } => {
            // The generator panics if its writer fails, for example at a closed pipe.
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "hystctl", &mut script);
            Target::Stdout.write(|out| out.write_all(&script))
        }
    }
}
