//! LFDM, IFM and Bouc-Wen as models of the free displacement in a force observer on a simulated actuator:
//! `cargo run --release -p hyst-tests --example force_study [SEED]`.

use hyst_tests::force_study::{Observed, STIFFNESS, run};

fn main() {
    let seed = std::env::args().nth(1).and_then(|s| s.parse().ok()).unwrap_or(1);
    let study = run(seed, 15.0, None);
    println!("test: 5, 10, 15, 20 and 30 Hz summed, span {:.2} µm; best model first", study.span);
    println!(
        "{:12}{:>12}{:>12}{:>12}{:>12}{:>12}",
        "", "RMSE [µm]", "of span [%]", "PV [µm]", "of span [%]", "train RMSE"
    );
    for Observed { model, .. } in &study.models {
        let test = model.test.expect("a test record was given");
        println!(
            "{:12}{:12.4}{:12.2}{:12.4}{:12.2}{:12.4}",
            model.kind.name(),
            test.errors.rmse,
            test.errors.nrmse_percent,
            test.peak_to_valley,
            100.0 * test.peak_to_valley / study.span,
            model.train.errors.rmse
        );
    }
    println!("\nforce of up to {:.2} N on {STIFFNESS} N/µm", study.force);
    println!("{:12}{:>12}{:>12}{:>14}{:>12}{:>12}", "", "kappa", "chi [µm]", "k_out [N/µm]", "RMS [N]", "largest [N]");
    for Observed { model, affine: (kappa, chi), stiffness, force: (rms, largest) } in &study.models {
        println!("{:12}{kappa:12.4}{chi:12.4}{stiffness:14.4}{rms:12.4}{largest:12.4}", model.kind.name());
    }
}
