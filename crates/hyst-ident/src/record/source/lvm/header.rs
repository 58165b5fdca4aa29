//! Headers of an LVM file: one for the file, and one for each segment.

use super::numbers::{Format, number};

/// The last line of a header.
pub(crate) const END: &str = "***End_of_Header***";
/// The first words of the file and of a segment.
pub(crate) const FILE: &str = "LabVIEW Measurement";
pub(crate) const SEGMENT: &str = "Channels";

/// The columns with the times of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum XColumns {
    No,
    One,
    Multi,
}

/// The header of the file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FileHeader {
    pub(crate) format: Format,
    pub(crate) x_columns: XColumns,
    /// Whether times are seconds since 1904.
    pub(crate) is_absolute: bool,
}

impl FileHeader {
    /// Parses the lines of the header.
    pub(crate) fn parse(lines: &[&str]) -> Result<Self, String> {
        // The separator is the character after a tag, so the value of the tag `Separator` is not needed.
        let after =
            |tag: &str| lines.iter().find_map(|line| line.strip_prefix(tag)).and_then(|rest| rest.chars().next());
        let separator =
            after("Separator").or_else(|| after("Decimal_Separator")).filter(|c| !c.is_alphanumeric()).unwrap_or('\t');
        let value = |tag: &str| {
            let is_tag = |line: &&&str| line.split(separator).next().is_some_and(|own| own.trim() == tag);
            // In a file that is separated by commas, the value of a tag may be a comma.
            lines
                .iter()
                .find(is_tag)
                .and_then(|line| line.split_once(separator))
                .map(|(_, value)| value.trim_end().to_owned())
        };
        let is_comma = value("Decimal_Separator").is_some_and(|value| value.trim_matches('"').starts_with(','));
        let x_columns = value("X_Columns").unwrap_or_default();
        let x_columns = match x_columns.split(separator).next().unwrap_or("").trim() {
            "No" => XColumns::No,
            "Multi" => XColumns::Multi,
            "One" | "" => XColumns::One,
            other => {
                return Err(format!(
                    "the header has X_Columns \"{other}\", not No, One or Multi; save the file again from LabVIEW"
                ));
            }
        };
        let is_absolute = value("Time_Pref").is_some_and(|value| value.trim().starts_with("Absolute"));
        Ok(Self { format: Format { separator, decimal: if is_comma { ',' } else { '.' } }, x_columns, is_absolute })
    }
}

/// The header of a segment.
#[derive(Clone, Debug)]
pub(crate) struct SegmentHeader<'a> {
    lines: Vec<Vec<&'a str>>,
}

impl<'a> SegmentHeader<'a> {
    pub(crate) fn parse(lines: &[&'a str], separator: char) -> Self {
        Self { lines: lines.iter().map(|line| line.split(separator).map(str::trim).collect()).collect() }
    }

    /// Returns the stated number of channels.
    pub(crate) fn channels(&self) -> Option<usize> {
        self.cells(SEGMENT).first()?.parse().ok()
    }

    /// Returns the cells after a tag.
    fn cells(&self, tag: &str) -> &[&'a str] {
        self.lines.iter().find(|cells| cells[0] == tag).map_or(&[], |cells| &cells[1..])
    }

    /// Returns the values of a tag for the channels in these cells of a row.
    pub(crate) fn of_channels(&self, tag: &str, channels: &[usize]) -> Vec<Option<&'a str>> {
        let cells = self.cells(tag);
        let filled: Vec<&'a str> = cells.iter().copied().filter(|cell| !cell.is_empty()).collect();
        // With one value per channel the order is sufficient. Otherwise the cell of a channel is above its values.
        if filled.len() == channels.len() {
            return filled.into_iter().map(Some).collect();
        }
        let above = |channel: &usize| {
            channel.checked_sub(1).and_then(|at| cells.get(at)).copied().filter(|cell| !cell.is_empty())
        };
        channels.iter().map(above).collect()
    }

    /// Returns the first filled cell of a tag.
    pub(crate) fn first(&self, tag: &str) -> Option<&'a str> {
        self.cells(tag).iter().copied().find(|cell| !cell.is_empty())
    }

    /// Returns the start of the segment \[s\], from date and time of its first channel. The zero is an arbitrary
    /// midnight.
    pub(crate) fn start(&self, decimal: char) -> Option<f64> {
        let mut date = self
            .first("Date")?
            .split(['/', '-'])
            .map(|part| part.parse::<i64>().ok().filter(|part| (0..=9999).contains(part)));
        let (year, month, day) = (date.next()??, date.next()??, date.next()??);
        let mut clock = self.first("Time")?.split(':');
        let (hour, minute) = (clock.next()?.parse::<u32>().ok()?, clock.next()?.parse::<u32>().ok()?);
        let second = number(clock.next()?, decimal)?;
        // The year begins in March, so a leap day is the last day of its year.
        let (year, month) = if month <= 2 { (year - 1, month + 9) } else { (year, month - 3) };
        let days = year * 365 + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day;
        Some(days as f64 * 86_400.0 + f64::from(hour) * 3600.0 + f64::from(minute) * 60.0 + second)
    }
}
