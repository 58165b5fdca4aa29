//! Compares feedback and feedforward on three references:
//! `cargo run --release -p hyst-tests --example control_study [SEED [SVG]]`.

use std::error::Error;
use std::path::PathBuf;

use hyst_tests::control_study::{CONTROLS, Study, run};
use plotters::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let seed = arguments.next().map_or(Ok(1), |s| s.parse())?;
    let picture = PathBuf::from(arguments.next().unwrap_or_else(|| "control-study.svg".into()));
    let study = run(seed);
    println!("named by the diagnosis: {}; PID: {}", study.named.join(", "), study.gains);
    print!("\n{:38}", "RMSE (largest) error [µm]");
    CONTROLS.iter().for_each(|name| print!("{name:>24}"));
    println!();
    for row in &study.rows {
        print!("{:38}", row.name);
        row.errors.iter().for_each(|e| print!("{:>24}", format!("{:.3} ({:.3})", e.rmse, e.max)));
        println!();
    }
    draw(&study, &picture)?;
    println!("\npicture: {}", picture.display());
    Ok(())
}

/// Draws the error over time, one panel for each reference.
fn draw(study: &Study, path: &PathBuf) -> Result<(), Box<dyn Error>> {
    hyst_tests::register_font();
    let root = SVGBackend::new(path, (1200, 900)).into_drawing_area();
    root.fill(&WHITE)?;
    let colours =
        [RGBColor(150, 150, 150), RGBColor(230, 140, 30), RGBColor(40, 110, 190), RGBColor(190, 50, 60), BLACK];
    for (area, row) in root.split_evenly((study.rows.len(), 1)).iter().zip(&study.rows) {
        // The names are next to the curves, not on them.
        let (curves, names) = area.split_horizontally(950);
        let limit = row.errors.iter().skip(1).fold(0.0f64, |m, e| m.max(e.max));
        let end = row.time.last().copied().unwrap_or(1.0);
        let mut chart = ChartBuilder::on(&curves)
            .caption(row.name, ("sans-serif", 18))
            .margin(8)
            .x_label_area_size(32)
            .y_label_area_size(60)
            .build_cartesian_2d(0.0..end, -limit..limit)?;
        chart
            .configure_mesh()
            .x_desc("time [s]")
            .y_desc("output minus reference [µm]")
            .light_line_style(WHITE)
            .draw()?;
        for (k, measured) in row.measured.iter().enumerate() {
            let points = row.time.iter().zip(measured).zip(&row.wanted);
            let line = points.map(|((t, y), r)| (*t, (y - r).clamp(-limit, limit))).step_by(4);
            let name = format!("{}: {:.3} µm", CONTROLS[k], row.errors[k].rmse);
            let (colour, y) = (colours[k], 60 + 26 * k as i32);
            chart.draw_series(LineSeries::new(line, &colour))?;
            names.draw(&PathElement::new([(0, y), (16, y)], colour.stroke_width(3)))?;
            names.draw(&Text::new(name, (22, y - 7), ("sans-serif", 14)))?;
        }
    }
    root.present()?;
    Ok(())
}
