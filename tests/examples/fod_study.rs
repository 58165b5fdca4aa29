//! Triangular against half-sine descent curves on a simulated actuator in a structure that rings; draws fod-study.svg:
//! `cargo run --release -p hyst-tests --example fod_study [SEED [SVG]]`.

use hyst_tests::fod_study::run;

fn main() {
    let mut args = std::env::args().skip(1);
    let seed = args.next().and_then(|s| s.parse().ok()).unwrap_or(1);
    let study = run(seed);
    println!("structure's phase at 10 Hz {:.1} deg\n", study.phase_deg);
    println!("{:28}{:>10}{:>14}{:>14}{:>14}", "surface", "violated", "worst [N]", "worst [σ]", "moved [N]");
    for s in &study.surfaces {
        let worst = s.report.breaches.first();
        let number = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.1}"));
        println!(
            "{:28}{:>10}{:>14}{:>14}{:>14}",
            s.name,
            s.report.breaches.len(),
            number(worst.map(|b| b.by)),
            number(worst.map(|b| b.sigmas)),
            number(s.report.moved.map(|m| m.largest)),
        );
    }
    println!("\n{:28}{:>24}", "drive for a 10 Hz sine", "RMS error, % of swing");
    for t in &study.tracking {
        println!("{:28}{:24.3}", t.name, t.rmse_percent);
    }
}
