//! Tests of the parameters of the dynamic Preisach model and the names in their errors.

use super::*;

/// Parameters in the form of files give the same model.
#[test]
fn parameters_build_the_model() {
    let classical = map(0.0);
    let mut preisach = PreisachParams {
        low: 0.0,
        high: HIGH,
        cells: CELLS,
        rest: 0.0,
        density: vec![0.0; CELLS * (CELLS + 1) / 2],
        once: vec![0.0; CELLS],
    };
    let volts = |k: usize| 5.0 * k as f64;
    preisach.set_surface(|i, j| classical.value(volts(i), volts(j)), |i| classical.virgin(volts(i))).unwrap();
    let mut params = DpmParams {
        preisach,
        mirror: MirrorParams::on_printed_grid(
            (0..72).map(|k| soft(2e3 * f64::from(k / 9 + 1), -80.0 + 20.0 * f64::from(k % 9))).collect(),
        ),
        fade: 20.0,
    };
    let built: Model = params.build(&PERIOD).unwrap();
    let (mut s, e) = (built.state(), Env::default());
    built.reset(&mut s, &e, 0.0);
    let u = lines(&[0.0, 70.0, 10.0, 60.0, 20.0, 80.0, 0.0], 20);
    for (u, y) in u.iter().zip(run(&model(0.0, 20.0, soft), 0.0, &u)) {
        assert!((built.step(&mut s, &e, *u) - y).abs() < 1e-12);
    }
    let mut visited = 0;
    params.visit(&mut |_, _| visited += 1);
    assert_eq!(visited, 3 + 136 + 16 + 4 + 72 + 1);
    params.fade = -1.0;
    let built: Result<Model, _> = params.build(&PERIOD);
    assert!(matches!(built, Err(Error::OutOfRange { name: "dpm.fade", .. })));
}

/// Errors of the parts have the names of this model.
#[test]
fn errors_of_the_parts_use_the_names_of_this_model() {
    let good = DpmParams {
        preisach: PreisachParams {
            low: 0.0,
            high: 80.0,
            cells: 1,
            rest: 0.0,
            density: [1.0].to_vec(),
            once: [0.0].to_vec(),
        },
        mirror: MirrorParams {
            rate_low: 1.0,
            rate_high: 2.0,
            rates: 2,
            change_low: -1.0,
            change_high: 1.0,
            changes: 1,
            weights: [1.0; 2].to_vec(),
        },
        fade: 20.0,
    };
    let built: Result<Model, _> = good.build(&PERIOD);
    assert!(built.is_ok());
    let changes: [fn(&mut DpmParams<Vec<f64>>); 17] = [
        |p| p.preisach.low = f64::NAN,
        |p| p.preisach.high = -1.0,
        |p| p.preisach.rest = f64::NAN,
        |p| (p.preisach.cells, p.preisach.density, p.preisach.once) = (0, Vec::new(), Vec::new()),
        |p| (p.preisach.cells, p.preisach.density, p.preisach.once) = (99, vec![1.0; 4950], vec![0.0; 99]),
        |p| p.preisach.cells = 2,
        |p| p.preisach.density[0] = -1.0,
        |p| p.preisach.once[0] = -2.0,
        |p| p.mirror.rate_low = 0.0,
        |p| p.mirror.rate_high = 0.5,
        |p| (p.mirror.rates, p.mirror.weights) = (99, vec![1.0; 99]),
        |p| (p.mirror.changes, p.mirror.weights) = (0, Vec::new()),
        |p| p.mirror.changes = 2,
        |p| p.mirror.change_low = f64::NAN,
        |p| p.mirror.change_high = -2.0,
        |p| p.mirror.weights[0] = 0.0,
        |p| p.mirror.weights[0] = f64::NAN,
    ];
    for (k, change) in changes.into_iter().enumerate() {
        let mut params = good.clone();
        change(&mut params);
        let built: Result<Model, _> = params.build(&PERIOD);
        let message = std::format!("{}", built.unwrap_err());
        let part = if k < 8 { "preisach" } else { "mirror" };
        let words = message.matches(part).count();
        assert!(words > 0 && words == message.matches(&std::format!("dpm.{part}")).count(), "{message}");
    }
}
