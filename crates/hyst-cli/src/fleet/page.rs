//! HTML page of a fleet: effects, control charts of parameters, failed records, actuators.
//!
//! The charts are control charts of individual values (Wheeler and Chambers, *Understanding Statistical Process
//! Control*). The centre is the median. The limits are 3.145 median moving ranges from the centre, which is 3 standard
//! deviations of the differences between successive actuators.

use std::collections::BTreeMap;
use std::io;
use std::path::{self, Component, Path};

use hyst_ident::diagnose::{Axis, Curve, Picture, Role, Style};

use super::Entry;
use super::journal::Journal;
use crate::report::figures;
use crate::report::html::{Page, Table, escaped};
use crate::text::{count, percent, short, symbol};

/// Distance from the centre to a limit, in median moving ranges: 3/0.954.
const RANGES_TO_LIMIT: f64 = 3.145;
/// Minimum number of values of a chart.
const MIN_VALUES: usize = 8;
/// Maximum number of actuators in a table.
const MAX_LISTED: usize = 500;
/// Maximum number of points within the limits of a chart; points outside the limits are always drawn.
const MAX_POINTS: usize = 1500;

/// A parameter of an effect over the fleet.
#[derive(Default)]
struct Series {
    unit: String,
    /// Index of the actuator in its order, and value.
    values: Vec<(usize, f64)>,
}

/// Centre and limits of a chart.
struct Limits {
    centre: f64,
    low: f64,
    high: f64,
}

impl Series {
    fn limits(&self) -> Option<Limits> {
        if self.values.len() < MIN_VALUES {
            return None;
        }
        let median = |mut values: Vec<f64>| {
            let middle = values.len() / 2;
            *values.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        let centre = median(self.values.iter().map(|(_, value)| *value).collect());
        let ranges = self.values.windows(2).map(|pair| (pair[1].1 - pair[0].1).abs()).collect();
        let reach = RANGES_TO_LIMIT * median(ranges);
        Some(Limits { centre, low: centre - reach, high: centre + reach })
    }
}

impl Limits {
    fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

/// Sorts the actuators by date and serial number; returns them with a description of the order.
fn in_order(entries: &[Entry]) -> (Vec<Entry>, &'static str) {
    let mut sorted = entries.to_vec();
    let dated = entries.iter().any(|entry| entry.date.is_some());
    let numbered = entries.iter().any(|entry| entry.serial.is_some());
    // Digits in a serial number are compared as numbers: P-9 comes before P-10.
    let natural = |text: &Option<String>| -> Vec<(u128, String)> {
        let text = text.as_deref().unwrap_or_default();
        text.split_inclusive(|c: char| !c.is_ascii_digit())
            .map(|part| {
                let digits: String = part.chars().take_while(char::is_ascii_digit).collect();
                (digits.parse().unwrap_or(0), part[digits.len()..].to_owned())
            })
            .collect()
    };
    sorted.sort_by_cached_key(|entry| (entry.date.clone().unwrap_or_default(), natural(&entry.serial)));
    let order = match (dated, numbered) {
        (true, _) => "sorted by date",
        (false, true) => "sorted by serial number",
        (false, false) => "sorted by file",
    };
    (sorted, order)
}

/// Returns the name of an actuator: its serial number and its file.
pub(crate) fn name(entry: &Entry) -> String {
    entry.serial.as_ref().map_or_else(|| entry.file.clone(), |serial| format!("{serial} ({})", entry.file))
}

/// Returns the title of a fleet.
pub fn title(records: &Path) -> String {
    format!("Fleet {}", records.file_name().unwrap_or(records.as_os_str()).to_string_lossy())
}

/// Returns the page of these actuators as HTML; its links are relative to the folder of the page.
///
/// # Errors
/// When the journal cannot be read.
pub fn page(title: &str, journal: &Journal, entries: &[Entry], folder: &Path) -> io::Result<String> {
    let (entries, order) = in_order(entries);
    let mut verdicts: BTreeMap<String, usize> = BTreeMap::new();
    let mut effects: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let mut series: BTreeMap<(String, String), Series> = BTreeMap::new();
    let (mut failed, mut failures, mut better) = (0, Vec::new(), Vec::new());
    let mut listed = Table::new("Actuators").words("actuator").words("date").words("verdict").words("effects");
    listed = listed.numbers("RMSE before").numbers("after").words("report");
    let mut done = 0;
    let mut shown = 0;
    for row in journal.rows(&entries)? {
        let (k, row) = row?;
        done += 1;
        let found = match &row.outcome {
            Ok(found) => found,
            Err(message) => {
                failed += 1;
                if failures.len() < MAX_LISTED {
                    failures.push((name(&row.entry), message.clone()));
                }
                continue;
            }
        };
        *verdicts.entry(found.verdict.clone()).or_default() += 1;
        for effect in &found.effects {
            effects.entry(effect.name.clone()).or_default().push(effect.probability);
            for (parameter, value) in &effect.parameters {
                let own = series.entry((effect.name.clone(), parameter.clone())).or_default();
                own.unit = symbol(&value.unit).to_owned();
                own.values.push((k, value.value));
            }
        }
        let own = series.entry((String::new(), "noise".to_owned())).or_default();
        own.unit = symbol(&found.unit).to_owned();
        own.values.push((k, found.noise));
        if let (Some(before), Some(after)) = (found.rmse_before, found.rmse_after)
            && before > 0.0
        {
            better.push(after / before);
        }
        if shown < MAX_LISTED {
            shown += 1;
            let names: Vec<&str> = found.effects.iter().map(|effect| effect.name.as_str()).collect();
            let number = |value: Option<f64>| {
                value.map_or_else(String::new, |value| format!("{} {}", short(value), symbol(&found.unit)))
            };
            let date = row.entry.date.clone().unwrap_or_default();
            let link = found.report.as_ref().map(|path| link(Path::new(path), folder));
            let cells = [
                name(&row.entry),
                date,
                found.verdict.clone(),
                names.join(", "),
                number(found.rmse_before),
                number(found.rmse_after),
            ];
            listed.linked_row(&cells, link.as_deref().unwrap_or_default());
        }
    }
    let mut page = Page::new(title);
    page.paragraph("", &summary(done, failed, entries.len(), &verdicts, &mut better));
    write_effects(&mut page, &effects, done - failed);
    write_charts(&mut page, &series, &entries, order);
    if failed > 0 {
        page.section("failed", "Records without a diagnosis");
        let mut table = Table::new("").words("actuator").words("reason");
        failures.iter().for_each(|(name, why)| table.row(&[name, why]));
        page.table(&table);
        more(&mut page, failed, failures.len());
    }
    page.section("actuators", "Actuators");
    page.table(&listed);
    more(&mut page, done - failed, shown);
    let pictures = charts(&series, order);
    page.finish(&figures::data(&pictures)?).map_err(Into::into)
}

/// Returns a link from a page in `folder` to a report.
fn link(report: &Path, folder: &Path) -> String {
    format!("<a href=\"{}\">report</a>", escaped(address(report, folder)))
}

/// Returns the address of a file relative to a folder; the whole path if they are on different drives.
fn address(file: &Path, folder: &Path) -> String {
    // Links are resolved as far as the file exists, so that `..` leads to the right folder.
    let whole = |path: &Path| path.canonicalize().or_else(|_| path::absolute(path)).unwrap_or_else(|_| path.to_owned());
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let (file, folder) = (whole(file), whole(folder));
    let (parts, own): (Vec<Component<'_>>, Vec<Component<'_>>) =
        (file.components().collect(), folder.components().collect());
    let common = parts.iter().zip(&own).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return file.display().to_string();
    }
    let up = std::iter::repeat_n("..".to_owned(), own.len() - common);
    let down = parts[common..].iter().map(|part| part.as_os_str().to_string_lossy().into_owned());
    let path = up.chain(down).collect::<Vec<_>>().join("/");
    // Characters with a meaning in an address.
    [('%', "%25"), ('#', "%23"), ('?', "%3F"), (' ', "%20")].iter().fold(path, |path, (c, code)| path.replace(*c, code))
}

fn more(page: &mut Page, all: usize, shown: usize) {
    if all > shown {
        page.paragraph("soft", &format!("the first {shown} of {all}; the results file has all"));
    }
}

fn summary(done: usize, failed: usize, all: usize, verdicts: &BTreeMap<String, usize>, better: &mut [f64]) -> String {
    let mut text = format!("{} of {} diagnosed", done - failed, count(all, "actuator"));
    if failed > 0 {
        text += &format!(", {} without a diagnosis", count(failed, "record"));
    }
    if done < all {
        text += &format!(", {} not done yet", all - done);
    }
    let each: Vec<String> = verdicts.iter().map(|(verdict, n)| format!("{n} {verdict}")).collect();
    if !each.is_empty() {
        text += &format!(": {}", each.join(", "));
    }
    better.sort_unstable_by(f64::total_cmp);
    if let Some(middle) = better.get(better.len() / 2) {
        text += &format!(
            ". Extended models have {} of the RMS residual of the fitted models (median)",
            percent(100.0 * middle)
        );
    }
    text
}

fn write_effects(page: &mut Page, effects: &BTreeMap<String, Vec<f64>>, diagnosed: usize) {
    if effects.is_empty() {
        return;
    }
    page.section("effects", "Effects");
    let mut table =
        Table::new("").words("effect").numbers("actuators").numbers("lowest probability").words("share of the fleet");
    let mut sorted: Vec<_> = effects.iter().collect();
    sorted.sort_by_key(|(name, probabilities)| (usize::MAX - probabilities.len(), (*name).clone()));
    for (name, probabilities) in sorted {
        let lowest = probabilities.iter().copied().fold(1.0, f64::min);
        let share = probabilities.len() as f64 / diagnosed.max(1) as f64;
        let cells =
            [name.as_str(), &probabilities.len().to_string(), &percent(100.0 * lowest), &percent(100.0 * share)];
        table.bar_row(&cells, share);
    }
    page.table(&table);
}

/// Returns the title of a series.
fn called(effect: &str, parameter: &str) -> String {
    if effect.is_empty() { "White noise of the output".to_owned() } else { format!("{effect}: {parameter}") }
}

fn write_charts(page: &mut Page, series: &BTreeMap<(String, String), Series>, entries: &[Entry], order: &str) {
    let pictures = charts(series, order);
    if pictures.is_empty() {
        return;
    }
    page.section("charts", "Parameters over the fleet");
    figures::write(page, &pictures.iter().enumerate().collect::<Vec<_>>());
    let mut table =
        Table::new("Values outside their limits").words("actuator").words("parameter").numbers("value").words("limits");
    let mut outside = 0;
    for ((effect, parameter), own) in series {
        let Some(limits) = own.limits() else { continue };
        for (k, value) in own.values.iter().filter(|(_, value)| !limits.holds(*value)) {
            outside += 1;
            if outside <= MAX_LISTED {
                let unit = &own.unit;
                let cells = [
                    name(&entries[*k]),
                    called(effect, parameter),
                    format!("{} {unit}", short(*value)),
                    format!("{} to {} {unit}", short(limits.low), short(limits.high)),
                ];
                table.row(&cells);
            }
        }
    }
    if outside == 0 {
        page.paragraph("", "No value is outside its limits");
    } else {
        page.table(&table);
        more(page, outside, outside.min(MAX_LISTED));
    }
}

/// Returns a chart of each parameter that has at least [`MIN_VALUES`] values.
fn charts(series: &BTreeMap<(String, String), Series>, order: &str) -> Vec<Picture> {
    let chart = |((effect, parameter), own): (&(String, String), &Series)| {
        let limits = own.limits()?;
        let step = own.values.len().div_ceil(MAX_POINTS);
        let (inside, outside): (Vec<_>, Vec<_>) = own.values.iter().partition(|(_, value)| limits.holds(*value));
        let inside: Vec<_> = inside.into_iter().step_by(step).collect();
        let (first, last) = (own.values.first()?.0 as f64 + 1.0, own.values.last()?.0 as f64 + 1.0);
        let points = |name: &str, role, values: &[(usize, f64)]| Curve {
            name: name.to_owned(),
            style: Style::Points,
            role,
            x: values.iter().map(|(k, _)| *k as f64 + 1.0).collect(),
            y: values.iter().map(|(_, value)| *value).collect(),
        };
        let line = |name: &str, at: f64| Curve {
            name: name.to_owned(),
            style: Style::Line,
            role: Role::Reference,
            x: vec![first, last],
            y: vec![at, at],
        };
        let mut curves = vec![points("within the limits", Role::Measured, &inside)];
        if !outside.is_empty() {
            curves.push(points("outside", Role::Without, &outside));
        }
        curves.extend([line("median", limits.centre), line("limit", limits.low), line("limit", limits.high)]);
        let caption = format!(
            "{} of {} outside {} to {} {}",
            outside.len(),
            count(own.values.len(), "value"),
            short(limits.low),
            short(limits.high),
            own.unit
        );
        let axis = |label: &str, unit: &str| Axis { label: label.to_owned(), unit: unit.to_owned(), log: false };
        Some(Picture {
            effect: None,
            title: called(effect, parameter),
            caption,
            x: axis(&format!("actuator, {order}"), ""),
            y: axis(parameter, &own.unit),
            curves,
            marks: Vec::new(),
        })
    };
    series.iter().filter_map(chart).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_follow_from_the_moving_ranges() {
        let value = |k: usize| (k, 10.0 + [0.0, 1.0, -1.0, 0.5][k % 4] + if k == 17 { 30.0 } else { 0.0 });
        let series = Series { unit: String::new(), values: (0..40).map(value).collect() };
        let limits = series.limits().unwrap();
        // The moving ranges are 1, 2, 1.5, 0.5 in turn.
        assert!(
            (limits.centre - 10.0).abs() <= 0.5 && (limits.high - limits.centre - 1.5 * RANGES_TO_LIMIT).abs() < 1e-9
        );
        let outside: Vec<usize> = series.values.iter().filter(|(_, v)| !limits.holds(*v)).map(|(k, _)| *k).collect();
        assert_eq!(outside, [17]);
        assert!(Series { values: series.values[..7].to_vec(), ..Series::default() }.limits().is_none());
    }

    #[test]
    fn links_are_relative_to_the_page() {
        let of = |file: &str, folder: &str| address(Path::new(file), Path::new(folder));
        assert_eq!(of("reports/a.html", ""), "reports/a.html");
        assert_eq!(of("reports/a.html", "pages"), "../reports/a.html");
        assert_eq!(of("out/reports/a.html", "out"), "reports/a.html");
        assert_eq!(of("/x/my reports #1/a.html", "/x/y/z"), "../../my%20reports%20%231/a.html");
    }

    #[test]
    fn serial_numbers_are_ordered_as_numbers() {
        let entry = |serial: &str, date: Option<&str>| Entry {
            file: serial.into(),
            test: None,
            serial: Some(serial.into()),
            date: date.map(Into::into),
        };
        let serials = |entries: &[Entry]| entries.iter().map(|e| e.file.clone()).collect::<Vec<_>>();
        let (sorted, order) = in_order(&[entry("P-10", None), entry("P-9", None)]);
        assert_eq!((serials(&sorted), order), (vec!["P-9".to_owned(), "P-10".to_owned()], "sorted by serial number"));
        let (sorted, _) = in_order(&[entry("P-9", Some("2026-05-02")), entry("P-10", Some("2026-05-01"))]);
        assert_eq!(serials(&sorted), ["P-10", "P-9"]);
    }
}
