//! Drive histories act like the same drive in a record, and fits recover them.

use super::reversals::path;
use crate::Samples;
use crate::base::past::columns;
use crate::base::{Basis, Drag, PiBasis, PreisachBasis};
use crate::criteria::LAW_ACCURACY;
use crate::fit::{FitOptions, fit_settled};
use crate::metrics::rms;

const PAST: [f64; 3] = [0.0, 95.0, 20.0];

/// A record of a few play operators that were driven up and back before the record starts at 45 V; later the drive
/// covers the whole range.
fn samples() -> Samples {
    let turns = [45.0, 70.0, 30.0, 60.0, 5.0, 100.0, 0.0, 90.0, 10.0, 100.0, 0.0, 60.0];
    let leg = |pair: &[f64]| {
        let (from, to) = (pair[0], pair[1]);
        (0..150).map(move |i| from + (to - from) * f64::from(i) / 150.0).collect::<Vec<_>>()
    };
    let input: Vec<f64> = turns.windows(2).flat_map(leg).collect();
    let whole = std::slice::from_ref(&(0..input.len())).to_vec();
    let plays = PiBasis { thresholds: vec![8.0, 17.0, 31.0, 42.0], floor: 0.0, virgin: f64::INFINITY, falls: false };
    let past = path(&PAST[1..], 45.0);
    let columns = columns(&plays, 0..5, &input, &whole, &[past], &Drag::NONE);
    let noise = |k: usize| 0.005 * (1e3 * (k as f64).sin()).sin();
    let weights = [0.1, 0.02, 0.015, 0.02, 0.01];
    let output =
        (0..input.len()).map(|k| columns.iter().zip(weights).map(|(c, w)| w * c[k]).sum::<f64>() + noise(k)).collect();
    Samples::of_columns(1e-3, input, output)
}

#[test]
fn a_drive_history_acts_like_the_same_drive_in_a_record() {
    let samples = samples();
    let past = path(&PAST[1..], 45.0);
    assert!(past[0] == 0.0 && past.last().is_some_and(|u| (20.0..45.0).contains(u)), "{past:?}");
    let with: Vec<f64> = past.iter().chain(&samples.input).copied().collect();
    let all = std::slice::from_ref(&(0..with.len())).to_vec();
    for basis in [&PiBasis::for_samples(&samples) as &dyn Basis, &PreisachBasis::for_samples(&samples, 8)] {
        let of = 0..basis.len();
        let pasts = std::slice::from_ref(&past);
        let own = columns(basis, of.clone(), &samples.input, &samples.segments, pasts, &Drag::NONE);
        let whole = basis.columns(of, &with, &all, &Drag::NONE);
        assert!(own.iter().zip(&whole).all(|(own, whole)| *own == whole[past.len()..]));
    }
}

/// With the drive history, no row is a start-up row on either base.
#[test]
fn a_record_that_begins_in_mid_cycle_is_followed_from_its_first_row() {
    for kind in 0..2 {
        let mut samples = samples();
        let bases: [Box<dyn Basis>; 2] =
            [Box::new(PiBasis::for_samples(&samples)), Box::new(PreisachBasis::for_samples(&samples, 12))];
        let (fitted, left) =
            fit_settled(&mut samples, bases[kind].as_ref(), &FitOptions::default(), &String::new).unwrap();
        assert!(!samples.pasts[0].is_empty() && samples.settling.iter().all(|s| !s), "{kind}: {:?}", samples.pasts);
        // The noise is at most 5 nm; the thresholds of the base differ from those of the actuator.
        let largest = left.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
        assert!(largest < 0.1, "{kind}: {largest}, RMSE {}", fitted.rmse());
    }
}

/// An actuator at 0 V also remembers an earlier drive. The amplitude falls, so only the first rise shows the lower
/// half.
#[test]
fn a_record_that_begins_at_0_v_after_use_is_followed_from_its_first_row() {
    let input: Vec<f64> =
        (0..3000).map(|k| 50.0 - 50.0 * (1.0 - f64::from(k) / 4000.0) * (f64::from(k) / 80.0).cos()).collect();
    let plays = PiBasis { thresholds: vec![8.0, 17.0, 31.0, 42.0], floor: 0.0, virgin: f64::INFINITY, falls: false };
    let whole = std::slice::from_ref(&(0..input.len())).to_vec();
    let columns = columns(&plays, 0..5, &input, &whole, &[path(&[100.0], 0.0)], &Drag::NONE);
    let noise = |k: usize| 0.02 * (1e3 * (k as f64).sin()).sin();
    let output = (0..input.len()).map(|k| columns.iter().map(|c| 0.05 * c[k]).sum::<f64>() + noise(k)).collect();
    let mut samples = Samples::of_columns(1e-3, input, output);
    let basis = PiBasis::for_samples(&samples);
    let (fitted, _) = fit_settled(&mut samples, &basis, &FitOptions::default(), &String::new).unwrap();
    assert!(!samples.pasts[0].is_empty());
    assert!(samples.settling.iter().all(|s| !s));
    let hysteresis = rms(&samples.hysteresis().1);
    assert!(fitted.rmse() < LAW_ACCURACY * hysteresis, "{} of {hysteresis}", fitted.rmse());
}

#[test]
fn a_record_from_rest_needs_no_drive_history() {
    let input: Vec<f64> = (0..2000).map(|k| 50.0 - 50.0 * (f64::from(k) / 80.0).cos()).collect();
    let plays = PiBasis { thresholds: vec![8.0, 17.0, 31.0], floor: 0.0, virgin: f64::INFINITY, falls: false };
    let whole = std::slice::from_ref(&(0..input.len())).to_vec();
    let columns = plays.columns(0..4, &input, &whole, &Drag::NONE);
    let output = (0..input.len()).map(|k| columns.iter().map(|c| 0.05 * c[k]).sum()).collect();
    let mut samples = Samples::of_columns(1e-3, input, output);
    let basis = PiBasis::for_samples(&samples);
    fit_settled(&mut samples, &basis, &FitOptions::default(), &String::new).unwrap();
    assert!(samples.pasts[0].is_empty());
}
