//! Large tables of text, which are read in blocks. Groups of rows are averaged into one.

use std::cell::{Cell, RefCell};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::super::{Contents, Head, Values, Wanted};
use super::dialect::Dialect;
use super::rows;
use super::{Text, encoding};
use crate::record::error::{Place, RecordError};
use crate::record::grid::Printed;

/// Smallest size of a file that is read in blocks \[bytes\].
pub(crate) const LARGE_BYTES: u64 = 256 << 20;
/// Largest number of rows after averaging. It is more than any fit uses.
const MAX_ROWS: u64 = 2_000_000;
/// Size of a block \[bytes\].
const BLOCK_BYTES: usize = 32 << 20;
/// Bytes at the beginning from which the dialect and the length of a row are determined.
const SAMPLE_BYTES: usize = 1 << 20;
/// Shortest time step of an interruption, as a multiple of the usual step.
const MIN_GAP: f64 = 1.5;

/// Progress callback. The argument is the share of the file that has been read.
type Watch<'a> = &'a mut dyn FnMut(f64);

/// A large table of text.
pub(crate) struct LargeText<'a> {
    file: String,
    path: PathBuf,
    bytes: u64,
    dialect: Dialect,
    heads: Vec<Head>,
    notes: Vec<String>,
    /// Number of rows of the file that are averaged into one.
    factor: usize,
    watch: RefCell<Watch<'a>>,
    /// Number of rows in incomplete groups, which are dropped.
    dropped: Cell<u64>,
}

impl<'a> LargeText<'a> {
    /// Opens the file at `path` if it is large and a table of text.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub(crate) fn open(path: &Path, watch: Watch<'a>) -> Result<Option<Self>, RecordError> {
        let file = path.display().to_string();
        let io = |source| RecordError::Io { file: file.clone(), source };
        let mut reader = File::open(path).map_err(io)?;
        let bytes = reader.metadata().map_err(io)?.len();
        if bytes < LARGE_BYTES {
            return Ok(None);
        }
        let mut sample = vec![0; SAMPLE_BYTES];
        reader.read_exact(&mut sample).map_err(io)?;
        let whole = sample.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        sample.truncate(whole);
        // UTF-16 and binary files are read as a whole.
        if sample.contains(&0) || sample.starts_with(b"\xff\xfe") || sample.starts_with(b"\xfe\xff") {
            return Ok(None);
        }
        let mark = if sample.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        let Ok(text) = Text::open(&file, &sample) else { return Ok(None) };
        let Text { text, dialect, heads, mut notes, .. } = text;
        // Only in UTF-8 the bytes of the text are those of the file.
        if !matches!(text, std::borrow::Cow::Borrowed(_)) {
            return Ok(None);
        }
        let sampled = text[dialect.start..].lines().count().max(1);
        let row_bytes = (text.len() - dialect.start) as f64 / sampled as f64;
        let rows = (bytes as f64 / row_bytes) as u64;
        let factor = rows.div_ceil(MAX_ROWS).max(1) as usize;
        if factor > 1 {
            notes.push(format!(
                "about {:.1} million rows: every {factor} rows are averaged into one",
                rows as f64 / 1e6
            ));
        }
        let dialect = dialect.starting_at(dialect.start + mark);
        let watch = RefCell::new(watch);
        drop(text);
        let dropped = Cell::new(0);
        Ok(Some(Self { file, path: path.to_owned(), bytes, dialect, heads, notes, factor, watch, dropped }))
    }

    /// Reads the blocks; `take` gets the columns of each.
    fn blocks(&self, fields: &[usize], mut take: impl FnMut(Vec<Values>)) -> Result<(), RecordError> {
        let io = |source| RecordError::Io { file: self.file.clone(), source };
        let mut reader = File::open(&self.path).map_err(io)?;
        let mut head = vec![0; self.dialect.start];
        reader.read_exact(&mut head).map_err(io)?;
        let midnight = self.midnight(&mut reader).map_err(io)?;
        let mut line = 1 + head.iter().filter(|byte| **byte == b'\n').count() as u64;
        let mut at = self.dialect.start as u64;
        let mut block = Vec::new();
        let mut ended = false;
        let dialect = self.dialect.starting_at(0);
        while !ended {
            let kept = block.len();
            let read = reader
                .by_ref()
                .take((BLOCK_BYTES - kept.min(BLOCK_BYTES - 1)) as u64)
                .read_to_end(&mut block)
                .map_err(io)?;
            ended = read == 0;
            at += read as u64;
            let whole =
                if ended { block.len() } else { block.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1) };
            if whole == 0 {
                if ended {
                    break;
                }
                if block.len() < BLOCK_BYTES {
                    continue;
                }
                let what = format!("line {line} is longer than 32 MB; write one row per line");
                return Err(RecordError::Damaged { file: self.file.clone(), format: "table of text", what });
            }
            let (text, _) = encoding::decode(&self.file, &block[..whole])?;
            let columns = rows::read_from(&text, &dialect, midnight, fields).map_err(|fault| {
                let head = |field: usize| self.name_of(field);
                fault.after(line).error(&self.file, &text, head)
            })?;
            line += text.bytes().filter(|byte| *byte == b'\n').count() as u64;
            take(columns.columns);
            block.drain(..whole);
            (self.watch.borrow_mut())(at as f64 / self.bytes as f64);
        }
        Ok(())
    }

    fn midnight(&self, reader: &mut File) -> std::io::Result<i64> {
        let mut first = vec![0; 4096];
        let read = reader.read(&mut first)?;
        reader.seek(SeekFrom::Start(self.dialect.start as u64))?;
        let text = String::from_utf8_lossy(&first[..read]);
        Ok(self.dialect.starting_at(0).midnight(&text))
    }

    fn name_of(&self, field: usize) -> String {
        self.dialect.column_of(field).map_or(String::new(), |at| self.heads[at].name.clone())
    }
}

impl Contents for LargeText<'_> {
    fn format(&self) -> String {
        format!("table of text, {}", self.dialect.words())
    }

    fn heads(&self) -> &[Head] {
        &self.heads
    }

    fn values(&self, wanted: Wanted<'_>) -> Result<Vec<Values>, RecordError> {
        let fields: Vec<usize> = wanted.columns.iter().map(|at| self.dialect.field_of(*at)).collect();
        let mut means = Means::new(wanted, self.factor);
        let mut printed = Printed::default();
        self.blocks(&fields, |columns| {
            if let Some(first) = columns.first() {
                printed.join(first.printed);
            }
            means.take(&columns);
        })?;
        self.dropped.set(means.dropped());
        Ok(means.finish().into_iter().map(|numbers| Values { numbers, printed }).collect())
    }

    fn rows_per_row(&self) -> usize {
        self.factor
    }

    fn late_notes(&self) -> Vec<String> {
        let dropped = self.dropped.get();
        let note = format!("{dropped} rows before interruptions are too few for a mean: left out");
        (dropped > 0).then_some(note).into_iter().collect()
    }

    fn place(&self, row: usize) -> Place {
        // The first of the averaged rows.
        Place::Row(row * self.factor)
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }
}

/// Means of groups of rows, not across a change of segment or an interruption.
struct Means {
    factor: usize,
    /// Index of the time column.
    time: Option<usize>,
    /// Index of the segment column.
    labels: Option<usize>,
    /// Longest time step without an interruption \[s\].
    longest: Option<f64>,
    /// Sum and number of the values of each column.
    sums: Vec<(f64, usize)>,
    rows: usize,
    /// Time and label of the row before.
    before: Option<(f64, f64)>,
    means: Vec<Vec<f64>>,
    /// Number of rows in incomplete groups.
    dropped: u64,
}

impl Means {
    fn new(wanted: Wanted<'_>, factor: usize) -> Self {
        let columns = wanted.columns.len();
        Self {
            factor,
            time: wanted.time,
            labels: wanted.segment,
            longest: None,
            sums: vec![(0.0, 0); columns],
            rows: 0,
            before: None,
            means: vec![Vec::new(); columns],
            dropped: 0,
        }
    }

    /// Returns the longest time step without an interruption, from the median step of the first rows.
    ///
    /// Steps of zero are ignored, because times may be printed too coarsely.
    fn longest_step(time: &[f64]) -> f64 {
        let mut steps: Vec<f64> =
            time.windows(2).take(10_000).map(|t| t[1] - t[0]).filter(|step| *step > 0.0).collect();
        steps.sort_unstable_by(f64::total_cmp);
        steps.get(steps.len() / 2).map_or(f64::INFINITY, |usual| MIN_GAP * usual)
    }

    fn take(&mut self, columns: &[Values]) {
        if self.factor == 1 {
            self.means.iter_mut().zip(columns).for_each(|(all, column)| all.extend(&column.numbers));
            return;
        }
        let rows = columns.first().map_or(0, |column| column.numbers.len());
        let times = self.time.map(|at| columns[at].numbers.as_slice());
        let longest = *self.longest.get_or_insert_with(|| times.map_or(f64::INFINITY, Self::longest_step));
        for row in 0..rows {
            let time = self.time.map_or(0.0, |at| columns[at].numbers[row]);
            let label = self.labels.map_or(0.0, |at| columns[at].numbers[row]);
            let breaks =
                self.before.is_some_and(|(before, other)| label != other || time - before > longest || time < before);
            if breaks {
                self.dropped += self.rows as u64;
                // A mean of an incomplete group would not be on the even grid.
                self.clear();
            }
            for ((sum, count), column) in self.sums.iter_mut().zip(columns) {
                let value = column.numbers[row];
                if value.is_finite() {
                    *sum += value;
                    *count += 1;
                }
            }
            self.rows += 1;
            if self.rows == self.factor {
                for (mean, (sum, count)) in self.means.iter_mut().zip(&self.sums) {
                    mean.push(if *count > 0 { sum / *count as f64 } else { f64::NAN });
                }
                self.clear();
            }
            self.before = Some((time, label));
        }
    }

    fn clear(&mut self) {
        self.sums.fill((0.0, 0));
        self.rows = 0;
    }

    /// Returns the number of rows in incomplete groups, including the last one.
    fn dropped(&self) -> u64 {
        self.dropped + self.rows as u64
    }

    fn finish(self) -> Vec<Vec<f64>> {
        self.means
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_not_averaged_across_an_interruption() {
        let column = |numbers: Vec<f64>| Values { numbers, printed: Printed::default() };
        let time: Vec<f64> = (0..10).map(f64::from).chain((0..7).map(|k| f64::from(k) + 100.0)).collect();
        let label: Vec<f64> = (0..17).map(|k| if k < 13 { 0.0 } else { 1.0 }).collect();
        let value: Vec<f64> = (0..17).map(|k| if k == 1 { f64::NAN } else { f64::from(k) }).collect();
        let mut means = Means::new(Wanted { columns: &[0, 1, 2], time: Some(0), segment: Some(1) }, 3);
        let all = [time, label, value].map(column);
        // In two blocks, with a boundary inside a group.
        means.take(&all.clone().map(|c| column(c.numbers[..5].to_vec())));
        means.take(&all.map(|c| column(c.numbers[5..].to_vec())));
        assert_eq!(means.dropped(), 2);
        assert_eq!(
            means.finish(),
            [vec![1.0, 4.0, 7.0, 101.0, 104.0], vec![0.0, 0.0, 0.0, 0.0, 1.0], vec![1.0, 4.0, 7.0, 11.0, 14.0]]
        );
    }
}
