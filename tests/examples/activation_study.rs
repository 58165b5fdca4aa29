//! Five activation-function models and Bouc-Wen on a simulated actuator, 24 cases:
//! `cargo run --release -p hyst-tests --example activation_study [SEED]`.

use hyst_ident::compare::Compared;
use hyst_tests::activation_study::{Case, HERTZ, MODELS, PAPERS_EVALUATIONS, VOLTS, ranking, run};

/// Name and value of a column in the paper's figures and tables.
type Figure = (&'static str, fn(&Compared) -> f64);

const FIGURES: [Figure; 4] = [
    ("RMSE [µm]", |m| m.train.errors.rmse),
    ("MAPE, without |y| below 1 % of span", |m| m.train.mape.ratio.unwrap_or(f64::NAN)),
    ("SMAPE", |m| m.train.smape),
    ("time of identification [s]", |m| m.fit_seconds),
];

fn main() {
    let seed = std::env::args().nth(1).and_then(|s| s.parse().ok()).unwrap_or(1);
    let cases = run(seed, PAPERS_EVALUATIONS);
    for (name, figure) in FIGURES {
        print!("\n{name:38}");
        MODELS.iter().for_each(|kind| print!("{:>10}", kind.name()));
        println!();
        for Case { volts, hz, models } in &cases {
            print!("{:38}", format!("0-{volts}-0 V, {hz} Hz"));
            models.iter().for_each(|m| print!("{:10.4}", figure(m)));
            println!();
        }
        print!("{:38}", "mean");
        let mean = |k: usize| cases.iter().map(|c| figure(&c.models[k])).sum::<f64>() / cases.len() as f64;
        (0..MODELS.len()).for_each(|k| print!("{:10.4}", mean(k)));
        println!();
    }
    println!(
        "\nof {} cases, number with the smallest RMSE, with the largest RMSE, and with an undetermined γ:",
        VOLTS.len() * HERTZ.len()
    );
    for (k, kind) in MODELS.iter().enumerate() {
        let best = cases.iter().filter(|c| ranking(c).first() == Some(kind)).count();
        let worst = cases.iter().filter(|c| ranking(c).last() == Some(kind)).count();
        let undetermined =
            |c: &&Case| c.models[k].undetermined.as_ref().is_some_and(|names| names.iter().any(|n| n == "gamma"));
        println!("{:12}{best:6}{worst:6}{:6}", kind.name(), cases.iter().filter(undetermined).count());
    }
}
