//! Triangular and half-sine descent curves on a simulated actuator in a resonant structure; draws a figure:
//! `cargo run --release -p hyst-tests --example fod_study [SEED [SVG]]`.

use hyst_tests::fod_study::{FodStudy, Identified, run};
use plotters::coord::Shift;
use plotters::prelude::*;

type Drawn = Result<(), Box<dyn std::error::Error>>;
type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

const COLOURS: [RGBColor; 3] = [RGBColor(120, 120, 120), RGBColor(200, 80, 40), RGBColor(30, 110, 190)];

fn main() -> Drawn {
    let mut args = std::env::args().skip(1);
    let seed = args.next().map_or(Ok(1), |s| s.parse())?;
    let path = args.next().unwrap_or_else(|| "fod-study.svg".into());
    let study = run(seed);
    print(&study);
    draw(&study, &path)?;
    println!("\n{path}");
    Ok(())
}

fn print(study: &FodStudy) {
    println!("structure's phase at 10 Hz {:.1} deg\n", study.phase_deg);
    println!("{:28}{:>10}{:>14}{:>14}{:>14}", "surface", "violated", "worst [N]", "worst [σ]", "moved [N]");
    for s in &study.surfaces {
        let worst = s.report.breaches.first();
        let number = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.1}"));
        println!(
            "{:28}{:>10}{:>14}{:>14}{:>14}",
            s.name,
            s.report.breaches.len(),
            number(worst.map(|b| b.by)),
            number(worst.map(|b| b.sigmas)),
            number(s.report.moved.map(|m| m.largest)),
        );
    }
    println!("\n{:28}{:>24}", "drive for a 10 Hz sine", "RMS error, % of swing");
    for t in &study.tracking {
        println!("{:28}{:24.3}", t.name, t.rmse_percent);
    }
}

/// Draws two surfaces above and the tracked sine below.
fn draw(study: &FodStudy, path: &str) -> Drawn {
    hyst_tests::register_font();
    let root = SVGBackend::new(path, (1300, 1000)).into_drawing_area();
    root.fill(&WHITE)?;
    let (above, below) = root.split_vertically(500);
    let (left, right) = above.split_horizontally(650);
    surface(&left, &study.surfaces[0])?;
    surface(&right, &study.surfaces[3])?;
    let (left, right) = below.split_horizontally(650);
    let runs = [&study.tracking[0], &study.tracking[1], &study.tracking[4]];
    let wanted = &study.reference;
    let loops = runs.map(|t| (t.name, wanted.iter().copied().zip(t.force.iter().copied()).collect::<Vec<_>>()));
    lines(&left, "10 Hz, corrected for the structure's phase and gain", "reference [N]", "force [N]", &loops)?;
    let error = |t: &[f64]| (0..).map(f64::from).zip(t.iter().zip(wanted).map(|(f, r)| f - r)).collect::<Vec<_>>();
    let errors = runs.map(|t| (t.name, error(&t.force)));
    lines(&right, "the same: force minus reference", "time [ms]", "error [N]", &errors)?;
    root.present()?;
    Ok(())
}

/// Draws E(α, β) over β for every fifth α, and the violated cells.
fn surface(area: &Area<'_>, s: &Identified) -> Drawn {
    let grid = s.surface.grid();
    let top = s.surface.value(grid.cells, 0);
    let mut chart = ChartBuilder::on(area)
        .caption(format!("Everett surface, {}: {} cells violated", s.name, s.report.breaches.len()), ("sans-serif", 18))
        .margin(10)
        .margin_right(26)
        .x_label_area_size(38)
        .y_label_area_size(62)
        .build_cartesian_2d(grid.low..grid.high, -0.05 * top..1.05 * top)?;
    chart.configure_mesh().x_desc("β [V]").y_desc("E(α, β) [N]").light_line_style(WHITE).draw()?;
    for i in (5..=grid.cells).step_by(5) {
        let curve = (0..=i).map(|j| (s.surface.at(j), s.surface.value(i, j)));
        chart.draw_series(LineSeries::new(curve, COLOURS[2]))?;
    }
    let node = |u: f64| ((u - grid.low) / (grid.high - grid.low) * grid.cells as f64).round() as usize;
    let violated = s.report.breaches.iter().map(|b| (b.beta, s.surface.value(node(b.alpha), node(b.beta))));
    chart.draw_series(violated.map(|at| Circle::new(at, 3, COLOURS[1].filled())))?;
    Ok(())
}

fn lines(area: &Area<'_>, title: &str, x: &str, y: &str, curves: &[(&'static str, Vec<(f64, f64)>)]) -> Drawn {
    let points = || curves.iter().flat_map(|c| &c.1);
    let range = |f: fn(&(f64, f64)) -> f64| {
        let (low, high) = points().map(f).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        low - 0.05 * (high - low)..high + 0.05 * (high - low)
    };
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 18))
        .margin(10)
        .margin_right(26)
        .x_label_area_size(38)
        .y_label_area_size(62)
        .build_cartesian_2d(range(|p| p.0), range(|p| p.1))?;
    chart.configure_mesh().x_desc(x).y_desc(y).light_line_style(WHITE).draw()?;
    for ((name, curve), colour) in curves.iter().zip(COLOURS) {
        chart
            .draw_series(LineSeries::new(curve.iter().copied(), colour))?
            .label(*name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(3)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.2))
        .draw()?;
    Ok(())
}
