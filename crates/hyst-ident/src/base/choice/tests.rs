//! Few elements are found at their places, and a smooth density keeps even ones.

use super::*;
use crate::base::play_column;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Play operators of ± 50 V with these thresholds and weights in addition to a part without hysteresis, and noise
/// with standard deviation `sigma`.
fn samples(plays: &[(f64, f64)], sigma: f64) -> Samples {
    let rows = 4000;
    let input: Vec<f64> =
        (0..rows).map(|k| f64::from(k) / 4000.0).map(|x| 50.0 * (3.0 * x).sin() * (97.0 * x).sin()).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut output: Vec<f64> =
        input.iter().map(|u| 0.1 * u + sigma * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0)).collect();
    let whole = 0..input.len();
    let segments = Vec::from([whole]);
    for (r, w) in plays {
        output.iter_mut().zip(play_column(&input, &segments, *r)).for_each(|(y, p)| *y += w * p);
    }
    Samples::of_columns(1e-3, input, output)
}

/// Calls `ask` with a bank of play operators.
fn asked<T>(samples: &Samples, ask: impl Fn(&Bank<'_>) -> T) -> T {
    let element =
        |r: &[f64]| -> Vec<Vec<f64>> { r.iter().map(|r| play_column(&samples.input, &samples.segments, *r)).collect() };
    let candidates = (1..=CANDIDATES).map(|i| 50.0 * i as f64 / (CANDIDATES + 1) as f64).collect();
    ask(&Bank::new(samples, vec![(samples.input.clone(), Bounds::above(0.0))], candidates, &element, ROWS))
}

fn even(count: u32) -> Vec<f64> {
    (1..=count).map(|i| 50.0 * f64::from(i) / f64::from(count + 1)).collect()
}

#[test]
fn few_play_operators_between_candidates_are_located() {
    let truth = [(3.3, 0.03), (11.7, 0.05), (38.2, 0.02)];
    let samples = samples(&truth, 0.01);
    for found in [asked(&samples, |b| b.at_most(10)).unwrap(), asked(&samples, |b| b.better_than(&even(9))).unwrap()] {
        assert_eq!(found.len(), 3, "{found:?}");
        for (found, (r, _)) in found.iter().zip(truth) {
            assert!((found - r).abs() < 0.1, "{found} {r}");
        }
    }
    let two = asked(&samples, |b| b.at_most(2)).unwrap();
    assert!(two.len() == 2 && (3.3..11.7).contains(&two[0]) && (two[1] - 38.2).abs() < 3.0, "{two:?}");
}

#[test]
fn a_smooth_density_keeps_even_thresholds() {
    let dense: Vec<(f64, f64)> = even(200).into_iter().map(|r| (r, 0.002 * (-r / 30.0).exp())).collect();
    let samples = samples(&dense, 0.01);
    assert_eq!(asked(&samples, |b| b.better_than(&even(15))), None);
    let chosen = asked(&samples, |b| b.at_most(6)).unwrap();
    assert!(chosen.len() <= 6 && chosen.is_sorted(), "{chosen:?}");
    let left = |places: &[f64]| asked(&samples, |b| b.left_out(places)).unwrap();
    assert!(left(&chosen) < left(&even(6)), "{chosen:?}");
}

#[test]
fn elements_that_the_record_cannot_separate_are_merged() {
    // All candidates from 20 V on give the same output.
    let samples = samples(&[(20.0, 0.05)], 0.01);
    let element = |r: &[f64]| -> Vec<Vec<f64>> {
        r.iter().map(|r| play_column(&samples.input, &samples.segments, r.min(20.0))).collect()
    };
    let candidates = even(CANDIDATES as u32);
    let bank = Bank::new(&samples, vec![(samples.input.clone(), Bounds::above(0.0))], candidates, &element, ROWS);
    assert_eq!(bank.at_most(10).unwrap().len(), 1);
}
