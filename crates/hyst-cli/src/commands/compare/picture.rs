//! One picture of a comparison: how large the errors of all models are, and what each of them leaves.

use hyst_ident::compare::{Compared, Comparison, SortedBy};
use hyst_ident::record::Record;
use plotters::coord::Shift;
use plotters::prelude::*;

use crate::chart::{Chart, Drawn, drawn};
use crate::exit::CommandResult;
use crate::text;

const TRAIN: RGBColor = RGBColor(30, 110, 190);
const TEST: RGBColor = RGBColor(200, 80, 40);

/// The picture as SVG; what is left is shown of `record`.
pub(super) fn draw(
    comparison: &Comparison,
    record: &Record,
    predicted: fn(&Compared) -> &[f64],
) -> CommandResult<String> {
    drawn(|svg| panels(svg, comparison, record, predicted))
}

fn panels(svg: &mut String, comparison: &Comparison, record: &Record, predicted: fn(&Compared) -> &[f64]) -> Drawn {
    let models = &comparison.models;
    let columns = (models.len() as f64).sqrt().ceil() as usize;
    let lines = models.len().div_ceil(columns);
    let root = SVGBackend::with_string(svg, (1500, u32::try_from(230 + 190 * lines.max(2))?)).into_drawing_area();
    root.fill(&WHITE)?;
    let unit = record.output_unit().map_or("", |unit| unit.symbol());
    let tested = comparison.sorted_by == SortedBy::TestRmse;
    let shown = if tested { "test" } else { "training" };
    let title = format!("{}: errors, and what each leaves of the {shown} record", text::count(models.len(), "model"));
    let root = root.titled(&title, ("sans-serif", 24))?;
    let (left, right) = root.split_horizontally(520);
    bars(&left, models, unit)?;
    let input = models.first().map_or("", |m| &m.fit.model.input.unit);
    let caption = format!("measured − model [{unit}] against the input [{input}], each on its own scale");
    let right = right.titled(&caption, ("sans-serif", 16))?;
    let settling = if tested { &comparison.test_settling } else { &comparison.train_settling };
    for (area, model) in right.split_evenly((lines, columns)).iter().zip(models) {
        let rmse = model.test.unwrap_or(model.train).errors.rmse;
        let mut chart = Chart::new(&format!("{}, RMS {}", model.kind, text::short(rmse)), "", "").small();
        let measured = record.output().unwrap_or_default();
        let counted = || (0..record.rows()).filter(|k| !settling[*k]);
        let input: Vec<f64> = counted().map(|k| record.input()[k]).collect();
        let left_over: Vec<f64> = counted().map(|k| measured[k] - predicted(model)[k]).collect();
        chart.path("", if tested { TEST } else { TRAIN }, &input, &left_over);
        chart.draw(area)?;
    }
    root.present()?;
    Ok(())
}

/// Bars of RMSE on a logarithmic axis, the best on top.
fn bars<B: DrawingBackend>(area: &DrawingArea<B, Shift>, models: &[Compared], unit: &str) -> Drawn
where
    B::ErrorType: 'static,
{
    let of = |m: &Compared| [Some((m.train, TRAIN)), m.test.map(|test| (test, TEST))];
    let all = || models.iter().flat_map(of).flatten().map(|(figures, _)| figures.errors.rmse).filter(|x| *x > 0.0);
    let (low, high) = all().fold((f64::INFINITY, 0.0f64), |(l, h), x| (l.min(x), h.max(x)));
    // A model without error has no place on the axis; if none has one, any axis does.
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
        let bar = |(i, m): (usize, &Compared)| {
            let (figures, _) = of(m)[which]?;
            let top = count - i as f64 - if which == 0 { 0.12 } else { 0.5 };
            let height = if tested { 0.36 } else { 0.76 };
            Some(Rectangle::new([(low, top - height), (figures.errors.rmse.max(low), top)], colour.mix(0.85).filled()))
        };
        let series = chart.draw_series(models.iter().enumerate().filter_map(bar))?;
        if tested {
            series.label(name).legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 18, y + 5)], colour.filled()));
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

/// Text that ends at its point.
fn text_right() -> plotters::style::text_anchor::Pos {
    use plotters::style::text_anchor::{HPos, Pos, VPos};
    Pos::new(HPos::Right, VPos::Center)
}
