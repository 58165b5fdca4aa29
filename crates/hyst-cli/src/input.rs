//! Reads the inputs of commands: records, models and plants.

use std::fs;
use std::io::{self, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use hyst_hw::{Plant, PlantConfig};
use hyst_ident::clipping::clipped;
use hyst_ident::frozen::frozen_of;
use hyst_ident::model::{Model, ModelError};
use hyst_ident::range;
use hyst_ident::record::{ColumnMap, Losses, Need, OutputUnit, Reading, Record};
use hyst_ident::simulate::Zero;
use hyst_ident::spikes::spikes_of;

use crate::cli::{MapArg, TemperatureArg, ZeroArg};
use crate::exit::{CommandError, CommandResult, Exit};
use crate::output::say;
use crate::progress::Progress;
use crate::text;

/// Reads the records of all files and joins them.
pub(crate) fn training(paths: &[PathBuf], map: &MapArg) -> CommandResult<Record> {
    let read = |path: &PathBuf| read(path, map, Need::InputAndOutput);
    let records: Vec<Record> = paths.iter().map(read).collect::<CommandResult<_>>()?;
    records.iter().for_each(print_notes);
    Ok(Record::join(records)?)
}

/// Reads a record from a file, or from stdin for `-`.
fn read(path: &Path, map: &MapArg, need: Need) -> CommandResult<Record> {
    let how = Reading { map: ColumnMap::parse(&map.map)?, rate: map.rate };
    if path != Path::new("-") {
        let bar = Progress::bar("reading", 1000);
        return Ok(Record::read_watched(path, how, need, &mut |share| bar.at((1000.0 * share) as usize))?);
    }
    let mut bytes = Vec::new();
    let outcome = io::stdin().lock().read_to_end(&mut bytes);
    outcome.map_err(|error| CommandError::bad_input(format!("stdin: cannot be read: {error}")))?;
    Ok(Record::parse("stdin", &bytes, how, need)?)
}

/// Reads the reference of a model, without columns that the model does not use.
pub(crate) fn reference(path: &Path, map: &MapArg, model: &Model) -> CommandResult<Record> {
    let need = Need::Reference { temperature: model.needs_temperature(), load: model.needs_load() };
    record(path, map, need)
}

/// Reads one record and prints notes about it.
pub(crate) fn record(path: &Path, map: &MapArg, need: Need) -> CommandResult<Record> {
    let record = read(path, map, need)?;
    print_notes(&record);
    if has_negative_gain(&record) {
        let column = record.output_unit().map_or("", |unit| unit.column());
        say(&format!(
            "note: {}: the output falls while the input rises; if the model's output rises, change the sign with \
             --map {column}=-COLUMN",
            record.name()
        ));
    }
    Ok(record)
}

/// Reads a record with input, output or both.
pub(crate) fn any(path: &Path, map: &MapArg) -> CommandResult<Record> {
    let how = Reading { map: ColumnMap::parse(&map.map)?, rate: map.rate };
    let record = Record::read_any(path, &how)?;
    print_notes(&record);
    Ok(record)
}

/// Whether the output falls while the input rises.
fn has_negative_gain(record: &Record) -> bool {
    have_negative_covariance(record.input(), record.output().unwrap_or_default())
}

/// Whether the covariance of two signals is negative.
fn have_negative_covariance(u: &[f64], y: &[f64]) -> bool {
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
    let (mean_u, mean_y) = (mean(u), mean(y));
    u.iter().zip(y).map(|(u, y)| (u - mean_u) * (y - mean_y)).sum::<f64>() < 0.0
}

/// Minimum area of an open loop, as a share of its bounding box.
const MIN_LOOP_AREA_SHARE: f64 = 0.003;

/// Whether the loops have the opposite direction of hysteresis (falling branch below rising one).
fn output_leads(record: &Record) -> bool {
    let (u, Some(y)) = (record.input(), record.output()) else { return false };
    let mut y = y.to_vec();
    for run in frozen_of(record) {
        let before = y[run.first.saturating_sub(1)];
        y[run.first..run.first + run.rows].fill(before);
    }
    let y = y.as_slice();
    let (wide, high) = (span(u), span(y));
    let (mut area, mut path) = (0.0, 0.0);
    for rows in record.segments() {
        let (Some(u), Some(y)) = (u.get(rows.clone()), y.get(rows.clone())) else { return false };
        let (&[u0, .., u1], &[y0, .., y1]) = (u, y) else { continue };
        // A segment that ends near its start is closed by a straight line.
        if (u1 - u0).abs() > 0.1 * wide {
            continue;
        }
        area += 0.5 * (y1 - y0) * (u0 - u1);
        for (u, y) in u.windows(2).zip(y.windows(2)) {
            area += (0.5 * (y[0] + y[1]) - y0) * (u[1] - u[0]);
            path += (u[1] - u[0]).abs();
        }
    }
    // A negative gain reverses the direction of the loop; the columns are not exchanged then.
    let area = if have_negative_covariance(u, y) { -area } else { area };
    let loops = path / (2.0 * wide);
    loops >= 1.0 && area > MIN_LOOP_AREA_SHARE * loops * wide * high
}

/// Maximum minus minimum.
fn span(x: &[f64]) -> f64 {
    let (low, high) = range(x.iter().copied());
    high - low
}

/// Usual sample rates of actuator records \[Hz\].
const USUAL_RATES: Range<f64> = 5.0..2e5;

/// Prints what was done to read a record, and its possible problems.
fn print_notes(record: &Record) {
    record.notes().iter().for_each(|note| say(&format!("note: {}: {note}", record.name())));
    warnings(record).iter().for_each(|warning| say(&format!("note: {}: {warning}", record.name())));
}

/// Refuses a record with a constant input or output.
pub(crate) fn refuse_constant(record: &Record) -> CommandResult {
    let constant = |x: &[f64]| record.rows() > 1 && !x.is_empty() && span(x) == 0.0;
    let output = record.output().unwrap_or_default();
    for (column, x) in
        [(record.input_column(), record.input()), (record.output_unit().map_or("", |unit| unit.column()), output)]
    {
        if constant(x) {
            let message = format!(
                "{}, column \"{column}\": the value is {} in every row. A record needs an input and an output that \
                 change; choose another column with --map",
                record.name(),
                text::short(x[0])
            );
            return Err(CommandError::bad_input(message));
        }
    }
    Ok(())
}

/// Maximum number of row intervals in a warning.
const MAX_INTERVALS: usize = 4;

/// Returns the possible problems of a record, one sentence each.
pub(crate) fn warnings(record: &Record) -> Vec<String> {
    let mut warnings = Vec::new();
    let rate = 1.0 / record.sample_period();
    if !USUAL_RATES.contains(&rate) {
        warnings.push(format!(
            "{} samples per second are unusual; if the times have another unit than their column says, read them with \
             --map {}=COLUMN",
            text::short(rate),
            if rate < USUAL_RATES.start { "time_ms" } else { "time_s" }
        ));
    }
    warnings.extend(losses(record.lost()));
    if output_leads(record) {
        warnings.push(
            "the loops have the opposite direction of hysteresis: the output leads the input; check whether the columns \
             of input and output are exchanged"
                .to_owned(),
        );
    }
    let unit = record.output_unit().map_or("", |unit| unit.symbol());
    // A reference may be constant at its ends; only a measured output can be clipped.
    let measured = record.output().filter(|_| !record.input().is_empty());
    let frozen = frozen_of(record);
    if let Some(longest) = frozen.iter().max_by_key(|run| run.rows) {
        let rows = frozen.iter().map(|run| run.rows).sum();
        warnings.push(format!(
            "the sensor repeats one value in {}; the longest run starts in row {} at {} s ({} rows of {} {unit}). A fit \
             leaves these rows out. Look for dropouts or a stopped data stream",
            text::count(rows, "row"),
            longest.first + 1,
            text::short(record.time()[longest.first]),
            longest.rows,
            text::short(longest.at)
        ));
    }
    let is_frozen = |row: usize| frozen.iter().any(|run| (run.first..run.first + run.rows).contains(&row));
    for end in measured.map_or_else(Vec::new, |y| clipped(y, record.segments())) {
        let intervals: Vec<&Range<usize>> =
            end.intervals.iter().filter(|interval| !is_frozen(interval.start)).collect();
        if intervals.is_empty() {
            continue;
        }
        let rows = intervals.iter().map(|interval| interval.len()).sum();
        let shown: Vec<String> =
            intervals.iter().take(MAX_INTERVALS).map(|i| format!("{} to {}", i.start + 1, i.end)).collect();
        let more = intervals.len().saturating_sub(MAX_INTERVALS);
        let more = if more > 0 { format!(" and {more} more intervals") } else { String::new() };
        warnings.push(format!(
            "the sensor is at the end of its range, {} {unit}, in {} ({}{more}). A fit leaves these rows out. Reduce the \
             drive or widen the range of the sensor to measure them",
            text::short(end.at),
            text::count(rows, "row"),
            shown.join(", ")
        ));
    }
    let spikes = spikes_of(record);
    if let Some(largest) = spikes.first() {
        let largest_is = if spikes.len() == 1 { "it" } else { "the largest" };
        warnings.push(format!(
            "{} of the output not fitted: {largest_is} is in row {} at {} s, {} times the output span away from its \
             neighbours",
            text::count(spikes.len(), "spike"),
            largest.row + 1,
            text::short(record.time()[largest.row]),
            text::short(largest.spans)
        ));
    }
    warnings
}

/// Returns what a log lost of its run, one sentence each.
pub(crate) fn losses(lost: Losses) -> Vec<String> {
    let cut_off = "the log was cut off: the samples after its last complete part are missing (at most 0.5 s in a log of \
                   hystctl run); if the run was longer, copy the file again";
    let cut = lost.cut_off.then(|| cut_off.to_owned());
    cut.into_iter().chain(damage(lost.damaged)).chain(gaps(lost.holes)).collect()
}

/// Returns a sentence about the damaged pieces (chunks of samples) of a log, if there are any.
pub(crate) fn damage(pieces: usize) -> Option<String> {
    let many = text::count(pieces, "damaged piece");
    (pieces > 0).then(|| format!("{many} of the log left out; each holds up to 0.5 s of samples, which are lost"))
}

/// Returns a sentence about the gaps within the segments of a log, if there are any.
pub(crate) fn gaps(gaps: usize) -> Option<String> {
    let many = text::count(gaps, "gap");
    (gaps > 0).then(|| {
        format!("{many} in time; after each a new segment begins, at whose start the drive history is unknown")
    })
}

/// Returns the options that records were read with, as arguments of a command.
pub(crate) fn reading(map: &MapArg, zero: &ZeroArg) -> Vec<String> {
    let zero = (zero.get() == Zero::PerRecord).then(|| ["--zero".to_owned(), "per-record".to_owned()]);
    columns(map).into_iter().chain(zero.into_iter().flatten()).collect()
}

/// Returns the options that select columns and sample rate, as arguments of a command.
pub(crate) fn columns(map: &MapArg) -> Vec<String> {
    let rate = map.rate.into_iter().flat_map(|rate| ["--rate".to_owned(), rate.to_string()]);
    map.map.iter().flat_map(|entry| ["--map".to_owned(), entry.clone()]).chain(rate).collect()
}

/// Prints a note if rows of a test record repeat the drive of the training records.
pub(crate) fn print_repeated(test: &Record, train: &Record) {
    let repeated = repeated_rows(test, train);
    if repeated > 0 {
        say(&format!(
            "note: {}: {} of its rows repeat a segment of the training drive; the errors there do not hold for new \
             drives; `hystctl excite identification --test` makes a drive that differs in all segments",
            test.name(),
            text::percent(100.0 * repeated as f64 / test.rows() as f64)
        ));
    }
}

/// Counts the rows of the segments whose drive equals that of a training segment within noise.
fn repeated_rows(test: &Record, train: &Record) -> usize {
    let (new, old) = (test.input(), train.input());
    let alike = |a: &[f64], b: &[f64]| {
        let squares = || a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        a.len() == b.len() && (squares() / a.len() as f64).sqrt() < 2e-3 * span(b)
    };
    let of_training = |rows: &Range<usize>| train.segments().iter().any(|r| alike(&new[rows.clone()], &old[r.clone()]));
    test.segments().iter().filter(|rows| of_training(rows)).map(Range::len).sum()
}

/// Whether a test record is one of the training's files, byte for byte.
pub(crate) fn is_trained_on(test: &Record, train: &Record) -> bool {
    let sums = |record: &Record| record.sources().iter().filter_map(|s| s.sha256.clone()).collect::<Vec<_>>();
    sums(test).iter().any(|sum| sums(train).contains(sum))
}

/// Note about a test record that was fitted.
pub(crate) const TRAINED_ON: &str =
    "note: the test record was fitted, too; its errors do not hold for new data; give another record with --test";

/// Reads a model; returns it with the text of its file.
pub(crate) fn model(path: &Path) -> CommandResult<(Model, String)> {
    let name = path.display().to_string();
    let text = fs::read_to_string(path).map_err(|source| ModelError::Read { path: name.clone(), source })?;
    Ok((Model::parse(&name, &text)?, text))
}

/// Returns the unit of a model's output.
pub(crate) fn output_unit(model: &Model) -> CommandResult<OutputUnit> {
    OutputUnit::of_column(&model.output.column).ok_or_else(|| {
        let message = format!(
            "the model's output column {:?} is unknown to this version of hystctl; fit the model again",
            model.output.column
        );
        CommandError::bad_input(message)
    })
}

/// Returns the constant temperature of the command line \[°C\]; prints a note if it has no effect.
pub(crate) fn temperature(given: TemperatureArg, model: &Model, record: &Record) -> Option<f64> {
    let degc = given.degc?;
    if !model.needs_temperature() {
        say("note: the model does not depend on temperature; --temperature has no effect");
    } else if record.temperature().is_some() {
        say(&format!("note: {} has temperature_degc; --temperature has no effect", record.name()));
    }
    Some(degc)
}

/// Reads the simulated plant that a file describes; `noise` replaces the seed of its noise.
pub(crate) fn plant(path: &Path, noise: Option<u64>) -> CommandResult<Plant> {
    let wrong = |error: anyhow::Error, advice: &str| {
        let message = format!("{}: {}; {advice}", path.display(), format!("{error:#}").trim_end());
        CommandError::new(Exit::BadInput, anyhow::anyhow!("{message}"))
    };
    let named = |error: anyhow::Error| wrong(error, "correct the plant file");
    let text = fs::read_to_string(path)
        .map_err(|error| wrong(error.into(), "`hystctl run --help` shows an example of a plant file"))?;
    let mut config = PlantConfig::from_toml(&text).map_err(|error| named(error.into()))?;
    config.noise_seed = noise.or(config.noise_seed);
    Plant::new(config).map_err(|error| named(error.into()))
}

/// Returns those of `names` that are columns of a file.
pub(crate) fn present<'a>(path: &Path, names: &[&'a str]) -> CommandResult<Vec<&'a str>> {
    let bytes = fs::read(path)?;
    let text = String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes));
    let header = text.lines().find(|line| !line.is_empty()).unwrap_or_default();
    let columns: Vec<&str> = header.split(',').map(|name| name.trim().trim_matches('"').trim()).collect();
    Ok(names.iter().copied().filter(|name| columns.contains(name)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_found_in_the_header() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        fs::write(&path, "\u{feff}\n time_s, \"voltage_v\",x\n0,settling,1\n").unwrap();
        assert_eq!(present(&path, &["voltage_v", "settling", "time_s"]).unwrap(), ["voltage_v", "time_s"]);
    }
}
