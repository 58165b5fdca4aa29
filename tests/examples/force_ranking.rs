//! A random force, found through IFM, LFDM, Bouc-Wen and an extended chain as free models:
//! `cargo run --release -p hyst-tests --example force_ranking [SEED]`.

use hyst_tests::force_ranking::{Ranked, run};

fn main() {
    let seed = std::env::args().nth(1).and_then(|s| s.parse().ok()).unwrap_or(1);
    let ranking = run(seed, 2000);
    println!("a force of {:.2} N (RMS) at an end of 2 N/µm; best model first", ranking.force);
    println!("{:24}{:>14}{:>10}{:>10}{:>12}{:>12}", "", "free [µm]", "kappa", "chi [µm]", "RMS [N]", "largest [N]");
    for Ranked { name, free_rmse, affine: (kappa, chi), rmse, max } in &ranking.models {
        println!("{name:24}{free_rmse:14.4}{kappa:10.4}{chi:10.4}{rmse:12.4}{max:12.4}");
    }
}
