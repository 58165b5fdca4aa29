//! Picture of a comparison: errors and residuals of all models.

use hyst_ident::compare::{Compared, Comparison, SortedBy};
use hyst_ident::record::Record;
use plotters::prelude::*;

use crate::canvas::{Area, Drawn, Format};
use crate::chart::Chart;
use crate::exit::CommandResult;
use crate::text;

const TRAIN: RGBColor = RGBColor(30, 110, 190);
const TEST: RGBColor = RGBColor(200, 80, 40);

/// Draws the picture; the residuals are those of `record`.
pub(super) fn draw(
    format: Format,
    comparison: &Comparison,
    record: &Record,
    predicted: fn(&Compared) -> &[f64],
) -> CommandResult<Vec<u8>> {
    let (_, lines) = panels_of(&comparison.models);
    let size = (1500, 230 + 190 * u32::try_from(lines.max(2)).unwrap_or(2));
    format.draw(size, |root| panels(root, comparison, record, predicted))
}

/// Returns the numbers of columns and rows of the panels of residuals.
fn panels_of(models: &[Compared]) -> (usize, usize) {
    let columns = (models.len() as f64).sqrt().ceil() as usize;
    (columns, models.len().div_ceil(columns.max(1)))
}

fn panels(root: &Area<'_>, comparison: &Comparison, record: &Record, predicted: fn(&Compared) -> &[f64]) -> Drawn {
    let models = &comparison.models;
    let (columns, lines) = panels_of(models);
    let unit = record.output_unit().map_or("", |unit| unit.symbol());
    let tested = comparison.sorted_by == SortedBy::TestRmse;
    let shown = if tested { "test" } else { "training" };
    let title = format!("{}: errors, and residuals on the {shown} record", text::count(models.len(), "model"));
    let root = root.titled(&title, ("sans-serif", 24))?;
    let (left, right) = root.split_horizontally(520);
    errors(&left, models, unit)?;
    let input = models.first().map_or("", |m| &m.fit.model.input.unit);
    let caption = "residuals (measured − model) over the input, all on one scale";
    let right = right.titled(caption, ("sans-serif", 16))?;
    let settling = if tested { &comparison.test_settling } else { &comparison.train_settling };
    let measured = record.output().unwrap_or_default();
    // One piece for each segment, without start-up rows.
    let residual = |model: &Compared| -> Vec<Vec<(f64, f64)>> {
        let row = |k: usize| (!settling[k]).then(|| (record.input()[k], measured[k] - predicted(model)[k]));
        record.segments().iter().map(|rows| rows.clone().filter_map(row).collect()).collect()
    };
    let residuals: Vec<_> = models.iter().map(residual).collect();
    // The scale follows the model with the median error; larger residuals are clipped, so that one bad model does not
    // flatten all others.
    let mut most: Vec<f64> = residuals
        .iter()
        .map(|pieces| pieces.iter().flatten().fold(0.0, |most: f64, (_, r)| most.max(r.abs())))
        .collect();
    most.sort_unstable_by(f64::total_cmp);
    let scale = 1.5 * most.get(most.len() / 2).copied().unwrap_or(0.0);
    for ((area, model), residual) in right.split_evenly((lines, columns)).iter().zip(models).zip(&residuals) {
        let rmse = model.test.unwrap_or(model.train).errors.rmse;
        let title = format!("{}, RMS {} {unit}", model.kind, text::short(rmse));
        let mut chart = Chart::new(&title, &format!("input [{input}]"), &format!("residual [{unit}]")).small();
        if scale > 0.0 && scale.is_finite() {
            chart = chart.between(-scale, scale);
        }
        chart.paths("", if tested { TEST } else { TRAIN }, residual);
        chart.draw(area)?;
    }
    Ok(())
}

/// Draws the RMSE of all models on a logarithmic axis, the best one on top.
fn errors(area: &Area<'_>, models: &[Compared], unit: &str) -> Drawn {
    let of = |m: &Compared| [Some((m.train, TRAIN)), m.test.map(|test| (test, TEST))];
    let all = || models.iter().flat_map(of).flatten().map(|(figures, _)| figures.errors.rmse).filter(|x| *x > 0.0);
    let (low, high) = all().fold((f64::INFINITY, 0.0f64), |(l, h), x| (l.min(x), h.max(x)));
    // An RMSE of zero is not on the axis; without any other RMSE the axis is arbitrary.
    let (low, high) = if low.is_finite() { (low / 2.0, high * 1.6) } else { (0.1, 1.0) };
    let count = models.len() as f64;
    let mut chart = ChartBuilder::on(area)
        .caption(format!("RMSE [{unit}] (number of parameters)"), ("sans-serif", 18))
        .margin(8)
        .margin_left(160)
        .x_label_area_size(38)
        .build_cartesian_2d((low..high).log_scale(), 0.0..count)?;
    chart
        .configure_mesh()
        .disable_y_axis()
        .disable_y_mesh()
        .light_line_style(WHITE)
        .label_style(("sans-serif", 13))
        .axis_desc_style(("sans-serif", 14))
        .draw()?;
    let tested = models.iter().any(|m| m.test.is_some());
    for (name, which, colour) in [("training record", 0, TRAIN), ("test record", 1, TEST)] {
        let dot = |(i, m): (usize, &Compared)| {
            let (figures, _) = of(m)[which]?;
            Some(Circle::new((figures.errors.rmse.max(low), count - i as f64 - 0.5), 5, colour.mix(0.85).filled()))
        };
        let series = chart.draw_series(models.iter().enumerate().filter_map(dot))?;
        if tested {
            series.label(name).legend(move |(x, y)| Circle::new((x + 9, y), 5, colour.filled()));
        }
    }
    if tested {
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.2))
            .label_font(("sans-serif", 13))
            .draw()?;
    }
    for (i, m) in models.iter().enumerate() {
        let (x, y) = chart.backend_coord(&(low, count - i as f64 - 0.5));
        let (left, top) = area.get_base_pixel();
        let name = format!("{} ({})", m.kind, m.parameters);
        let style = ("sans-serif", 14).into_text_style(area).pos(text_right());
        area.draw(&Text::new(name, (x - left - 6, y - top), style))?;
    }
    Ok(())
}

/// Alignment of text that ends at its point.
fn text_right() -> plotters::style::text_anchor::Pos {
    use plotters::style::text_anchor::{HPos, Pos, VPos};
    Pos::new(HPos::Right, VPos::Center)
}
