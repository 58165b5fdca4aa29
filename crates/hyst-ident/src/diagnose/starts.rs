//! Start values for the search of an effect's parameters.
//!
//! Most effects are smooth in their parameters and can start near zero. A frequency is not: it is first searched over
//! the whole band, by the first-order gain in Σ residual².

use hyst_core::{
    DelayParams, DriftParams, Error, InterferenceParams, LagParams, LoadParams, RateLaw, RateParams, ResonanceParams,
    TemperatureParams,
};

use super::scan::Scan;
use super::spectrum::{peaks, tone};
use super::trial_parameters::{bank, starting_temperature, stops};
use crate::base::DragParams;
use crate::model::{Effect, Effects, Widening};
use crate::nested::{Cause, Hypothesis, slopes};
use crate::samples::Samples;

/// Number of modes, and of slopes, from which a search starts.
const MAX_STARTS: usize = 2;
/// Number of frequencies of the coarse scan.
const SCAN_FREQUENCIES: usize = 48;
/// Exponents of the rate that are tried, and the overdrive at the reference rate as a share of the input range.
const EXPONENTS: [f64; 4] = [0.15, 0.4, 0.7, 1.0];
const TRIAL_OVERDRIVE: f64 = 0.005;
/// Ratio of successive start values of a delay or lag, and their maximum as a share of the segment.
const LATENESS_RATIO: f64 = 12.0;
const MAX_LATENESS_SHARE: f64 = 0.01;
/// Number of slopes of the coarse scan, and the ratio of successive ones.
const SLOPES: usize = 20;
const SLOPE_RATIO: f64 = 0.65;

/// Returns the hypotheses from which the search of `cause` starts, added to the scanned fit; none if its first-order
/// gain is too small.
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
        Cause::InitialState => return Ok(vec![also(&|h| h.initial_state = true)]),
        Cause::SlewLimit => {
            let limits = slew_limits(scan)?;
            return Ok(limits.into_iter().map(|v_per_s| also(&|h| h.slew_limit = Some(v_per_s))).collect());
        }
    };
    Ok(match effect {
        Effect::Delay => lateness(samples).map(|seconds| with(&|e| e.delay = Some(DelayParams { seconds }))).collect(),
        Effect::Lag => lateness(samples).map(|seconds| with(&|e| e.lag = Some(LagParams { seconds }))).collect(),
        Effect::RateDependence => {
            // A drag that grows with the rate, and one that grows with its square root.
            let (low, high) = samples.input_range();
            let linear = DragParams { seconds: samples.period, volt_seconds: 0.0 };
            let root = DragParams { seconds: 0.0, volt_seconds: 1e-3 * (high - low) * samples.period };
            let in_the_plays = [linear, root].map(|drag| also(&|h| h.drag = Some(drag)));
            // Rate-dependence of the whole drive works on any basis.
            let on_the_drive = widenings(scan)?.into_iter().map(|rate| with(&|e| e.rate = Some(rate)));
            // Thresholds that grow with the rate.
            let grown = if problem.may_widen { grown_thresholds(scan)? } else { None };
            let grown = grown.map(|widening| with(&|e| e.widening = Some(widening.clone())));
            in_the_plays.into_iter().filter(|_| problem.basis.drags()).chain(on_the_drive).chain(grown).collect()
        }
        // Asymmetry is searched on the model's own base.
        Effect::Asymmetry => Vec::new(),
        // Only a deflection, or also a change of the gain. A change of exactly zero means none.
        Effect::Load => [0.0, f64::MIN_POSITIVE]
            .map(|gain_per_newton| with(&|e| e.load = Some(LoadParams { per_newton: 0.0, gain_per_newton })))
            .into(),
        Effect::Saturation => {
            // No start with limits at both ends: a screening basis that bends towards both ends may have no saturation.
            let stops = stops(samples, from).into_iter().flat_map(|[upper, lower, _]| [upper, lower]);
            stops.map(|stop| with(&|e| e.saturation = Some(stop))).collect()
        }
        Effect::Temperature => {
            let reference_degc = starting_temperature(samples);
            // Only the gain, with an expansion, or also with another loop width; each without and with a thermal lag.
            // An expansion of exactly zero means no expansion.
            let whole = samples.time[samples.len() - 1] - samples.time[0];
            let lags = [0.0, 0.02 * whole, 0.15 * whole];
            const SOME: f64 = f64::MIN_POSITIVE;
            let parts = [(0.0, 0.0), (SOME, 0.0), (SOME, SOME)];
            let laws =
                lags.into_iter().flat_map(|seconds| parts.map(|(expansion, direct)| (seconds, expansion, direct)));
            let of = |(seconds, expansion, direct)| TemperatureParams {
                per_kelvin: 0.0,
                reference_degc,
                expansion,
                direct,
                seconds,
            };
            laws.map(|law| with(&|e| e.temperature = Some(of(law)))).collect()
        }
        // From zero and from an ordinary creep: a lag and a creep can block each other in a local minimum.
        Effect::Creep => {
            [0.0, 0.01].map(|share| with(&|e| e.creep = Some(bank(samples, problem.only_loop, share)))).into()
        }
        Effect::Drift => {
            // A line; a settling drift with a quarter of the record or a shorter time constant; or both.
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

/// Returns start values for a delay or lag \[s\]: one sample, and longer ones if the sample rate is high for the
/// record.
fn lateness(samples: &Samples) -> impl Iterator<Item = f64> {
    let most = MAX_LATENESS_SHARE * samples.longest_segment();
    let times = [1.0, LATENESS_RATIO, LATENESS_RATIO * LATENESS_RATIO].map(|periods| periods * samples.period);
    times.into_iter().enumerate().filter(move |(i, seconds)| *i == 0 || *seconds < most).map(|(_, seconds)| seconds)
}

/// Returns the rate laws with the largest first-order gain: the best two with different forms. Their reference rate is
/// the input range per second.
fn widenings(scan: &Scan<'_>) -> Result<Vec<RateParams>, Error> {
    let (low, high) = scan.problem.samples.input_range();
    let range = high - low;
    let mut scored = Vec::new();
    for law in RateLaw::ALL {
        for exponent in EXPONENTS {
            let rate = RateParams { volts: TRIAL_OVERDRIVE * range, exponent, reference_rate: range, law };
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
        if chosen.len() < MAX_STARTS && chosen.iter().all(|c| c.law != rate.law) {
            chosen.push(rate);
        }
    }
    Ok(chosen)
}

/// Growth of the thresholds at the reference rate (the median rate of the moving rows), and their number, evenly over
/// half the range.
const GROWTH: f64 = 0.3;
const GROWN_THRESHOLDS: usize = 6;
/// Exponents, and times in samples over which the rate is averaged, that are tried.
const GROWTH_EXPONENTS: [f64; 2] = [0.3, 0.8];
const AVERAGING_SAMPLES: [f64; 3] = [1.5, 12.0, 100.0];

/// Returns the widening whose columns have the largest gain, if that is promising.
fn grown_thresholds(scan: &Scan<'_>) -> Result<Option<Widening>, Error> {
    let samples = scan.problem.samples;
    let (low, high) = samples.input_range();
    let Some(reference_rate) = median_rate(samples) else { return Ok(None) };
    let thresholds: Vec<f64> =
        (1..=GROWN_THRESHOLDS).map(|i| 0.5 * (high - low) * i as f64 / (GROWN_THRESHOLDS + 1) as f64).collect();
    let mut best: Option<(f64, Widening)> = None;
    for exponent in GROWTH_EXPONENTS {
        for averaging_samples in AVERAGING_SAMPLES {
            let seconds = averaging_samples * samples.period;
            if seconds > MAX_LATENESS_SHARE * samples.longest_segment() {
                continue;
            }
            let (thresholds, weights) = (thresholds.clone(), vec![0.0; GROWN_THRESHOLDS]);
            let widening = Widening { growth: GROWTH, exponent, reference_rate, seconds, thresholds, weights };
            let gain = scan.gain_of_widening(&widening)?;
            if gain >= best.as_ref().map_or(scan.promising, |(most, _)| *most) {
                best = Some((gain, widening));
            }
        }
    }
    Ok(best.map(|(_, widening)| widening))
}

/// Returns the median rate of the moving rows \[V/s\].
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

/// Returns start values of the slew limit: the slopes with the largest first-order gain.
fn slew_limits(scan: &Scan<'_>) -> Result<Vec<f64>, Error> {
    let mut scored = Vec::new();
    let (least, steepest) = slopes(scan.problem.samples);
    let limits = (0..SLOPES).scan(steepest, |limit, _| {
        *limit *= SLOPE_RATIO;
        Some(*limit)
    });
    for limit in limits.take_while(|limit| *limit > least) {
        let limited = Hypothesis { slew_limit: Some(limit), ..scan.from.hypothesis.clone() };
        scored.extend(scan.gain(&scan.moved(&limited)?).map(|(gain, _)| (gain, limit)));
    }
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    Ok(scored.into_iter().take(MAX_STARTS).map(|(_, limit)| limit).collect())
}

/// Returns the modes with the largest first-order gain.
fn modes(scan: &Scan<'_>) -> Result<Vec<ResonanceParams>, Error> {
    let samples = scan.problem.samples;
    let (low, high) = (3.0 / samples.longest_segment(), 0.45 / samples.period);
    let mut grid: Vec<f64> =
        (0..SCAN_FREQUENCIES).map(|i| low * (high / low).powf(i as f64 / (SCAN_FREQUENCIES - 1) as f64)).collect();
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
        // A neighbour on the grid would lead to the same optimum.
        if chosen.iter().all(|c| (c.hz / mode.hz).ln().abs() > 0.25) {
            chosen.push(mode);
        }
        if chosen.len() == MAX_STARTS {
            break;
        }
    }
    Ok(chosen)
}
