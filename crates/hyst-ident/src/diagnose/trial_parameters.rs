//! Trial parameters that follow from the record: creep bank, saturation limits, reference temperature.

use hyst_core::SaturationParams;

use crate::model::CreepBank;
use crate::nested::{Fitted, Hypothesis, shown_motion};
use crate::samples::Samples;

/// Creep elements per decade of time.
pub(super) const PER_DECADE: f64 = 2.0;
/// Maximum number of faster creep elements, and their minimum time constant in samples.
const MAX_FASTER_ELEMENTS: u8 = 4;
const MIN_CREEP_SAMPLES: f64 = 4.0;
/// Start value of the knee's width, as a share of the range between the limits.
pub(super) const KNEE: f64 = 0.01;
/// Distance of an unused limit, in spans of the output or of the drive.
pub(super) const UNUSED_LIMIT_DISTANCE: f64 = 3.0;

/// Returns a bank of creep elements with time constants from 30 samples (at least 1/400 of the longest segment) to
/// three times the longest segment. If the record repeats one loop, they start at its period: faster creep is
/// indistinguishable from the loop's shape or a lag.
pub(super) fn bank(samples: &Samples, only_loop: Option<f64>, share: f64) -> CreepBank {
    let longest = samples.longest_segment();
    let loops = only_loop.map_or(0.0, |hz| (1.0 / hz).min(longest));
    let (first, last) = ((30.0 * samples.period).max(longest / 400.0).max(loops), 3.0 * longest);
    let count = ((last / first).log10() * PER_DECADE).round().max(1.0) as usize;
    let seconds: Vec<f64> = (0..=count).map(|i| first * (last / first).powf(i as f64 / count as f64)).collect();
    CreepBank { shares: vec![share; seconds.len()], seconds }
}

/// Adds faster creep elements, down to a few samples.
pub(super) fn with_faster_creep(samples: &Samples, h: &Hypothesis) -> Hypothesis {
    let mut faster = h.clone();
    let Some(creep) = &mut faster.effects.creep else { return faster };
    let first = creep.seconds.iter().copied().fold(f64::INFINITY, f64::min);
    for i in 1..=MAX_FASTER_ELEMENTS {
        let seconds = first * 10f64.powf(-f64::from(i) / PER_DECADE);
        if seconds < MIN_CREEP_SAMPLES * samples.period {
            break;
        }
        creep.seconds.insert(0, seconds);
        creep.shares.insert(0, 0.0);
    }
    faster
}

/// Returns saturation limits at the upper end of the shown motion, at the lower end, and at both; an unused limit is
/// far away. Returns `None` without motion.
pub(super) fn stops(samples: &Samples, from: &Fitted) -> Option<[SaturationParams; 3]> {
    let mut shown = shown_motion(samples, from);
    shown.sort_by(f64::total_cmp);
    let at = |share: f64| shown.get((share * shown.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(0.0);
    // Noise exceeds the limit, so the extreme values are not used.
    let (low, high) = (at(0.001), at(0.999));
    let far = UNUSED_LIMIT_DISTANCE * (high - low);
    let stop = |low, high| SaturationParams::behind(low, high, KNEE);
    let stops = [stop(high - far, high), stop(low, low + far), stop(low, high)];
    (low < high).then_some(stops)
}

/// Returns lower limits above the rest position: the device shows its motion only beyond them.
pub(super) fn stops_above_rest(samples: &Samples, from: &Fitted) -> Option<[SaturationParams; 3]> {
    let [_, lower, _] = stops(samples, from)?;
    let span = (lower.high - lower.low) / UNUSED_LIMIT_DISTANCE;
    Some([0.03, 0.1, 0.25].map(|share| SaturationParams { low: lower.low + share * span, ..lower }))
}

/// Returns the reference temperature, at which the gain is 1: that of the first second, rounded to 0.1 °C.
pub(super) fn starting_temperature(samples: &Samples) -> f64 {
    let Some(t) = &samples.temperature else { return 0.0 };
    let rows = ((1.0 / samples.period_of(0)) as usize).clamp(1, t.len());
    let mean = t[..rows].iter().sum::<f64>() / rows as f64;
    (10.0 * mean).round() / 10.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Effects;

    #[test]
    fn faster_creep_elements_end_at_four_samples() {
        let samples = Samples::of_columns(4e-3, vec![0.0], vec![0.0]);
        let creep = CreepBank { seconds: vec![0.5, 5.0], shares: vec![0.03, 0.02] };
        let h = Hypothesis::of(Effects { creep: Some(creep), ..Effects::default() });
        let faster = with_faster_creep(&samples, &h).effects.creep.unwrap();
        // 0.016 s is four samples; the next element would have 0.0158 s.
        assert_eq!(faster.seconds.len(), 4, "{:?}", faster.seconds);
        assert!(faster.seconds.is_sorted() && faster.seconds[0] > 0.016);
        assert_eq!(faster.shares, [0.0, 0.0, 0.03, 0.02]);
        assert_eq!(with_faster_creep(&samples, &Hypothesis::default()), Hypothesis::default());
    }
}
