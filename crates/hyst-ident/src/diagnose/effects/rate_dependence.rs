//! Rate-dependence: the loops change with the rate of the drive. On the drive, as a power of its rate; in the play
//! operators, as a drag; or in their thresholds.

use hyst_core::{Error, RateLaw, RateParams, ViscousPiParams};

use super::diagnosable::Diagnosable;
use super::kind::EffectKind;
use super::late;
use crate::base::DragParams;
use crate::criteria::LAW_ACCURACY;
use crate::diagnose::context::{Context, Put};
use crate::diagnose::evidence::frequency::{Filter, response_pictures};
use crate::diagnose::evidence::map;
use crate::diagnose::evidence::picture::Picture;
use crate::diagnose::evidence::scene::Scene;
use crate::diagnose::limit::{Limit, Limits};
use crate::diagnose::scan::Scan;
use crate::diagnose::single_loop::only_one_loop;
use crate::digits::short;
use crate::model::{Base, Effect, Effects, Model, Widening};
use crate::nested::{Fitted, Hypothesis, Problem};
use crate::samples::Samples;

/// Number of laws on the drive from which a search starts.
const MAX_STARTS: usize = 2;
/// Exponents of the rate that are tried, and the overdrive at the reference rate as a share of the input range.
const EXPONENTS: [f64; 4] = [0.15, 0.4, 0.7, 1.0];
const TRIAL_OVERDRIVE: f64 = 0.005;
/// Largest overdrive of the limit of detection, as a share of the input range.
const MAX_LIMIT_OVERDRIVE: f64 = 0.3;
/// Growth of the thresholds at the reference rate (the median rate of the moving rows), and their number, evenly over
/// half the range.
const GROWTH: f64 = 0.3;
const GROWN_THRESHOLDS: usize = 6;
/// Exponents, and times in samples over which the rate is averaged, that are tried.
const GROWTH_EXPONENTS: [f64; 2] = [0.3, 0.8];
const AVERAGING_SAMPLES: [f64; 3] = [1.5, 12.0, 100.0];
/// Shortest time of a drag, in sample periods.
const MIN_DRAG_SAMPLES: f64 = 0.02;

pub(super) struct RateDependence;

impl Diagnosable for RateDependence {
    fn effect(&self) -> Effect {
        Effect::RateDependence
    }

    fn kind(&self) -> EffectKind {
        EffectKind::Rate
    }

    fn hidden(&self, problem: &Problem<'_>) -> Option<&'static str> {
        only_one_loop(problem)
    }

    fn is_late(&self) -> bool {
        true
    }

    fn starts(&self, scan: &Scan<'_>) -> Result<Vec<Hypothesis>, Error> {
        let Scan { problem, from, .. } = scan;
        // A drag that grows with the rate, and one that grows with its square root.
        let (low, high) = problem.samples.input_range();
        let linear = DragParams { seconds: problem.samples.period, volt_seconds: 0.0 };
        let root = DragParams { seconds: 0.0, volt_seconds: 1e-3 * (high - low) * problem.samples.period };
        let in_the_plays = [linear, root].map(|drag| Hypothesis { drag: Some(drag), ..from.hypothesis.clone() });
        // Rate-dependence of the whole drive works on any basis.
        let on_the_drive = on_the_drive(scan)?.into_iter().map(|rate| scan.with(&|e| e.rate = Some(rate)));
        // Thresholds that grow with the rate.
        let grown = if problem.may_widen { grown_thresholds(scan)? } else { None };
        let grown = grown.map(|widening| scan.with(&|e| e.widening = Some(widening.clone())));
        Ok(in_the_plays.into_iter().filter(|_| problem.basis.drags()).chain(on_the_drive).chain(grown).collect())
    }

    fn limit(&self, limits: &Limits<'_>) -> Result<Option<Limit>, Error> {
        let (low, high) = limits.scan.problem.samples.input_range();
        let reference_rate = high - low;
        let size =
            limits.size(1e-3 * reference_rate, MAX_LIMIT_OVERDRIVE * reference_rate, limits.least, &|volts| {
                let rate = RateParams { volts, exponent: 0.5, reference_rate, law: RateLaw::Holds };
                limits.scan.moved_with(&|e| e.rate = Some(rate))
            })?;
        let (unit, at) = (limits.input, short(reference_rate));
        let meaning = format!("lag behind a drive of {at} {unit}/s, growing with the square root of the rate");
        Ok(Some(Limit::of(size, unit, meaning)))
    }

    fn is_plausible(&self, problem: &Problem<'_>, fit: &Fitted) -> bool {
        let h = &fit.hypothesis;
        let least = MIN_DRAG_SAMPLES * problem.samples.period;
        h.effects.rate.is_none_or(|p| p.volts > 0.0 && !is_lag(&p))
            && h.drag.is_none_or(|p| p.volt_seconds > 0.0 || p.seconds > least)
    }

    fn is_undetermined(&self, effects: &Effects, unsure: &dyn Fn(&str, f64) -> bool, _span: f64) -> bool {
        let of_thresholds = |p: &Widening| unsure("rate-dependence.extra_half_width", p.extra_half_width());
        effects.rate.is_some_and(|p| unsure("rate-dependence.volts", p.volts))
            || effects.widening.as_ref().is_some_and(of_thresholds)
    }

    fn law(&self, model: &Model) -> Option<&'static str> {
        Some(match (&model.effects.widening, model.effects.rate) {
            (Some(_), _) => "power-thresholds",
            (None, None) => "viscous-plays",
            (None, Some(p)) => match p.law {
                RateLaw::Follows => "power-follows",
                RateLaw::Holds => "power-holds",
                RateLaw::Relaxes => "power-relaxes",
            },
        })
    }

    fn signature(&self, context: &Context<'_>) -> Option<String> {
        let (e, input) = (&context.extended.effects, context.extended.input.symbol());
        if let Some(p) = &e.widening {
            return Some(format!(
                "the loop widens with rate^{:.2}, wide loops more than narrow ones: at {} {input}/s the branches of a wide loop are {} {} farther \
                 apart than at low rate",
                p.exponent,
                short(p.reference_rate),
                short(2.0 * p.extra_half_width()),
                context.symbol()
            ));
        }
        if let Some(p) = e.rate {
            return Some(format!(
                "the loop widens with rate^{:.2}: at {} {input}/s the hysteresis lags the drive by {} {input}",
                p.exponent,
                short(p.reference_rate),
                short(p.volts)
            ));
        }
        Some(match viscous_plays(context.extended) {
            Some(p) if p.volt_seconds > 0.0 => format!(
                "the loop widens with rate: at 100 {input}/s a sliding play operator lags the drive by {:.3} {input}",
                100.0 * p.seconds + (100.0 * p.volt_seconds).sqrt()
            ),
            Some(p) => format!("the loop widens with rate: sliding play operators lag by {:.3} ms", 1e3 * p.seconds),
            None => {
                "the loop widens with rate; this base model has no rate-dependent form: fit pi, or fit dpm to records at several rates"
                    .into()
            }
        })
    }

    fn parameters(&self, context: &Context<'_>, put: &mut Put<'_>) {
        const STAGE: &str = "rate-dependence";
        let (e, input) = (&context.extended.effects, context.extended.input.symbol());
        if let Some(p) = &e.widening {
            put(STAGE, "extra_half_width", p.extra_half_width(), &context.model.output.unit);
            put(STAGE, "exponent", p.exponent, "1");
            put(STAGE, "seconds", p.seconds, "s");
            put(STAGE, "reference_rate", p.reference_rate, &format!("{input}/s"));
        } else if let Some(p) = e.rate {
            put(STAGE, "volts", p.volts, input);
            put(STAGE, "exponent", p.exponent, "1");
            put(STAGE, "reference_rate", p.reference_rate, &format!("{input}/s"));
        } else if let Some(p) = viscous_plays(context.extended) {
            put(STAGE, "seconds", p.seconds, "s");
            put(STAGE, "volt_seconds", p.volt_seconds, &format!("{input} s"));
        }
    }

    fn without(&self, model: &Model) -> Model {
        match &model.base {
            Base::ViscousPi(p) => Model { base: Base::Pi(p.pi.clone()), ..model.clone() },
            _ => Model { effects: model.effects.without(Effect::RateDependence), ..model.clone() },
        }
    }

    fn pictures(&self, _model: &Model, scene: &Scene<'_>) -> Vec<Picture> {
        let filter = Filter {
            effect: Effect::RateDependence,
            phase_says: "Rate-dependent play operators shift the phase more at a higher rate of the drive.",
            gain_says: "Rate-dependent play operators lower the gain more at a higher rate of the drive.",
            response: None,
        };
        let mut pictures = map::trailing(scene).into_iter().collect::<Vec<_>>();
        pictures.extend(response_pictures(&filter, scene));
        pictures
    }
}

/// Returns the viscous play operators of a model.
fn viscous_plays(model: &Model) -> Option<&ViscousPiParams<Vec<f64>>> {
    if let Base::ViscousPi(p) = &model.base { Some(p) } else { None }
}

/// Returns whether a rate law is that of a first-order lag, u − v = τ v̇, or its expansion, v = u − τ u̇.
fn is_lag(p: &RateParams) -> bool {
    p.law != RateLaw::Holds && (1.0 - p.exponent).abs() < LAW_ACCURACY
}

/// Returns the rate laws with the largest first-order gain: the best two with different forms. Their reference rate is
/// the input range per second.
fn on_the_drive(scan: &Scan<'_>) -> Result<Vec<RateParams>, Error> {
    let (low, high) = scan.problem.samples.input_range();
    let range = high - low;
    let mut scored = Vec::new();
    for law in RateLaw::ALL {
        for exponent in EXPONENTS {
            let rate = RateParams { volts: TRIAL_OVERDRIVE * range, exponent, reference_rate: range, law };
            if let Some((gain, amplitude)) = scan.gain(&scan.moved_with(&|e| e.rate = Some(rate))?) {
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
            if seconds > late::MAX_SHARE * samples.longest_segment() {
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
