//! `excite`: makes drives to identify or test an actuator.

use hyst_ident::excite::{
    AmSine, DecayingSine, Drive, ExciteError, Forc, Identification, Limits, MinorLoops, Multisine, Peak, Phases,
    Raster, Shape, Sine, Spiral, Stairs, Sweep, Tone, Triangle,
};
use serde::Serialize;

use crate::cli::{Common, ExciteArgs, ExciteKind, PeakForm, SeparateArgs};
use crate::exit::CommandResult;
use crate::output::{self, Report};
use crate::text;
use options::in_options;

mod options;
mod separate;

/// Report of a drive.
#[derive(Debug, Serialize)]
struct Summary<'a> {
    output: String,
    rows: usize,
    rate_hz: f64,
    seconds: f64,
    segments: &'a [&'static str],
    /// Maximum slope \[V/s\].
    steepest_v_per_s: f64,
    /// Peak over RMS of a multisine, without its fades.
    #[serde(skip_serializing_if = "Option::is_none")]
    crest_factor: Option<f64>,
}

/// Runs the command.
pub(super) fn run(args: &ExciteArgs) -> CommandResult {
    let Made { common, drive, crest_factor } = match make(&args.kind) {
        Ok(made) => made,
        Err(separation) => return separate::run(separation),
    };
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
        steepest_v_per_s: drive.steepest(),
        crest_factor,
    };
    report.print(&summary.text(), &summary)
}

/// Drive that the arguments describe.
struct Made<'a> {
    common: &'a Common,
    drive: Result<Drive, ExciteError>,
    crest_factor: Option<f64>,
}

/// Rest between segments of drives without an option for it \[s\].
const REST: f64 = 1.0;

/// Makes the drive; returns the arguments of `separate` as an error, because it has its own report.
fn make(kind: &ExciteKind) -> Result<Made<'_>, &SeparateArgs> {
    let limits = |c: &Common| Limits { rate_hz: c.rate, lo_v: c.low, hi_v: c.high, slew_v_per_s: c.slew };
    let (mut crest_factor, mut between) = (None, REST);
    let (common, shapes) = match kind {
        ExciteKind::Identification { seconds, rest, slow, fast, band, hold, ramp, test, seed, common } => {
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
            let free = |field: &str| match field {
                "slow_hz" => slow.is_none(),
                "fast_hz" => fast.is_none(),
                "band_hz" => band.is_none(),
                "ramp_s" => ramp.is_none(),
                _ => false,
            };
            let within = limits(common);
            let spec = spec.within_slew(&within, &free);
            let spec = if *test { spec.for_test_within_slew(&within, &free) } else { spec };
            return Ok(Made { common, drive: spec.drive(&limits(common)), crest_factor: None });
        }
        ExciteKind::Separate(args) => return Err(args),
        ExciteKind::Sine { periodic, common } => {
            (common, vec![Shape::Sine(Sine { frequency_hz: periodic.frequency, cycles: periodic.cycles })])
        }
        ExciteKind::DecayingSine { frequency, seconds, common } => {
            (common, vec![Shape::DecayingSine(DecayingSine { frequency_hz: *frequency, duration_s: *seconds })])
        }
        ExciteKind::Triangle { periodic, common } => {
            (common, vec![Shape::Triangle(Triangle { frequency_hz: periodic.frequency, cycles: periodic.cycles })])
        }
        ExciteKind::Stairs { levels, hold, ramp, seed, common } => {
            (common, vec![Shape::Stairs(Stairs { levels: *levels, hold_s: *hold, ramp_s: *ramp, seed: *seed })])
        }
        ExciteKind::Multisine { from, to, lines, seconds, fade, periods, seed, common } => {
            let shape = Multisine {
                low_hz: *from,
                high_hz: *to,
                lines: *lines,
                periods: *periods,
                phases: seed.map_or(Phases::LowCrest, Phases::Random),
                duration_s: *seconds,
                fade_s: fade.unwrap_or(0.1 * seconds),
            };
            crest_factor = shape.crest_factor(common.rate).ok();
            (common, vec![Shape::Multisine(shape)])
        }
        ExciteKind::Sweep { from, to, seconds, common } => {
            (common, vec![Shape::Sweep(Sweep { low_hz: *from, high_hz: *to, duration_s: *seconds })])
        }
        ExciteKind::Forc { curves, seconds, rest, peak, common } => {
            let peak = match peak {
                PeakForm::Triangle => Peak::Triangle,
                PeakForm::HalfSine => Peak::HalfSine,
            };
            between = *rest;
            let forc = |peak_s: &f64| Shape::Forc(Forc { curves: *curves, peak_s: *peak_s, rest_s: *rest, peak });
            (common, seconds.iter().map(forc).collect())
        }
        ExciteKind::AmSine { frequency, modulation, depth, cycles, common } => {
            let (frequency_hz, modulation_hz) = (*frequency, *modulation);
            (common, vec![Shape::AmSine(AmSine { frequency_hz, modulation_hz, depth: *depth, cycles: *cycles })])
        }
        ExciteKind::Tones { frequencies, amplitudes, cycles, rest, common } => {
            between = *rest;
            let tone =
                |frequency_hz: f64, amplitude: f64| Shape::Tone(Tone { frequency_hz, amplitude, cycles: *cycles });
            let of = |hz: &f64| amplitudes.iter().map(|a| tone(*hz, *a)).collect::<Vec<_>>();
            (common, frequencies.iter().flat_map(of).collect())
        }
        ExciteKind::Raster { turning, periodic, common } => {
            let (frequency_hz, cycles) = (periodic.frequency, periodic.cycles);
            (common, vec![Shape::Raster(Raster { frequency_hz, cycles, turning: *turning })])
        }
        ExciteKind::Spiral { phase, periodic, common } => {
            let (frequency_hz, cycles) = (periodic.frequency, periodic.cycles);
            (common, vec![Shape::Spiral(Spiral { frequency_hz, cycles, phase_deg: *phase })])
        }
        ExciteKind::MinorLoops { levels, share, periodic, common } => {
            let (frequency_hz, cycles) = (periodic.frequency, periodic.cycles);
            (common, vec![Shape::MinorLoops(MinorLoops { levels: *levels, share: *share, frequency_hz, cycles })])
        }
    };
    Ok(Made { common, drive: Drive::new(&shapes, &limits(common), between), crest_factor })
}

impl Summary<'_> {
    fn text(&self) -> String {
        let crest = self.crest_factor.map_or_else(String::new, |crest| format!(", crest factor {crest:.2}"));
        format!(
            "{}: {} at {} Hz, {} s, maximum slope {} V/s, {}: {}{crest}",
            self.output,
            text::count(self.rows, "row"),
            self.rate_hz,
            text::short(self.seconds),
            text::short(self.steepest_v_per_s),
            text::count(self.segments.len(), "segment"),
            self.segments.join(", ")
        )
    }
}
