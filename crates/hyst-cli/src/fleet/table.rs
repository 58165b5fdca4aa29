//! Results of a fleet as a Parquet file: one row per actuator, with the columns of all actuators.
//!
//! The journal is read twice: first to find the columns, then to write them in blocks.

use std::collections::BTreeSet;
use std::io::{self, Write};
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;

use super::journal::Journal;
use super::{Entry, Found, Row};

/// Number of rows that are held in memory.
const BLOCK: usize = 4096;

/// Values of a column.
enum Cells {
    Texts(Vec<Option<String>>),
    Numbers(Vec<Option<f64>>),
    Counts(Vec<Option<i64>>),
}

type Text = fn(&Row) -> Option<String>;
type Number = fn(&Found) -> Option<f64>;

const TEXTS: &[(&str, Text)] = &[
    ("file", |row| Some(row.entry.file.clone())),
    ("serial", |row| row.entry.serial.clone()),
    ("date", |row| row.entry.date.clone()),
    ("error", |row| row.outcome.as_ref().err().cloned()),
    ("verdict", |row| found(row).map(|found| found.verdict.clone())),
    ("effects", |row| {
        found(row).map(|found| found.effects.iter().map(|effect| effect.name.as_str()).collect::<Vec<_>>().join(","))
    }),
    ("model", |row| found(row).map(|found| found.model.clone())),
    ("unit", |row| found(row).map(|found| found.unit.clone())),
    ("report", |row| found(row).and_then(|found| found.report.clone())),
    ("report_error", |row| found(row).and_then(|found| found.report_error.clone())),
    ("sha256", |row| row.sha256.clone()),
    ("options", |row| Some(row.options.clone())),
];

const NUMBERS: &[(&str, Number)] = &[
    ("noise", |found| Some(found.noise)),
    ("rmse_before", |found| found.rmse_before),
    ("rmse_after", |found| found.rmse_after),
    ("test_rmse_before", |found| found.test_rmse_before),
    ("test_rmse_after", |found| found.test_rmse_after),
];

fn found(row: &Row) -> Option<&Found> {
    row.outcome.as_ref().ok()
}

/// Returns the columns of all effects of an actuator: probabilities, parameters and standard errors.
fn of_effects(found: &Found) -> impl Iterator<Item = (String, Option<f64>)> + '_ {
    let suspected = found.suspects.iter().map(|(name, p)| (format!("{name}_suspected"), Some(*p)));
    let named = found.effects.iter().flat_map(|effect| {
        let own = &effect.name;
        let parameters = effect.parameters.iter().flat_map(move |(name, parameter)| {
            [(format!("{own}_{name}"), Some(parameter.value)), (format!("{own}_{name}_std_error"), parameter.std_error)]
        });
        std::iter::once((format!("{own}_probability"), Some(effect.probability))).chain(parameters)
    });
    named.chain(suspected)
}

/// Writes the rows of these actuators.
///
/// # Errors
/// When the journal cannot be read or `out` cannot be written.
pub fn write(out: &mut dyn Write, journal: &Journal, entries: &[Entry]) -> io::Result<()> {
    in_blocks(out, journal, entries, BLOCK)
}

fn in_blocks(out: &mut dyn Write, journal: &Journal, entries: &[Entry], block_rows: usize) -> io::Result<()> {
    let mut further = BTreeSet::new();
    for row in journal.rows(entries)? {
        let (_, row) = row?;
        further.extend(found(&row).into_iter().flat_map(of_effects).map(|(name, _)| name));
    }
    let texts = TEXTS.iter().map(|(name, _)| format!("OPTIONAL BYTE_ARRAY {name} (UTF8);"));
    let counts = std::iter::once("OPTIONAL INT64 rows;".to_owned());
    let numbers =
        NUMBERS.iter().map(|(name, _)| (*name).to_owned()).chain(["took_s".to_owned()]).chain(further.iter().cloned());
    // Names in the schema must not contain hyphens.
    let numbers = numbers.map(|name| format!("OPTIONAL DOUBLE {};", column(&name)));
    let schema = format!("message fleet {{ {} }}", texts.chain(counts).chain(numbers).collect::<Vec<_>>().join(" "));
    let schema = Arc::new(parse_message_type(&schema).map_err(failed)?);
    let properties = Arc::new(WriterProperties::builder().set_compression(Compression::SNAPPY).build());
    // The writer needs an output that is `Send`, so each block is buffered in memory.
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, properties).map_err(failed)?;
    let mut rows = journal.rows(entries)?;
    loop {
        let block: Vec<Row> = rows.by_ref().take(block_rows).map(|row| Ok(row?.1)).collect::<io::Result<_>>()?;
        if block.is_empty() {
            break;
        }
        let mut group = writer.next_row_group().map_err(failed)?;
        for cells in cells(&block, &further) {
            write_cells(&mut group, cells).map_err(failed)?;
        }
        group.close().map_err(failed)?;
        out.write_all(writer.inner())?;
        writer.inner_mut().clear();
    }
    writer.finish().map_err(failed)?;
    out.write_all(writer.inner())
}

/// Returns a name with only letters, digits and underscores.
fn column(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

fn failed(error: ParquetError) -> io::Error {
    io::Error::other(error)
}

/// Returns the values of each column, in the order of the schema.
fn cells(block: &[Row], further: &BTreeSet<String>) -> Vec<Cells> {
    let texts = TEXTS.iter().map(|(_, of)| Cells::Texts(block.iter().map(of).collect()));
    let rows = |row: &Row| found(row).map(|found| found.rows as i64);
    let counts = std::iter::once(Cells::Counts(block.iter().map(rows).collect()));
    let numbers =
        NUMBERS.iter().map(|(_, of)| Cells::Numbers(block.iter().map(|row| found(row).and_then(of)).collect()));
    let took = std::iter::once(Cells::Numbers(block.iter().map(|row| Some(row.took_s)).collect()));
    let own: Vec<Vec<(String, Option<f64>)>> =
        block.iter().map(|row| found(row).into_iter().flat_map(of_effects).collect()).collect();
    let of_effects = further.iter().map(|name| {
        let of = |own: &Vec<(String, Option<f64>)>| {
            own.iter().find(|(other, _)| other == name).and_then(|(_, value)| *value)
        };
        Cells::Numbers(own.iter().map(of).collect())
    });
    texts.chain(counts).chain(numbers).chain(took).chain(of_effects).collect()
}

fn write_cells(group: &mut SerializedRowGroupWriter<'_, Vec<u8>>, cells: Cells) -> Result<(), ParquetError> {
    let Some(mut column) = group.next_column()? else { return Ok(()) };
    match cells {
        Cells::Texts(cells) => {
            let levels = levels(&cells);
            let values: Vec<ByteArray> =
                cells.into_iter().flatten().map(|text| ByteArray::from(text.into_bytes())).collect();
            column.typed::<ByteArrayType>().write_batch(&values, Some(&levels), None)?;
        }
        Cells::Numbers(cells) => {
            let values: Vec<f64> = cells.iter().flatten().copied().collect();
            column.typed::<DoubleType>().write_batch(&values, Some(&levels(&cells)), None)?;
        }
        Cells::Counts(cells) => {
            let values: Vec<i64> = cells.iter().flatten().copied().collect();
            column.typed::<Int64Type>().write_batch(&values, Some(&levels(&cells)), None)?;
        }
    }
    column.close()
}

/// Returns the definition levels of a column: 1 for a value, 0 for none.
fn levels<T>(cells: &[Option<T>]) -> Vec<i16> {
    cells.iter().map(|cell| i16::from(cell.is_some())).collect()
}

#[cfg(test)]
mod tests {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;

    use super::super::{NamedEffect, Parameter};
    use super::*;

    #[test]
    fn a_reader_finds_every_cell_in_every_block() {
        let folder = tempfile::tempdir().unwrap();
        let mut journal = Journal::open(&folder.path().join("j")).unwrap();
        let row = |k: usize| {
            let entry = Entry { file: format!("p{k}"), test: None, serial: Some(format!("S-{k}")), date: None };
            let parameter = Parameter { value: k as f64, std_error: None, unit: "s".into() };
            let effect = NamedEffect {
                name: "rate-dependence".into(),
                probability: 0.97,
                parameters: [("seconds".to_owned(), parameter)].into(),
            };
            let found = Found {
                rows: 10 * k,
                model: "pi".into(),
                unit: "um".into(),
                verdict: "explained".into(),
                noise: 0.1 * k as f64,
                rmse_before: Some(1.0),
                rmse_after: None,
                test_rmse_before: None,
                test_rmse_after: None,
                effects: if k == 3 { vec![effect] } else { Vec::new() },
                suspects: [].into(),
                report: None,
                report_error: None,
            };
            let outcome = if k == 1 { Err("torn".to_owned()) } else { Ok(found) };
            Row { entry, sha256: None, options: "o".into(), took_s: 0.5, outcome }
        };
        let rows: Vec<Row> = (0..5).map(row).collect();
        rows.iter().for_each(|row| journal.add(row).unwrap());
        let entries: Vec<Entry> = rows.iter().map(|row| row.entry.clone()).collect();
        let mut bytes = Vec::new();
        in_blocks(&mut bytes, &journal, &entries, 2).unwrap();
        let reader = SerializedFileReader::new(bytes::Bytes::from(bytes)).unwrap();
        assert_eq!(reader.num_row_groups(), 3);
        let schema = reader.metadata().file_metadata().schema_descr();
        let at = |name: &str| (0..schema.num_columns()).find(|k| schema.column(*k).name() == name).unwrap();
        let read: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
        assert_eq!(read.len(), 5);
        for (k, row) in read.iter().enumerate() {
            assert_eq!(row.get_string(at("serial")).unwrap(), &format!("S-{k}"));
            if k == 1 {
                assert_eq!(row.get_string(at("error")).unwrap(), "torn");
                assert!(row.get_double(at("noise")).is_err());
            } else {
                assert_eq!(row.get_double(at("noise")).unwrap(), 0.1 * k as f64);
                assert_eq!(row.get_long(at("rows")).unwrap(), 10 * k as i64);
            }
            assert_eq!(row.get_double(at("rate_dependence_seconds")).ok(), (k == 3).then_some(3.0));
        }
    }
}
