//! `demo`: all steps on a simulated actuator with an effect that the seed chooses.
//!
//! Steps: experiment, fit, diagnosis, extension, compensation, tracking. The identification uses only what an engineer
//! has: the drive, the measured output, and a temperature if the device measures one. The plant file is compared with
//! the result at the end.

mod outcome;
mod picture;

use std::fs;
use std::io;
use std::path::Path;

use hyst_hw::{Daq, Plant, PlantConfig, RecordOptions, Sample};
use hyst_ident::atomic_file::write_atomic;
use hyst_ident::diagnose::{DiagnoseOptions, diagnose_until};
use hyst_ident::excite::{Drive, Identification, Limits};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::model::Kind;
use hyst_ident::record::Record;
use hyst_ident::simulate::{Zero, simulate};

use crate::cli::DemoArgs;
use crate::exit::{CommandError, CommandResult};
use crate::hosted;
use crate::output::{self, Report};
use crate::progress::Progress;
use crate::recording;
use crate::tracking::{Files, Task};
use outcome::{Outcome, Runs};

/// Sample rate of the experiments \[Hz\].
const RATE_HZ: f64 = 1000.0;

/// Summary of a demo; it also marks a folder as that of a demo.
const MARK: &str = "demo.json";

/// Runs the command.
pub(crate) fn run(args: &DemoArgs) -> CommandResult {
    let out = &args.out;
    fs::create_dir_all(out)
        .map_err(|e| CommandError::failed(format!("{}: {e}; choose another folder with --out", out.display())))?;
    // The file names are common ones, so a folder with other files is refused.
    let foreign = fs::read_dir(out).is_ok_and(|mut files| files.next().is_some()) && !out.join(MARK).is_file();
    if foreign {
        let message = format!(
            "{}: the folder holds files that are not from a demo; give another folder with --out",
            out.display()
        );
        return Err(CommandError::bad_input(message));
    }
    write(out, MARK, "{}\n")?;
    let progress = Progress::spinner("creating the simulated actuator");

    // The seed chooses the effect; the identification does not use `config`, except for the voltage limits.
    let config = PlantConfig::random(args.seed);
    let mut plant = Plant::new(config.clone()).map_err(CommandError::failed)?;
    let limits =
        Limits { rate_hz: RATE_HZ, lo_v: config.actuator.min_v, hi_v: config.actuator.max_v, slew_v_per_s: None };
    let usual = Identification::at_rate(RATE_HZ, args.seed);

    progress.set_message("recording the identification drive");
    let train = experiment(&mut plant, &usual.drive(&limits)?, "train.csv")?;
    progress.set_message("recording the test drive");
    let test = experiment(&mut plant, &usual.for_test().drive(&limits)?, "test.csv")?;
    let train = write_record(out, "train.csv", train)?;
    let test = write_record(out, "test.csv", test)?;

    progress.set_message("fitting Prandtl-Ishlinskii");
    let model = fit(&train, Kind::Pi, &FitOptions { seed: args.seed, ..FitOptions::default() })?;
    let options = DiagnoseOptions { zero: Zero::None, seed: args.seed };
    let diagnosis =
        diagnose_until(&train, Some(&test), &model, &options, &|what| progress.set_message(what), &hosted::stopping())?;

    progress.set_message("following a reference");
    let task = Task::of(&diagnosis.extended, &train, RATE_HZ);
    let judged = |samples: &[Sample]| task.judge(samples, &diagnosis.extended);
    let files = Files { log: &out.join("run.mcap"), drive: &out.join("drive.csv") };
    let runs = Runs {
        plain: judged(&task.by_gain(&mut plant, &train, &model)?),
        base: judged(&task.through(&mut plant, &model, None)?),
        extended: judged(&task.through(&mut plant, &diagnosis.extended, Some(&files))?),
        time: task.time(),
        travel: task.travel.clone(),
    };

    progress.set_message("drawing the picture");
    let before = simulate(&model, &test, Zero::None)?;
    let after = simulate(&diagnosis.extended, &test, Zero::None)?;
    let picture = picture::draw(&test, &before.predicted, &after.predicted, &runs, &diagnosis.findings)?;

    write(out, "model.json", model.to_json())?;
    write(out, "extended.json", diagnosis.extended.to_json())?;
    write(out, "findings.json", json(&diagnosis.findings)?)?;
    write(out, "picture.svg", &picture)?;
    write(out, "plant.toml", config.to_toml().map_err(CommandError::failed)?)?;
    drop(progress);

    let outcome = Outcome { diagnosis: &diagnosis, model: &model, runs: &runs, config: &config };
    write(out, MARK, &json(&outcome.summary())?)?;
    Report::new(args.json.json, &[])?.print(&outcome.text(out), &outcome.summary())
}

fn json(value: &impl serde::Serialize) -> CommandResult<String> {
    Ok(serde_json::to_string_pretty(value).map_err(io::Error::other)? + "\n")
}

/// Plays a drive, with rests between its segments, and returns the record.
fn experiment(plant: &mut Plant, drive: &Drive, name: &str) -> CommandResult<Record> {
    let segments: Vec<&[f64]> = drive.segments().iter().map(|rows| &drive.voltage()[rows.clone()]).collect();
    let recording = hyst_hw::record(plant, &segments, &RecordOptions::at(RATE_HZ), |_| hosted::going())
        .map_err(|failure| CommandError::failed(format!("the simulated actuator: {failure}")))?;
    recording::to_record(&recording, name, recording::unit(Daq::capabilities(plant).output))
}

fn write(folder: &Path, name: &str, content: impl AsRef<[u8]>) -> CommandResult {
    Ok(write_atomic(folder.join(name), |out| out.write_all(content.as_ref()))?)
}

/// Writes a record and returns it with the checksum of its file.
fn write_record(folder: &Path, name: &str, record: Record) -> CommandResult<Record> {
    let mut file = Vec::new();
    record.write_csv(&mut file).map_err(output::io_error)?;
    write_atomic(folder.join(name), |out| out.write_all(&file))?;
    Ok(record.kept_as(&file))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyst_ident::record::{ColumnMap, Columns, Need};

    #[test]
    fn a_written_record_has_the_checksum_of_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let columns =
            Columns { time: vec![0.0, 0.1, 0.2], input: Some(vec![0.0, 1.0, 0.1 + 0.2]), ..Columns::default() };
        let record = Record::from_samples(columns).unwrap();
        assert_eq!(record.sources()[0].sha256, None);
        let kept = write_record(folder.path(), "train.csv", record).unwrap();
        let read = Record::read(folder.path().join("train.csv"), &ColumnMap::default(), Need::Input).unwrap();
        assert!(kept.sources()[0].sha256.is_some());
        assert_eq!((&kept.sources()[0].sha256, kept.input()), (&read.sources()[0].sha256, read.input()));
    }
}
