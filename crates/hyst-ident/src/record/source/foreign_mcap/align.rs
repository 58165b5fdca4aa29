//! Alignment of topics with nearly the same times.

use super::clock::Clock;
use super::series::Series;

/// Largest share of messages that may be missing in one of two topics.
const MAX_LOST_SHARE: f64 = 0.01;
/// Fewest messages of a topic in which one message may be missing.
const MIN_TO_LOSE: usize = 8;
/// Longest step that is interpolated, as a multiple of the usual step. At 2 a message is lost.
const MAX_STEP: f64 = 1.75;
/// Largest number of topics with a note each.
const MAX_NOTES: usize = 8;

/// The times of a topic relative to those of a reference topic \[ns\].
struct Shift {
    /// The median time difference; negative if the messages are earlier.
    usual: i64,
    /// The median time step of the reference topic.
    period: i64,
    /// The median time step of the topic.
    own_period: i64,
    /// Whether all messages that both topics have are at the same times.
    is_none: bool,
}

/// Interpolates topics to the times of other topics with as many messages at nearly the same times.
///
/// The topic with the most messages (the first, if several have as many) is not interpolated, and neither are topics
/// that match no other. Returns one note per interpolated topic.
pub(crate) fn align(topics: &mut [(Series, Clock)]) -> Vec<String> {
    let mut order: Vec<usize> = (0..topics.len()).collect();
    order.sort_by_key(|at| std::cmp::Reverse(topics[*at].0.rows()));
    let (mut is_done, mut notes) = (vec![false; topics.len()], Vec::new());
    for (place, at) in order.iter().enumerate() {
        if std::mem::replace(&mut is_done[*at], true) || !is_increasing(&topics[*at].1.times) {
            continue;
        }
        let reference = topics[*at].1.clone();
        for other in &order[place + 1..] {
            let (series, clock) = &mut topics[*other];
            if is_done[*other] {
                continue;
            }
            if *clock == reference {
                is_done[*other] = true;
            } else if let Some(shift) = shift(&reference.times, &clock.times) {
                is_done[*other] = true;
                let longest = (shift.own_period as f64 * MAX_STEP) as i64;
                let mut empty = 0;
                for column in &mut series.columns {
                    column.values = interpolated(&column.values, &clock.times, &reference.times, longest);
                    empty = empty.max(column.values.iter().filter(|value| value.is_nan()).count());
                }
                notes.push(note(&series.topic, &reference.topic, &shift, empty));
                *clock = reference.clone();
            }
        }
    }
    let more = notes.len().saturating_sub(MAX_NOTES);
    notes.truncate(MAX_NOTES);
    notes.extend((more > 0).then(|| format!("{more} more topics are interpolated in the same way")));
    notes
}

fn note(topic: &str, reference: &str, shift: &Shift, empty: usize) -> String {
    let rows = if empty == 1 { "1 row has".to_owned() } else { format!("{empty} rows have") };
    if shift.is_none {
        return format!("{topic} has no message at some times of {reference}: {rows} no value");
    }
    let side = if shift.usual < 0 { "before" } else { "after" };
    let ms = |ns: i64| significant(ns.unsigned_abs() as f64 * 1e-6);
    let (usual, period) = (ms(shift.usual), ms(shift.period));
    let rows = if empty == 0 { String::new() } else { format!("; {rows} no value") };
    format!(
        "{topic} is interpolated linearly to the times of {reference}: its messages are {usual} ms {side} those (period {period} ms){rows}"
    )
}

/// Formats a number with three significant digits.
fn significant(value: f64) -> String {
    let digits = if value > 0.0 { (2 - value.log10().floor() as i32).clamp(0, 9) as usize } else { 0 };
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

fn is_increasing(times: &[i64]) -> bool {
    times.is_sorted_by(|a, b| a < b)
}

/// Returns the lower median.
fn median(mut of: Vec<i64>) -> Option<i64> {
    let middle = of.len().checked_sub(1)? / 2;
    Some(*of.select_nth_unstable(middle).1)
}

fn period(times: &[i64]) -> Option<i64> {
    median(times.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).collect()).filter(|period| *period > 0)
}

/// Compares `times` with those of `reference`; `None` unless there are as many times and nearly the same ones.
fn shift(reference: &[i64], times: &[i64]) -> Option<Shift> {
    let most = reference.len().max(times.len());
    let lost = (MAX_LOST_SHARE * most as f64) as usize;
    let lost = if most < MIN_TO_LOSE { 0 } else { lost.max(1) };
    if reference.len().abs_diff(times.len()) > lost || !is_increasing(times) {
        return None;
    }
    let (period, own_period) = (period(reference)?, period(times)?);
    let (mut at, mut far, mut offsets) = (0, 0, Vec::with_capacity(reference.len()));
    for time in reference {
        let distance = |at: usize| times.get(at).map(|other| other.saturating_sub(*time));
        while let (Some(here), Some(next)) = (distance(at), distance(at + 1))
            && next.unsigned_abs() <= here.unsigned_abs()
        {
            at += 1;
        }
        let offset = distance(at)?;
        if offset.unsigned_abs() as f64 >= 0.5 * period as f64 { far += 1 } else { offsets.push(offset) }
    }
    if far > lost {
        return None;
    }
    let is_none = offsets.iter().all(|offset| *offset == 0);
    Some(Shift { usual: median(offsets)?, period, own_period, is_none })
}

/// Interpolates values to other times; NaN before the first, after the last, and within steps that are too long.
fn interpolated(values: &[f64], from: &[i64], to: &[i64], longest: i64) -> Vec<f64> {
    let mut at = 0;
    let value = |time: &i64| {
        while from.get(at + 1).is_some_and(|next| next <= time) {
            at += 1;
        }
        let (first, left) = (from[at], values[at]);
        if first == *time {
            return left;
        }
        match (from.get(at + 1), values.get(at + 1)) {
            (Some(next), Some(right)) if first < *time && next.saturating_sub(first) <= longest => {
                let share = (time - first) as f64 / (next - first) as f64;
                left + share * (right - left)
            }
            _ => f64::NAN,
        }
    };
    to.iter().map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_not_extrapolated_or_interpolated_across_long_steps() {
        let found = interpolated(&[0.0, 10.0, 20.0, 50.0], &[1, 11, 21, 51], &[0, 1, 6, 16, 21, 30, 51, 60], 17);
        let text = format!("{found:?}");
        assert_eq!(text, "[NaN, 0.0, 5.0, 15.0, 20.0, NaN, 50.0, NaN]");
    }

    #[test]
    fn topics_match_within_half_a_period() {
        let every = |period: i64, start: i64, count: i64| (0..count).map(|k| start + k * period).collect::<Vec<_>>();
        let usual = |a: &[i64], b: &[i64]| shift(a, b).map(|shift| shift.usual);
        let times = every(1000, 0, 300);
        assert_eq!(usual(&times, &every(1000, 400, 300)), Some(400));
        assert_eq!(usual(&times, &every(1000, -400, 299)), Some(-400));
        assert_eq!(usual(&times, &every(1000, 600, 300)), Some(-400), "all but one have a message nearby");
        assert_eq!(usual(&times, &every(1000, 5400, 300)), None);
        assert_eq!(usual(&times, &every(1000, 0, 290)), None);
        assert_eq!(usual(&times, &every(1010, 0, 300)), None);
        assert_eq!(usual(&times, &every(500, 0, 300)), None);
        let mut lossy = every(1000, 400, 300);
        lossy.remove(100);
        assert_eq!(usual(&times, &lossy), Some(400));
        assert_eq!(significant(0.3), "0.3");
        assert_eq!(significant(1234.5), "1234");
    }
}
