//! Iterative learning on a device with other physics than the model.

use std::sync::OnceLock;

use hyst_ident::learn::{Ended, LearnError, LearnOptions, Learner};
use hyst_ident::model::{Kind, Model};
use hyst_ident::record::Record;
use hyst_tests::learning::{identify, play, reference, scale_gain};
use hyst_tests::other_bench::{Bench, OtherDevice};
use hyst_tests::other_physics::Law;

const BENCH: Bench = Bench {
    seed: 3,
    law: Law::ColemanHodgdon,
    rate_hz: 1000.0,
    volts: 100.0,
    stroke_um: 12.0,
    noise_um: 0.005,
    delay_s: 0.0,
    lag_s: 0.0,
    creep: 0.0,
    mode: None,
};

/// Returns a model of the device, fitted once, and a reference in the middle of its travel.
fn task() -> (Model, Record) {
    static MODEL: OnceLock<Model> = OnceLock::new();
    let model = MODEL.get_or_init(|| identify(&mut OtherDevice::new(BENCH), false)).clone();
    let (low, high) = (model.output.low, model.output.high);
    let reference = reference(1, BENCH.rate_hz, low + 0.2 * (high - low), low + 0.8 * (high - low));
    (model, reference)
}

/// Runs the passes. Returns their errors divided by the repeatability, and the reason of the end.
fn learn(device: &mut OtherDevice, model: &Model, reference: &Record) -> (Vec<f64>, Ended) {
    let mut learner = Learner::new(model, reference, LearnOptions::default()).unwrap();
    loop {
        let drive = learner.drive().voltage.clone();
        if let Some(ended) = learner.take(&play(device, &drive, 2)).unwrap() {
            let floor = learner.passes().last().unwrap().repeatability;
            return (learner.passes().map(|pass| pass.rmse / floor).collect(), ended);
        }
    }
}

#[test]
fn the_error_falls_to_the_repeatability() {
    let mut device = OtherDevice::new(BENCH);
    let (model, reference) = task();
    let (passes, ended) = learn(&mut device, &model, &reference);
    assert!(passes[0] > 1.5, "the first pass has no error to learn from: {passes:?}");
    let best = passes.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(best < 1.3 && passes.iter().all(|p| *p <= 1.02 * passes[0]), "{passes:?}");
    assert!(ended == Ended::AtFloor || ended == Ended::NoGain, "{ended:?}");
}

#[test]
fn a_wrong_gain_and_a_missing_delay_are_learned() {
    for (bench, factor) in [(BENCH, 1.3), (BENCH, 0.75), (Bench { delay_s: 2e-3, ..BENCH }, 1.0)] {
        let (mut model, reference) = task();
        scale_gain(&mut model, factor);
        // The model was fitted to a device without delay.
        let (passes, ended) = learn(&mut OtherDevice::new(bench), &model, &reference);
        let best = passes.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(best < 0.1 * passes[0], "{factor}: {passes:?} {ended:?}");
    }
}

#[test]
fn an_output_that_does_not_follow_is_rejected() {
    let mut device = OtherDevice::new(BENCH);
    let (model, reference) = task();
    let mut learner = Learner::new(&model, &reference, LearnOptions::default()).unwrap();
    let drive = learner.drive().voltage.clone();
    let plays = play(&mut device, &drive, 2);
    let all =
        |change: &dyn Fn(f64) -> f64| plays.iter().map(|y| y.iter().map(|y| change(*y)).collect()).collect::<Vec<_>>();
    let rejected = |learner: &mut Learner<'_>, plays: &[Vec<f64>]| learner.take(plays).unwrap_err();
    let turned = rejected(&mut learner, &all(&|y| 10.0 - y));
    assert!(turned.to_string().contains("wrong sign"), "{turned}");
    let frozen = rejected(&mut learner, &all(&|_| 4.0));
    assert!(matches!(frozen, LearnError::NotFollowing { .. }), "{frozen}");
    let mut lost = all(&|y| y);
    lost[1][7] = f64::NAN;
    assert!(matches!(rejected(&mut learner, &lost), LearnError::NotFinite { play: 2, row: 8 }));
    assert!(matches!(rejected(&mut learner, &plays[..1]), LearnError::Plays { plays: 1, .. }));
    // The drive is still that of the model's inverse, and the valid runs are accepted afterwards.
    assert_eq!(learner.drive().voltage, drive);
    assert!(learner.best().is_none() && learner.take(&plays).unwrap().is_none());
}

#[test]
fn a_frozen_sensor_in_a_later_pass_changes_nothing() {
    let mut device = OtherDevice::new(BENCH);
    let (model, reference) = task();
    let mut learner = Learner::new(&model, &reference, LearnOptions::default()).unwrap();
    let first = play(&mut device, &learner.drive().voltage.clone(), 2);
    let frozen: Vec<Vec<f64>> = first.iter().map(|y| vec![4.0; y.len()]).collect();
    assert_eq!(learner.take(&first).unwrap(), None);
    let next = learner.drive().voltage.clone();
    assert!(matches!(learner.take(&frozen), Err(LearnError::NotFollowing { .. })));
    // The pass is discarded, and the same drive can be played again.
    assert_eq!((learner.passes().count(), learner.best().unwrap().0), (1, 0));
    assert_eq!(learner.drive().voltage, next);
}

/// The other tests are meaningless with a useless model.
#[test]
fn the_model_of_this_device_is_accurate() {
    let (model, _) = task();
    let span = model.output.high - model.output.low;
    assert!(model.rmse.unwrap() < 0.05 * span && model.base.kind() == Kind::Pi, "{:?} of {span}", model.rmse);
}
