//! Plot of a run: output and reference over the last seconds, and the latest values.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Color, Style, Stylize};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Chart, Dataset, Gauge, GraphType};

use super::seconds::Seconds;
use crate::commands::run::values::Values;
use crate::text;

/// Draws the plot; `share` is the share of the run that is finished.
pub(super) fn draw(frame: &mut Frame<'_>, seconds: &Seconds, unit: &str, share: f64) {
    let [chart, numbers, gauge] =
        Layout::vertical([Constraint::Min(4), Constraint::Length(1), Constraint::Length(1)]).areas(frame.area());
    let output = seconds.curve(|values| Some(values.sample.output));
    let wanted = seconds.curve(|values| values.wanted);
    let predicted = seconds.curve(|values| values.predicted.filter(|_| values.wanted.is_none()));
    let ends = |low: f64, high: f64, y: &f64| (low.min(*y), high.max(*y));
    let (low, high) = [&output, &wanted]
        .into_iter()
        .flatten()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (_, y)| ends(low, high, y));
    let margin = (0.05 * (high - low)).max(1e-6);
    let (low, high) = if low <= high { (low - margin, high + margin) } else { (0.0, 1.0) };
    let (from, to) = seconds.window();
    let line = |name: &'static str, points, color| {
        Dataset::default().name(name).marker(Marker::Braille).graph_type(GraphType::Line).fg(color).data(points)
    };
    let mut lines = vec![line("measured", &output, Color::Cyan)];
    if !wanted.is_empty() {
        lines.push(line("reference", &wanted, Color::Yellow));
    }
    if !predicted.is_empty() {
        lines.push(line("model", &predicted, Color::DarkGray));
    }
    let axis = |low: f64, high: f64, title: String| {
        Axis::default()
            .title(title.dark_gray())
            .bounds([low, high])
            .labels([text::short(low), text::short(0.5 * (low + high)), text::short(high)])
            .style(Style::default().dark_gray())
    };
    let picture = Chart::new(lines)
        .hidden_legend_constraints((Constraint::Percentage(60), Constraint::Percentage(60)))
        .x_axis(axis(from, to, "s".to_owned()))
        .y_axis(axis(low, high, unit.to_owned()));
    frame.render_widget(picture, chart);
    if let Some(now) = seconds.now() {
        frame.render_widget(latest(now, seconds.rmse(), unit), numbers);
    }
    let label = format!("{:.0} %, Ctrl-C ramps to rest", 100.0 * share);
    frame.render_widget(Gauge::default().ratio(share.clamp(0.0, 1.0)).label(label).gauge_style(Color::Blue), gauge);
}

/// Returns the latest values in a line.
fn latest(now: &Values, rmse: Option<f64>, unit: &str) -> Line<'static> {
    let mut spans = Vec::new();
    let mut one = |name: &str, value: Option<f64>, unit: &str| {
        if let Some(value) = value {
            spans.push(Span::from(format!("{name} ")).dark_gray());
            spans.push(Span::from(format!("{} {unit}  ", text::short(value))));
        }
    };
    one("t", Some(now.sample.time_s), "s");
    one("drive", Some(now.sample.drive_v), "V");
    one("output", Some(now.sample.output), unit);
    one("error", now.wanted.map(|wanted| now.sample.output - wanted), unit);
    one("RMSE", rmse, unit);
    one("model", now.predicted, unit);
    one("force", now.force, "N");
    one("", now.sample.temperature_degc, "°C");
    one("load", now.sample.load_n, "N");
    Line::from(spans)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyst_hw::Sample;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn shown(seconds: &Seconds) -> String {
        let mut terminal = Terminal::new(TestBackend::new(120, 16)).unwrap();
        terminal.draw(|frame| draw(frame, seconds, "µm", 0.42)).unwrap();
        terminal.backend().to_string()
    }

    #[test]
    fn values_and_curves_of_a_run_are_shown() {
        let mut seconds = Seconds::default();
        for k in 0..20_000 {
            let t = f64::from(k) * 1e-3;
            let wanted = 5.0 - 5.0 * t.cos();
            let sample = Sample {
                time_s: t,
                drive_v: 40.0,
                output: wanted + 0.25,
                temperature_degc: Some(23.5),
                load_n: None,
                force_n: None,
            };
            seconds.add(Values { sample, wanted: Some(wanted), predicted: None, force: Some(-1.5) });
        }
        let (from, _) = seconds.window();
        assert!((14.9..15.1).contains(&from) && seconds.curve(|values| values.wanted).len() <= 402);
        let text = shown(&seconds);
        for part in ["measured", "reference", "RMSE 0.2500 µm", "drive 40.00 V", "force -1.500 N", "23.50 °C", "42 %"]
        {
            assert!(text.contains(part), "{part} is missing in\n{text}");
        }
        // Curves are drawn with braille characters.
        assert!(text.chars().filter(|c| ('\u{2801}'..='\u{28ff}').contains(c)).count() > 50, "{text}");
        assert!(!text.contains("load"));
    }

    #[test]
    fn an_empty_run_and_values_that_are_not_finite_are_drawn() {
        shown(&Seconds::default());
        let mut seconds = Seconds::default();
        let sample = Sample {
            time_s: 0.0,
            drive_v: f64::NAN,
            output: f64::NAN,
            temperature_degc: None,
            load_n: None,
            force_n: None,
        };
        seconds.add(Values { sample, wanted: Some(1.0), predicted: None, force: None });
        shown(&seconds);
        assert_eq!(seconds.rmse(), None);
    }
}
