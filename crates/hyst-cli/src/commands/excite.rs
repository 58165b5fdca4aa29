//! `excite`: drives with which to identify or test an actuator.

use hyst_ident::excite::{
    DecayingSine, Drive, ExciteError, Forc, Identification, Limits, Multisine, Peak, Phases, Shape, Sine, Stairs,
    Sweep, Triangle,
};
use serde::Serialize;

use crate::cli::{Common, ExciteArgs, ExciteKind, PeakForm};
use crate::exit::{CommandError, CommandResult, Exit};
use crate::output::{self, Report};
use crate::text;

/// What is said about a drive.
#[derive(Debug, Serialize)]
struct Summary<'a> {
    output: String,
    rows: usize,
    rate_hz: f64,
    seconds: f64,
    segments: &'a [&'static str],
}

/// Runs the command.
pub(super) fn run(args: &ExciteArgs) -> CommandResult {
    let (common, drive) = make(&args.kind);
    output::check(&[], &[&common.output])?;
    let report = Report::new(common.json.json, &[&common.output])?;
    let drive = drive.map_err(in_options)?;
    common.output.write(|out| drive.write_csv(out).map_err(output::io_error))?;
    let summary = Summary {
        output: common.output.to_string(),
        rows: drive.voltage().len(),
        rate_hz: common.rate,
        seconds: drive.time().last().map_or(0.0, |end| end + 1.0 / common.rate),
        segments: drive.shapes(),
    };
    report.print(&summary.text(), &summary)
}

/// The drive that the arguments describe.
fn make(kind: &ExciteKind) -> (&Common, Result<Drive, ExciteError>) {
    let limits = |c: &Common| Limits { rate_hz: c.rate, lo_v: c.low, hi_v: c.high, slew_v_per_s: c.slew };
    let (common, shape) = match kind {
        ExciteKind::Identification { seconds, rest, slow, fast, band, hold, ramp, seed, common } => {
            let usual = Identification::at_rate(common.rate, *seed);
            let spec = Identification {
                duration_s: *seconds,
                rest_s: *rest,
                slow_hz: slow.unwrap_or(usual.slow_hz),
                fast_hz: fast.unwrap_or(usual.fast_hz),
                band_hz: band.unwrap_or(usual.band_hz),
                hold_s: *hold,
                ramp_s: ramp.unwrap_or(usual.ramp_s),
                seed: *seed,
            };
            return (common, spec.drive(&limits(common)));
        }
        ExciteKind::Sine { periodic, common } => {
            (common, Shape::Sine(Sine { frequency_hz: periodic.frequency, cycles: periodic.cycles }))
        }
        ExciteKind::DecayingSine { frequency, seconds, common } => {
            (common, Shape::DecayingSine(DecayingSine { frequency_hz: *frequency, duration_s: *seconds }))
        }
        ExciteKind::Triangle { periodic, common } => {
            (common, Shape::Triangle(Triangle { frequency_hz: periodic.frequency, cycles: periodic.cycles }))
        }
        ExciteKind::Stairs { levels, hold, ramp, seed, common } => {
            (common, Shape::Stairs(Stairs { levels: *levels, hold_s: *hold, ramp_s: *ramp, seed: *seed }))
        }
        ExciteKind::Multisine { from, to, lines, seconds, fade, seed, common } => {
            let shape = Multisine {
                low_hz: *from,
                high_hz: *to,
                lines: *lines,
                phases: seed.map_or(Phases::Schroeder, Phases::Random),
                duration_s: *seconds,
                fade_s: fade.unwrap_or(0.1 * seconds),
            };
            (common, Shape::Multisine(shape))
        }
        ExciteKind::Sweep { from, to, seconds, common } => {
            (common, Shape::Sweep(Sweep { low_hz: *from, high_hz: *to, duration_s: *seconds }))
        }
        ExciteKind::Forc { curves, seconds, rest, peak, common } => {
            let peak = match peak {
                PeakForm::Triangle => Peak::Triangle,
                PeakForm::HalfSine => Peak::HalfSine,
            };
            let one = |peak_s: &f64| Shape::Forc(Forc { curves: *curves, peak_s: *peak_s, rest_s: *rest, peak });
            let shapes: Vec<Shape> = seconds.iter().map(one).collect();
            return (common, Drive::new(&shapes, &limits(common), *rest));
        }
    };
    (common, Drive::new(&[shape], &limits(common), 0.0))
}

/// The library's fields and the options that set them.
const OPTIONS: [(&str, &str); 20] = [
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
];

/// The message with the options' names instead of the fields'.
fn in_options(error: ExciteError) -> CommandError {
    let message = OPTIONS.iter().fold(error.to_string(), |text, (field, option)| text.replace(field, option));
    CommandError::new(Exit::BadInput, anyhow::anyhow!("{message}"))
}

impl Summary<'_> {
    fn text(&self) -> String {
        format!(
            "{}: {} at {} Hz, {} s, {}: {}",
            self.output,
            text::count(self.rows, "row"),
            self.rate_hz,
            text::short(self.seconds),
            text::count(self.segments.len(), "segment"),
            self.segments.join(", ")
        )
    }
}
