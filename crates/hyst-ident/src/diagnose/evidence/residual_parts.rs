//! Breakdown of the remainder by time, drive, branch and frequency.

use serde::{Deserialize, Serialize};

use super::bins::Bins;
use super::density::Density;
use super::drive::{Branch, branches, clock};
use super::scene::Scene;

/// One part of a record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// Name, for example `12.0 to 18.1 s`.
    pub name: String,
    /// RMS of the remainder in it; for a band of frequencies, RMS of its power in the band \[output unit\].
    pub rms: f64,
    /// Share of the whole record's Σ residual².
    pub share: f64,
}

/// Breakdown of the remainder on the training record by one quantity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Breakdown {
    /// The quantity: `time`, `drive`, `branch` or `frequency`.
    pub by: String,
    /// Its parts, in order.
    pub parts: Vec<Part>,
}

/// Numbers of segments that are examined one by one; a record with fewer or more is divided into equal parts.
const SEGMENTS: std::ops::RangeInclusive<usize> = 2..=12;
/// Number of equal parts of the time, and of bands of the drive.
const PARTS: usize = 8;
/// Frequency bands per decade.
const PER_DECADE: f64 = 2.0;

/// Returns the breakdowns by time, drive, branch and frequency.
pub(super) fn breakdowns(scene: &Scene<'_>) -> Vec<Breakdown> {
    [by_time(scene), by_drive(scene), by_branch(scene), by_frequency(scene)].into_iter().flatten().collect()
}

/// Returns a breakdown, given the part of every row.
fn by_part(scene: &Scene<'_>, by: &str, names: Vec<String>, part: impl Fn(usize) -> Option<usize>) -> Breakdown {
    let mut sums = vec![(0.0, 0_usize); names.len()];
    for k in scene.rows() {
        if let Some(sum) = part(k).and_then(|i| sums.get_mut(i)) {
            *sum = (sum.0 + scene.with.residual[k].powi(2), sum.1 + 1);
        }
    }
    let all: f64 = sums.iter().map(|s| s.0).sum();
    let parts = names.into_iter().zip(sums).filter(|(_, (_, n))| *n > 0).map(|(name, (squares, n))| Part {
        name,
        rms: (squares / n as f64).sqrt(),
        share: share(squares, all),
    });
    Breakdown { by: by.into(), parts: parts.collect() }
}

fn share(part: f64, all: f64) -> f64 {
    if all > 0.0 { part / all } else { 0.0 }
}

fn by_time(scene: &Scene<'_>) -> Option<Breakdown> {
    let (clock, samples) = (clock(&scene.samples), &scene.samples);
    if SEGMENTS.contains(&samples.segments.len()) {
        let named = |(i, s): (usize, &std::ops::Range<usize>)| {
            format!("segment {}, {:.1} to {:.1} s", i + 1, clock[s.start], clock[s.end - 1])
        };
        let names = samples.segments.iter().enumerate().map(named).collect();
        return Some(by_part(scene, "time", names, |k| samples.segments.iter().position(|s| s.contains(&k))));
    }
    let bins = Bins::over(clock.iter().copied(), PARTS)?;
    let names = (0..PARTS).map(|i| format!("{} to {} s", figure(bins.edge(i)), figure(bins.edge(i + 1)))).collect();
    Some(by_part(scene, "time", names, |k| bins.index(clock[k])))
}

fn by_drive(scene: &Scene<'_>) -> Option<Breakdown> {
    let u = &scene.samples.input;
    let bins = Bins::over(u.iter().copied(), PARTS)?;
    let name = |i| format!("{} to {} {}", figure(bins.edge(i)), figure(bins.edge(i + 1)), scene.drive_unit);
    Some(by_part(scene, "drive", (0..PARTS).map(name).collect(), |k| bins.index(u[k])))
}

const BRANCHES: [(Branch, &str); 3] =
    [(Branch::Rising, "rising"), (Branch::Falling, "falling"), (Branch::AtRest, "at rest")];

fn by_branch(scene: &Scene<'_>) -> Option<Breakdown> {
    let branches = branches(&scene.samples);
    let names = BRANCHES.map(|b| b.1.to_owned()).into();
    Some(by_part(scene, "branch", names, |k| BRANCHES.iter().position(|b| b.0 == branches[k])))
}

/// Returns the breakdown into bands of half a decade. Power below the slowest line of the spectrum, including the mean,
/// counts for the lowest band.
fn by_frequency(scene: &Scene<'_>) -> Option<Breakdown> {
    let density = Density::finest(&scene.samples, &scene.with.residual)?;
    let (n, squares) = scene.rows().fold((0.0, 0.0), |(n, s), k| (n + 1.0, s + scene.with.residual[k].powi(2)));
    let variance: f64 = squares / f64::max(n, 1.0);
    let (first, last) = (*density.hz.first()?, *density.hz.last()? + density.step());
    // Edges at 1 and 3 of each decade, so that they are the same for all records.
    let edge = |i: i32| if i % 2 == 0 { 10f64.powi(i / 2) } else { 3.0 * 10f64.powi((i - 1).div_euclid(2)) };
    let lowest = (PER_DECADE * first.log10()).floor() as i32;
    let mut edges: Vec<f64> = (lowest..).map(edge).skip_while(|e| *e <= first).take_while(|e| *e < last).collect();
    edges.push(last);
    let mut powers: Vec<f64> = edges.windows(2).map(|w| density.between(w[0], w[1])).collect();
    // The spectrum weights the middle of its windows. For a residual that varies over the record, its sum differs from
    // the variance.
    let sum = powers.iter().sum::<f64>();
    powers.iter_mut().for_each(|p| *p *= f64::min(1.0, variance / sum.max(f64::MIN_POSITIVE)));
    let rest = (variance - sum).max(0.0);
    let part = |name: String, power: f64| Part { name, rms: power.sqrt(), share: share(power, variance) };
    let mut parts = vec![part(format!("below {} Hz", round(edges[0])), rest)];
    for (w, power) in edges.windows(2).zip(powers) {
        parts.push(part(format!("{} to {} Hz", round(w[0]), round(w[1])), power));
    }
    Some(Breakdown { by: "frequency".into(), parts })
}

/// Minimum RMS of a part that is reported, relative to the RMS of the whole record, and minimum share of a frequency
/// band.
const MIN_RMS_RATIO: f64 = 1.3;
const MIN_BAND_SHARE: f64 = 0.5;

/// Returns the breakdowns in sentences; none if the remainder is noise.
pub(super) fn places(scene: &Scene<'_>, breakdowns: &[Breakdown]) -> Vec<String> {
    let (n, squares) = scene.rows().fold((0.0, 0.0), |(n, s), k| (n + 1.0, s + scene.with.residual[k].powi(2)));
    let whole = (squares / f64::max(n, 1.0)).sqrt();
    if whole <= MIN_RMS_RATIO * scene.noise {
        return Vec::new();
    }
    let unit = scene.unit;
    let mut places = Vec::new();
    for Breakdown { by, parts } in breakdowns {
        let Some(most) = parts.iter().max_by(|a, b| a.rms.total_cmp(&b.rms)) else { continue };
        let against = format!("{} {unit} RMS against {} {unit} over the whole record", figure(most.rms), figure(whole));
        match by.as_str() {
            "frequency" if most.share >= MIN_BAND_SHARE => {
                places.push(format!("{:.0} % of its power is {}", 100.0 * most.share, between(&most.name)));
            }
            "frequency" => {}
            _ if most.rms < MIN_RMS_RATIO * whole => {}
            "time" => places.push(format!("it is largest in {}: {against}", most.name)),
            "branch" if most.name == "at rest" => {
                places.push(format!("it is largest where the drive rests: {against}"));
            }
            "branch" => places.push(format!("it is largest where the drive is {}: {against}", most.name)),
            _ => places.push(format!("it is largest at drives {}: {against}", between(&most.name))),
        }
    }
    places.extend(jump(scene));
    if places.is_empty() {
        places.push("it is spread evenly over time, drive, branch and frequency".into());
    }
    places
}

/// Number of means over time in which a jump is searched, minimum share of their variance that it explains, and maximum
/// ratio of its squares to those of a slope.
const MEANS: usize = 100;
const MIN_JUMP_SHARE: f64 = 0.6;
const MAX_RATIO_TO_SLOPE: f64 = 0.5;

/// Returns a jump of the mean residual, if it explains the slow part better than a slope.
fn jump(scene: &Scene<'_>) -> Option<String> {
    let clock = clock(&scene.samples);
    let bins = Bins::over(clock.iter().copied(), MEANS)?;
    let (time, mean) = bins.means(scene.rows().map(|k| (clock[k], scene.with.residual[k])));
    let average = |v: &[f64]| v.iter().sum::<f64>() / v.len().max(1) as f64;
    let spread = |v: &[f64]| v.iter().map(|x| (x - average(v)).powi(2)).sum::<f64>();
    let left = |at: usize| spread(&mean[..at]) + spread(&mean[at..]);
    let at = (2..mean.len().saturating_sub(1)).min_by(|a, b| left(*a).total_cmp(&left(*b)))?;
    let (t, y) = (average(&time), average(&mean));
    let (ty, tt) =
        time.iter().zip(&mean).fold((0.0, 0.0), |s, (a, b)| (s.0 + (a - t) * (b - y), s.1 + (a - t).powi(2)));
    let (whole, sloping) = (spread(&mean), spread(&mean) - ty * ty / tt);
    let sharp = left(at) < (1.0 - MIN_JUMP_SHARE) * whole && left(at) < MAX_RATIO_TO_SLOPE * sloping;
    let height = average(&mean[at..]) - average(&mean[..at]);
    let (seconds, sign) = (0.5 * (time[at - 1] + time[at]), if height > 0.0 { "+" } else { "" });
    sharp.then(|| format!("its mean jumps by {sign}{} {} at about {seconds:.1} s", figure(height), scene.unit))
}

/// Changes `1 to 3 Hz` to `between 1 and 3 Hz`; other names stay unchanged.
fn between(name: &str) -> String {
    match name.split_once(" to ") {
        Some((low, high)) => format!("between {low} and {high}"),
        None => name.into(),
    }
}

/// Returns three significant digits, without trailing zeros after the decimal point.
fn figure(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let decimals = (2 - x.abs().log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{x:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// Returns the edge of a band with one significant digit.
fn round(hz: f64) -> String {
    let decimals = (-hz.log10().floor() as i32).max(0) as usize;
    format!("{hz:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_short() {
        assert_eq!([0.0, 15.0, 0.012_345, -2.5, 1234.4].map(figure), ["0", "15", "0.0123", "-2.5", "1234"]);
        assert_eq!([0.3, 1.0, 3.0, 30.0, 499.6].map(round), ["0.3", "1", "3", "30", "500"]);
        assert_eq!(between("1 to 3 Hz"), "between 1 and 3 Hz");
        assert_eq!(between("below 1 Hz"), "below 1 Hz");
    }
}
