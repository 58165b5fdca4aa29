//! Tables of text: CSV and its dialects, and text exports of instruments.
//!
//! The dialect (delimiter, decimal sign, first row) is the one with the most numbers in the first rows. Lines above the
//! numbers are names, units and remarks.

mod detect;
mod dialect;
mod encoding;
mod fields;
mod lines;
mod remarks;
mod rows;
mod stream;

use std::borrow::Cow;
use std::cell::Cell as SharedCell;

use super::{Contents, Head, Values, Wanted};
use crate::record::error::{Place, RecordError};
pub(crate) use stream::LargeText;

use dialect::Dialect;
use lines::{line_at, shortened};

/// A table of text whose rows are not read yet.
pub(crate) struct Text<'a> {
    file: String,
    text: Cow<'a, str>,
    dialect: Dialect,
    heads: Vec<Head>,
    texts: Vec<(String, String)>,
    notes: Vec<String>,
    /// The byte at which lines below the rows begin.
    end: usize,
    /// Number of lines between the rows that repeat the header.
    headings: SharedCell<usize>,
    /// Number of other lines between the rows that are not rows.
    others: SharedCell<usize>,
}

impl<'a> Text<'a> {
    /// Finds the dialect of a file and its header.
    pub(super) fn open(file: &str, bytes: &'a [u8]) -> Result<Self, RecordError> {
        let (text, encoding) = encoding::decode(file, bytes)?;
        let mut notes: Vec<String> = encoding.into_iter().collect();
        let empty = || RecordError::Empty { file: file.to_owned() };
        if text.trim().is_empty() {
            return Err(empty());
        }
        let dialect = Dialect::find(&text).ok_or_else(|| no_numbers(file, &text))?;
        let (heads, texts) = (dialect.heads(&text), dialect.texts(&text));
        notes.extend(dialect.note());
        let footer = dialect.footer(&text).map(|(at, line)| (at, shortened(line)));
        if let Some((at, line)) = &footer {
            notes.push(format!(
                "lines from line {} (\"{line}\") to the end are not read: they are not rows of numbers",
                line_at(&text, *at)
            ));
        }
        let end = footer.map_or(text.len(), |(at, _)| at);
        Ok(Self {
            file: file.to_owned(),
            text,
            dialect,
            heads,
            texts,
            notes,
            end,
            headings: SharedCell::new(0),
            others: SharedCell::new(0),
        })
    }
}

/// Returns the error of a text without a row of numbers.
fn no_numbers(file: &str, text: &str) -> RecordError {
    let lines = text.lines().filter(|line| !line.trim().is_empty()).count();
    if lines <= 1 {
        RecordError::NoRows { file: file.to_owned() }
    } else {
        RecordError::NoNumbers { file: file.to_owned() }
    }
}

impl Contents for Text<'_> {
    fn format(&self) -> String {
        format!("table of text, {}", self.dialect.words())
    }

    fn heads(&self) -> &[Head] {
        &self.heads
    }

    fn texts(&self) -> &[(String, String)] {
        &self.texts
    }

    fn values(&self, wanted: Wanted<'_>) -> Result<Vec<Values>, RecordError> {
        let cells: Vec<usize> = wanted.columns.iter().map(|at| self.dialect.field_of(*at)).collect();
        let read = rows::read(&self.text[..self.end], &self.dialect, &cells).map_err(|fault| {
            let head = |field: usize| {
                self.dialect.column_of(field).map_or(String::new(), |at| shortened(&self.heads[at].name))
            };
            fault.error(&self.file, &self.text, head)
        })?;
        self.headings.set(read.headings);
        self.others.set(read.others);
        Ok(read.columns)
    }

    fn late_notes(&self) -> Vec<String> {
        let word =
            |lines: usize| if lines == 1 { "1 line repeats".to_owned() } else { format!("{lines} lines repeat") };
        let note = |lines: usize| format!("{} the header among the rows: not read", word(lines));
        Some(self.headings.get()).filter(|lines| *lines > 0).map(note).into_iter().collect()
    }

    fn place(&self, row: usize) -> Place {
        Place::Line(rows::line_of_row(&self.text, &self.dialect, row))
    }

    fn header(&self) -> Option<Place> {
        self.dialect.header_line(&self.text).map(Place::Line)
    }

    fn plain_text(&self) -> Option<&str> {
        let is_plain = self.dialect.is_plain(&self.text) && self.notes.is_empty();
        (is_plain && self.headings.get() + self.others.get() == 0).then_some(&*self.text)
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }
}

#[cfg(test)]
mod tests {
    use super::super::Axis;
    use super::*;

    #[track_caller]
    fn table(bytes: &[u8]) -> (Vec<String>, Vec<Vec<f64>>) {
        let text = Text::open("x.csv", bytes).unwrap();
        let all: Vec<usize> = (0..text.heads.len()).collect();
        let values = text.values(Wanted::all(&all)).unwrap_or_else(|error| panic!("{error}"));
        (text.heads.iter().map(|head| head.name.clone()).collect(), values.into_iter().map(|v| v.numbers).collect())
    }

    #[test]
    fn dialects_are_detected() {
        let expected = vec![vec![0.0, 0.5], vec![1.5, -2.5], vec![3.0, 4.25]];
        for text in [
            "a,b,c\n0,1.5,3\n0.5,-2.5,4.25\n",
            "a;b;c\n0;1.5;3\n0.5;-2.5;4.25\n",
            "a;b;c\n0;1,5;3\n0,5;-2,5;4,25\n",
            "a\tb\tc\r\n0\t1.5\t3\r\n0.5\t-2.5\t4.25\r\n",
            "a\tb\tc\n0\t1,5\t3\n0,5\t-2,5\t4,25\n",
            "# a b c\n0.0e+00 1.5 3\n5.0e-01 -2.5 4.25\n",
            "  a   b     c\n  0   1.5   3\n 0.5 -2.5  4.25\n",
            "a,b,c,\n0,1.5,3,\n0.5,-2.5,4.25,\n",
            "% made by hand\n%\na,b,c\n0,1.5,3\n# in between\n0.5,-2.5,4.25\n\n",
            "\"a\";\"b\";\"c\"\n\"0\";\"1,5\";\"3\"\n\"0,5\";\"-2,5\";\"4,25\"\n",
            "Device: X, made 2024\nOperator;none\na,b,c\n0,1.5,3\n0.5,-2.5,4.25\n",
            "a,b,c\r0,1.5,3\r0.5,-2.5,4.25\r",
        ] {
            let (names, values) = table(text.as_bytes());
            assert_eq!(names, ["a", "b", "c"], "{text}");
            assert_eq!(values, expected, "{text}");
        }
        let utf16: Vec<u8> =
            "\u{feff}a;b;c\n0;1,5;3\n0,5;-2,5;4,25\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(table(&utf16).1, expected);
    }

    #[test]
    fn names_units_and_rates_are_read_above_the_numbers() {
        let open = |text: &'static str| Text::open("x.csv", text.as_bytes()).unwrap();
        let scope =
            open("Model,XY\nSample Interval,1.0e-3,s\nTime,Channel A,Channel B\n(ms),(V),(µm)\n\n0.0,1,2\n0.1,1,3\n");
        let of = |text: &Text<'_>| {
            text.heads.iter().map(|h| (h.name.clone(), h.unit.clone().unwrap_or_default())).collect::<Vec<_>>()
        };
        let own = |name: &str, unit: &str| (name.to_owned(), unit.to_owned());
        assert_eq!(of(&scope), [own("Time", "ms"), own("Channel A", "V"), own("Channel B", "µm")]);
        assert_eq!(scope.heads[0].axis, Axis::Even { start: 0.0, step: 1e-3 });
        assert_eq!(of(&open("0.0,1,2\n0.1,1,3\n")), [own("1", ""), own("2", ""), own("3", "")]);
        assert_eq!(of(&open("x-axis,1,2\nsecond,Volt,Volt\n-0.1,1,2\n0.1,1,3\n"))[1], own("1", "Volt"));
    }

    #[test]
    fn thousands_repeated_headers_and_footers_are_handled() {
        let expected = vec![vec![0.0, 999.0, 1050.0], vec![0.5, -2.5, 12_004.25]];
        for text in [
            "a;b\n0;0,5\n999;-2,5\n1.050;12.004,25\n",
            "a;b\n0;0.5\n999;-2.5\n1'050;12'004.25\n",
            "a,b\n0,0.5\n999,-2.5\n\"1,050\",\"12,004.25\"\n",
            "a\tb\n0\t0.5\n999\t-2.5\na\tb\n1,050\t12,004.25\n",
            "a,b\n0,0.5\n999,-2.5\n1050,12004.25\nMean,3.2\nEND\n",
            "a,b\n0,0.5\n999,-2.5\n1050,12004.25\n\nmade by hand\n",
        ] {
            assert_eq!(table(text.as_bytes()).1, expected, "{text}");
        }
        // Whole numbers only: 1.000 after 999 is one thousand.
        let whole: String = (997..1003)
            .map(|k| format!("{}\n", if k < 1000 { format!("{k};5") } else { format!("1.{:03};5", k - 1000) }))
            .collect();
        assert_eq!(table(format!("a;b\n{whole}").as_bytes()).1[0], [997.0, 998.0, 999.0, 1000.0, 1001.0, 1002.0]);
        // A damaged last row is not a footer.
        assert!(Text::open("x.csv", b"a,b\n0,1\n1,2\n2x,3\n").unwrap().values(Wanted::all(&[0])).is_err());
    }

    #[test]
    fn cells_without_a_number_are_missing_or_refused() {
        let (_, values) = table(b"a,b\n0,NaN\n1,\n2,5\n3,inf\n");
        assert!(values[1][0].is_nan() && values[1][1].is_nan() && values[1][2] == 5.0 && values[1][3].is_nan());
        let text = Text::open("x.csv", b"a,b\n0,1\n1,2\n2,x y\n3,4\n").unwrap();
        let message = text.values(Wanted::all(&[1])).unwrap_err().to_string();
        assert!(message.contains("x.csv, line 4, column \"b\"") && message.contains("\"x y\""), "{message}");
        let message =
            Text::open("x.csv", b"a,b\n0,1\n1,2\n2\n3,4\n").unwrap().values(Wanted::all(&[0])).unwrap_err().to_string();
        assert!(message.contains("line 4") && message.contains("1 field"), "{message}");
    }
}
