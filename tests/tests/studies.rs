//! The comparisons of the examples, on actuators with other seeds.

use hyst_ident::model::Kind;
use hyst_tests::{activation_study, control_study, dpm_study, fod_study, force_ranking, force_study};

#[test]
fn half_sine_curves_give_a_valid_surface_in_a_resonant_structure_and_triangles_do_not() {
    let study = fod_study::run(12);
    let violated: Vec<usize> = study.surfaces.iter().map(|s| s.report.breaches.len()).collect();
    assert!(violated[0] > 5, "{violated:?}");
    assert_eq!(violated[3], 0, "{violated:?}");
    // The triangular surface must be moved to be valid, the half-sine surface not.
    assert!(study.surfaces[0].report.moved.is_some_and(|m| m.largest_sigmas > 3.0));
    assert_eq!(study.surfaces[3].report.moved, None);
    let error: Vec<f64> = study.tracking.iter().map(|t| t.rmse_percent).collect();
    let [none, triangle, half_sine] = [error[0], error[1], error[4]];
    assert!(triangle < none && half_sine < 0.5 * triangle, "{error:?}");
}

#[test]
fn the_dynamic_model_predicts_and_tracks_better_than_the_classical_model_for_every_waveform() {
    let study = dpm_study::run(12);
    assert!(study.report.rmse < 0.6 * study.report.rmse_classical, "{:?}", study.report);
    for row in &study.rows {
        let ([classical, _, dynamic], [none, by_classical, by_dynamic]) = (row.predicted, row.tracked);
        assert!(dynamic <= 0.73 * classical, "{row:?}");
        assert!(by_dynamic <= 0.46 * none && by_dynamic < by_classical, "{row:?}");
    }
}

#[test]
fn a_force_is_estimated_with_each_of_the_three_models() {
    let study = force_study::run(12, 9.0, Some(300));
    assert_eq!(study.models.len(), 3);
    let rmse: Vec<f64> = study.models.iter().map(|m| m.model.test.unwrap().errors.rmse).collect();
    assert!(rmse.is_sorted(), "{rmse:?}");
    for m in &study.models {
        let (kappa, chi) = m.affine;
        let (rms, largest) = m.force;
        // Two of the models are linear: their error in the loops appears as force. An estimate of zero has the error 1.
        let (tolerance, share) = if m.model.kind == Kind::BoucWen { (0.1, 0.5) } else { (0.4, 1.0) };
        let what = format!("{}: {:?} {} {:?} of {}", m.model.kind, m.affine, m.stiffness, m.force, study.force);
        assert!((kappa - 1.0).abs() < tolerance && chi.abs() < tolerance * study.span, "{what}");
        assert!((m.stiffness / force_study::STIFFNESS - 1.0).abs() < tolerance, "{what}");
        assert!(rms <= largest && largest < share * study.force, "{what}");
    }
    assert_eq!(study.models[0].model.kind, Kind::BoucWen, "the model with loops has the smallest error");
    let again = force_study::run(12, 9.0, Some(300));
    let numbers = |s: &force_study::ForceStudy| {
        s.models.iter().map(|m| (m.model.kind, m.affine, m.stiffness, m.force)).collect::<Vec<_>>()
    };
    assert_eq!(numbers(&study), numbers(&again));
}

/// Tests of a minute or more. `cargo xtask test` skips them; `cargo xtask test --long` and `cargo test` run them.
mod long {
    use super::*;

    #[test]
    fn pid_with_inverse_is_better_than_either_beyond_the_bandwidth_of_the_pid() {
        let study = control_study::run(12);
        assert!(study.pid_hz > 1.0, "{}", study.gains);
        for row in &study.rows {
            let [gain, base, extended, pid, both] = [0, 1, 2, 3, 4].map(|k| row.errors[k].rmse);
            assert!(extended < base && extended < gain, "{}: {:?}", row.name, row.errors);
            if row.band_hz > study.pid_hz {
                assert!(both < pid && both < extended, "{}: {:?}", row.name, row.errors);
            }
        }
        assert!(study.rows.iter().any(|row| row.band_hz > study.pid_hz), "{}", study.pid_hz);
    }

    #[test]
    fn the_extended_chain_estimates_a_force_best() {
        let ranking = force_ranking::run(5, 300);
        assert_eq!(ranking.models.len(), 5);
        let best = &ranking.models[0];
        assert!(best.name.starts_with("pi + "), "{ranking:?}");
        assert!(best.rmse < 0.25 * ranking.force, "{ranking:?}");
        // The base without its extension and the other models have larger errors.
        assert!(ranking.models[1..].iter().all(|m| m.rmse > 1.5 * best.rmse), "{ranking:?}");
    }

    #[test]
    fn every_activation_model_has_finite_errors_in_all_24_cases() {
        let cases = activation_study::run(12, 90);
        assert_eq!(cases.len(), 24);
        for case in &cases {
            let kinds: Vec<_> = case.models.iter().map(|m| m.kind).collect();
            assert_eq!(kinds, activation_study::MODELS, "{} V, {} Hz", case.volts, case.hz);
            for m in &case.models {
                let f = m.train;
                let figures =
                    [f.errors.rmse, f.errors.max_abs, f.peak_to_valley, f.smape, f.mape.ratio.unwrap(), m.fit_seconds];
                assert!(figures.iter().all(|x| x.is_finite() && *x > 0.0), "{} V, {} Hz: {m:?}", case.volts, case.hz);
                // Not worse than a straight line on such a loop.
                assert!(f.errors.nrmse_percent < 10.0, "{} V, {} Hz: {m:?}", case.volts, case.hz);
            }
        }
        let again = activation_study::run(12, 90);
        let order = |cases: &[activation_study::Case]| cases.iter().map(activation_study::ranking).collect::<Vec<_>>();
        assert_eq!(order(&cases), order(&again));
    }
}
