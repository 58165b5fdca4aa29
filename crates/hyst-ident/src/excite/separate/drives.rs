//! The candidate drives.

use std::f64::consts::PI;

use super::result::SeparateOptions;
use crate::excite::{
    AmSine, DecayingSine, Drive, ExciteError, Limits, MinorLoops, Multisine, Phases, Shape, Sine, Stairs, Sweep,
    Triangle,
};

/// Specification of a candidate drive.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    /// Name in messages.
    pub(super) name: &'static str,
    shapes: Vec<Shape>,
    rest_s: f64,
}

impl Candidate {
    /// Computes the drive within the limits.
    pub(super) fn drive(&self, limits: &Limits) -> Result<Drive, ExciteError> {
        Drive::new(&self.shapes, limits, self.rest_s)
    }
}

/// Returns the candidate drives, each of about the requested duration and as fast as the limits allow.
pub(super) fn family(limits: &Limits, options: &SeparateOptions) -> Vec<Candidate> {
    let (duration, seed) = (options.duration_s, options.seed);
    let span = limits.hi_v - limits.lo_v;
    let slew = limits.slew_v_per_s.unwrap_or(f64::INFINITY);
    // The slope of a full-span sine is π f span; a margin of a fifth is left for smooth ramps and sums. Most amplifiers
    // can drive 60 Hz, the highest frequency without a slew limit.
    let highest = if limits.slew_v_per_s.is_some() { 200.0 } else { 60.0 };
    let fast = (0.05 * limits.rate_hz).min(highest).min(0.8 * slew / (PI * span)).max(2.0 / duration);
    let slow = f64::max(0.5_f64.min(0.1 * fast), 2.0 / duration);
    let ramp_s = f64::max(0.03, 2.0 / fast.min(60.0)).max(4.0 / limits.rate_hz).max(PI * span / (1.6 * slew));
    let sine = |hz: f64, seconds: f64| {
        Shape::Sine(Sine { frequency_hz: hz, cycles: (hz * seconds).round().clamp(1.0, 1e6) as u32 })
    };
    let stairs = |levels: u32, seconds: f64| {
        let hold_s = (seconds / f64::from(levels) - ramp_s).max(ramp_s);
        Shape::Stairs(Stairs { levels, hold_s, ramp_s, seed })
    };
    let loops = f64::min(8.0 * slow, fast);
    let one = |name, shape| Candidate { name, shapes: vec![shape], rest_s: 0.0 };
    let quarter = 0.25 * duration;
    let rates = [1.0 / 30.0, 0.1, 1.0 / 3.0, 1.0].map(|share| (share * fast).max(1.0 / quarter));
    let levels = (duration / 2.5).round().clamp(2.0, 40.0) as u32;
    vec![
        one("slow full loops", sine(slow, duration)),
        Candidate {
            name: "full loops at four rates",
            shapes: rates.iter().map(|hz| sine(*hz, quarter)).collect(),
            rest_s: 0.0,
        },
        one("full loops as fast as the limits allow", sine(fast, duration)),
        one("a sweep from slow to fast", Shape::Sweep(Sweep { low_hz: slow, high_hz: fast, duration_s: duration })),
        one("triangles, sharp at every reversal", triangle(loops, duration)),
        one(
            "nested loops of decreasing amplitude",
            Shape::DecayingSine(DecayingSine { frequency_hz: loops, duration_s: duration.max(4.0 / loops) }),
        ),
        one(
            "minor loops at several levels",
            Shape::MinorLoops(MinorLoops {
                levels: 6,
                share: 0.25,
                frequency_hz: loops,
                cycles: (duration * loops / 6.0 - 1.0).clamp(1.0, 1e6) as u32,
            }),
        ),
        one("steps with holds", stairs(levels, duration)),
        one("one step and a long hold", stairs(1, duration)),
        one("two levels, each held for half of the time", stairs(2, duration)),
        Candidate {
            name: "the same loops repeated, with rests between them",
            shapes: vec![sine(loops, 0.12 * duration); 4],
            rest_s: 0.17 * duration,
        },
        Candidate {
            name: "fast loops, a long hold, and the same fast loops again",
            shapes: vec![sine(loops, 0.2 * duration), stairs(1, 0.6 * duration), sine(loops, 0.2 * duration)],
            rest_s: 0.0,
        },
        one(
            "a multisine up to the highest frequency",
            Shape::Multisine(Multisine {
                low_hz: slow,
                high_hz: fast,
                lines: ((fast - slow) * duration).floor().clamp(1.0, 60.0) as u32,
                periods: 1,
                phases: Phases::Random(seed),
                duration_s: duration,
                fade_s: 0.1 * duration,
            }),
        ),
        one(
            "an amplitude-modulated fast sine",
            Shape::AmSine(AmSine {
                frequency_hz: f64::max(fast, 25.0 / duration),
                modulation_hz: 4.0 / duration,
                depth: 0.9,
                cycles: 4,
            }),
        ),
        Candidate {
            name: "steps with holds, then a sweep",
            shapes: vec![
                stairs(levels.div_ceil(2), 0.5 * duration),
                Shape::Sweep(Sweep { low_hz: slow, high_hz: fast, duration_s: 0.5 * duration }),
            ],
            rest_s: 0.0,
        },
    ]
}

fn triangle(hz: f64, seconds: f64) -> Shape {
    Shape::Triangle(Triangle { frequency_hz: hz, cycles: (hz * seconds).round().clamp(1.0, 1e6) as u32 })
}
