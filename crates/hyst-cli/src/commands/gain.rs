//! `gain`: measures gain and phase of sines over amplitude and frequency.

use hyst_ident::Samples;
use hyst_ident::linear::{GainPoint, gain_map};
use serde::Serialize;

use crate::cli::GainArgs;
use crate::exit::CommandResult;
use crate::output::{self, Report, Target, say};
use crate::{input, text};

/// Report of a gain map.
#[derive(Debug, Serialize)]
struct Summary {
    unit: String,
    points: Vec<GainPoint>,
    #[serde(skip)]
    drive_unit: String,
}

/// Runs the command.
pub(super) fn run(args: &GainArgs) -> CommandResult {
    let written: Vec<&Target> = args.output.iter().collect();
    output::check(&args.records.iter().map(AsRef::as_ref).collect::<Vec<_>>(), &written)?;
    let report = Report::new(args.json.json, &written)?;
    let record = input::training(&args.records, &args.map)?;
    let points = gain_map(&Samples::from_record(&record), args.frequency)?;
    let summary =
        Summary { unit: text::gain_unit(&record), points, drive_unit: text::column_unit(record.input_column()) };
    if let Some(target) = &args.output {
        target.write(|out| csv(out, &summary.points))?;
    }
    let mut text = summary.text();
    let absent = |segment: &usize| summary.points.iter().all(|p| p.segment != *segment);
    let left_out: Vec<String> = (0..record.segments().len()).filter(absent).map(|s| s.to_string()).collect();
    if !left_out.is_empty() {
        let which = text::listed(&left_out);
        say(&format!("note: fewer than three cycles of a sine in {}: {which}", text::count(left_out.len(), "segment")));
    }
    if let Some(Target::File(path)) = &args.output {
        text.push_str(&format!("\npoints: {}", path.display()));
    }
    report.print(&text, &summary)
}

fn csv(out: &mut dyn std::io::Write, points: &[GainPoint]) -> std::io::Result<()> {
    writeln!(out, "segment,hz,amplitude,bias,gain,phase_deg,gain_std_error,phase_std_error_deg,harmonics,cycles")?;
    for p in points {
        let error = |e: Option<f64>| e.map_or_else(String::new, |e| format!("{e:.3e}"));
        writeln!(
            out,
            "{},{:.6},{:.6},{:.6},{:.6e},{:.4},{},{},{:.5},{}",
            p.segment,
            p.hz,
            p.amplitude,
            p.bias,
            p.gain,
            p.phase.to_degrees(),
            error(p.gain_std_error),
            error(p.phase_std_error.map(f64::to_degrees)),
            p.harmonics,
            p.cycles
        )?;
    }
    Ok(())
}

impl Summary {
    fn text(&self) -> String {
        let head = [
            "segment",
            "Hz",
            &format!("amplitude [{}]", self.drive_unit),
            &format!("gain [{}]", self.unit),
            "phase [deg]",
            "harmonics",
            "cycles",
        ]
        .map(str::to_owned)
        .to_vec();
        let row = |p: &GainPoint| {
            vec![
                p.segment.to_string(),
                text::short(p.hz),
                text::short(p.amplitude),
                text::with_error(p.gain, p.gain_std_error),
                text::with_error(p.phase.to_degrees(), p.phase_std_error.map(f64::to_degrees)),
                text::percent(100.0 * p.harmonics),
                p.cycles.to_string(),
            ]
        };
        text::table(&std::iter::once(head).chain(self.points.iter().map(row)).collect::<Vec<_>>())
    }
}
