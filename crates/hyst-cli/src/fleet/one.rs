//! Reads, fits and diagnoses one actuator, on the threads of the calling pool.

use std::collections::BTreeMap;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Instant;

use hyst_ident::atomic_file::write_atomic;
use hyst_ident::diagnose::{DiagnoseOptions, Diagnosis};
use hyst_ident::model::Model;
use hyst_ident::record::{ColumnMap, Need, Reading, Record};
use hyst_ident::simulate::Zero;
use hyst_ident::stop::Stop;
use sha2::{Digest, Sha256};

use super::{Entry, Found, NamedEffect, Options, Parameter, Row};
use crate::auto_model::{fitted_and_diagnosed, kind_of};
use crate::exit::{CommandError, CommandResult};
use crate::report::{self, Contents};

/// Prefix of the parameters of single creep elements.
const CREEP_ELEMENT: &str = "share_";

/// Returns the SHA-256 of an actuator's files; `None` if a file cannot be read.
pub fn sum_of(entry: &Entry) -> Option<String> {
    let mut sum = Sha256::new();
    for path in [Some(&entry.file), entry.test.as_ref()].into_iter().flatten() {
        // The length comes first, so that two files and one joined file have different sums.
        let bytes = fs::read(path).ok()?;
        sum.update((bytes.len() as u64).to_le_bytes());
        sum.update(&bytes);
    }
    Some(format!("{:x}", sum.finalize()))
}

/// Returns the row of an actuator, also if it fails; `None` if `stop` has ended it.
pub fn row(entry: &Entry, options: &Options, stop: &Stop) -> Option<Row> {
    let began = Instant::now();
    // Computed before the files are read, so that a file that changes meanwhile is processed again.
    let sha256 = sum_of(entry);
    let outcome = catch_unwind(AssertUnwindSafe(|| found(entry, options, stop)));
    if stop.is_stopped() {
        return None;
    }
    let outcome = match outcome {
        Ok(found) => found.map_err(|error| error.text()),
        Err(_) => Err("internal error of hystctl; please report it with this file".to_owned()),
    };
    Some(Row {
        entry: entry.clone(),
        sha256,
        options: options.fingerprint(),
        took_s: began.elapsed().as_secs_f64(),
        outcome,
    })
}

fn found(entry: &Entry, options: &Options, stop: &Stop) -> CommandResult<Found> {
    let how = Reading { map: ColumnMap::parse(&options.map)?, rate: options.rate };
    let train = Record::read(&entry.file, how.clone(), Need::InputAndOutput)?;
    let test = entry.test.as_ref().map(|path| Record::read(path, how, Need::InputAndOutput)).transpose()?;
    let zero = if options.zero_per_record { Zero::PerRecord } else { Zero::None };
    let diagnosing = DiagnoseOptions { zero, seed: options.seed };
    let kind = kind_of(&options.model)?;
    let (model, text, diagnosis) = fitted_and_diagnosed(&train, test.as_ref(), kind, &diagnosing, &|_| {}, stop)?;
    // If the report cannot be written, the results are kept.
    let report = written(entry, options, (&train, test.as_ref()), (&model, &text), &diagnosis);
    let (report, report_error) = match report {
        Ok(path) => (path, None),
        Err(error) => (None, Some(error.text())),
    };
    let Diagnosis { findings, .. } = diagnosis;
    let effects = findings.effects.iter().map(|finding| NamedEffect {
        name: finding.name.name().to_owned(),
        probability: finding.probability,
        parameters: finding
            .parameters
            .iter()
            // Creep elements have different time constants in each record; only their total is comparable.
            .filter(|(name, _)| !name.starts_with(CREEP_ELEMENT))
            .map(|(name, found)| {
                let (value, std_error, unit) = (found.value, found.std_error, found.unit.clone());
                (name.clone(), Parameter { value, std_error, unit })
            })
            .collect(),
    });
    let rmse = |errors: &Option<hyst_ident::metrics::Errors>| errors.as_ref().map(|errors| errors.rmse);
    Ok(Found {
        rows: train.rows(),
        model: findings.base.name().to_owned(),
        verdict: serde_json::to_value(findings.verdict)
            .ok()
            .and_then(|v| Some(v.as_str()?.to_owned()))
            .unwrap_or_default(),
        noise: findings.noise_floor,
        rmse_before: rmse(&findings.before.train),
        rmse_after: rmse(&findings.after.train),
        test_rmse_before: rmse(&findings.before.test),
        test_rmse_after: rmse(&findings.after.test),
        effects: effects.collect(),
        suspects: findings
            .suspects
            .iter()
            .map(|s| (s.name.name().to_owned(), s.probability))
            .collect::<BTreeMap<_, _>>(),
        unit: findings.unit,
        report,
        report_error,
    })
}

/// Writes the report if the options ask for reports; returns its path.
fn written(
    entry: &Entry,
    options: &Options,
    (train, test): (&Record, Option<&Record>),
    (model, text): (&Model, &str),
    diagnosis: &Diagnosis,
) -> CommandResult<Option<String>> {
    let Some(folder) = &options.reports else { return Ok(None) };
    let contents = Contents {
        diagnosis,
        model,
        model_file: "its model",
        model_path: "model.json",
        model_sha256: &format!("{:x}", Sha256::digest(text)),
        extended_file: None,
        train,
        test,
        reading: options.map.iter().flat_map(|entry| ["--map".to_owned(), entry.clone()]).collect(),
        seed: options.seed,
    };
    let page = report::page(&contents).map_err(CommandError::failed)?;
    // The hash distinguishes files of the same name; the limit keeps names short enough for file systems.
    let stem = Path::new(&entry.file).file_stem().unwrap_or_default().to_string_lossy();
    let stem: String =
        stem.chars().map(|c| if c.is_alphanumeric() || "._-".contains(c) { c } else { '_' }).take(80).collect();
    let digits = format!("{:x}", Sha256::digest(format!("{:?}", (&entry.file, &entry.test))));
    let path = folder.join(format!("{stem}-{}.html", &digits[..8]));
    write_atomic(&path, |out| out.write_all(page.as_bytes()))?;
    Ok(Some(path.display().to_string()))
}
