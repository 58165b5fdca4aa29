//! `demo`: all steps on a simulated actuator with an effect that the seed chooses.
//!
//! Steps: experiment, fit, diagnosis, extension, compensation, tracking. The identification uses only what an engineer
//! has: the drive, the measured output, and a temperature if the device measures one. The plant file is compared with
//! the result at the end.

mod picture;

use std::fs;
use std::io;
use std::path::Path;

use hyst_hw::{Daq, Plant, PlantConfig, RecordOptions, Sample};
use hyst_ident::atomic_file::write_atomic;
use hyst_ident::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose_until};
use hyst_ident::excite::{Drive, Identification, Limits};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::metrics::Errors;
use hyst_ident::model::{Effect, Kind, Model};
use hyst_ident::record::Record;
use hyst_ident::simulate::{Zero, simulate};

use crate::cli::DemoArgs;
use crate::exit::{CommandError, CommandResult};
use crate::host;
use crate::output::{self, Report};
use crate::progress::Progress;
use crate::tracking::{Files, Run, Task};
use crate::{recording, text};

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
        diagnose_until(&train, Some(&test), &model, &options, &|what| progress.set_message(what), &host::stopping())?;

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
    let recording = hyst_hw::record(plant, &segments, &RecordOptions::at(RATE_HZ), |_| host::going())
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

/// Runs with one reference: plain gain, inverse of the base model, inverse of the extended model.
struct Runs {
    time: Vec<f64>,
    /// Wanted displacement from rest \[output unit\].
    travel: Vec<f64>,
    plain: Run,
    base: Run,
    extended: Run,
}

/// Results of a demo.
struct Outcome<'a> {
    diagnosis: &'a Diagnosis,
    model: &'a Model,
    runs: &'a Runs,
    config: &'a PlantConfig,
}

impl Outcome<'_> {
    fn text(&self, out: &Path) -> String {
        let (f, runs) = (&self.diagnosis.findings, self.runs);
        let unit = text::symbol(&f.unit);
        let error = |e: Option<Errors>| {
            e.map_or_else(String::new, |e| {
                format!("{} {unit} ({})", text::short(e.rmse), text::percent(e.nrmse_percent))
            })
        };
        let rows: usize = self.model.fitted_on.iter().map(|f| f.rows).sum();
        let mut lines = vec![
            format!("fit        {} on {rows} rows of an identification experiment", self.model.base.kind()),
            format!("           RMSE {} on a test record, which is never fitted", error(f.before.test)),
        ];
        if f.effects.is_empty() {
            lines.push(format!("found      no effect: {}", verdict(f.verdict)));
        }
        for effect in &f.effects {
            let mut evidence = effect.evidence.iter();
            lines.push(format!("found      {}: {}", effect.name, evidence.next().map_or("", String::as_str)));
            lines.extend(evidence.map(|line| format!("           {line}")));
            for other in effect.alternatives.iter().filter(|a| a.indistinguishable) {
                lines.push(format!("           the record cannot distinguish it from {}", other.name));
            }
        }
        lines.push(format!("extended   RMSE {} → {} on the test record", error(f.before.test), error(f.after.test)));
        lines.push(format!("remainder  {}", f.remainder.description));
        lines.push("tracking   RMS error of a reference on the actuator:".to_owned());
        let against = |run: &Run| {
            let times = runs.plain.rmse / run.rmse;
            format!("{} {unit}, {times:.1} times smaller than with the plain gain", text::short(run.rmse))
        };
        lines.push(format!("             plain gain        {} {unit}", text::short(runs.plain.rmse)));
        lines.push(format!("             base inverse      {}", against(&runs.base)));
        lines.push(format!("             extended inverse  {}", against(&runs.extended)));
        let sensor: Vec<&str> =
            f.effects.iter().map(|e| e.name).filter(|e| !e.acts_on_the_motion()).map(Effect::name).collect();
        if !sensor.is_empty() {
            let (effects, verb) = (text::listed(&sensor), if sensor.len() == 1 { "is" } else { "are" });
            lines.push(format!(
                "           {effects} {verb} in the sensor, not in the motion: removed from all three errors (the last one is {} \
                 {unit} with it) and not compensated",
                text::short(runs.extended.shown_rmse)
            ));
        }
        let (truth, named) = (self.truth(), self.named());
        let (modes, found) = (self.config.modes.len(), self.diagnosis.extended.effects.resonances.len());
        let of_modes = match (modes, found) {
            (_, 0) => String::new(),
            (modes, found) if found < modes => format!(", {found} of its {modes} modes"),
            (modes, found) if found > modes => format!(", but with {found} modes instead of {modes}"),
            _ => String::new(),
        };
        let had = if truth.is_empty() { "no effect".to_owned() } else { text::listed(&truth) };
        lines.push(format!(
            "truth      the plant file has {had}: {}{of_modes}",
            if truth == named { "found correctly" } else { "NOT found correctly" }
        ));
        lines.push(format!("written    {}", out.display()));
        lines.join("\n")
    }

    fn truth(&self) -> Vec<&'static str> {
        let mut names = self.config.effects();
        names.sort_unstable();
        names
    }

    fn named(&self) -> Vec<&'static str> {
        let mut names: Vec<&str> = self.diagnosis.findings.effects.iter().map(|e| e.name.name()).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    fn summary(&self) -> serde_json::Value {
        let f = &self.diagnosis.findings;
        serde_json::json!({
            "named": self.named(),
            "switched_on": self.truth(),
            "verdict": f.verdict,
            "unit": f.unit,
            "test": { "before": f.before.test, "after": f.after.test },
            "tracking_rmse": {
                "plain_gain": self.runs.plain.rmse,
                "base_inverse": self.runs.base.rmse,
                "extended_inverse": self.runs.extended.rmse,
            },
            "tracking_max_abs": {
                "plain_gain": self.runs.plain.max_abs,
                "base_inverse": self.runs.base.max_abs,
                "extended_inverse": self.runs.extended.max_abs,
            },
        })
    }
}

fn verdict(v: Verdict) -> &'static str {
    match v {
        Verdict::Explained => "explained",
        Verdict::NothingMissing => "the residual is at the noise floor",
        Verdict::BaseTooCoarse => "the base model is too coarse",
        Verdict::Unexplained => "the residual matches none of the known effects",
    }
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
