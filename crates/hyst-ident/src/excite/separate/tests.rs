//! Tests over all pairs of effects.

use super::*;
use crate::model::Effect;

const LIMITS: Limits = Limits { rate_hz: 1000.0, lo_v: 0.0, hi_v: 120.0, slew_v_per_s: Some(50_000.0) };

/// Compares every pair on every drive.
fn all_pairs(options: &SeparateOptions) -> Vec<((Effect, Effect), Vec<Tried>)> {
    let mut pairs: Vec<((Effect, Effect), Vec<Tried>)> = Vec::new();
    for candidate in drives::family(&LIMITS, options) {
        candidate.drive(&LIMITS).unwrap_or_else(|error| panic!("{}: {error}", candidate.name));
        let rig = Rig::new(&candidate, &LIMITS, options).unwrap();
        let families = Effect::ALL.map(|effect| Family::new(&rig, effect));
        let mut index = 0;
        for (i, a) in Effect::ALL.iter().enumerate() {
            for (j, b) in Effect::ALL.iter().enumerate().skip(i + 1) {
                let found = compare(candidate.name, &rig, &families[i], &families[j], options.noise);
                if pairs.len() == index {
                    pairs.push(((*a, *b), Vec::new()));
                }
                pairs[index].1.push(found);
                index += 1;
            }
        }
    }
    pairs
}

fn best(tried: &[Tried]) -> Tried {
    *tried.iter().max_by(|a, b| a.left().total_cmp(&b.left())).unwrap()
}

const SHORT: SeparateOptions =
    SeparateOptions { duration_s: 12.0, noise: 1e-3, thermometer: false, load_cell: false, seed: 1 };

#[test]
fn every_pair_is_separable_except_an_unmeasured_load_and_drift() {
    let pairs = all_pairs(&SHORT);
    assert_eq!(pairs.len(), 55);
    let hidden: Vec<(Effect, Effect)> =
        pairs.iter().filter(|(_, tried)| best(tried).left() < 0.1).map(|(pair, _)| *pair).collect();
    assert_eq!(hidden, [(Effect::Load, Effect::Drift)]);
    let measured = SeparateOptions { thermometer: true, load_cell: true, ..SHORT };
    for (pair, tried) in all_pairs(&measured) {
        assert!(best(&tried).left() > 0.1, "{pair:?}: {:?}", best(&tried));
    }
}

#[test]
fn fast_loops_separate_effects_that_slow_ones_do_not() {
    let left = |a: Effect, b: Effect, drive: &str| {
        let answer = separate(a, b, &LIMITS, &SHORT).unwrap();
        let of = answer.tried.iter().find(|tried| tried.drive == drive).unwrap().left();
        (of, answer.tried[0].left())
    };
    let (slow, best) = left(Effect::Delay, Effect::Lag, "slow full loops");
    assert!(slow < 0.1 && best > 3.0, "{slow} {best}");
    let (fast, best) = left(Effect::Creep, Effect::Drift, "full loops as fast as the limits allow");
    let (slow, _) = left(Effect::Creep, Effect::Drift, "slow full loops");
    assert!(fast.min(slow) < 0.1 && best > 1.0, "{fast} {slow} {best}");
    // With a thermometer, temperature can imitate less.
    let with = separate(Effect::Temperature, Effect::Creep, &LIMITS, &SeparateOptions { thermometer: true, ..SHORT });
    let without = separate(Effect::Temperature, Effect::Creep, &LIMITS, &SHORT).unwrap();
    assert!(with.unwrap().tried[0].left() > without.tried[0].left());
}

#[test]
fn an_effect_imitates_itself() {
    let options = SeparateOptions { thermometer: true, load_cell: true, ..SHORT };
    for candidate in drives::family(&LIMITS, &options) {
        let rig = Rig::new(&candidate, &LIMITS, &options).unwrap();
        for effect in Effect::ALL {
            let family = Family::new(&rig, effect);
            let size = family.signature().norm() / (rig.rows() as f64).sqrt();
            let left = family.imitation_residual(&rig, family.signature());
            // A tone between two lines of the spectrum is the hardest; the loop explains a tone at the frequency of the
            // drive.
            assert!(left <= 0.1 * size + 0.1 * options.noise, "{effect} with {}: {left} of {size}", candidate.name);
        }
    }
}

#[test]
fn results_are_explained_and_within_the_limits() {
    for (a, b, words) in [
        (Effect::Lag, Effect::Delay, "high frequency"),
        (Effect::Creep, Effect::Drift, "rests"),
        (Effect::Load, Effect::Drift, "load_n"),
        (Effect::Temperature, Effect::Drift, "temperature_degc"),
    ] {
        let answer = separate(a, b, &LIMITS, &SHORT).unwrap();
        for part in [a.name(), b.name(), words, answer.tried[0].drive] {
            assert!(answer.reason.contains(part), "{part:?} is missing in: {}", answer.reason);
        }
        assert!(answer.tried.windows(2).all(|w| w[0].left() >= w[1].left()) && answer.tried.len() > 10);
        assert!(answer.drive.voltage().iter().all(|u| (0.0..=120.0).contains(u)));
        let (first, last) = (answer.drive.time()[0], answer.drive.time()[answer.drive.time().len() - 1]);
        assert!((10.0..17.0).contains(&(last - first)), "{last}");
    }
    assert_eq!(separate(Effect::Load, Effect::Drift, &LIMITS, &SHORT).unwrap().verdict, Verdict::NotByADrive);
    // An amplifier that takes seconds does not excite effects of milliseconds.
    let slow = Limits { slew_v_per_s: Some(60.0), ..LIMITS };
    assert_eq!(separate(Effect::Delay, Effect::Lag, &slow, &SHORT).unwrap().verdict, Verdict::NotByADrive);
}

#[test]
fn invalid_options_are_errors() {
    let pair = (Effect::Lag, Effect::Delay);
    let message =
        |limits: &Limits, options: SeparateOptions| separate(pair.0, pair.1, limits, &options).unwrap_err().to_string();
    assert!(message(&LIMITS, SeparateOptions { duration_s: 1.0, ..SHORT }).contains("duration_s = 1"));
    assert!(message(&LIMITS, SeparateOptions { noise: 0.0, ..SHORT }).contains("noise = 0"));
    assert!(message(&Limits { hi_v: -1.0, ..LIMITS }, SHORT).contains("hi_v = -1"));
    assert!(message(&Limits { rate_hz: 5.0, ..LIMITS }, SHORT).contains("rate_hz = 5"));
    assert!(
        separate(Effect::Lag, Effect::Lag, &LIMITS, &SHORT).unwrap_err().to_string().contains("both effects are lag")
    );
    assert_eq!("rate-dependence".parse(), Ok(Effect::RateDependence));
    assert!("noise".parse::<Effect>().unwrap_err().contains("interference"));
}
