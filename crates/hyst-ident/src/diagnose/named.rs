//! One named effect in numbers and words: its law, its parameters and its evidence.

use std::collections::BTreeMap;

use hyst_core::{AsymmetryParams, CurveSide, InterferenceParams, RateLaw, ViscousPiParams};

use super::findings::{Alternative, EffectKind, Finding, Found};
use super::search::Named;
use crate::digits::{short, signed};
use crate::model::{Base, Effect, Model, creep_share};
use crate::record::OutputUnit;
use crate::samples::Samples;

/// What an effect is described from.
pub(super) struct Context<'a> {
    pub(super) model: &'a Model,
    pub(super) extended: &'a Model,
    pub(super) samples: &'a Samples,
    /// Standard errors by `stage.parameter`.
    pub(super) errors: &'a BTreeMap<String, f64>,
    /// Cross-validated RMSE on the basis of the search with all effects found, in noise floors.
    pub(super) left: f64,
}

/// Builds the finding of a named effect.
pub(super) fn finding(m: &Context<'_>, named: &Named) -> Finding {
    let unit = symbol(m);
    let after = named.cv_with;
    let j = &named.judgement;
    // First the evidence that a person can check on the device, then the statistics.
    let mut evidence: Vec<String> = signature(m, named.effect).into_iter().collect();
    evidence.push(format!(
        "cross-validated error {} {unit} without it, {} {unit} with it; better in {:.1} % of {} bootstrap draws",
        short(named.cv_without),
        short(after),
        100.0 * j.confidence,
        super::score::DRAWS
    ));
    evidence.push(format!(
        "explains {:.0} % of the residual variance above the noise floor; its RMS is {:.1} noise floors",
        100.0 * j.share,
        j.over_noise
    ));
    if j.sensor_tone {
        evidence.push(
            "the tone is present throughout the record and far above the residual at neighbouring frequencies; neither the drive nor a \
             misfit of the base model causes such a tone"
                .into(),
        );
    }
    Finding {
        name: named.effect,
        kind: EffectKind::of(named.effect),
        law: law(m.extended, named.effect).map(str::to_owned),
        probability: named.evidence(m.left).probability(),
        parameters: parameters(m, named.effect),
        evidence,
        alternatives: named
            .rivals
            .iter()
            .map(|i| Alternative { name: i.effect, cv_rmse: i.cv_rmse, indistinguishable: i.tie })
            .collect(),
        cv_rmse_before: named.cv_without,
        cv_rmse_after: after,
    }
}

/// Returns the law of an effect in a model; `None` for a flexible form.
fn law(model: &Model, effect: Effect) -> Option<&'static str> {
    let e = &model.effects;
    Some(match effect {
        Effect::Delay => "dead-time",
        Effect::Lag => "first-order",
        Effect::RateDependence if e.widening.is_some() => "power-thresholds",
        Effect::RateDependence if e.rate.is_none() => "viscous-plays",
        Effect::RateDependence => match e.rate?.law {
            RateLaw::Follows => "power-follows",
            RateLaw::Holds => "power-holds",
            RateLaw::Relaxes => "power-relaxes",
        },
        Effect::Temperature => match e.temperature? {
            p if p.direct != 0.0 && p.seconds > 0.0 => "gain-loop-width-and-expansion-behind-a-thermal-lag",
            p if p.direct != 0.0 => "gain-loop-width-and-expansion",
            p if p.expansion != 0.0 && p.seconds > 0.0 => "gain-and-expansion-behind-a-thermal-lag",
            p if p.expansion != 0.0 => "gain-and-expansion",
            p if p.seconds > 0.0 => "gain-behind-a-thermal-lag",
            _ => "gain",
        },
        Effect::Load if e.load?.gain_per_newton != 0.0 => "compliance-and-gain",
        Effect::Load => "compliance",
        Effect::Resonance => "second-order",
        Effect::Saturation => "knee",
        Effect::Drift => match e.drift?.seconds > 0.0 {
            true => "exponential",
            false => "line",
        },
        Effect::Interference => match harmonics(&e.interference?).next() {
            Some(_) => "sine-with-harmonics",
            None => "sine",
        },
        // A bank of relaxations and a piecewise linear curve have no law.
        Effect::Creep | Effect::Asymmetry => return None,
    })
}

/// Returns the symbol of the output's unit.
fn symbol<'a>(m: &'a Context<'_>) -> &'a str {
    let unit = &m.model.output.unit;
    OutputUnit::of_suffix(unit).map_or(unit.as_str(), |u| u.symbol())
}

/// Returns the mean gain over the range of the record \[y/u\], without its sign.
fn mean_gain(m: &Context<'_>) -> f64 {
    let (low, high) = m.samples.input_range();
    (m.samples.output_span() / (high - low)).max(f64::MIN_POSITIVE)
}

/// Describes the effect so that a person can check it on the device.
fn signature(m: &Context<'_>, effect: Effect) -> Option<String> {
    let (e, input) = (&m.extended.effects, m.extended.input.symbol());
    Some(match effect {
        Effect::Delay => format!("the output is delayed by {:.3} ms at every frequency", 1e3 * e.delay?.seconds),
        Effect::Lag => {
            let tau = e.lag?.seconds;
            format!(
                "the phase follows a first-order lag with a corner frequency of {:.1} Hz",
                1.0 / (2.0 * std::f64::consts::PI * tau)
            )
        }
        Effect::Asymmetry => {
            let p = e.asymmetry.as_ref()?;
            let (low, high) = slopes(p);
            let side = match p.side {
                CurveSide::Output => "behind",
                CurveSide::Input => "before",
            };
            format!(
                "the curve {side} the hysteresis has slope {low:.3} at its lower end and {high:.3} at its upper end"
            )
        }
        Effect::RateDependence if e.widening.is_some() => {
            let p = e.widening.as_ref()?;
            format!(
                "the loop widens with rate^{:.2}, wide loops more than narrow ones: at {} {input}/s the branches of a wide loop are {} {} farther \
                 apart than at low rate",
                p.exponent,
                short(p.reference_rate),
                short(2.0 * p.extra_half_width()),
                symbol(m)
            )
        }
        Effect::RateDependence if e.rate.is_some() => {
            let p = e.rate?;
            format!(
                "the loop widens with rate^{:.2}: at {} {input}/s the hysteresis lags the drive by {} {input}",
                p.exponent,
                short(p.reference_rate),
                short(p.volts)
            )
        }
        Effect::RateDependence => match rate_dependence(m.extended) {
            Some(p) if p.volt_seconds > 0.0 => format!(
                "the loop widens with rate: at 100 {input}/s a sliding play operator lags the drive by {:.3} {input}",
                100.0 * p.seconds + (100.0 * p.volt_seconds).sqrt()
            ),
            Some(p) => format!("the loop widens with rate: sliding play operators lag by {:.3} ms", 1e3 * p.seconds),
            None => {
                "the loop widens with rate; this base model has no rate-dependent form: fit pi, or fit dpm to records at several rates"
                    .into()
            }
        },
        Effect::Load => {
            let p = e.load?;
            let stiffens = match p.gain_per_newton {
                0.0 => String::new(),
                gain => format!(", and the gain changes by {:+.3} % per N", 100.0 * gain),
            };
            format!("the output moves by {} {} per N of load{stiffens}", signed(p.per_newton), symbol(m))
        }
        Effect::Saturation => {
            let (name, limit) = limit(m)?;
            format!("the output stops at {} {} at its {name} end while the drive continues", short(limit), symbol(m))
        }
        Effect::Temperature => {
            let p = e.temperature?;
            let expands = match p.expansion {
                0.0 => String::new(),
                expansion => format!(", and the zero moves by {} {} per K", signed(expansion), symbol(m)),
            };
            let late = match p.seconds {
                0.0 => String::new(),
                seconds => {
                    format!("; the actuator follows the thermometer with a time constant of {} s", short(seconds))
                }
            };
            let beside = 100.0 * p.direct / mean_gain(m);
            let widens = match p.direct {
                0.0 => String::new(),
                _ => format!(", the width of the loops by {:+.2} % per K", 100.0 * p.per_kelvin),
            };
            format!("the gain changes by {:+.2} % per K{widens}{expands}{late}", 100.0 * p.per_kelvin + beside)
        }
        Effect::Creep => {
            let (p, (hold, holds)) = (e.creep.as_ref()?, longest_hold(m.samples));
            let shares = p.seconds.iter().zip(&p.shares);
            let share: f64 = shares.map(|(tau, share)| share * (1.0 - (-hold / tau).exp())).sum();
            let share = 100.0 * share;
            match holds {
                true => format!(
                    "in the longest hold ({hold:.2} s) the output continues to move by {share:.1} % of the step before it"
                ),
                false => format!(
                    "the drive has no hold; in {hold:.2} s (the longest segment) the output would continue to move by {share:.1} % of a step"
                ),
            }
        }
        Effect::Resonance => {
            let r = e.resonances.first()?;
            format!("a mode rings at {:.1} Hz with damping ratio {:.4}", r.hz, r.damping)
        }
        Effect::Drift => {
            let (first, last) = (*m.samples.time.first()?, *m.samples.time.last()?);
            let p = e.drift?;
            let settles = if p.seconds > 0.0 {
                format!(" and settles with a time constant of {} s", short(p.seconds))
            } else {
                String::new()
            };
            format!(
                "the zero moves by {} {} over the {:.0} s of the record{settles}",
                signed(p.at(last) - p.at(first)),
                symbol(m),
                last - first
            )
        }
        Effect::Interference => {
            let p = e.interference?;
            let also: Vec<String> = harmonics(&p)
                .map(|(order, amplitude)| {
                    format!("{} {} at {:.1} Hz", short(amplitude), symbol(m), f64::from(order) * p.hz)
                })
                .collect();
            let also = if also.is_empty() { String::new() } else { format!(", with harmonics of {}", also.join(", ")) };
            format!(
                "the sensor shows a tone of {} {} at {:.3} Hz{also}, independent of the drive",
                short(p.amplitude),
                symbol(m),
                p.hz
            )
        }
    })
}

/// Returns the orders and amplitudes \[y\] of a tone's harmonics.
fn harmonics(tone: &InterferenceParams) -> impl Iterator<Item = (u8, f64)> {
    (2..)
        .zip(tone.harmonics.chunks_exact(2))
        .map(|(order, parts)| (order, parts[0].hypot(parts[1])))
        .filter(|(_, a)| *a > 0.0)
}

/// Returns the longest hold of the drive \[s\] and `true`; without a hold, the longest segment \[s\] and `false`.
fn longest_hold(samples: &Samples) -> (f64, bool) {
    let (low, high) = samples.input_range();
    let still = |a: f64, b: f64| (a - b).abs() <= 1e-6 * (high - low);
    let holds = samples.segments.iter().enumerate().flat_map(|(i, s)| {
        let runs = samples.input[s.clone()].chunk_by(move |a, b| still(*a, *b)).map(<[f64]>::len);
        runs.filter(|rows| *rows > MIN_HOLD_ROWS).map(move |rows| samples.period_of(i) * (rows - 1) as f64)
    });
    match holds.reduce(f64::max) {
        Some(longest) => (longest, true),
        None => (samples.longest_segment(), false),
    }
}

/// Minimum number of rows of a hold.
const MIN_HOLD_ROWS: usize = 50;

/// Returns the slopes of a curve at its two ends.
fn slopes(p: &AsymmetryParams<Vec<f64>>) -> (f64, f64) {
    let end = |rising: bool| {
        let zones = p.thresholds.iter().zip(&p.weights).filter(|(s, _)| (**s >= 0.0) == rising);
        1.0 + zones.map(|(_, c)| c).sum::<f64>()
    };
    (end(false), end(true))
}

/// Returns the viscous play operators of a model.
fn rate_dependence(model: &Model) -> Option<&ViscousPiParams<Vec<f64>>> {
    if let Base::ViscousPi(p) = &model.base { Some(p) } else { None }
}

/// Returns the end at which the motion is limited, and the sensor value there.
fn limit(m: &Context<'_>) -> Option<(&'static str, f64)> {
    let (p, zero) = (m.extended.effects.saturation?, m.extended.zero);
    let (low, high) = (m.extended.output.low - zero, m.extended.output.high - zero);
    // The limit that the output comes closer to.
    Some(if p.high - high < low - p.low { ("upper", p.high + zero) } else { ("lower", p.low + zero) })
}

fn parameters(m: &Context<'_>, effect: Effect) -> BTreeMap<String, Found> {
    let (e, y, input) = (&m.extended.effects, &m.model.output.unit, m.extended.input.symbol());
    let mut list = BTreeMap::new();
    let mut put = |stage: &str, name: &str, value: f64, unit: &str| {
        let std_error = m.errors.get(&format!("{stage}.{name}")).copied();
        let suffix = stage.strip_prefix("resonance").unwrap_or_default();
        list.insert(format!("{name}{suffix}"), Found { value, std_error, unit: unit.into() });
    };
    match effect {
        Effect::Delay => e.delay.iter().for_each(|p| put("delay", "seconds", p.seconds, "s")),
        Effect::Lag => e.lag.iter().for_each(|p| put("lag", "seconds", p.seconds, "s")),
        Effect::Asymmetry => e.asymmetry.iter().for_each(|p| {
            let unit = if p.side == CurveSide::Input { input } else { y };
            for (i, (s, c)) in p.thresholds.iter().zip(&p.weights).enumerate() {
                put("asymmetry", &format!("thresholds[{i}]"), *s, unit);
                put("asymmetry", &format!("weights[{i}]"), *c, "1");
            }
        }),
        Effect::RateDependence if e.widening.is_some() => e.widening.iter().for_each(|p| {
            put("rate-dependence", "extra_half_width", p.extra_half_width(), y);
            put("rate-dependence", "exponent", p.exponent, "1");
            put("rate-dependence", "seconds", p.seconds, "s");
            put("rate-dependence", "reference_rate", p.reference_rate, &format!("{input}/s"));
        }),
        Effect::RateDependence if e.rate.is_some() => e.rate.iter().for_each(|p| {
            put("rate-dependence", "volts", p.volts, input);
            put("rate-dependence", "exponent", p.exponent, "1");
            put("rate-dependence", "reference_rate", p.reference_rate, &format!("{input}/s"));
        }),
        Effect::RateDependence => rate_dependence(m.extended).iter().for_each(|p| {
            put("rate-dependence", "seconds", p.seconds, "s");
            put("rate-dependence", "volt_seconds", p.volt_seconds, &format!("{input} s"));
        }),
        Effect::Load => e.load.iter().for_each(|p| {
            put("load", "per_newton", p.per_newton, &format!("{y}/N"));
            if p.gain_per_newton != 0.0 {
                put("load", "gain_per_newton", p.gain_per_newton, "1/N");
            }
        }),
        Effect::Saturation => e.saturation.iter().for_each(|p| {
            if let Some((name, _)) = limit(m) {
                let value = if name == "upper" { p.high } else { p.low };
                put("saturation", if name == "upper" { "high" } else { "low" }, value, y);
                put("saturation", "knee", p.knee, "1");
            }
        }),
        Effect::Temperature => e.temperature.iter().for_each(|p| {
            put("temperature", "per_kelvin", p.per_kelvin, "1/K");
            put("temperature", "reference_degc", p.reference_degc, "degC");
            if p.expansion != 0.0 {
                put("temperature", "expansion", p.expansion, &format!("{y}/K"));
            }
            if p.direct != 0.0 {
                put("temperature", "direct", p.direct, &format!("{y}/({input} K)"));
            }
            if p.seconds > 0.0 {
                put("temperature", "seconds", p.seconds, "s");
            }
        }),
        Effect::Creep => e.creep.iter().for_each(|p| {
            for (tau, share) in p.seconds.iter().zip(&p.shares).filter(|(_, share)| **share > 0.0) {
                put("creep", &creep_share(*tau), *share, "1");
            }
            put("creep", "total", p.total(), "1");
        }),
        Effect::Resonance => {
            for (i, p) in e.resonances.iter().enumerate() {
                let stage = if i == 0 { "resonance" } else { "resonance_2" };
                put(stage, "hz", p.hz, "Hz");
                put(stage, "damping", p.damping, "1");
                put(stage, "gain", p.gain, "1");
            }
        }
        Effect::Drift => e.drift.iter().for_each(|p| {
            if p.seconds == 0.0 || p.per_second != 0.0 {
                put("drift", "per_second", p.per_second, &format!("{y}/s"));
            }
            if p.seconds > 0.0 {
                put("drift", "settling", p.settling, y);
                put("drift", "seconds", p.seconds, "s");
            }
        }),
        Effect::Interference => e.interference.iter().for_each(|p| {
            put("interference", "hz", p.hz, "Hz");
            put("interference", "amplitude", p.amplitude, y);
            put("interference", "phase", p.phase, "rad");
            for (order, amplitude) in harmonics(p) {
                put("interference", &format!("harmonic_{order}"), amplitude, y);
            }
        }),
    }
    list
}
