//! Convergence of the searches of a fit: a table of all generations, and a picture.

use std::io::{self, Write};

use hyst_ident::fit::Fit;
use hyst_ident::optimize::{Found, Scale, Spread, TraceRow, Trials};
use plotters::prelude::*;

use crate::canvas::{Area, Drawn, Format};
use crate::chart::Chart;
use crate::cli::FitArgs;
use crate::exit::{CommandError, CommandResult};
use crate::text;

const BEST: RGBColor = RGBColor(200, 80, 40);
const OTHERS: RGBColor = RGBColor(150, 170, 190);
const POLISHED: RGBColor = RGBColor(30, 110, 190);

/// Writes the table of `--trace` and the picture of `--picture`.
pub(super) fn write(args: &FitArgs, trials: &Trials, polished: Option<f64>, unit: &str) -> CommandResult {
    if let Some(target) = &args.trace {
        target.write(|out| table(out, trials))?;
    }
    if let Some(target) = &args.picture {
        let title = format!("{}, {}: convergence of the search", args.model, text::count(trials.found.len(), "trial"));
        let lines = trials.variables.len().div_ceil(columns(trials));
        let size = (1400, 460 + 260 * u32::try_from(lines).unwrap_or(1));
        let picture = Format::of(target)?.draw(size, |root| panels(root, &title, trials, polished, unit))?;
        target.write(|out| out.write_all(&picture))?;
    }
    Ok(())
}

/// Refuses `--trace` and `--picture` for a fit without a search; called before anything is written.
pub(super) fn check(args: &FitArgs, fit: &Fit) -> CommandResult {
    let given = [("--trace", args.trace.is_some()), ("--picture", args.picture.is_some())];
    match given.iter().find(|(_, given)| *given) {
        Some((option, _)) if fit.trials.is_none() => Err(CommandError::bad_input(format!(
            "{option} shows a search, but {} was fitted without one ({}); leave {option} out or give a model that is searched",
            args.model, fit.how
        ))),
        _ => Ok(()),
    }
}

/// Writes all generations of all trials: lowest cost so far, and its variables.
fn table(out: &mut dyn Write, trials: &Trials) -> io::Result<()> {
    write!(out, "trial,generation,evaluations,cost")?;
    for variable in &trials.variables {
        write!(out, ",{}", variable.name)?;
    }
    writeln!(out)?;
    for (trial, found) in trials.found.iter().enumerate() {
        for TraceRow { generation, evaluations, cost, values } in &found.trace {
            write!(out, "{trial},{generation},{evaluations},{cost:?}")?;
            for value in values {
                write!(out, ",{value:?}")?;
            }
            writeln!(out)?;
        }
    }
    Ok(())
}

/// Returns the number of columns of the panels of variables.
fn columns(trials: &Trials) -> usize {
    trials.variables.len().clamp(1, 4)
}

fn panels(root: &Area<'_>, title: &str, trials: &Trials, polished: Option<f64>, unit: &str) -> Drawn {
    let columns = columns(trials);
    let lines = trials.variables.len().div_ceil(columns);
    let root = root.titled(title, ("sans-serif", 24))?;
    let (above, below) = root.split_vertically(420);
    let several = trials.found.len() > 1;
    let (left, right) = above.split_horizontally(if several { 1080 } else { 1400 });
    let by_evaluations = |row: &TraceRow| (row.evaluations as f64, row.cost);
    let mut costs = Chart::new("lowest cost so far", "evaluations", &format!("RMS [{unit}]")).logarithmic();
    every_trial(&mut costs, trials, &by_evaluations);
    if let Some(cost) = polished {
        let last = trials.found.iter().map(|f| f.evaluations).max().unwrap_or(0) as f64;
        let name = format!("after Levenberg-Marquardt: {} {unit}", text::short(cost));
        costs.curve(&name, POLISHED, &[vec![(0.0, cost), (last, cost)]]);
    }
    costs.draw(&left)?;
    if let (true, Some(spread)) = (several, trials.costs()) {
        box_plot(&right, &trials.found, &spread, unit)?;
    }
    for (d, (area, variable)) in below.split_evenly((lines, columns)).iter().zip(&trials.variables).enumerate() {
        let unit = if variable.unit.is_empty() { String::new() } else { format!(" [{}]", variable.unit) };
        let chart = Chart::new(&format!("{}{unit} by generation", variable.name), "", "").small();
        let mut chart = if variable.scale == Scale::Log { chart.logarithmic() } else { chart };
        every_trial(&mut chart, trials, &|row: &TraceRow| (row.generation as f64, row.values[d]));
        chart.draw(area)?;
    }
    Ok(())
}

/// Adds a line for each trial; the best one is drawn last.
fn every_trial(chart: &mut Chart, trials: &Trials, point: &dyn Fn(&TraceRow) -> (f64, f64)) {
    let line = |found: &Found| -> Vec<(f64, f64)> { found.trace.iter().map(point).collect() };
    let Some(best) = trials.best() else { return };
    let others: Vec<_> = trials.found.iter().filter(|found| !std::ptr::eq(*found, best)).map(line).collect();
    if !others.is_empty() {
        chart.curve("other trials", OTHERS, &others);
    }
    chart.curve(if others.is_empty() { "the trial" } else { "best trial" }, BEST, &[line(best)]);
}

/// Draws quartiles and extremes of the final costs, and each final cost as a point.
fn box_plot(area: &Area<'_>, found: &[Found], spread: &Spread, unit: &str) -> Drawn {
    let Spread { lowest, lower_quartile, median, upper_quartile, highest } = *spread;
    let room = 0.08 * (highest - lowest).max(1e-3 * highest.abs()).max(f64::MIN_POSITIVE);
    let mut chart = ChartBuilder::on(area)
        .caption("final costs", ("sans-serif", 18))
        .margin(8)
        .x_label_area_size(38)
        .y_label_area_size(90)
        .build_cartesian_2d(0.0..1.0, lowest - room..highest + room)?;
    chart
        .configure_mesh()
        .disable_x_axis()
        .disable_x_mesh()
        .light_line_style(WHITE)
        .label_style(("sans-serif", 13))
        .y_desc(format!("RMS [{unit}]"))
        .y_label_formatter(&|y| format!("{y:.4e}"))
        .draw()?;
    let ink = BLACK.stroke_width(1);
    chart.draw_series(
        [(0.3, lower_quartile, upper_quartile)]
            .map(|(x, low, high)| Rectangle::new([(x, low), (0.7, high)], OTHERS.mix(0.4).filled())),
    )?;
    let lines = [
        [(0.3, lower_quartile), (0.7, lower_quartile)],
        [(0.3, upper_quartile), (0.7, upper_quartile)],
        [(0.3, lower_quartile), (0.3, upper_quartile)],
        [(0.7, lower_quartile), (0.7, upper_quartile)],
        [(0.5, upper_quartile), (0.5, highest)],
        [(0.5, lowest), (0.5, lower_quartile)],
        [(0.4, highest), (0.6, highest)],
        [(0.4, lowest), (0.6, lowest)],
    ];
    chart.draw_series(lines.map(|line| PathElement::new(line.to_vec(), ink)))?;
    chart.draw_series([PathElement::new(vec![(0.3, median), (0.7, median)], BEST.stroke_width(3))])?;
    chart.draw_series(found.iter().map(|f| Circle::new((0.85, f.cost), 3, POLISHED.mix(0.6).filled())))?;
    Ok(())
}
