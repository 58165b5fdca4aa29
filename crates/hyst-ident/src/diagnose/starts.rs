//! Where the search for an effect's parameters begins.
//!
//! Most effects enter smoothly and can begin near nothing. A frequency cannot: it is looked for over
//! the whole band first, by how much of the residual a first-order change would take.

use hyst_core::{
    DelayParams, DriftParams, Error, InterferenceParams, LagParams, LoadParams, RateLaw, RateParams, ResonanceParams,
    SaturationParams, TemperatureParams,
};

use super::scan::Scan;
use super::spectrum::{peaks, tone};
use crate::base::DragParams;
use crate::model::{CreepBank, Effect, Effects, Widening};
use crate::nested::{Cause, Fitted, Hypothesis, shown_motion, slopes};
use crate::samples::Samples;

/// Creep elements per decade of time.
pub(super) const PER_DECADE: f64 = 2.0;
/// Elements of a faster creep at most, and the samples that one lasts at least.
const FASTER: u8 = 4;
const FASTEST: f64 = 4.0;
/// Modes, and slopes, that are followed up.
const FOLLOWED: usize = 2;
/// Frequencies of the coarse scan.
const SCAN: usize = 48;
/// Exponents of the rate that are tried, and the overdrive at the reference rate, as a share of the range.
const EXPONENTS: [f64; 4] = [0.15, 0.4, 0.7, 1.0];
const TRIED_OVERDRIVE: f64 = 0.005;
/// Ratio of one start of a delay or lag to the one before, and the share of a segment below which they are.
const LATER: f64 = 12.0;
const MOST_LATE: f64 = 0.01;
/// Slopes of the coarse scan, and what each is of the one before.
const SLOPES: usize = 20;
const LESS_STEEP: f64 = 0.65;

/// Hypotheses to begin at: that of the scanned fit, and `cause`; none where it would take next to nothing.
pub(super) fn starts(scan: &Scan<'_>, cause: Cause) -> Result<Vec<Hypothesis>, Error> {
    if !scan.is_promising(cause)? {
        return Ok(Vec::new());
    }
    let Scan { problem, from, .. } = scan;
    let samples = problem.samples;
    let also = |change: &dyn Fn(&mut Hypothesis)| {
        let mut h = from.hypothesis.clone();
        change(&mut h);
        h
    };
    let with = |change: &dyn Fn(&mut Effects)| also(&|h| change(&mut h.effects));
    let effect = match cause {
        Cause::Effect(effect) => effect,
        Cause::ZeroWanders => return Ok(vec![also(&|h| h.zero_wanders = true)]),
        Cause::GainWanders => return Ok(vec![also(&|h| h.gain_wanders = true)]),
        Cause::GoesOn => return Ok(vec![also(&|h| h.goes_on = true)]),
        Cause::SlewLimit => {
            let limits = slew_limits(scan)?;
            return Ok(limits.into_iter().map(|v_per_s| also(&|h| h.slew_limit = Some(v_per_s))).collect());
        }
    };
    Ok(match effect {
        Effect::Delay => lateness(samples).map(|seconds| with(&|e| e.delay = Some(DelayParams { seconds }))).collect(),
        Effect::Lag => lateness(samples).map(|seconds| with(&|e| e.lag = Some(LagParams { seconds }))).collect(),
        Effect::RateDependence => {
            // A drag that grows with the rate, and one that grows with its root.
            let (low, high) = samples.input_range();
            let linear = DragParams { seconds: samples.period, volt_seconds: 0.0 };
            let root = DragParams { seconds: 0.0, volt_seconds: 1e-3 * (high - low) * samples.period };
            let in_the_plays = [linear, root].map(|drag| also(&|h| h.drag = Some(drag)));
            // And one on the whole drive, for any base.
            let on_the_drive = widenings(scan)?.into_iter().map(|rate| with(&|e| e.rate = Some(rate)));
            // And thresholds that grow with the rate.
            let grown = if problem.may_widen { grown_thresholds(scan)? } else { None };
            let grown = grown.map(|widening| with(&|e| e.widening = Some(widening.clone())));
            in_the_plays.into_iter().filter(|_| problem.basis.drags()).chain(on_the_drive).chain(grown).collect()
        }
        // It is looked for on the user's base.
        Effect::Asymmetry => Vec::new(),
        Effect::Load => vec![with(&|e| e.load = Some(LoadParams { per_newton: 0.0 }))],
        Effect::Saturation => {
            // A rich base that bends towards both ends may be no stop: that is asked of a base which has seen one.
            let stops = stops(samples, from).into_iter().flat_map(|[upper, lower, _]| [upper, lower]);
            stops.map(|stop| with(&|e| e.saturation = Some(stop))).collect()
        }
        Effect::Temperature => {
            let reference_degc = starting_temperature(samples);
            // The gain alone, or with an expansion, each at once or behind a thermal lag. An expansion of zero would be none.
            let whole = samples.time[samples.len() - 1] - samples.time[0];
            let lags = [0.0, 0.02 * whole, 0.15 * whole];
            let laws =
                lags.into_iter().flat_map(|seconds| [0.0, f64::MIN_POSITIVE].map(|expansion| (seconds, expansion)));
            let of = |(seconds, expansion)| TemperatureParams { per_kelvin: 0.0, reference_degc, expansion, seconds };
            laws.map(|law| with(&|e| e.temperature = Some(of(law)))).collect()
        }
        // From nothing, and from an ordinary creep: lag and creep can hold each other in a local minimum.
        Effect::Creep => {
            [0.0, 0.01].map(|share| with(&|e| e.creep = Some(bank(samples, problem.only_loop, share)))).into()
        }
        Effect::Drift => {
            // A line; one that settles, in a quarter of the record or faster; or both: a course that gets slower and slower.
            let since_s = samples.time[0];
            let whole = samples.time[samples.len() - 1] - since_s;
            let laws = [(0.0, 0.0), (0.0, 0.25 * whole), (0.0, 0.06 * whole), (f64::MIN_POSITIVE, 0.25 * whole)];
            let drift = |(per_second, seconds)| DriftParams { per_second, seconds, since_s, ..DriftParams::default() };
            laws.map(|law| with(&|e| e.drift = Some(drift(law)))).into()
        }
        Effect::Interference => {
            let found = tone(samples, &scan.residual);
            found
                .map(|hz| with(&|e| e.interference = Some(InterferenceParams { hz, ..Default::default() })))
                .into_iter()
                .collect()
        }
        Effect::Resonance => {
            let found = modes(scan)?;
            found.into_iter().map(|mode| with(&|e| e.resonances.push(mode))).collect()
        }
    })
}

/// Times by which the output may be late \[s\]: a sample, and where the sample rate is high for the record, more.
fn lateness(samples: &Samples) -> impl Iterator<Item = f64> {
    let most = MOST_LATE * samples.longest_segment();
    let times = [1.0, LATER, LATER * LATER].map(|periods| periods * samples.period);
    times.into_iter().enumerate().filter(move |(i, seconds)| *i == 0 || *seconds < most).map(|(_, seconds)| seconds)
}

/// A stop at the upper and one at the lower end of what the sensor has shown, the other end far away, and one at both; none where it has shown no motion.
pub(super) fn stops(samples: &Samples, from: &Fitted) -> Option<[SaturationParams; 3]> {
    let mut shown = shown_motion(samples, from);
    shown.sort_by(f64::total_cmp);
    let at = |share: f64| shown.get((share * shown.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(0.0);
    // Noise reaches beyond a stop: not the very last value.
    let (low, high) = (at(0.001), at(0.999));
    let far = FAR_STOP * (high - low);
    let stop = |low, high| SaturationParams { low, high, knee: KNEE };
    let stops = [stop(high - far, high), stop(low, low + far), stop(low, high)];
    (low < high).then_some(stops)
}

/// Lower stops under which the device rests: it only shows its motion once it has gone that far.
pub(super) fn stops_above_rest(samples: &Samples, from: &Fitted) -> Option<[SaturationParams; 3]> {
    let [_, lower, _] = stops(samples, from)?;
    let span = (lower.high - lower.low) / FAR_STOP;
    Some([0.03, 0.1, 0.25].map(|share| SaturationParams { low: lower.low + share * span, ..lower }))
}

/// Width of a knee at the start, as a share of the range between the limits.
const KNEE: f64 = 0.01;
/// How far away, in spans of the output, a stop is that nothing reaches.
const FAR_STOP: f64 = 3.0;

/// Temperature at which the gain counts as 1: where the record began, to a tenth of a degree.
pub(super) fn starting_temperature(samples: &Samples) -> f64 {
    let Some(t) = &samples.temperature else { return 0.0 };
    let rows = ((1.0 / samples.period_of(0)) as usize).clamp(1, t.len());
    let mean = t[..rows].iter().sum::<f64>() / rows as f64;
    (10.0 * mean).round() / 10.0
}

/// Time constants from 30 samples (but not below a 400th of the longest segment) to three times the longest segment. Where a record repeats
/// one loop, from its period on: what goes on within it may as well be the loop's shape, or late.
pub(super) fn bank(samples: &Samples, only_loop: Option<f64>, share: f64) -> CreepBank {
    let longest = samples.longest_segment();
    let loops = only_loop.map_or(0.0, |hz| (1.0 / hz).min(longest));
    let (first, last) = ((30.0 * samples.period).max(longest / 400.0).max(loops), 3.0 * longest);
    let count = ((last / first).log10() * PER_DECADE).round().max(1.0) as usize;
    let seconds: Vec<f64> = (0..=count).map(|i| first * (last / first).powf(i as f64 / count as f64)).collect();
    CreepBank { shares: vec![share; seconds.len()], seconds }
}

/// The same with elements of a creep that goes on faster still, down to a few samples.
pub(super) fn with_faster_creep(samples: &Samples, h: &Hypothesis) -> Hypothesis {
    let mut faster = h.clone();
    let Some(creep) = &mut faster.effects.creep else { return faster };
    let first = creep.seconds.iter().copied().fold(f64::INFINITY, f64::min);
    for i in 1..=FASTER {
        let seconds = first * 10f64.powf(-f64::from(i) / PER_DECADE);
        if seconds < FASTEST * samples.period {
            break;
        }
        creep.seconds.insert(0, seconds);
        creep.shares.insert(0, 0.0);
    }
    faster
}

/// Laws of the rate whose first-order change takes most of the residual: the best two that differ in more than the exponent. The range in a
/// second is their reference rate.
fn widenings(scan: &Scan<'_>) -> Result<Vec<RateParams>, Error> {
    let (low, high) = scan.problem.samples.input_range();
    let range = high - low;
    let mut scored = Vec::new();
    for law in RateLaw::ALL {
        for exponent in EXPONENTS {
            let rate = RateParams { volts: TRIED_OVERDRIVE * range, exponent, reference_rate: range, law };
            let mut h = scan.from.hypothesis.clone();
            h.effects.rate = Some(rate);
            if let Some((gain, amplitude)) = scan.gain(&scan.moved(&h)?) {
                let volts = rate.volts * amplitude.clamp(0.1, 10.0);
                scored.push((gain, RateParams { volts, ..rate }));
            }
        }
    }
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<RateParams> = Vec::new();
    for (_, rate) in scored {
        if chosen.len() < FOLLOWED && chosen.iter().all(|c| c.law != rate.law) {
            chosen.push(rate);
        }
    }
    Ok(chosen)
}

/// Growth of the thresholds at the reference rate, which is that of the median moving row; and the thresholds, evenly over half the range.
const GROWTH: f64 = 0.3;
const GROWN: usize = 6;
/// Exponents, and times over which the rate is felt in samples, that are tried.
const GROWTH_EXPONENTS: [f64; 2] = [0.3, 0.8];
const FELT_OVER: [f64; 3] = [1.5, 12.0, 100.0];

/// The thresholds that grow with the rate whose columns take most of the residual, if that is promising.
fn grown_thresholds(scan: &Scan<'_>) -> Result<Option<Widening>, Error> {
    let samples = scan.problem.samples;
    let (low, high) = samples.input_range();
    let Some(reference_rate) = median_rate(samples) else { return Ok(None) };
    let thresholds: Vec<f64> = (1..=GROWN).map(|i| 0.5 * (high - low) * i as f64 / (GROWN + 1) as f64).collect();
    let mut best: Option<(f64, Widening)> = None;
    for exponent in GROWTH_EXPONENTS {
        for felt_over in FELT_OVER {
            let seconds = felt_over * samples.period;
            if seconds > MOST_LATE * samples.longest_segment() {
                continue;
            }
            let (thresholds, weights) = (thresholds.clone(), vec![0.0; GROWN]);
            let widening = Widening { growth: GROWTH, exponent, reference_rate, seconds, thresholds, weights };
            let gain = scan.gain_of_widening(&widening)?;
            if gain >= best.as_ref().map_or(scan.promising, |(most, _)| *most) {
                best = Some((gain, widening));
            }
        }
    }
    Ok(best.map(|(_, widening)| widening))
}

/// Median rate of the rows that move \[V/s\].
fn median_rate(samples: &Samples) -> Option<f64> {
    let (low, high) = samples.input_range();
    let mut rates: Vec<f64> = Vec::with_capacity(samples.len());
    for (i, rows) in samples.segments.iter().enumerate() {
        let period = samples.period_of(i);
        rates.extend(samples.input[rows.clone()].windows(2).map(|w| (w[1] - w[0]).abs() / period));
    }
    rates.retain(|rate| *rate * samples.period > 1e-6 * (high - low));
    rates.sort_by(f64::total_cmp);
    rates.get(rates.len() / 2).copied()
}

/// Slopes of the drive from which on it may not be followed, the one that takes most of the residual and a neighbour.
fn slew_limits(scan: &Scan<'_>) -> Result<Vec<f64>, Error> {
    let mut scored = Vec::new();
    let (least, steepest) = slopes(scan.problem.samples);
    let limits = (0..SLOPES).scan(steepest, |limit, _| {
        *limit *= LESS_STEEP;
        Some(*limit)
    });
    for limit in limits.take_while(|limit| *limit > least) {
        let limited = Hypothesis { slew_limit: Some(limit), ..scan.from.hypothesis.clone() };
        scored.extend(scan.gain(&scan.moved(&limited)?).map(|(gain, _)| (gain, limit)));
    }
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    Ok(scored.into_iter().take(FOLLOWED).map(|(_, limit)| limit).collect())
}

/// Modes whose first-order change takes most of the residual.
fn modes(scan: &Scan<'_>) -> Result<Vec<ResonanceParams>, Error> {
    let samples = scan.problem.samples;
    let (low, high) = (3.0 / samples.longest_segment(), 0.45 / samples.period);
    let mut grid: Vec<f64> = (0..SCAN).map(|i| low * (high / low).powf(i as f64 / (SCAN - 1) as f64)).collect();
    grid.extend(peaks(samples, &scan.residual, 4).into_iter().filter(|hz| *hz > low && *hz < high));
    let mut scored = Vec::new();
    for hz in grid {
        for damping in [0.02, 0.15] {
            let mode = ResonanceParams { hz, damping, gain: 1.0 };
            let moved = scan.behind(Effects { resonances: vec![mode], ..Effects::default() })?;
            if let Some((gain, amplitude)) = scan.gain(&moved) {
                scored.push((gain, ResonanceParams { gain: amplitude.clamp(0.05, 1.1), ..mode }));
            }
        }
    }
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<ResonanceParams> = Vec::new();
    for (_, mode) in scored {
        // A neighbour on the grid would lead to the same place.
        if chosen.iter().all(|c| (c.hz / mode.hz).ln().abs() > 0.25) {
            chosen.push(mode);
        }
        if chosen.len() == FOLLOWED {
            break;
        }
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_faster_creep_ends_at_a_few_samples() {
        let samples = Samples::of_columns(4e-3, vec![0.0], vec![0.0]);
        let creep = CreepBank { seconds: vec![0.5, 5.0], shares: vec![0.03, 0.02] };
        let h = Hypothesis::of(Effects { creep: Some(creep), ..Effects::default() });
        let faster = with_faster_creep(&samples, &h).effects.creep.unwrap();
        // 0.016 s is four samples; the next would be 0.0158 s.
        assert_eq!(faster.seconds.len(), 4, "{:?}", faster.seconds);
        assert!(faster.seconds.is_sorted() && faster.seconds[0] > 0.016);
        assert_eq!(faster.shares, [0.0, 0.0, 0.03, 0.02]);
        assert_eq!(with_faster_creep(&samples, &Hypothesis::default()), Hypothesis::default());
    }
}
