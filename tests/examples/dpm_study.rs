//! The classical and the dynamic Preisach model on a simulated force actuator whose relays have viscous walls:
//! `cargo run --release -p hyst-tests --example dpm_study [SEED]`.

use hyst_tests::dpm_study::run;

fn main() {
    let seed = std::env::args().nth(1).and_then(|s| s.parse().ok()).unwrap_or(1);
    let study = run(seed);
    let r = &study.report;
    println!(
        "mirror function: {:.3} to {:.3}, fade {:.1} V, {} of 72 nodes untouched",
        r.xi[0],
        r.xi[1],
        r.fade,
        r.untouched.len()
    );
    let left_out = r.rmse_left_out.unwrap_or(f64::NAN);
    println!(
        "calibration: RMSE {:.4} N classical, {:.4} N dynamic, {left_out:.4} N cross-validated",
        r.rmse_classical, r.rmse
    );
    println!("\n{:32}{:>10}{:>10}{:>10}{:>12}", "prediction, RMSE [N]", "CPM", "CPM all", "DPM", "DPM / CPM");
    for row in &study.rows {
        let [slow, all, dynamic] = row.predicted;
        println!("{:32}{slow:10.4}{all:10.4}{dynamic:10.4}{:12.3}", row.name, dynamic / slow);
    }
    println!("\n{:32}{:>10}{:>10}{:>10}{:>12}", "tracking, RMSE [N]", "none", "CPM", "DPM", "DPM / none");
    for row in &study.rows {
        let [none, classical, dynamic] = row.tracked;
        println!("{:32}{none:10.4}{classical:10.4}{dynamic:10.4}{:12.3}", row.name, dynamic / none);
    }
}
