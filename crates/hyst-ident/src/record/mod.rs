//! Records: measured time series of an actuator (input, output, temperature, load).
//!
//! The record format is a CSV file with one header line. Column names end in their unit: `segment` (integer, optional;
//! the actuator rests and its state resets between segments), `time_s|time_ms|time_us`, the input `voltage_v` (or
//! another quantity, such as `force_in_n`), one output (`displacement_um|_nm|_mm` or `force_n`), and optionally
//! `temperature_degc` and `load_n`. Further columns are copied unchanged. Time increases across segments. Within a
//! segment the time steps are equal to the last printed digit. Each segment may have its own sample period.
//!
//! Other file formats are read in three steps: `source` finds the columns of a file, `roles` assigns a role to each
//! column, and `repair` produces evenly spaced rows. [`Record::notes`] lists every change.
//!
//! Reading checks these rules. A [`Record`] has finite values, increasing time, at least one row and columns of equal
//! length.

mod align;
mod assembly;
mod checked;
mod checksum;
mod columns;
mod contents;
mod error;
mod grid;
mod heading;
mod join;
mod log;
mod losses;
mod read;
mod repair;
mod roles;
mod sink;
mod source;
mod survey;
mod table;
#[cfg(test)]
mod tests;
mod unit;
mod values;
mod write;

pub use assembly::{ABSOLUTE_ZERO, Columns};
pub use checked::{Record, Source};
pub use columns::{ColumnMap, MapError, Need, Reading, is_input_column};
pub use contents::MAX_CHANNELS;
pub use error::{Place, RecordError};
pub use log::{EVENTS, LogEvent, LogRecords, LogSample, RunLog, TOPIC, is_log};
pub use losses::Losses;
pub use sink::FileKind;
pub use survey::{Channel, Survey};
pub use table::TableColumn;
pub use unit::{OutputUnit, Quantity};
pub use write::{Extra, WriteError};
