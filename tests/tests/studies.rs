//! The comparisons of the examples `fod_study` and `dpm_study`, on actuators of other seeds.

use hyst_tests::{dpm_study, fod_study};

#[test]
fn half_sine_curves_measure_a_valid_surface_in_a_structure_that_rings_and_triangles_do_not() {
    let study = fod_study::run(12);
    let violated: Vec<usize> = study.surfaces.iter().map(|s| s.report.breaches.len()).collect();
    assert!(violated[0] > 5, "{violated:?}");
    assert_eq!(violated[3], 0, "{violated:?}");
    // The triangular surface has to be moved to be an operator; the half-sine one stays as it is.
    assert!(study.surfaces[0].report.moved.is_some_and(|m| m.largest_sigmas > 3.0));
    assert_eq!(study.surfaces[3].report.moved, None);
    let error: Vec<f64> = study.tracking.iter().map(|t| t.rmse_percent).collect();
    let [none, triangle, half_sine] = [error[0], error[1], error[4]];
    assert!(triangle < none && half_sine < 0.5 * triangle, "{error:?}");
}

#[test]
fn the_dynamic_model_predicts_and_tracks_better_than_the_classical_one_at_every_waveform() {
    let study = dpm_study::run(12);
    assert!(study.report.rmse < 0.6 * study.report.rmse_classical, "{:?}", study.report);
    for row in &study.rows {
        let ([classical, _, dynamic], [none, by_classical, by_dynamic]) = (row.predicted, row.tracked);
        assert!(dynamic <= 0.73 * classical, "{row:?}");
        assert!(by_dynamic <= 0.46 * none && by_dynamic < by_classical, "{row:?}");
    }
}
