//! Arguments of all commands, as clap parses them.

mod close_loop;
mod compare;
mod compensate;
mod demo;
mod device;
mod diagnose;
mod excite;
mod export;
mod fit;
mod help;
mod learn;
mod linear;
mod log;
mod records;
mod run;
mod search;
mod shared;
mod simulate;
mod values;

use clap::{Parser, Subcommand};
use clap_complete::Shell;

pub(crate) use close_loop::CloseLoopArgs;
pub(crate) use compare::CompareArgs;
pub(crate) use compensate::CompensateArgs;
pub(crate) use demo::DemoArgs;
pub(crate) use device::{DevicesArgs, RecordArgs, StatusArgs, StopArgs};
pub(crate) use diagnose::{DiagnoseArgs, FleetArgs};
pub(crate) use excite::{Common, ExciteArgs, ExciteKind, PeakForm, SeparateArgs};
pub(crate) use export::{ExportArgs, ExportFormat};
pub(crate) use fit::{FitArgs, FitFrom};
use help::EXAMPLES;
pub(crate) use learn::LearnArgs;
pub(crate) use linear::{GainArgs, LoopArgs, ResponseArgs};
pub(crate) use log::{LogArgs, LogCommand, LogConvertArgs, LogInfoArgs, LogRecoverArgs};
pub(crate) use records::{ConvertArgs, InfoArgs, PlotArgs};
pub(crate) use run::{Control, RunArgs};
pub(crate) use shared::{LimitArgs, MapArg, TemperatureArg, ZeroArg};
pub(crate) use simulate::{ForceArgs, SimulateArgs};
pub(crate) use values::{Device, PidGains, VoltageLimits};

/// Identify, diagnose and compensate piezo actuators and other actuators with hysteresis.
#[derive(Debug, Parser)]
#[command(name = "hystctl", version = env!("HYST_VERSION"), after_help = EXAMPLES, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Fit(FitArgs),
    Compare(CompareArgs),
    Simulate(SimulateArgs),
    Diagnose(DiagnoseArgs),
    Fleet(FleetArgs),
    CloseLoop(CloseLoopArgs),
    Learn(LearnArgs),
    Compensate(CompensateArgs),
    Excite(ExciteArgs),
    Response(ResponseArgs),
    Gain(GainArgs),
    Loop(LoopArgs),
    Force(ForceArgs),
    Run(RunArgs),
    Record(RecordArgs),
    Stop(StopArgs),
    Status(StatusArgs),
    Devices(DevicesArgs),
    Info(InfoArgs),
    Convert(ConvertArgs),
    Plot(PlotArgs),
    Log(LogArgs),
    Export(ExportArgs),
    Demo(DemoArgs),
    /// Print a completion script for a shell
    #[command(after_help = "Example:\n  hystctl completions bash > /etc/bash_completion.d/hystctl")]
    Completions {
        /// Shell to complete for
        shell: Shell,
    },
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::Target;
    use clap::CommandFactory;

    fn parse(line: &str) -> Result<Command, String> {
        Cli::try_parse_from(line.split(' ')).map(|cli| cli.command).map_err(|error| error.to_string())
    }

    #[test]
    fn clap_accepts_the_definition() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_run_has_either_a_reference_or_a_drive() {
        let run = |rest: &str| parse(&format!("hystctl run --daq sim:p.toml {rest}"));
        run("--drive u.csv").unwrap();
        run("--model m.json --reference r.csv").unwrap();
        for rest in ["--record a.csv", "--reference r.csv", "--model m.json", "--model m.json --drive u.csv"] {
            run(rest).unwrap_err();
        }
        run("--model m.json --reference r.csv --drive u.csv").unwrap_err();
    }

    #[test]
    fn negative_voltages_are_values() {
        let line = "hystctl compensate --model m.json r.csv -o - --limit -20,120";
        let Ok(Command::Compensate(args)) = parse(line) else { panic!("not a compensation") };
        assert_eq!(args.limits.limit, Some(VoltageLimits { low: -20.0, high: 120.0 }));
        assert_eq!(args.output, Target::Stdout);
        parse("hystctl excite sine --frequency 1 --cycles 2 --low -20 --high 50 -o u.csv").unwrap();
    }

    #[test]
    fn unknown_devices_and_models_are_refused_with_the_known_ones() {
        let message = parse("hystctl run --daq usb:3 --drive u.csv").unwrap_err();
        assert!(message.contains("sim:PLANT.toml"), "{message}");
        let message = parse("hystctl fit a.csv --model preisch -o m.json").unwrap_err();
        assert!(message.contains("pi, preisach"), "{message}");
    }
}
