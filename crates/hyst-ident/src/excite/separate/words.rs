//! Explains the result in words.

use super::result::{SeparateOptions, Tried, Verdict};
use crate::model::Effect;

/// Returns how the two effects differ, how well the drive separates them, and what else to measure.
pub(super) fn reason(pair: (Effect, Effect), verdict: Verdict, best: &Tried, options: &SeparateOptions) -> String {
    let (a, b) = pair;
    let mut text = format!("{a} {}; {b} {}.", signature(a), signature(b));
    if let Some(difference) = difference(a, b) {
        text.push_str(&format!(" {difference}"));
    }
    let (first, second) = (figure(best.first_left), figure(best.second_left));
    let drive = best.drive;
    text.push_str(&match verdict {
        Verdict::Clear => format!(
            " With {drive}, {b} imitates {a} except for {first} times the noise, and {a} imitates {b} except for {second} \
             times the noise."
        ),
        Verdict::Faint => format!(
            " With {drive}, {b} imitates {a} except for only {first} times the noise, and {a} imitates {b} except for \
             {second} times: visible only in the mean of many rows, and only if the misfit of the base model is not larger. \
             Record the drive several times."
        ),
        Verdict::NotByADrive => format!(
            " No drive within the limits separates them: with the best one, {drive}, one effect imitates the other except \
             for {} times the noise. A further measurement is needed.",
            figure(best.left())
        ),
    });
    let measured = measure(a, options).into_iter().chain(measure(b, options));
    let mut added = Vec::new();
    for what in measured.filter(|what| !what.is_empty()) {
        if !added.contains(&what) {
            text.push_str(&format!(" {what}"));
            added.push(what);
        }
    }
    text
}

fn figure(x: f64) -> String {
    if x >= 10.0 { format!("{x:.0}") } else { format!("{x:.2}") }
}

/// Returns what an effect does to the output.
fn signature(effect: Effect) -> &'static str {
    match effect {
        Effect::Delay => {
            "shifts the output by the same time at every frequency: its phase lag grows in proportion to frequency and the \
             amplitude stays"
        }
        Effect::Lag => "attenuates fast motion: its phase lag approaches 90° and the amplitude falls",
        Effect::Asymmetry => "bends the loop by the same curve at any rate and at any time",
        Effect::RateDependence => {
            "widens the loop with rate, but only while play operators slide: just after a reversal the output is not late"
        }
        Effect::Temperature => "scales the loop about its zero with temperature, independent of the drive",
        Effect::Creep => "continues after every step by a share of it, more and more slowly",
        Effect::Load => "adds the deflection by the external force, independent of the drive",
        Effect::Resonance => "rings after corners and steps and raises the amplitude near its frequency",
        Effect::Saturation => "flattens the output beyond a level at the ends of the motion",
        Effect::Drift => "adds a ramp over time that continues while the device rests",
        Effect::Interference => "adds a tone over time that continues while the device rests",
    }
}

/// Returns where to look for the difference of two similar effects.
fn difference(a: Effect, b: Effect) -> Option<&'static str> {
    use Effect::{
        Asymmetry, Creep, Delay, Drift, Interference, Lag, Load, RateDependence, Resonance, Saturation, Temperature,
    };
    let (a, b) = if a <= b { (a, b) } else { (b, a) };
    Some(match (a, b) {
        (Delay, Lag) => {
            "In slow loops both cause the same widening; phase and amplitude at high frequency separate them."
        }
        (Delay | Lag, RateDependence) => "Look just after each reversal: drag alone is not late there.",
        (Delay | Lag | RateDependence, Resonance) => {
            "Far below its frequency a mode has the phase of a short delay; near it the amplitude rises."
        }
        (RateDependence | Lag, Creep) => "Creep lasts for seconds after a step, the other for milliseconds.",
        (Asymmetry, Saturation) => {
            "Both are curves without memory, and a curve of enough dead zones is a stop: they differ only in the sharpness \
             of the knee, and a compensation is the same for both."
        }
        (Asymmetry | Saturation, Temperature) => "The curve is constant over time; the scale is not.",
        (Temperature, Drift) => {
            "Repeat the same loop later: temperature changes its height, drift shifts it; at rest only drift is visible."
        }
        (Temperature, Creep) => "Creep starts again with every step of the drive; temperature is independent of it.",
        (Creep, Drift) => {
            "Creep slows down and reverses with the drive; drift continues at one rate, also while the device rests."
        }
        (Creep, Load) => "Creep starts with the steps of the drive; a load is independent of it.",
        (Load, Drift) => "An unmeasured load can be any slow addition, for example a ramp.",
        (Temperature, Load) => "Temperature scales the loop; a load shifts it.",
        (Resonance, Interference) => {
            "A mode rings only after a motion and decays; a tone continues while the device rests."
        }
        (Drift, Interference) => "Any record of several periods of the tone shows both.",
        _ => return None,
    })
}

/// Returns what else to measure for an effect that comes from the surroundings.
fn measure(effect: Effect, options: &SeparateOptions) -> Option<&'static str> {
    match effect {
        Effect::Temperature if !options.thermometer => Some(
            "Record the temperature (temperature_degc): an unmeasured temperature can be any slow function of time.",
        ),
        Effect::Temperature => Some("Let the temperature change by 1 K or more during the record."),
        Effect::Load if !options.load_cell => {
            Some("Record the load (load_n), or remove it: an unmeasured load can be any slow function of time.")
        }
        Effect::Load => Some(
            "No drive changes the load: apply and remove a known load during the record, not in step with the drive.",
        ),
        _ => None,
    }
}
