//! `response`: estimates the frequency response with coherence, and the modes of the structure.

use std::fmt::Write as _;

use hyst_ident::Samples;
use hyst_ident::linear::{
    Delay, FrequencyResponse, Method, OrderRow, Structure, StructureOptions, Zero, identify_structure,
};
use serde::Serialize;

use crate::canvas::Format;
use crate::cli::ResponseArgs;
use crate::exit::CommandResult;
use crate::output::{self, Report, Target};
use crate::progress::Progress;
use crate::{input, text};

mod picture;

/// Report of a response.
#[derive(Debug, Serialize)]
struct Summary<'a> {
    unit: &'a str,
    method: Method,
    lines: usize,
    band_hz: f64,
    rows_skipped: usize,
    order: usize,
    reason: &'a str,
    delay_s: f64,
    prediction_error: f64,
    simulation_percent: f64,
    modes: Vec<ModeRow>,
    zeros: Vec<ZeroRow>,
    orders: &'a [OrderRow],
    at: Vec<At>,
}

#[derive(Debug, Serialize)]
struct ModeRow {
    hz: f64,
    hz_std_error: f64,
    damping: f64,
    damping_std_error: f64,
    peak: f64,
}

#[derive(Debug, Serialize)]
struct ZeroRow {
    hz: f64,
    damping: f64,
}

/// The model at one frequency.
#[derive(Debug, Serialize)]
struct At {
    hz: f64,
    gain: f64,
    phase_deg: f64,
}

/// Runs the command.
pub(super) fn run(args: &ResponseArgs) -> CommandResult {
    let written: Vec<&Target> = args.output.iter().chain(&args.picture).collect();
    output::check(&args.records.iter().map(AsRef::as_ref).collect::<Vec<_>>(), &written)?;
    args.picture.as_ref().map(Format::of).transpose()?;
    let report = Report::new(args.json.json, &written)?;
    let record = input::training(&args.records, &args.map)?;
    let unit = text::gain_unit(&record);
    let options = StructureOptions {
        order: args.order.0.clone(),
        delay: args.delay.map_or(Delay::Auto, Delay::Rows),
        band_hz: args.to,
        window_s: args.window,
        period_s: args.period,
    };
    let progress = Progress::spinner("fitting");
    let found = identify_structure(&Samples::from_record(&record), &options)?;
    drop(progress);

    if let Some(target) = &args.output {
        target.write(|out| csv(out, &found))?;
    }
    if let Some(target) = &args.picture {
        let title = format!("{}: response and ARMAX model of order {}", record.name(), found.model.order());
        let picture = picture::draw(Format::of(target)?, &found, &unit, &title)?;
        target.write(|out| out.write_all(&picture))?;
    }
    let summary = Summary::new(&found, &unit, &args.at);
    let mut text = summary.text();
    for (target, what) in [(&args.output, "response"), (&args.picture, "picture")] {
        if let Some(Target::File(path)) = target {
            let _ = write!(text, "\n{what}: {}", path.display());
        }
    }
    report.print(&text, &summary)
}

/// Writes one row for each line of the response, with gain and phase of the model.
fn csv(out: &mut dyn std::io::Write, found: &Structure) -> std::io::Result<()> {
    writeln!(out, "hz,gain,phase_deg,coherence,gain_low,gain_high,model_gain,model_phase_deg")?;
    let FrequencyResponse { lines, .. } = &found.response;
    for line in lines {
        let (low, high) = line.gain_band();
        let (hz, gain, phase, coherence) = (line.hz, line.gain, line.phase.to_degrees(), line.coherence);
        write!(out, "{hz:.6},{gain:.6e},{phase:.3},{coherence:.5},{low:.6e},{high:.6e}")?;
        // The model is not valid above its band.
        if line.hz <= found.band_hz {
            let model = found.model.response(line.hz);
            writeln!(out, ",{:.6e},{:.3}", model.abs(), model.arg().to_degrees())?;
        } else {
            writeln!(out, ",,")?;
        }
    }
    Ok(())
}

impl<'a> Summary<'a> {
    fn new(found: &'a Structure, unit: &'a str, at: &[f64]) -> Self {
        let model = |hz: &f64| {
            let h = found.model.response(*hz);
            At { hz: *hz, gain: h.abs(), phase_deg: h.arg().to_degrees() }
        };
        Self {
            unit,
            method: found.response.method,
            lines: found.response.lines.len(),
            band_hz: found.band_hz,
            rows_skipped: found.factor - 1,
            order: found.model.order(),
            reason: &found.reason,
            delay_s: found.model.delay as f64 * found.model.period,
            prediction_error: found.model.noise,
            simulation_percent: 100.0 * found.simulation_share,
            modes: found
                .modes
                .iter()
                // Poles above the band are not modes of the structure.
                .filter(|m| m.hz <= found.band_hz)
                .map(|m| ModeRow {
                    hz: m.hz,
                    hz_std_error: m.hz_std_error,
                    damping: m.damping,
                    damping_std_error: m.damping_std_error,
                    peak: m.peak,
                })
                .collect(),
            zeros: found
                .zeros
                .iter()
                .filter(|zero| zero.hz <= found.band_hz)
                .map(|Zero { hz, damping }| ZeroRow { hz: *hz, damping: *damping })
                .collect(),
            orders: &found.orders,
            at: at.iter().map(model).collect(),
        }
    }

    fn text(&self) -> String {
        let mut text = match self.method {
            Method::Welch { window_s, averages, effective_averages } => format!(
                "response: {} lines, H1 over {averages} Hann windows of {} s, half overlapped ({} independent)\n",
                self.lines,
                text::short(window_s),
                text::short(effective_averages)
            ),
            Method::Periodic { period_s, periods, unexcited_share } => format!(
                "response: {} lines, averages over {periods} periods of {} s; share of the output at lines without drive {}\n",
                self.lines,
                text::short(period_s),
                text::percent(100.0 * unexcited_share)
            ),
        };
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "model: ARMAX of order {} up to {} Hz{}, delay {} s",
            self.order,
            text::short(self.band_hz),
            match self.rows_skipped {
                0 => String::new(),
                n => format!(", every {}th row after a low-pass", n + 1),
            },
            text::short(self.delay_s)
        );
        let _ = writeln!(text, "order: {}", self.reason);
        let _ = writeln!(
            text,
            "model error: {} one row ahead, {} of the output's standard deviation in simulation\n",
            text::short(self.prediction_error),
            text::percent(self.simulation_percent)
        );
        if !self.orders.is_empty() {
            text.push_str(&self.orders_table());
            text.push('\n');
        }
        text.push_str(&self.modes_table());
        if !self.zeros.is_empty() {
            let zero = |z: &ZeroRow| format!("{} Hz ({})", text::short(z.hz), text::short(z.damping));
            let zeros: Vec<String> = self.zeros.iter().map(zero).collect();
            let _ = writeln!(text, "zeros (damping): {}", text::listed(&zeros));
        }
        for at in &self.at {
            let (hz, gain, phase) = (text::short(at.hz), text::short(at.gain), text::short(at.phase_deg));
            let _ = writeln!(text, "at {hz} Hz: gain {gain} {}, phase {phase} deg", self.unit);
        }
        text
    }

    fn orders_table(&self) -> String {
        let head = ["order", "one row ahead", "simulation", "AIC", "BIC", ""].map(str::to_owned).to_vec();
        let row = |o: &OrderRow| {
            vec![
                o.order.to_string(),
                text::short(o.one_step),
                if o.simulation.is_finite() { text::short(o.simulation) } else { "unstable".to_owned() },
                format!("{:.0}", o.aic),
                format!("{:.0}", o.bic),
                if o.order == self.order { "taken".to_owned() } else { String::new() },
            ]
        };
        text::table(&std::iter::once(head).chain(self.orders.iter().map(row)).collect::<Vec<_>>())
    }

    fn modes_table(&self) -> String {
        if self.modes.is_empty() {
            return "no mode in the band\n".to_owned();
        }
        let head = ["mode", "Hz", "damping ratio", &format!("own peak [{}]", self.unit)].map(str::to_owned).to_vec();
        let row = |(k, m): (usize, &ModeRow)| {
            let damping = text::with_error(m.damping, Some(m.damping_std_error));
            vec![(k + 1).to_string(), text::with_error(m.hz, Some(m.hz_std_error)), damping, text::short(m.peak)]
        };
        text::table(&std::iter::once(head).chain(self.modes.iter().enumerate().map(row)).collect::<Vec<_>>())
    }
}
