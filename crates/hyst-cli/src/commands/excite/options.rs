//! Names of the options in error messages of the library.

use hyst_ident::excite::ExciteError;

use crate::exit::{CommandError, Exit};

/// Fields of the library and the options that set them.
const OPTIONS: [(&str, &str); 25] = [
    ("modulation_hz", "--modulation"),
    ("slew_v_per_s", "--slew"),
    ("frequency_hz", "--frequency"),
    ("duration_s", "--seconds"),
    ("rate_hz", "--rate"),
    ("slow_hz", "--slow"),
    ("fast_hz", "--fast"),
    ("band_hz", "--band"),
    ("high_hz", "--to"),
    ("low_hz", "--from"),
    ("hold_s", "--hold"),
    ("ramp_s", "--ramp"),
    ("rest_s", "--rest"),
    ("peak_s", "--seconds"),
    ("fade_s", "--fade"),
    ("lo_v", "--low"),
    ("hi_v", "--high"),
    ("cycles =", "--cycles ="),
    ("curves =", "--curves ="),
    ("levels =", "--levels ="),
    ("lines =", "--lines ="),
    ("periods =", "--periods ="),
    ("depth =", "--depth ="),
    ("share =", "--share ="),
    ("amplitude =", "--amplitudes ="),
];

/// Returns the error with names of options instead of names of fields.
pub(super) fn in_options(error: ExciteError) -> CommandError {
    let message = OPTIONS.iter().fold(error.to_string(), |text, (field, option)| text.replace(field, option));
    CommandError::new(Exit::BadInput, anyhow::anyhow!("{message}"))
}
