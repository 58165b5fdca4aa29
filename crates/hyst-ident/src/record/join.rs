//! Joining the records of several files into one.

use super::grid::Period;
use super::{OutputUnit, Record, RecordError};

impl Record {
    /// Joins records in the given order.
    ///
    /// [`Record::file_of_segment`] states the file of each segment. Each file keeps its own time origin and sample
    /// period. Columns without a role are dropped.
    ///
    /// # Errors
    /// If there is no record, or if two records differ in the column of the input or output, or in whether temperature
    /// or load was measured.
    pub fn join(records: Vec<Self>) -> Result<Self, RecordError> {
        let mut records = records.into_iter();
        let Some(mut all) = records.next() else {
            return Err(RecordError::Nothing);
        };
        for next in records {
            all.check_like(&next)?;
            all.append(next);
        }
        Ok(all)
    }

    fn check_like(&self, next: &Self) -> Result<(), RecordError> {
        let unlike = |what, found: String, expected: String| {
            Err(RecordError::Unlike { file: next.name(), other_file: self.name(), what, found, expected })
        };
        let input = |r: &Self| {
            if r.input.is_some() { format!("\"{}\"", r.input_column) } else { "none".to_owned() }
        };
        let output =
            |r: &Self| r.output_unit().map_or("none".to_owned(), |unit: OutputUnit| format!("\"{}\"", unit.column()));
        let present = |there: bool| if there { "measured" } else { "not measured" }.to_owned();
        let pairs = [
            ("the input column", input(next), input(self)),
            ("the output column", output(next), output(self)),
            ("\"temperature_degc\"", present(next.temperature.is_some()), present(self.temperature.is_some())),
            ("\"load_n\"", present(next.load.is_some()), present(self.load.is_some())),
        ];
        for (what, found, expected) in pairs {
            if found != expected {
                return unlike(what, found, expected);
            }
        }
        Ok(())
    }

    fn append(&mut self, mut next: Self) {
        self.share_periods(&mut next);
        let (rows, files) = (self.rows(), self.sources.len());
        if !(self.missing.is_empty() && next.missing.is_empty()) {
            self.missing.resize(rows, false);
            self.missing.extend(&next.missing);
            self.missing.resize(rows + next.rows(), false);
        }
        self.notes.extend(next.notes);
        self.sources.extend(next.sources);
        self.labelled |= next.labelled;
        self.lost = self.lost.and(next.lost);
        self.resampled |= next.resampled;
        self.labels.extend(next.labels);
        self.periods.extend(next.periods);
        self.segments.extend(next.segments.into_iter().map(|s| s.start + rows..s.end + rows));
        self.file_of_segment.extend(next.file_of_segment.into_iter().map(|file| file + files));
        self.time.extend(next.time);
        let extend = |all: &mut Option<Vec<f64>>, more: Option<Vec<f64>>| {
            if let (Some(all), Some(more)) = (all, more) {
                all.extend(more);
            }
        };
        extend(&mut self.input, next.input);
        extend(&mut self.temperature, next.temperature);
        extend(&mut self.load, next.load);
        if let (Some((_, all)), Some((_, more))) = (&mut self.output, next.output) {
            all.extend(more);
        }
        self.text = None;
    }

    /// Sets periods of two records that are equal within the printed digits to one value, that of the longer record.
    fn share_periods(&mut self, next: &mut Self) {
        let next_is_longer = next.rows() > self.rows();
        for mine in 0..self.periods.len() {
            let known = self.periods[mine];
            let of = |other: &Period| known.fits.0.max(other.fits.0) <= known.fits.1.min(other.fits.1);
            let Some(other) = next.periods.iter().copied().find(of) else { continue };
            let value = if next_is_longer { other.value } else { known.value };
            let fits = (known.fits.0.max(other.fits.0), known.fits.1.min(other.fits.1));
            for period in self.periods.iter_mut().chain(&mut next.periods).filter(|p| **p == known || **p == other) {
                *period = Period { value, fits };
            }
        }
    }
}
