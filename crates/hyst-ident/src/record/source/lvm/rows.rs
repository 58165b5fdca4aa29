//! Segments and rows of an LVM file.

use super::header::{END, FILE, FileHeader, SEGMENT, SegmentHeader, XColumns};
use super::numbers::{Format, midnight, number, since};

/// Largest number of characters of a cell in a message.
const MAX_SHOWN: usize = 24;
/// Smallest time that is a date and not a duration \[s since 1904\]: 30 years.
const EARLIEST_DATE: f64 = 1e9;

/// The role of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Role {
    /// Times of the next channel, or of all channels.
    Time,
    Channel,
}

/// A column of the file.
#[derive(Clone, Debug)]
pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) role: Role,
    pub(crate) unit: Option<String>,
    pub(crate) values: Vec<f64>,
    /// Number of samples that the header states.
    pub(crate) samples: Option<usize>,
    /// Time of the first row \[s\].
    pub(crate) start: f64,
    /// Sample period \[s\].
    pub(crate) step: Option<f64>,
    /// The number of the cell in a row.
    cell: usize,
}

/// All segments of a file, in sequence.
#[derive(Debug)]
pub(crate) struct Content {
    pub(crate) columns: Vec<Column>,
    /// Rows at which segments start.
    pub(crate) starts: Vec<usize>,
    pub(crate) x_columns: XColumns,
    pub(crate) notes: Vec<String>,
}

/// A file that is being read.
struct Reader<'a> {
    lines: Vec<&'a str>,
    at: usize,
    header: FileHeader,
    /// The zero of absolute times \[s since 1904\].
    midnight: i64,
    content: Content,
    /// Start of the first segment \[s\].
    first_start: Option<f64>,
    ends_with_line: bool,
}

/// Reads all segments of a file.
pub(crate) fn read(text: &str) -> Result<Content, String> {
    let lines: Vec<&str> = text.lines().collect();
    let header =
        FileHeader { format: Format { separator: '\t', decimal: '.' }, x_columns: XColumns::One, is_absolute: false };
    let content = Content { columns: Vec::new(), starts: Vec::new(), x_columns: XColumns::One, notes: Vec::new() };
    let ends_with_line = text.ends_with('\n');
    let mut reader = Reader { lines, at: 0, header, midnight: 0, content, first_start: None, ends_with_line };
    while let Some(line) = reader.lines.get(reader.at).copied() {
        if line.starts_with(FILE) {
            let header = reader.header_lines("the file's header")?;
            reader.header = FileHeader::parse(&header)?;
        } else if line.trim().is_empty() {
            reader.at += 1;
        } else if line.starts_with("***Start_Special***") {
            // Settings of a program are not needed.
            while reader.lines.get(reader.at).is_some_and(|line| !line.starts_with("***End_Special***")) {
                reader.at += 1;
            }
            reader.at += 1;
        } else {
            reader.segment()?;
        }
    }
    if reader.content.starts.is_empty() {
        return Err("no segment with values follows the header; record at least two samples".into());
    }
    Ok(reader.content)
}

impl<'a> Reader<'a> {
    /// Returns the lines of a header without the last one.
    fn header_lines(&mut self, what: &str) -> Result<Vec<&'a str>, String> {
        let rest = &self.lines[self.at..];
        let end = rest.iter().position(|line| line.starts_with(END));
        let end =
            end.ok_or_else(|| format!("line {}: {what} has no end; the file is cut off: copy it again", self.at + 1))?;
        self.at += end + 1;
        Ok(rest[..end].to_vec())
    }

    /// Reads a segment: its header, the names of its columns, and its rows.
    fn segment(&mut self) -> Result<(), String> {
        let first_line = self.at + 1;
        let lines = if self.lines[self.at].starts_with(SEGMENT) {
            self.header_lines("a segment's header")?
        } else {
            Vec::new()
        };
        let segment = SegmentHeader::parse(&lines, self.header.format.separator);
        let Some(names) = self.names(&segment) else { return Ok(()) };
        let layout = self.layout(&names, &segment);
        if layout.is_empty() {
            return Err(format!("line {first_line}: the segment has no channels; record at least one"));
        }
        let row = self.content.columns.first().map_or(0, |column| column.values.len());
        if self.content.starts.is_empty() {
            self.content.columns = layout;
            self.content.x_columns = self.header.x_columns;
            self.first_start = segment.start(self.header.format.decimal);
        } else {
            let same = |(one, other): (&Column, &Column)| one.role == other.role && one.name == other.name;
            if layout.len() != self.content.columns.len() || !layout.iter().zip(&self.content.columns).all(same) {
                return Err(format!(
                    "line {first_line}: the channels are not those of the first segment; save each segment in a separate file"
                ));
            }
            // The columns may be in other cells than before.
            for (column, other) in self.content.columns.iter_mut().zip(&layout) {
                column.cell = other.cell;
            }
        }
        self.content.starts.push(row);
        self.rows(row, segment.first("Samples").and_then(|samples| samples.parse().ok()))?;
        if self.content.columns[0].values.len() == row {
            self.content.starts.pop();
            return Ok(());
        }
        self.follow(row, &segment);
        Ok(())
    }

    /// Returns the names of the columns of a segment, or default names if the segment has none.
    fn names(&mut self, segment: &SegmentHeader<'a>) -> Option<Vec<String>> {
        let Format { separator, decimal } = self.header.format;
        while self.lines.get(self.at)?.trim().is_empty() {
            self.at += 1;
        }
        let cells: Vec<&str> = self.lines[self.at].split(separator).map(str::trim).collect();
        if cells.iter().any(|cell| number(cell, decimal).is_none()) {
            self.at += 1;
            return Some(cells.into_iter().map(str::to_owned).collect());
        }
        let is_multi = self.header.x_columns == XColumns::Multi;
        let width = if is_multi { 2 } else { 1 };
        let found = cells.len().saturating_sub(usize::from(!is_multi)) / width;
        let count = segment.channels().unwrap_or(found).min(found);
        let mut names = vec!["X_Value".to_owned()];
        for channel in 1..=count {
            if is_multi && channel > 1 {
                names.push("X_Value".to_owned());
            }
            names.push(format!("Channel {channel}"));
        }
        Some(names)
    }

    /// Returns the columns that the header of a segment describes.
    fn layout(&mut self, names: &[String], segment: &SegmentHeader<'a>) -> Vec<Column> {
        let decimal = self.header.format.decimal;
        let is_time = |name: &str| name.starts_with("X_Value") || name.starts_with("X Value");
        let is_comment = |at: usize| at + 1 == names.len() && names[at].eq_ignore_ascii_case("comment");
        let named: Vec<usize> = (0..names.len()).filter(|at| !names[*at].is_empty() && !is_comment(*at)).collect();
        let channels: Vec<usize> = named.iter().copied().filter(|at| !is_time(&names[*at])).collect();
        let of = |tag: &str| segment.of_channels(tag, &channels).into_iter();
        let is_over_time = segment.first("X_Dimension").is_none_or(|dimension| dimension == "Time");
        let x_unit = segment.first("X_Unit_Label").or(is_over_time.then_some("s"));
        let (mut units, mut samples, mut starts, mut steps) =
            (of("Y_Unit_Label"), of("Samples"), of("X0"), of("Delta_X"));
        let mut columns = Vec::new();
        for cell in named {
            let mut column = Column {
                name: names[cell].clone(),
                role: Role::Time,
                unit: x_unit.map(str::to_owned),
                values: Vec::new(),
                samples: None,
                start: 0.0,
                step: None,
                cell,
            };
            if !is_time(&column.name) {
                column.role = Role::Channel;
                column.unit = units.next().flatten().map(str::to_owned);
                column.samples = samples.next().flatten().and_then(|samples| samples.parse().ok());
                let start = starts.next().flatten().unwrap_or("0");
                self.set_midnight(start);
                column.start = since(start, decimal, self.midnight).filter(|start| start.is_finite()).unwrap_or(0.0);
                let step = steps.next().flatten().and_then(|step| number(step, decimal));
                column.step = step.filter(|step| *step > 0.0 && is_over_time);
            } else if self.header.x_columns == XColumns::No {
                // If the rows have no times, these cells are empty.
                continue;
            }
            columns.push(column);
        }
        columns
    }

    /// Sets the midnight before the first absolute time.
    fn set_midnight(&mut self, cell: &str) {
        let decimal = self.header.format.decimal;
        if self.midnight == 0
            && self.header.is_absolute
            && number(cell, decimal).is_some_and(|time| time > EARLIEST_DATE)
        {
            self.midnight = midnight(cell, decimal).unwrap_or(0);
        }
    }

    /// Reads rows up to the next header.
    fn rows(&mut self, start: usize, samples: Option<usize>) -> Result<(), String> {
        let Format { separator, decimal } = self.header.format;
        let needed = self.content.columns.iter().map(|column| column.cell + 1).max().unwrap_or(0);
        while let Some(line) = self.lines.get(self.at).copied() {
            if [FILE, SEGMENT, "***"].iter().any(|tag| line.starts_with(tag)) {
                break;
            }
            self.at += 1;
            if line.trim().is_empty() {
                continue;
            }
            let cells: Vec<&str> = line.split(separator).collect();
            let row = self.content.columns[0].values.len() - start;
            let is_last = self.at == self.lines.len() && !self.ends_with_line;
            if is_last
                && (cells.len() < needed || cells.len() == needed && samples.is_some_and(|samples| row + 1 < samples))
            {
                self.content.notes.push(format!(
                    "line {} is cut off and is not read; if the file should be longer, copy it again",
                    self.at
                ));
                continue;
            }
            if cells.len() < needed {
                return Err(format!(
                    "line {} has {} cells, but the segment has {needed} columns; complete or remove the line",
                    self.at,
                    cells.len()
                ));
            }
            for at in 0..self.content.columns.len() {
                let column = &self.content.columns[at];
                let cell = cells[column.cell];
                let is_time = column.role == Role::Time;
                if is_time {
                    self.set_midnight(cell);
                }
                let value = if is_time { since(cell, decimal, self.midnight) } else { number(cell, decimal) };
                let column = &mut self.content.columns[at];
                let Some(value) = value else {
                    let shown: String = cell.trim().chars().take(MAX_SHOWN).collect();
                    let what = format!("line {}, column \"{}\": \"{shown}\" is not a number", self.at, column.name);
                    return Err(format!("{what}; write it as 1{decimal}25, or remove the line"));
                };
                column.values.push(value);
            }
        }
        let rows = self.content.columns[0].values.len() - start;
        if let Some(samples) = samples.filter(|samples| rows < *samples) {
            let what = format!(
                "segment {} ends after {rows} of the {samples} samples that its header states",
                self.content.starts.len()
            );
            self.content.notes.push(format!("{what}; if it is cut off, copy the file again"));
        }
        Ok(())
    }

    /// Shifts the times of a segment that starts at `row`, if they restart.
    ///
    /// The segment then starts at the date and time of its header, or else one step after the segment before.
    fn follow(&mut self, row: usize, segment: &SegmentHeader<'a>) {
        let Some(clock) = self.content.columns.iter().find(|column| column.role == Role::Time).filter(|_| row > 0)
        else {
            return;
        };
        let (last, first) = (clock.values[row - 1], clock.values[row]);
        // Missing times cannot be compared.
        if first > last || first.is_nan() || last.is_nan() {
            return;
        }
        let stated =
            segment.start(self.header.format.decimal).zip(self.first_start).map(|(start, first)| start - first);
        let spacing = if row >= 2 { last - clock.values[row - 2] } else { 0.0 };
        let step = self.content.columns.iter().find_map(|column| column.step).unwrap_or(spacing);
        let shift = stated.filter(|shift| shift.is_finite() && first + shift > last).unwrap_or(last + step - first);
        for column in self.content.columns.iter_mut().filter(|column| column.role == Role::Time) {
            column.values[row..].iter_mut().for_each(|time| *time += shift);
        }
        let number = self.content.starts.len();
        self.content.notes.push(format!("the times of segment {number} restart; {shift} s are added to them"));
    }
}
