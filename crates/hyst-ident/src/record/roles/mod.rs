//! Assignment of roles and units to the columns of a file.
//!
//! The order of precedence is: `--map`, names of the record format, headings with a unit (a column in volts is the
//! input, a column in micrometres the output). If two columns are possible, the words of the headings decide. A unit is
//! never assumed: if it is not stated, the message ends with the options to paste.

mod canonical;
mod headings;
mod layout;
mod messages;
mod resolve;
mod search;
#[cfg(test)]
mod tests;
mod words;

pub(crate) use layout::{Choice, Clock, File, Layout};
pub(crate) use resolve::mapped;
