//! Steps and bounds of the nonlinear parameters for a record.

use std::ops::Range;

use super::hypothesis::Unknown;
use super::{Cause, Hypothesis};
use crate::Samples;
use crate::lsq::Bounds;
use crate::model::Effect;
use crate::statistics::range;
use hyst_core::CurveSide;

/// Largest overdrive at the reference rate, in ranges of the input: above it the loop is all rate-dependence and no
/// hysteresis.
const LARGEST_OVERDRIVE: f64 = 0.3;

/// Returns a parameter after a change, within its bounds. A change that leads to a bound ends there in spite of rounding.
pub(super) fn moved(value: f64, change: f64, limit: Bounds) -> f64 {
    let (to, rounding) = (value + change, 1e-12 * value.abs());
    match to {
        to if to - limit.lower <= rounding => limit.lower,
        to if limit.upper - to <= rounding => limit.upper,
        to => to,
    }
}

/// Returns the bounds of a nonlinear parameter for this record.
pub(super) fn bounds_of(p: &Unknown<'_>, samples: &Samples) -> Bounds {
    let nyquist = 0.5 / samples.period;
    let bounds = match (p.cause, p.name.starts_with("hz")) {
        (Cause::SlewLimit, _) => {
            let (lower, upper) = slopes(samples);
            Bounds { lower, upper }
        }
        (Cause::Effect(Effect::Resonance), true) => {
            Bounds { lower: 2.0 / samples.longest_segment(), upper: 0.95 * nyquist }
        }
        (Cause::Effect(Effect::Interference), true) => {
            Bounds { lower: 2.0 / samples.longest_segment(), upper: nyquist }
        }
        (Cause::Effect(Effect::Drift), _) => {
            // A faster drift is a creep of each step, a slower one is a line.
            Bounds { lower: 0.02 * whole(samples), upper: 2.0 * whole(samples) }
        }
        (Cause::Effect(Effect::Temperature), _) if p.name == "seconds" => {
            Bounds { lower: samples.period, upper: 0.5 * whole(samples) }
        }
        (Cause::Effect(Effect::Temperature), _) => {
            let most = MAX_GAIN_CHANGE / swing(&samples.temperature);
            Bounds { lower: -most, upper: most }
        }
        (Cause::Effect(Effect::Load), _) => {
            let most = MAX_GAIN_CHANGE / swing(&samples.load);
            Bounds { lower: -most, upper: most }
        }
        (Cause::Effect(Effect::RateDependence), _) if p.name == "volts" => {
            Bounds { lower: 0.0, upper: LARGEST_OVERDRIVE * range_of(samples) }
        }
        (Cause::Effect(Effect::RateDependence), _) if p.name == "exponent" => Bounds { lower: p.lower, upper: p.upper },
        (Cause::Effect(Effect::RateDependence), _) if p.name == "volt_seconds" => {
            Bounds { lower: 0.0, upper: range_of(samples) * 0.1 * samples.longest_segment() }
        }
        (Cause::Effect(Effect::Delay | Effect::Lag | Effect::RateDependence), _) => {
            Bounds { lower: 0.0, upper: p.upper.min(0.1 * samples.longest_segment()).min(4000.0 * samples.period) }
        }
        _ => Bounds { lower: p.lower, upper: p.upper },
    };
    // Segments of a few rows leave no room between the bounds.
    Bounds { upper: bounds.upper.max(bounds.lower), ..bounds }
}

/// Largest relative change of the gain, or of the width of the loops, over the temperatures or loads of a record: both
/// stay positive.
const MAX_GAIN_CHANGE: f64 = 0.9;

/// Returns how far a recorded channel moves, in its unit; one unit if it does not move.
fn swing(channel: &Option<Vec<f64>>) -> f64 {
    let (low, high) = range(channel.iter().flatten().copied());
    if high > low { high - low } else { 1.0 }
}

/// Returns the time from the first to the last row \[s\].
fn whole(samples: &Samples) -> f64 {
    samples.time.last().zip(samples.time.first()).map_or(0.0, |(last, first)| last - first)
}

/// Fraction of the upper bound below which a time constant, and the gain of a mode, count as inside their bounds.
const MAX_SHARE_OF_BOUND: f64 = 0.9;
const MAX_GAIN_SHARE_OF_BOUND: f64 = 0.99;

/// Damping ratio below which a mode rings. A ringing mode is visible at its own frequency, even if a coarse base
/// distorts its gain.
const MAX_RINGING_DAMPING: f64 = 0.1;

/// Returns whether the search for a slew limit, a delay, a lag, a drag or the gain of a damped mode ended at its bound.
pub(crate) fn ends_at_a_bound(h: &Hypothesis, samples: &Samples) -> bool {
    let mut ends = false;
    // A slow settling beside a line is a bend: its time constant is not determined, the bend is.
    let bends = h.effects.drift.is_some_and(|p| p.per_second != 0.0);
    let mut dampings = h.effects.resonances.iter().map(|mode| mode.damping);
    h.clone().visit_nonlinear(&mut |p| {
        let inside = match p.cause {
            // An exponent of one is a valid law.
            Cause::Effect(Effect::RateDependence) if p.name == "exponent" => return,
            Cause::Effect(Effect::Drift) if bends => return,
            // A drift that settles more slowly than the bound is a line or a bend; its time constant is meaningless.
            Cause::Effect(Effect::Delay | Effect::Lag | Effect::RateDependence | Effect::Drift) | Cause::SlewLimit => {
                MAX_SHARE_OF_BOUND
            }
            // The same holds for a thermal lag, and for a change of the gain.
            Cause::Effect(Effect::Temperature | Effect::Load) => MAX_SHARE_OF_BOUND,
            Cause::Effect(Effect::Resonance) if p.name.starts_with("gain") => {
                if dampings.next().is_some_and(|damping| damping < MAX_RINGING_DAMPING) {
                    return;
                }
                MAX_GAIN_SHARE_OF_BOUND
            }
            _ => return,
        };
        let bounds = bounds_of(&p, samples);
        ends |= p.value.abs() >= inside * bounds.upper || (p.cause == Cause::SlewLimit && *p.value <= bounds.lower);
    });
    ends
}

/// Returns the slopes \[V/s\] of an amplifier that follows next to nothing of the drive, and of one that follows all of
/// it. A single jump may be far steeper than the rest.
pub(crate) fn slopes(samples: &Samples) -> (f64, f64) {
    let steepest_of = |(i, rows): (usize, &Range<usize>)| {
        let rises = samples.input[rows.clone()].windows(2);
        rises.fold(0.0, |most: f64, w| most.max((w[1] - w[0]).abs())) / samples.period_of(i)
    };
    let steepest = samples.segments.iter().enumerate().map(steepest_of).fold(0.0, f64::max);
    (f64::min(range_of(samples) / samples.longest_segment(), steepest), steepest)
}

/// Returns the range of the input.
fn range_of(samples: &Samples) -> f64 {
    let (low, high) = samples.input_range();
    high - low
}

/// Distance of a saturation limit from the motion or drive, in spans of it, beyond which it is not reached. Such a limit is not
/// moved: only the product of its distance and the knee has an effect.
const OUT_OF_REACH: f64 = 1.0;

/// Returns the hypothesis with the `index`-th nonlinear parameter moved by a small step, the step and its cause. The
/// step is zero if the parameter has no effect.
/// `motion` is the minimum and maximum of the motion in the rows that count \[y\].
pub(super) fn stepped(
    h: &Hypothesis,
    index: usize,
    samples: &Samples,
    motion: (f64, f64),
) -> Option<(Hypothesis, f64, Cause)> {
    let mut moved = h.clone();
    let mut found = None;
    let mut i = 0;
    // What the limits of a saturation limit: the motion or the drive.
    let (reached, span) = match h.effects.limits(CurveSide::Input) {
        Some(_) => (samples.input_range(), range_of(samples)),
        None => (motion, samples.output_span()),
    };
    let room = OUT_OF_REACH * (reached.1 - reached.0);
    moved.visit_nonlinear(&mut |p| {
        if i == index {
            let step = match p.cause {
                Cause::SlewLimit => 1e-4 * *p.value,
                Cause::Effect(effect) => match (effect, p.name.trim_end_matches("_2")) {
                    (Effect::RateDependence, "volt_seconds") => {
                        1e-3 * (1e-4 * range_of(samples) * samples.period).max(*p.value)
                    }
                    (Effect::RateDependence, "volts") => 1e-3 * (1e-3 * range_of(samples)).max(*p.value),
                    (Effect::RateDependence, "exponent") => 1e-3,
                    (Effect::Temperature, "seconds") => 1e-3 * *p.value,
                    (Effect::Delay | Effect::Lag | Effect::RateDependence, _) => 1e-3 * samples.period.max(*p.value),
                    (Effect::Resonance, "hz") => 1e-5 * *p.value,
                    (Effect::Resonance, "damping") => 1e-3 * *p.value + 1e-7,
                    (Effect::Load, _) => 1e-5 / swing(&samples.load),
                    (Effect::Saturation, "low") if *p.value < reached.0 - room => 0.0,
                    (Effect::Saturation, "high") if *p.value > reached.1 + room => 0.0,
                    (Effect::Saturation, "low" | "high") => 1e-5 * span,
                    _ => 1e-5,
                },
                Cause::ZeroWanders | Cause::GainWanders | Cause::InitialState => 0.0,
            };
            // Downwards near the upper bound: beyond it the stage may not exist.
            let step = if *p.value + step > p.upper { -step } else { step };
            *p.value += step;
            found = Some((step, p.cause));
        }
        i += 1;
    });
    found.map(|(step, cause)| (moved, step, cause))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::DragParams;
    use crate::model::Effects;
    use hyst_core::{DelayParams, LagParams, ResonanceParams, SaturationParams};

    /// Rows with a period of 1 ms, the drive from 0 to 1, the output from 100 to 110.
    fn samples(rows: usize) -> Samples {
        let share = |k: usize| k as f64 / (rows - 1) as f64;
        let output = (0..rows).map(|k| 100.0 + 10.0 * share(k)).collect();
        Samples::of_columns(1e-3, (0..rows).map(share).collect(), output)
    }

    #[test]
    fn a_change_to_a_bound_ends_on_it() {
        let limit = Bounds { lower: 0.0, upper: 0.7 };
        // In binary 0.1 + 0.2 − 0.3 is not zero.
        assert_eq!(moved(0.1 + 0.2, -0.3, limit), 0.0);
        assert_eq!(moved(0.3, -2.0, limit), 0.0);
        assert_eq!(moved(0.3, 2.0, limit), 0.7);
        assert_eq!(moved(0.25, 0.25, limit), 0.5);
    }

    #[test]
    fn a_lag_at_its_bound_is_reported() {
        let ends = |rows: usize, seconds: f64| {
            let effects = Effects { lag: Some(LagParams { seconds }), ..Effects::default() };
            ends_at_a_bound(&Hypothesis::of(effects), &samples(rows))
        };
        // A tenth of a segment of 2 s.
        assert!(ends(2000, 0.2) && !ends(2000, 0.1));
        // No search goes beyond one second, however long the record is.
        assert!(ends(40_000, 1.0) && !ends(40_000, 0.5));
        assert!(!ends_at_a_bound(&Hypothesis::default(), &samples(2000)));
        // A delay, a drag, and the gain of a mode.
        let of = |effects: Effects| ends_at_a_bound(&Hypothesis::of(effects), &samples(2000));
        let delay = |seconds: f64| of(Effects { delay: Some(DelayParams { seconds }), ..Effects::default() });
        assert!(delay(0.19) && !delay(0.17));
        let drag = |seconds: f64| Some(DragParams { seconds, volt_seconds: 0.0 });
        let dragged = |seconds| Hypothesis { drag: drag(seconds), ..Hypothesis::default() };
        assert!(ends_at_a_bound(&dragged(0.19), &samples(2000)) && !ends_at_a_bound(&dragged(0.17), &samples(2000)));
        let mode = |damping: f64, gain: f64| ResonanceParams { hz: 50.0, damping, gain };
        let carries = |damping: f64, gain: f64| {
            of(Effects { resonances: vec![mode(0.02, 1.2), mode(damping, gain)], ..Effects::default() })
        };
        assert!(carries(0.2, 1.195) && !carries(0.2, 1.1));
        // A ringing mode is accepted with any gain.
        assert!(!carries(0.02, 1.2));
    }

    #[test]
    fn a_saturation_limit_out_of_reach_is_not_moved() {
        let samples = samples(2);
        let moves = |low: f64, high: f64| {
            let stop = SaturationParams::behind(low, high, 0.1);
            let h = Hypothesis::of(Effects { saturation: Some(stop), ..Effects::default() });
            let step = |index| stepped(&h, index, &samples, (100.0, 110.0)).map(|(_, step, _)| step > 0.0);
            assert_eq!((step(2), step(3)), (Some(true), None));
            (step(0), step(1))
        };
        // The distance from the motion counts, not the value.
        assert_eq!(moves(95.0, 130.0), (Some(true), Some(false)));
        assert_eq!(moves(0.0, 115.0), (Some(false), Some(true)));
    }
}
