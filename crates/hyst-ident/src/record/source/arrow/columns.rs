//! The columns of a file, extended by each record batch.

use std::collections::HashMap;

use super::buffers::{Batch, append, is_set};
use super::fault::Fault;
use super::flatbuffer;
use super::message::{BATCH, DICTIONARY};
use super::schema::{Dictionary, Field, Kind, Number, Schema};
use crate::record::source::columnar::{Clock, unpacked_limit};
use crate::record::source::{Head, Table};

/// Longest list that is read as columns `name[1]`, `name[2]`, …. Longer lists are images or waveforms.
const MAX_LIST: usize = 1000;

/// Largest number of columns of a file, including elements of lists.
const MAX_COLUMNS: usize = 100_000;

/// The columns of a file, and the state for reading further batches.
pub(super) struct Columns {
    schema: Schema,
    store: Store,
}

struct Store {
    columns: Vec<Column>,
    dictionaries: HashMap<i64, Vec<f64>>,
    memory: Memory,
}

struct Column {
    head: Head,
    numbers: Numbers,
}

/// The numbers of a column so far.
struct Numbers {
    values: Vec<f64>,
    clock: Clock,
}

/// The memory that further values may take \[bytes\].
struct Memory(usize);

impl Columns {
    /// Makes columns without rows. `size` is the size of the file \[bytes\].
    pub(super) fn new(schema: Schema, size: usize) -> Result<Self, Fault> {
        let mut columns = Vec::new();
        for field in &schema.fields {
            add_columns(field, "", &mut columns)?;
        }
        let memory = Memory(unpacked_limit(size));
        Ok(Self { schema, store: Store { columns, dictionaries: HashMap::new(), memory } })
    }

    /// Reads the rows of a message. Messages of other kinds are skipped.
    pub(super) fn take(&mut self, kind: u8, header: flatbuffer::Table<'_>, body: &[u8]) -> Result<(), Fault> {
        match kind {
            BATCH => {
                let mut batch = Batch::open(header, body)?;
                let mut column = 0;
                self.schema.fields.iter().try_for_each(|field| self.store.read(&mut batch, field, &mut column, None))
            }
            DICTIONARY => {
                let id = header.i64(0, 0);
                let dictionary = self.schema.dictionaries.iter().find(|own| own.id == id);
                let (Some(dictionary), Some(data)) = (dictionary, header.table(1)) else {
                    return Err(Fault::damaged("a dictionary belongs to no column"));
                };
                let mut batch = Batch::open(data, body)?;
                let extends = header.u8(2, 0) != 0;
                self.store
                    .read_dictionary(&mut batch, dictionary, extends)
                    .map_err(|fault| fault.of(&dictionary.values))
            }
            _ => Ok(()),
        }
    }

    /// Moves the columns to `table` and returns the key-value metadata of the file.
    pub(super) fn fill(self, table: &mut Table) -> Vec<(String, String)> {
        // A column with a single row is a setting, not a measurement.
        for column in self.store.columns.into_iter().filter(|column| column.numbers.values.len() >= 2) {
            table.push(column.head, column.numbers.values);
        }
        self.schema.statements
    }
}

/// Adds the columns of a field, in the order of a batch.
fn add_columns(field: &Field, path: &str, columns: &mut Vec<Column>) -> Result<(), Fault> {
    let name = if path.is_empty() { field.name.clone() } else { format!("{path}.{}", field.name) };
    let mut add = |name: String, unit: &Option<String>, number: Option<Number>| {
        if columns.len() >= MAX_COLUMNS {
            return Err(Fault::new(format!(
                "there are more than {MAX_COLUMNS} columns; write only the columns of the record"
            )));
        }
        let head = Head { unit: unit.clone(), ..Head::new(name) };
        columns.push(Column { head, numbers: Numbers::new(number) });
        Ok(())
    };
    match (&field.kind, field.children.as_slice()) {
        (Kind::Number(number), _) => add(name, &field.unit, Some(*number)),
        (Kind::Dictionary { .. }, _) => add(name, &field.unit, None),
        (Kind::Lists(length), [Field { kind: Kind::Number(number), unit, .. }]) if *length <= MAX_LIST => {
            let unit = if field.unit.is_some() { &field.unit } else { unit };
            (1..=*length).try_for_each(|k| add(format!("{name}[{k}]"), unit, Some(*number)))
        }
        (Kind::Struct, children) => children.iter().try_for_each(|child| add_columns(child, &name, columns)),
        _ => Ok(()),
    }
}

impl Memory {
    /// Accounts for `count` numbers.
    fn claim(&mut self, count: usize) -> Result<(), Fault> {
        let rest = count.checked_mul(size_of::<f64>()).and_then(|bytes| self.0.checked_sub(bytes));
        let too_many = || {
            Fault::new(
                "the numbers unpack to more than 200 times the size of the file; write only the columns of the record, as CSV",
            )
        };
        self.0 = rest.ok_or_else(too_many)?;
        Ok(())
    }
}

impl Numbers {
    fn new(number: Option<Number>) -> Self {
        let per_second = if let Some(Number::Instant { per_second, .. }) = number { per_second } else { 1 };
        Self { values: Vec::new(), clock: Clock::new(per_second) }
    }

    /// Reads the numbers of the next field, which has `rows` rows. `outer` are the valid rows of the enclosing struct.
    fn read(
        &mut self,
        memory: &mut Memory,
        batch: &mut Batch<'_>,
        number: Number,
        rows: usize,
        outer: Option<&[u8]>,
    ) -> Result<(), Fault> {
        let valid = validity(batch, rows, outer)?;
        memory.claim(rows)?;
        let stored = batch.buffer()?;
        let size = number.size(rows).ok_or_else(|| Fault::damaged("there are too many rows"))?;
        let bytes = batch.unpack(stored, size)?;
        match valid {
            Some(valid) => append(&mut self.values, number, &bytes, rows, &|row| is_set(&valid, row), &mut self.clock),
            None => append(&mut self.values, number, &bytes, rows, &|_| true, &mut self.clock),
        }
        Ok(())
    }
}

/// Reads the node of the next field, which has `rows` rows, and its first buffer.
///
/// Returns the bits of the rows that are valid in the field and in the enclosing struct; `None` if all rows are valid.
fn validity(batch: &mut Batch<'_>, rows: usize, outer: Option<&[u8]>) -> Result<Option<Vec<u8>>, Fault> {
    let node = batch.node()?;
    if node.rows != rows {
        return Err(Fault::damaged("the column is not as long as the others"));
    }
    let stored = batch.buffer()?;
    // The buffer may be empty if there are no nulls.
    if !node.nulls || stored.is_empty() {
        return Ok(outer.map(<[u8]>::to_vec));
    }
    let mut bits = batch.unpack(stored, rows.div_ceil(8))?.into_owned();
    if let Some(outer) = outer {
        bits.iter_mut().zip(outer).for_each(|(byte, outer)| *byte &= outer);
    }
    Ok(Some(bits))
}

impl Store {
    /// Reads the rows of a field and of its children. `outer` are the valid rows of the enclosing struct.
    fn read(
        &mut self,
        batch: &mut Batch<'_>,
        field: &Field,
        column: &mut usize,
        outer: Option<&[u8]>,
    ) -> Result<(), Fault> {
        let (at, rows) = (*column, batch.rows());
        let read = match (&field.kind, field.children.as_slice()) {
            (Kind::Number(number), _) => {
                *column += 1;
                self.columns[at].numbers.read(&mut self.memory, batch, *number, rows, outer)
            }
            (Kind::Dictionary { id, index }, _) => {
                *column += 1;
                self.read_indices(batch, *id, *index, at, outer)
            }
            (Kind::Lists(length), [Field { kind: Kind::Number(number), .. }]) if *length <= MAX_LIST => {
                *column += length;
                self.read_lists(batch, *number, at..at + length, outer)
            }
            (Kind::Struct, children) => {
                let valid = validity(batch, rows, outer).map_err(|fault| fault.of(field))?;
                return children.iter().try_for_each(|child| self.read(batch, child, column, valid.as_deref()));
            }
            _ => skip(batch, field),
        };
        read.map_err(|fault| fault.of(field))
    }

    /// Reads indices into a dictionary and appends the numbers that they select.
    fn read_indices(
        &mut self,
        batch: &mut Batch<'_>,
        id: i64,
        index: Number,
        at: usize,
        outer: Option<&[u8]>,
    ) -> Result<(), Fault> {
        let mut indices = Numbers::new(None);
        indices.read(&mut self.memory, batch, index, batch.rows(), outer)?;
        let dictionary = self.dictionaries.get(&id).map_or(&[][..], Vec::as_slice);
        // The index of a null row is NaN.
        let value = |index: f64| if index >= 0.0 { dictionary.get(index as usize).copied() } else { None };
        self.columns[at]
            .numbers
            .values
            .extend(indices.values.into_iter().map(|index| value(index).unwrap_or(f64::NAN)));
        Ok(())
    }

    /// Reads lists of one length. Column k has the k-th number of each list.
    fn read_lists(
        &mut self,
        batch: &mut Batch<'_>,
        number: Number,
        columns: std::ops::Range<usize>,
        outer: Option<&[u8]>,
    ) -> Result<(), Fault> {
        let (rows, length) = (batch.rows(), columns.len());
        let valid = validity(batch, rows, outer)?;
        let mut all = Numbers::new(Some(number));
        // All columns of a list count from the same midnight.
        all.clock = self.columns.get(columns.start).map_or(all.clock, |first| first.numbers.clock);
        let count = rows.checked_mul(length).ok_or_else(|| Fault::damaged("there are too many rows"))?;
        all.read(&mut self.memory, batch, number, count, None)?;
        self.memory.claim(count)?;
        for (k, column) in self.columns[columns].iter_mut().enumerate() {
            let is_valid = |row| valid.as_deref().is_none_or(|valid| is_set(valid, row));
            let value = |row| if is_valid(row) { all.values[row * length + k] } else { f64::NAN };
            column.numbers.values.extend((0..rows).map(value));
            column.numbers.clock = all.clock;
        }
        Ok(())
    }

    fn read_dictionary(&mut self, batch: &mut Batch<'_>, dictionary: &Dictionary, extends: bool) -> Result<(), Fault> {
        let Kind::Number(number) = dictionary.values.kind else { return Ok(()) };
        let mut numbers = Numbers::new(None);
        if extends {
            numbers.values = self.dictionaries.remove(&dictionary.id).unwrap_or_default();
        }
        numbers.read(&mut self.memory, batch, number, batch.rows(), None)?;
        self.dictionaries.insert(dictionary.id, numbers.values);
        Ok(())
    }
}

/// Skips a field and its children.
fn skip(batch: &mut Batch<'_>, field: &Field) -> Result<(), Fault> {
    batch.node()?;
    batch.skip(field.buffers, field.variadic)?;
    field.children.iter().try_for_each(|child| skip(batch, child))
}

impl Fault {
    /// Adds the name of the column.
    fn of(self, field: &Field) -> Self {
        Self(format!("column \"{}\": {}", field.name, self.0))
    }
}
