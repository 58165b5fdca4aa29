//! Reading what commands are given: records, models, plants.

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

/// The records of all files, joined to one.
pub(crate) fn training(paths: &[PathBuf], map: &MapArg) -> CommandResult<Record> {
    let read = |path: &PathBuf| read(path, map, Need::InputAndOutput);
    let records: Vec<Record> = paths.iter().map(read).collect::<CommandResult<_>>()?;
    records.iter().for_each(tell_oddities);
    Ok(Record::join(records)?)
}

/// A file, or what comes on stdin for `-`.
fn read(path: &Path, map: &MapArg, need: Need) -> CommandResult<Record> {
    let how = Reading { map: ColumnMap::parse(&map.map)?, rate: map.rate };
    if path != Path::new("-") {
        let bar = Progress::bar("reading", 1000);
        return Ok(Record::read_watched(path, how, need, &mut |share| bar.at((1000.0 * share) as usize))?);
    }
    let mut bytes = Vec::new();
    let came = io::stdin().lock().read_to_end(&mut bytes);
    came.map_err(|error| CommandError::bad_input(format!("stdin: cannot be read: {error}")))?;
    Ok(Record::parse("stdin", &bytes, how, need)?)
}

/// One record.
pub(crate) fn record(path: &Path, map: &MapArg, need: Need) -> CommandResult<Record> {
    let record = read(path, map, need)?;
    tell_oddities(&record);
    if falls(&record) {
        let column = record.output_unit().map_or("", |unit| unit.column());
        say(&format!(
            "note: {}: the output falls where the input rises; if that of the model does not, read it with --map {column}=-COLUMN",
            record.name()
        ));
    }
    Ok(record)
}

/// A record with what the file has: input and output, or one of them.
pub(crate) fn any(path: &Path, map: &MapArg) -> CommandResult<Record> {
    let how = Reading { map: ColumnMap::parse(&map.map)?, rate: map.rate };
    let record = Record::read_any(path, &how)?;
    tell_oddities(&record);
    Ok(record)
}

/// Whether the output goes against the input.
fn falls(record: &Record) -> bool {
    opposed(record.input(), record.output().unwrap_or_default())
}

/// Whether one signal falls where the other rises.
fn opposed(u: &[f64], y: &[f64]) -> bool {
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
    let (mean_u, mean_y) = (mean(u), mean(y));
    u.iter().zip(y).map(|(u, y)| (u - mean_u) * (y - mean_y)).sum::<f64>() < 0.0
}

/// Share of a whole loop's box from which on a loop is open.
const OPEN: f64 = 0.003;

/// Whether loops are passed the other way round than hysteresis makes them: with a falling branch below the rising one.
fn leads(record: &Record) -> bool {
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
        // What comes back, nearly, to where it began is closed by a straight line.
        if (u1 - u0).abs() > 0.1 * wide {
            continue;
        }
        area += 0.5 * (y1 - y0) * (u0 - u1);
        for (u, y) in u.windows(2).zip(y.windows(2)) {
            area += (0.5 * (y[0] + y[1]) - y0) * (u[1] - u[0]);
            path += (u[1] - u[0]).abs();
        }
    }
    // Of an output whose sign is turned a loop is passed the other way, and nothing is exchanged.
    let area = if opposed(u, y) { -area } else { area };
    let loops = path / (2.0 * wide);
    loops >= 1.0 && area > OPEN * loops * wide * high
}

/// Largest value less the smallest.
fn span(x: &[f64]) -> f64 {
    let (low, high) = range(x.iter().copied());
    high - low
}

/// Sample rates that actuators are measured at \[Hz\].
const ORDINARY_RATES: Range<f64> = 5.0..2e5;

/// Says what was done to read a record.
fn tell_notes(record: &Record) {
    record.notes().iter().for_each(|note| say(&format!("note: {}: {note}", record.name())));
}

/// Says what was done to read a record, and what is legal in it but seldom meant.
pub(crate) fn tell_oddities(record: &Record) {
    tell_notes(record);
    oddities(record).iter().for_each(|odd| say(&format!("note: {}: {odd}", record.name())));
}

/// Refuses a record of which input or output never moves.
pub(crate) fn refuse_still(record: &Record) -> CommandResult {
    let still = |x: &[f64]| record.rows() > 1 && !x.is_empty() && span(x) == 0.0;
    let output = record.output().unwrap_or_default();
    for (column, x) in
        [(record.input_column(), record.input()), (record.output_unit().map_or("", |unit| unit.column()), output)]
    {
        if still(x) {
            let message = format!(
                "{}, column \"{column}\": the value is {} in every row. A record needs an input and an output that move; choose another column with --map",
                record.name(),
                text::short(x[0])
            );
            return Err(CommandError::bad_input(message));
        }
    }
    Ok(())
}

/// Intervals of rows that a sentence lists.
const MAX_INTERVALS: usize = 4;

/// What is legal in a record but seldom meant, a sentence each.
pub(crate) fn oddities(record: &Record) -> Vec<String> {
    let mut odd = Vec::new();
    let rate = 1.0 / record.sample_period();
    if !ORDINARY_RATES.contains(&rate) {
        odd.push(format!(
            "{} samples per second; if its times are in another unit than their column says, name that, as with --map {}=COLUMN",
            text::short(rate),
            if rate < ORDINARY_RATES.start { "time_ms" } else { "time_s" }
        ));
    }
    odd.extend(losses(record.lost()));
    if leads(record) {
        odd.push("the output runs ahead of the input in its loops, where hysteresis makes it follow; are the columns of input and output exchanged?".to_owned());
    }
    let unit = record.output_unit().map_or("", |unit| unit.symbol());
    // A reference may stand where it likes.
    let measured = record.output().filter(|_| !record.input().is_empty());
    let frozen = frozen_of(record);
    if let Some(longest) = frozen.iter().max_by_key(|run| run.rows) {
        let rows = frozen.iter().map(|run| run.rows).sum();
        odd.push(format!(
            "the sensor repeats one value: {}, the most from row {} at {} s ({} of {} {unit}). A fit leaves these rows out. Look for dropouts or a stopped data stream",
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
        odd.push(format!(
            "the sensor is at the end of its range, {} {unit}, in {} ({}{more}). A fit leaves these rows out. Lower the drive or widen the range to see them",
            text::short(end.at),
            text::count(rows, "row"),
            shown.join(", ")
        ));
    }
    let spikes = spikes_of(record);
    if let Some(largest) = spikes.first() {
        let largest_is = if spikes.len() == 1 { "it" } else { "the largest" };
        odd.push(format!(
            "{} of the output not fitted: {largest_is} is in row {} at {} s and is {} times the output span away from its neighbours",
            text::count(spikes.len(), "spike"),
            largest.row + 1,
            text::short(record.time()[largest.row]),
            text::short(largest.spans)
        ));
    }
    odd
}

/// What a log lost of its run, a sentence each.
pub(crate) fn losses(lost: Losses) -> Vec<String> {
    let cut = lost.cut_off.then(|| "the log was cut off: what came after its last whole part is missing (of a log of hystctl run half a second at most); copy the file again if it should be longer".to_owned());
    cut.into_iter().chain(damage(lost.damaged)).chain(holes(lost.holes)).collect()
}

/// What to say about pieces of a log that are damaged, if there are any.
pub(crate) fn damage(pieces: usize) -> Option<String> {
    let many = text::count(pieces, "damaged piece");
    (pieces > 0).then(|| format!("{many} of the log left out; their samples, up to half a second each, are lost"))
}

/// What to say about samples that are missing within a segment.
pub(crate) fn holes(holes: usize) -> Option<String> {
    let many = text::count(holes, "hole");
    (holes > 0).then(|| format!("{many} in time, behind each of which another segment begins: what an actuator remembers from before is not known there"))
}

/// Options with which records are read, as the command line takes them.
pub(crate) fn reading(map: &MapArg, zero: &ZeroArg) -> Vec<String> {
    let zero = (zero.get() == Zero::PerRecord).then(|| ["--zero".to_owned(), "per-record".to_owned()]);
    columns(map).into_iter().chain(zero.into_iter().flatten()).collect()
}

/// Those of them that say which columns are read.
pub(crate) fn columns(map: &MapArg) -> Vec<String> {
    let rate = map.rate.into_iter().flat_map(|rate| ["--rate".to_owned(), rate.to_string()]);
    map.map.iter().flat_map(|entry| ["--map".to_owned(), entry.clone()]).chain(rate).collect()
}

/// Says how much of a test record repeats the training's drive, if any of it does.
pub(crate) fn tell_repeated(test: &Record, train: &Record) {
    let repeated = repeated_rows(test, train);
    if repeated > 0 {
        say(&format!(
            "note: {}: {} of its rows repeat a segment of the training's drive, and the errors say less about new drives there; `hystctl excite identification --test` makes a drive that differs throughout",
            test.name(),
            text::percent(100.0 * repeated as f64 / test.rows() as f64)
        ));
    }
}

/// Rows of those whole segments whose drive is, but for noise, that of a segment of the training.
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

/// What is said of such a test record.
pub(crate) const TRAINED_ON: &str =
    "note: the test record is one of those that were fitted; its errors say nothing about new data";

/// A model and the text of its file.
pub(crate) fn model(path: &Path) -> CommandResult<(Model, String)> {
    let name = path.display().to_string();
    let text = fs::read_to_string(path).map_err(|source| ModelError::Read { path: name.clone(), source })?;
    Ok((Model::parse(&name, &text)?, text))
}

/// The unit of a model's output.
pub(crate) fn output_unit(model: &Model) -> CommandResult<OutputUnit> {
    OutputUnit::of_column(&model.output.column).ok_or_else(|| {
        let message = format!(
            "the model's output column is {:?}, which is none of this version; fit the model anew",
            model.output.column
        );
        CommandError::bad_input(message)
    })
}

/// The constant temperature of the command line \[°C\]; says so where it has no effect.
pub(crate) fn temperature(given: TemperatureArg, model: &Model, record: &Record) -> Option<f64> {
    let degc = given.degc?;
    if !model.needs_temperature() {
        say("note: the model does not depend on temperature; --temperature has no effect");
    } else if record.temperature().is_some() {
        say(&format!("note: {} has temperature_degc; --temperature has no effect", record.name()));
    }
    Some(degc)
}

/// The simulated plant that a file describes, with its noise from another seed if one is given.
pub(crate) fn plant(path: &Path, noise: Option<u64>) -> CommandResult<Plant> {
    let wrong = |error: anyhow::Error, advice: &str| {
        let message = format!("{}: {}; {advice}", path.display(), format!("{error:#}").trim_end());
        CommandError::new(Exit::BadInput, anyhow::anyhow!("{message}"))
    };
    let named = |error: anyhow::Error| wrong(error, "correct the plant's file");
    let text = fs::read_to_string(path)
        .map_err(|error| wrong(error.into(), "`hystctl run --help` shows what such a file holds"))?;
    let mut config = PlantConfig::from_toml(&text).map_err(|error| named(error.into()))?;
    config.noise_seed = noise.or(config.noise_seed);
    Plant::new(config).map_err(|error| named(error.into()))
}

/// Those of `names` that a file has as columns already.
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
