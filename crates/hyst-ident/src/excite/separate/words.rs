//! The answer in words.

use super::{SeparateOptions, Tried, Verdict};
use crate::model::Effect;

/// How the two differ, what the drive leaves, and what to measure besides.
pub(super) fn reason(pair: (Effect, Effect), verdict: Verdict, best: &Tried, options: &SeparateOptions) -> String {
    let (a, b) = pair;
    let mut text = format!("{a} {}; {b} {}.", mark(a), mark(b));
    if let Some(difference) = difference(a, b) {
        text.push_str(&format!(" {difference}"));
    }
    let (first, second) = (figure(best.first_left), figure(best.second_left));
    let drive = best.drive;
    text.push_str(&match verdict {
        Verdict::Clear => format!(
            " With {drive}, the best {b} misses {first} times the noise of what {a} does, and the best {a} misses {second} \
             times the noise of what {b} does."
        ),
        Verdict::Faint => format!(
            " With {drive}, the best {b} misses only {first} times the noise of what {a} does, and the best {a} {second} \
             times: seen in the mean of many rows, and only if the model of the loop misses no more than that. Record it \
             several times over."
        ),
        Verdict::NotByADrive => format!(
            " No drive within the limits tells them apart: of the best, {drive}, the one imitates the other to {} times the \
             noise. A further measurement is needed.",
            figure(best.left())
        ),
    });
    let measured = measure(a, options).into_iter().chain(measure(b, options));
    let mut said = Vec::new();
    for what in measured.filter(|what| !what.is_empty()) {
        if !said.contains(&what) {
            text.push_str(&format!(" {what}"));
            said.push(what);
        }
    }
    text
}

fn figure(x: f64) -> String {
    if x >= 10.0 { format!("{x:.0}") } else { format!("{x:.2}") }
}

/// What an effect does to the output.
fn mark(suspect: Effect) -> &'static str {
    match suspect {
        Effect::Delay => {
            "moves everything by the same time, so its phase grows in proportion to frequency and the amplitude stays"
        }
        Effect::Lag => "rounds what is fast: its phase bends towards 90° and the amplitude falls",
        Effect::Asymmetry => "bends the loop by the same curve at any rate and at any time",
        Effect::RateDependence => {
            "widens loops with the rate, but only while plays slide: just after a turn nothing is late"
        }
        Effect::Temperature => "scales the loop about its zero, following the temperature and not the drive",
        Effect::Creep => "goes on after every step, by a share of it, ever more slowly",
        Effect::Load => "adds what the external force pushes, whatever the drive does",
        Effect::Resonance => "rings after corners and steps and raises the amplitude near its frequency",
        Effect::Saturation => "flattens what goes beyond a level at the ends of the motion",
        Effect::Drift => "adds a ramp on the lab's clock that goes on while the device rests",
        Effect::Interference => "adds a tone on the lab's clock that goes on while nothing is driven",
    }
}

/// What to look at where two effects are alike.
fn difference(a: Effect, b: Effect) -> Option<&'static str> {
    use Effect::{
        Asymmetry, Creep, Delay, Drift, Interference, Lag, Load, RateDependence, Resonance, Saturation, Temperature,
    };
    let (a, b) = if a <= b { (a, b) } else { (b, a) };
    Some(match (a, b) {
        (Delay, Lag) => {
            "Slow loops show both as the same widening; they part by phase and amplitude at high frequency."
        }
        (Delay | Lag, RateDependence) => "Look just after each turn: there drag alone is not late.",
        (Delay | Lag | RateDependence, Resonance) => {
            "Far below the mode its phase is that of a short delay; near it the amplitude rises instead of staying or falling."
        }
        (RateDependence | Lag, Creep) => "Creep lasts for seconds after a step, the other for milliseconds.",
        (Asymmetry, Saturation) => {
            "Both are curves without memory, and a curve of enough dead zones is a stop: they differ in the sharpness of the knee \
             alone, and a compensation does the same for both."
        }
        (Asymmetry | Saturation, Temperature) => "The curve is the same at any time; the scale is not.",
        (Temperature, Drift) => {
            "Repeat the same loop later: temperature changes its height, drift shifts it as a whole; at rest only drift is seen."
        }
        (Temperature, Creep) => "Creep starts anew with every step of the drive, temperature does not know of it.",
        (Creep, Drift) => {
            "Creep slows down and turns round with the drive; drift goes on at one rate, through rests too."
        }
        (Creep, Load) => "Creep starts with the drive's steps, a load comes and goes by itself.",
        (Load, Drift) => "A load that nobody measures can be any slow addition, a ramp among them.",
        (Temperature, Load) => "Temperature scales the loop, a load shifts it as a whole.",
        (Resonance, Interference) => {
            "A mode rings only after something moved and dies away; a tone stands while the device rests."
        }
        (Drift, Interference) => "Any record of several periods of the tone shows both.",
        _ => return None,
    })
}

/// What to measure besides, for an effect that comes from the surroundings.
fn measure(suspect: Effect, options: &SeparateOptions) -> Option<&'static str> {
    match suspect {
        Effect::Temperature if !options.thermometer => Some(
            "A thermometer (temperature_degc) settles what temperature does at once: without it, it is taken as any slow \
                  function of time.",
        ),
        Effect::Temperature => Some("Let the temperature change by a kelvin or more while it plays."),
        Effect::Load if !options.load_cell => {
            Some("Record the load (load_n), or take it off: without that it is taken as any slow function of time.")
        }
        Effect::Load => {
            Some("No drive makes a load: put a known one on and off while it plays, out of step with the drive.")
        }
        _ => None,
    }
}
