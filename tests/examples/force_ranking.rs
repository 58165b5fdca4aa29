//! Estimates a random force with IFM, LFDM, Bouc-Wen, PI and an extended chain as models of the free actuator:
//! `cargo run --release -p hyst-tests --example force_ranking [SEED]`.

use hyst_tests::force_ranking::{Ranked, run};

fn main() {
    let seed = std::env::args().nth(1).and_then(|s| s.parse().ok()).unwrap_or(1);
    let ranking = run(seed, 2000);
    println!("force {:.2} N RMS, stiffness of the end 2 N/µm; best model first", ranking.force);
    println!("{:24}{:>14}{:>10}{:>10}{:>12}{:>12}", "", "free [µm]", "kappa", "chi [µm]", "RMS [N]", "largest [N]");
    for Ranked { name, free_rmse, affine: (kappa, chi), rmse, max } in &ranking.models {
        println!("{name:24}{free_rmse:14.4}{kappa:10.4}{chi:10.4}{rmse:12.4}{max:12.4}");
    }
}
