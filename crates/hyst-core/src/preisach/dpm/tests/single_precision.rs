//! Tests of the dynamic Preisach model and its inverse in f32.

use super::*;
use crate::Search;

/// Returns the model with `soft` in f32.
fn single_precision(double: &Model) -> Dpm<f32, 17, 8, 9> {
    let volts = |k: usize| 5.0 * k as f64;
    let map = Everett::from_surface(
        Grid { low: 0.0, high: HIGH, cells: CELLS },
        0.0,
        |i, j| double.map.value(volts(i), volts(j)),
        |i| double.map.virgin(volts(i)),
    );
    Dpm::new(map.unwrap(), Mirror::from_fn(&GRID, soft).unwrap(), 20.0, &PERIOD).unwrap()
}

#[test]
fn single_precision_agrees_with_double() {
    let double = model(0.0, 20.0, soft);
    let nodes: Vec<f64> = (0..72).map(|k| soft(2e3 * f64::from(k / 9 + 1), -80.0 + 20.0 * f64::from(k % 9))).collect();
    let grid = MirrorParams::on_printed_grid(nodes);
    let map = Everett::<f32, 17>::from_surface(
        Grid { low: 0.0, high: HIGH, cells: CELLS },
        0.0,
        |i, j| double.map.value(5.0 * i as f64, 5.0 * j as f64),
        |i| double.map.virgin(5.0 * i as f64),
    );
    let single = Dpm::<f32, 17, 8, 9>::new(map.unwrap(), grid.build(&()).unwrap(), 20.0, &PERIOD).unwrap();
    let e = Env::default();
    let (mut a, mut b) = (double.state(), single.state());
    double.reset(&mut a, &e, 0.0);
    single.reset(&mut b, &Env::default(), 0.0);
    let mut largest = 0.0f64;
    for k in 0..20_000 {
        let t = f64::from(k) * 1e-4;
        let u = 40.0 - 28.0 * libm::cos(232.0 * t) + 11.0 * libm::sin(710.0 * t);
        // The same input for both, which f32 represents exactly.
        let u = u as f32;
        let (y, z) = (double.step(&mut a, &e, f64::from(u)), single.step(&mut b, &Env::default(), u));
        largest = largest.max((y - f64::from(z)).abs());
    }
    assert!(largest < 5e-5 * 14.4, "{largest}");
}

#[test]
fn search_works_in_single_precision() {
    let single = single_precision(&model(0.0, 20.0, soft));
    let inverse = Search::new(single.clone(), -40.0, 120.0, 1e-5).unwrap();
    let (mut s, mut i, e) = (single.state(), inverse.state(), Env::default());
    inverse.reset(&mut i, &e, 0.0);
    single.reset(&mut s, &e, 0.0);
    for k in 0..5000 {
        let t = 1e-4 * k as f32;
        let reference = (t / 0.02).min(1.0) * (5.5 - 3.9 * (200.0 * t).cos() + (900.0 * t).sin());
        let drive = inverse.step(&mut i, &e, reference);
        // The tolerance times 0.3 N/V, plus some units in the last place of 10 N.
        assert!((single.step(&mut s, &e, drive) - reference).abs() < 1e-5, "{k}");
    }
}
