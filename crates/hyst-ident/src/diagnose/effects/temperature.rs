//! Temperature: a recorded temperature changes the gain, the zero and the width of the loops, also behind a thermal lag.

use hyst_core::{Error, TemperatureParams};

use super::diagnosable::Diagnosable;
use super::kind::EffectKind;
use crate::diagnose::context::{Context, Put};
use crate::diagnose::evidence::map;
use crate::diagnose::evidence::picture::Picture;
use crate::diagnose::evidence::scene::Scene;
use crate::diagnose::limit::{Limit, Limits};
use crate::diagnose::scan::Scan;
use crate::diagnose::trial_parameters::starting_temperature;
use crate::digits::{short, signed};
use crate::model::{Effect, Effects, Model};
use crate::nested::{Fitted, Hypothesis, Problem};
use crate::statistics::range;

/// Minimum range of the temperature \[K\].
const MIN_RANGE_K: f64 = 0.5;
/// Thermal lag of a first-order column, and those from which the search starts, as shares of the record.
const LAG_SHARE: f64 = 0.15;
const LAG_SHARES: [f64; 3] = [0.0, 0.02, LAG_SHARE];
/// Largest limit of detection \[1/K\].
const MAX_LIMIT: f64 = 0.05;

pub(super) struct Temperature;

impl Diagnosable for Temperature {
    fn effect(&self) -> Effect {
        Effect::Temperature
    }

    fn kind(&self) -> EffectKind {
        EffectKind::Temperature
    }

    fn hidden(&self, problem: &Problem<'_>) -> Option<&'static str> {
        match &problem.samples.temperature {
            None => Some("the temperature was not recorded"),
            Some(degc) => {
                let (low, high) = range(degc.iter().copied());
                (high - low <= MIN_RANGE_K).then_some("the temperature changed by less than 0.5 K")
            }
        }
    }

    fn columns(&self, scan: &Scan<'_>) -> Result<Option<Vec<Vec<f64>>>, Error> {
        let s = scan.problem.samples;
        let whole = s.time[s.len() - 1] - s.time[0];
        let reference_degc = starting_temperature(s);
        let gain = TemperatureParams { per_kelvin: 1e-3, reference_degc, ..TemperatureParams::default() };
        let kelvin: Vec<f64> = s.temperature.iter().flatten().map(|t| t - reference_degc).collect();
        let late = TemperatureParams { seconds: LAG_SHARE * whole, ..gain };
        let of = |p| scan.behind(Effects { temperature: Some(p), ..Effects::default() });
        Ok(Some(vec![of(gain)?, of(late)?, scan.times_drive(&kelvin), kelvin]))
    }

    /// Only the gain, with an expansion, or also with another loop width; each without and with a thermal lag. An
    /// expansion of exactly zero means no expansion.
    fn starts(&self, scan: &Scan<'_>) -> Result<Vec<Hypothesis>, Error> {
        let s = scan.problem.samples;
        let reference_degc = starting_temperature(s);
        let whole = s.time[s.len() - 1] - s.time[0];
        const SOME: f64 = f64::MIN_POSITIVE;
        let parts = [(0.0, 0.0), (SOME, 0.0), (SOME, SOME)];
        let laws = LAG_SHARES
            .into_iter()
            .flat_map(|share| parts.map(|(expansion, direct)| (share * whole, expansion, direct)));
        let of = |(seconds, expansion, direct)| TemperatureParams {
            per_kelvin: 0.0,
            reference_degc,
            expansion,
            direct,
            seconds,
        };
        Ok(laws.map(|law| scan.with(&|e| e.temperature = Some(of(law)))).collect())
    }

    fn limit(&self, limits: &Limits<'_>) -> Result<Option<Limit>, Error> {
        let reference_degc = starting_temperature(limits.scan.problem.samples);
        let size = limits.size(1e-3, MAX_LIMIT, limits.least, &|per_kelvin| {
            let p = TemperatureParams { per_kelvin, reference_degc, ..TemperatureParams::default() };
            limits.scan.behind(Effects { temperature: Some(p), ..Effects::default() })
        })?;
        Ok(Some(Limit::of(size, "1/K", "relative change of the gain per kelvin".into())))
    }

    fn is_plausible(&self, _problem: &Problem<'_>, _fit: &Fitted) -> bool {
        true
    }

    fn is_undetermined(&self, effects: &Effects, unsure: &dyn Fn(&str, f64) -> bool, _span: f64) -> bool {
        effects.temperature.is_some_and(|p| {
            let expands = p.expansion != 0.0 && !unsure("temperature.expansion", p.expansion);
            let widens = p.direct != 0.0 && !unsure("temperature.direct", p.direct);
            unsure("temperature.per_kelvin", p.per_kelvin) && !expands && !widens
        })
    }

    fn law(&self, model: &Model) -> Option<&'static str> {
        Some(match model.effects.temperature? {
            p if p.direct != 0.0 && p.seconds > 0.0 => "gain-loop-width-and-expansion-behind-a-thermal-lag",
            p if p.direct != 0.0 => "gain-loop-width-and-expansion",
            p if p.expansion != 0.0 && p.seconds > 0.0 => "gain-and-expansion-behind-a-thermal-lag",
            p if p.expansion != 0.0 => "gain-and-expansion",
            p if p.seconds > 0.0 => "gain-behind-a-thermal-lag",
            _ => "gain",
        })
    }

    fn signature(&self, context: &Context<'_>) -> Option<String> {
        let p = context.extended.effects.temperature?;
        let expands = match p.expansion {
            0.0 => String::new(),
            expansion => format!(", and the zero moves by {} {} per K", signed(expansion), context.symbol()),
        };
        let late = match p.seconds {
            0.0 => String::new(),
            seconds => format!("; the actuator follows the thermometer with a time constant of {} s", short(seconds)),
        };
        let beside = 100.0 * p.direct / context.mean_gain();
        let widens = match p.direct {
            0.0 => String::new(),
            _ => format!(", the width of the loops by {:+.2} % per K", 100.0 * p.per_kelvin),
        };
        Some(format!("the gain changes by {:+.2} % per K{widens}{expands}{late}", 100.0 * p.per_kelvin + beside))
    }

    fn parameters(&self, context: &Context<'_>, put: &mut Put<'_>) {
        let Some(p) = context.extended.effects.temperature else { return };
        let (unit, input) = (&context.model.output.unit, context.extended.input.symbol());
        put("temperature", "per_kelvin", p.per_kelvin, "1/K");
        put("temperature", "reference_degc", p.reference_degc, "degC");
        if p.expansion != 0.0 {
            put("temperature", "expansion", p.expansion, &format!("{unit}/K"));
        }
        if p.direct != 0.0 {
            put("temperature", "direct", p.direct, &format!("{unit}/({input} K)"));
        }
        if p.seconds > 0.0 {
            put("temperature", "seconds", p.seconds, "s");
        }
    }

    fn pictures(&self, model: &Model, scene: &Scene<'_>) -> Vec<Picture> {
        let pictures = [map::gain_over_temperature(model, scene), map::expansion_over_temperature(model, scene)];
        pictures.into_iter().flatten().collect()
    }
}
