//! Finds first-order descent curves in a drive: rows that rise from the lowest input to a peak and fall back.

use std::ops::Range;

use serde::Serialize;

use crate::Samples;
use crate::noise::noise_floor;

/// Maximum height of an input at rest above its lowest value, as a share of its range.
const REST_SHARE: f64 = 0.004;
/// Maximum relative difference of durations that count as equal.
const DURATION_TOLERANCE: f64 = 0.12;
/// Height below which the form of a peak is ignored, as a share of the highest peak.
const MIN_SHAPED_HEIGHT: f64 = 0.2;
/// Ratio of the width at nine tenths of the height to that at one half: 0.2 for a triangle, 0.431 for half a sine.
const WIDTH_RATIOS: [(f64, PeakShape); 2] = [(0.2, PeakShape::Triangle), (0.431, PeakShape::HalfSine)];

/// The form of the peaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PeakShape {
    /// Straight flanks, which excite structural modes.
    Triangle,
    /// Half a sine wave.
    HalfSine,
    /// Another form.
    Other,
}

/// Peaks of one form and duration.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Family {
    /// Their form.
    pub shape: PeakShape,
    /// Duration of a peak from rest to rest \[s\]; for an unknown form, twice the time above half of its height.
    pub peak_s: f64,
    /// Number of peaks.
    pub curves: usize,
}

/// One excursion from the lowest input to a peak and back, without a reversal on either flank.
#[derive(Clone, Debug)]
pub(super) struct Peak {
    /// Segment of the record.
    pub(super) segment: usize,
    /// Row of the highest input.
    pub(super) top: usize,
    /// Rows from the peak to the first row at rest.
    pub(super) falling: Range<usize>,
    /// The highest input.
    pub(super) height: f64,
    /// Whether it is the highest so far in its segment: its top is then on the virgin curve.
    pub(super) first_so_high: bool,
    /// Time above half of the height \[s\].
    half_width: f64,
    shape: PeakShape,
}

/// The curves of a record.
pub(super) struct Curves {
    /// Lowest input, at which the device rests.
    pub(super) low: f64,
    /// Change of the input that counts as none.
    pub(super) tolerance: f64,
    pub(super) families: Vec<(Family, Vec<Peak>)>,
    /// Excursions that are not first-order descent curves.
    pub(super) passed_over: usize,
}

impl Curves {
    pub(super) fn of(samples: &Samples) -> Self {
        let u = &samples.input;
        let (least, most) = samples.input_range();
        // The median of the values near the lowest one, because the lowest one includes noise.
        let mut bottom: Vec<f64> = u.iter().copied().filter(|u| *u <= least + 0.01 * (most - least)).collect();
        let low = median(&mut bottom).unwrap_or(least);
        let tolerance = (REST_SHARE * (most - low)).max(6.0 * noise_floor(u, &samples.segments));
        let mut curves = Self { low, tolerance, families: Vec::new(), passed_over: 0 };
        let mut peaks = Vec::new();
        for (segment, rows) in samples.segments.iter().enumerate() {
            let mut highest = low;
            let mut from = rows.start;
            while let Some(start) = (from..rows.end).find(|k| u[*k] > low + tolerance) {
                let end = (start..rows.end).find(|k| u[*k] <= low + tolerance).unwrap_or(rows.end);
                match curves.peak(u, samples.period, segment, start..end, rows, highest) {
                    Some(peak) => peaks.push(peak),
                    None => curves.passed_over += 1,
                }
                highest = u[start..end].iter().fold(highest, |m, u| m.max(*u));
                from = end;
            }
        }
        curves.families = families(peaks, low, most - low);
        curves
    }

    /// Returns the peak in the rows `above` rest, if they are a first-order descent curve.
    fn peak(
        &self,
        u: &[f64],
        period: f64,
        segment: usize,
        above: Range<usize>,
        rows: &Range<usize>,
        highest: f64,
    ) -> Option<Peak> {
        // Starts and ends at rest, and its height differs from rest.
        let whole = above.end < rows.end && above.start > rows.start;
        let top = above.clone().max_by(|a, b| u[*a].total_cmp(&u[*b]))?;
        let height = u[top];
        if !whole || height < self.low + 2.0 * self.tolerance || top + 2 > above.end {
            return None;
        }
        let reverses = |rows: &mut dyn Iterator<Item = usize>| {
            rows.scan(f64::NEG_INFINITY, |most, k| {
                *most = most.max(u[k]);
                Some(*most - u[k])
            })
            .any(|back| back > self.tolerance)
        };
        if reverses(&mut (above.start..=top)) || reverses(&mut (top..above.end).rev()) {
            return None;
        }
        let width = |share: f64| self.time_above(u, &above, share * (height - self.low) + self.low) * period;
        let (half_width, near_top) = (width(0.5), width(0.9));
        let ratio = near_top / half_width;
        let shape = WIDTH_RATIOS.iter().find(|s| (ratio - s.0).abs() < 0.08).map_or(PeakShape::Other, |s| s.1);
        Some(Peak {
            segment,
            top,
            falling: top..above.end + 1,
            height,
            first_so_high: height > highest,
            half_width,
            shape,
        })
    }

    /// Returns the time above `level` within an excursion \[rows\], with interpolated crossings.
    fn time_above(&self, u: &[f64], above: &Range<usize>, level: f64) -> f64 {
        let inside = |k: usize| u[k] > level;
        let Some(first) = above.clone().find(|k| inside(*k)) else { return 0.0 };
        let last = above.clone().rfind(|k| inside(*k)).unwrap_or(first);
        // The excursion has one row before and one after it, both below every level.
        let part = |outer: usize, inner: usize| (u[inner] - level) / (u[inner] - u[outer]);
        (last - first) as f64 + part(first.saturating_sub(1), first) + part(last + 1, last)
    }
}

/// Groups peaks by form and duration; `high` is the height of the highest peak above rest.
fn families(mut peaks: Vec<Peak>, low: f64, high: f64) -> Vec<(Family, Vec<Peak>)> {
    let mut groups: Vec<Vec<Peak>> = Vec::new();
    // The highest first: their form and duration are the most accurate.
    peaks.sort_by(|a, b| b.height.total_cmp(&a.height));
    for peak in peaks {
        // A low peak spans too few steps of the converter for its form; its duration determines the group.
        let small = peak.height - low < MIN_SHAPED_HEIGHT * high;
        let fits = |g: &&mut Vec<Peak>| {
            (g[0].half_width / peak.half_width - 1.0).abs() < DURATION_TOLERANCE && (small || g[0].shape == peak.shape)
        };
        match groups.iter_mut().find(fits) {
            Some(group) => group.push(peak),
            None => groups.push(vec![peak]),
        }
    }
    groups.into_iter().map(|g| (g[0].family(g.len()), g)).collect()
}

impl Peak {
    fn family(&self, curves: usize) -> Family {
        let of_half_width = match self.shape {
            PeakShape::Triangle | PeakShape::Other => 2.0,
            PeakShape::HalfSine => 1.5,
        };
        Family { shape: self.shape, peak_s: of_half_width * self.half_width, curves }
    }
}

/// Returns the median (the upper one of an even number).
pub(super) fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
