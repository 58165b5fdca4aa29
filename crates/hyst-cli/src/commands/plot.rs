//! `plot`: draws records and residuals of models.

use std::path::Path;

use hyst_ident::linear::amplitude_density;
use hyst_ident::range;
use hyst_ident::record::Record;
use hyst_ident::simulate::{SimulateOptions, simulate_with};
use plotters::prelude::*;

use crate::canvas::{Area, Drawn, Format};
use crate::chart::Chart;
use crate::cli::PlotArgs;
use crate::exit::{CommandError, CommandResult};
use crate::{input, output, text};

/// Colours that are readable with colour vision deficiency (Okabe and Ito 2008).
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(90, 90, 90),
];
/// Width of the picture, and height of a row of panels \[pixels\].
const WIDTH: u32 = 1400;
const HEIGHT: u32 = 420;

/// A curve of a record.
type Pieces = Vec<Vec<(f64, f64)>>;

/// Residuals of a model on all records.
struct Residuals {
    model: String,
    /// Measured minus predicted for each record; `None` for a record without an output.
    residuals: Vec<Option<Vec<f64>>>,
    /// Whether each row counts; start-up rows do not.
    counts: Vec<Vec<bool>>,
}

/// Runs the command.
pub(super) fn run(args: &PlotArgs) -> CommandResult {
    let read: Vec<&Path> = args.records.iter().chain(&args.model).map(AsRef::as_ref).collect();
    output::check(&read, &[&args.output])?;
    let format = Format::of(&args.output)?;
    let records: Vec<Record> =
        args.records.iter().map(|path| input::any(path, &args.map)).collect::<CommandResult<_>>()?;
    let models: Vec<Residuals> =
        args.model.iter().map(|path| residuals_of(path, &records, args)).collect::<CommandResult<_>>()?;
    same_units(&records)?;
    let size = (WIDTH, (2 + models.len() as u32) * HEIGHT);
    let picture = format.draw(size, |root| panels(root, &records, &models))?;
    args.output.write(|out| out.write_all(&picture))
}

fn residuals_of(path: &Path, records: &[Record], args: &PlotArgs) -> CommandResult<Residuals> {
    let (model, _) = input::model(path)?;
    let options = SimulateOptions { zero: args.zero.get(), ..SimulateOptions::default() };
    let (mut residuals, mut counts) = (Vec::new(), Vec::new());
    for record in records {
        let simulation = simulate_with(&model, record, &options)?;
        let residual = |y: &[f64]| y.iter().zip(&simulation.predicted).map(|(y, p)| y - p).collect();
        residuals.push(record.output().map(residual));
        counts.push(simulation.settling.iter().map(|settling| !settling).collect());
    }
    let model = path.file_stem().map_or_else(|| path.display().to_string(), |stem| stem.to_string_lossy().into_owned());
    Ok(Residuals { model, residuals, counts })
}

/// Returns the name of a record's file without its folder.
fn name(record: &Record) -> String {
    let name = record.name();
    Path::new(&name).file_name().map_or(name.clone(), |file| file.to_string_lossy().into_owned())
}

/// Returns the points of a curve, in one piece for each segment.
fn pieces(record: &Record, of: impl Fn(usize) -> Option<(f64, f64)>) -> Pieces {
    record.segments().iter().map(|rows| rows.clone().filter_map(&of).collect()).collect()
}

/// Refuses records with different units of the inputs or outputs, which cannot share an axis.
fn same_units(records: &[Record]) -> CommandResult {
    let inputs = records.iter().filter(|record| !record.input().is_empty()).map(|r| (r, r.input_column().to_owned()));
    let outputs = records.iter().filter_map(|r| Some((r, r.output_unit()?.column().to_owned())));
    for columns in [inputs.collect::<Vec<_>>(), outputs.collect()] {
        let Some(((first, column), others)) = columns.split_first() else { continue };
        if let Some((other, different)) = others.iter().find(|(_, own)| own != column) {
            return Err(CommandError::bad_input(format!(
                "{} has {column} and {} has {different}: they cannot share an axis; plot each record separately",
                first.name(),
                other.name()
            )));
        }
    }
    Ok(())
}

fn panels(root: &Area<'_>, records: &[Record], models: &[Residuals]) -> Drawn {
    let areas = root.split_evenly((2 + models.len(), 1));
    let unit = records.iter().find_map(Record::output_unit).map_or("", |unit| unit.symbol());
    let output = format!("output [{unit}]");
    let drive = records
        .iter()
        .find(|record| !record.input().is_empty())
        .map_or("input".to_owned(), |r| text::column_unit(r.input_column()));
    let drive = format!("input [{drive}]");
    let coloured = || records.iter().zip(COLOURS.iter().cycle());

    let (left, right) = areas[0].split_horizontally(WIDTH / 2 - 140);
    let (above, below) = right.split_vertically(HEIGHT / 2);
    let mut loops = Chart::new("loops: output over input", &drive, &output);
    let mut driven = Chart::new("input over time", "", &drive);
    let mut measured = Chart::new("output over time", "time [s]", &output);
    for (record, colour) in coloured() {
        let (t, u, y) = (record.time(), record.input(), record.output().unwrap_or_default());
        if !u.is_empty() && !y.is_empty() {
            loops.paths(&name(record), *colour, &pieces(record, |k| Some((u[k], y[k]))));
        }
        if !u.is_empty() {
            driven.curve(&name(record), *colour, &pieces(record, |k| Some((t[k], u[k]))));
        }
        if !y.is_empty() {
            measured.curve(&name(record), *colour, &pieces(record, |k| Some((t[k], y[k]))));
        }
    }
    for (chart, area) in [(&loops, &left), (&driven, &above), (&measured, &below)] {
        chart.draw_if_any(area)?;
    }

    let mut spectra = Chart::new("amplitude density (Welch)", "frequency [Hz]", &format!("output [{unit}/√Hz]"))
        .logarithmic()
        .log_across();
    for (record, colour) in coloured() {
        let density = |x: &[f64]| amplitude_density(x, record.segments(), record.sample_period());
        if let Some(y) = record.output() {
            spectra.curve(&name(record), *colour, &[density(y)]);
        }
    }
    let mut further = COLOURS.iter().cycle().skip(records.len());
    for model in models {
        for (record, residual) in records.iter().zip(&model.residuals) {
            let Some(residual) = residual else { continue };
            let density = amplitude_density(residual, record.segments(), record.sample_period());
            let colour = *further.next().unwrap_or(&BLACK);
            spectra.curve(&format!("{} − {}", name(record), model.model), colour, &[density]);
        }
    }
    spectra.draw_if_any(&areas[1])?;

    // One scale for all models, so that the panels can be compared.
    let all = models.iter().flat_map(|m| m.residuals.iter().flatten().zip(&m.counts));
    let (low, high) =
        range(all.flat_map(|(r, counts)| r.iter().zip(counts).filter(|(_, counts)| **counts).map(|(r, _)| *r)));
    let most = low.abs().max(high.abs());
    for (model, area) in models.iter().zip(&areas[2..]) {
        let title = format!("measured minus predicted by {}", model.model);
        let mut chart = Chart::new(&title, "time [s]", &format!("residual [{unit}]"));
        if most.is_finite() && most > 0.0 {
            chart = chart.between(-1.08 * most, 1.08 * most);
        }
        for ((record, colour), (residual, counts)) in coloured().zip(model.residuals.iter().zip(&model.counts)) {
            let Some(residual) = residual else { continue };
            let counted = || residual.iter().zip(counts).filter(|(_, counts)| **counts).map(|(r, _)| *r);
            let rms = (counted().map(|r| r * r).sum::<f64>() / counted().count().max(1) as f64).sqrt();
            let t = record.time();
            let label = format!("{}, RMS {} {unit}", name(record), text::short(rms));
            chart.curve(&label, *colour, &pieces(record, |k| counts[k].then(|| (t[k], residual[k]))));
        }
        chart.draw_if_any(area)?;
    }
    Ok(())
}
