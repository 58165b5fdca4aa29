//! `fit` by search: the number of threads changes nothing, and what cannot be searched is named.

use hyst_tests::{Lab, Ran};

#[test]
fn the_number_of_threads_changes_no_digit() {
    let lab = Lab::with_train("");
    for (model, options) in [
        ("bouc-wen", "--trials 2 --evaluations 400"),
        ("gpi", "--optimizer gwo --elements 4 --evaluations 200"),
        ("pi", ""),
        ("pi", "--thresholds 4"),
        ("maxwell-slip", ""),
    ] {
        let fitted = |threads: &str| {
            let mut command =
                lab.command(&format!("fit train.csv --model {model} --seed 5 {options} -o m.json --json"));
            let ran: Ran = command.env("RAYON_NUM_THREADS", threads).output().expect("hystctl starts").into();
            assert_eq!(ran.code, 0, "{model}: {}", ran.stderr);
            (ran.stdout, lab.read("m.json"))
        };
        assert!(fitted("1") == fitted("2"), "{model} {options}");
    }
}

#[test]
fn a_search_that_cannot_be_run_is_refused_by_name() {
    let lab = Lab::with_train("");
    for (options, parts) in [
        // The command line's own check, before any file is read.
        ("--bounds alpha=2..1", &["--bounds", "alpha", "(2) has to be below", "(1)"][..]),
        ("--bounds gamma/beta", &["--bounds", "gamma=0.01..5"]),
        ("--optimizer de", &["--optimizer de", "--seed"]),
        // What only the model and the record can tell.
        ("--bounds alpha=1..2", &["alpha", "bouc-wen", "gamma/beta"]),
        ("--bounds gamma/beta=0..inf", &["train.csv", "gamma/beta", "finite range"]),
        ("--population 0", &["train.csv", "population = 0", "at least"]),
        ("--evaluations 0", &["train.csv", "0 evaluations"]),
        ("--trials 0", &["train.csv", "trials = 0", "at least 1"]),
    ] {
        let message = lab.refuses(&format!("fit train.csv --model bouc-wen {options} -o m.json"), 2);
        for part in parts {
            assert!(message.contains(part), "{options}: \"{part}\" is missing in: {message}");
        }
    }
}

#[test]
fn bounds_within_which_no_model_is_finite_are_named() {
    let lab = Lab::with_train("");
    // |γ| above β: the memory of a Bouc-Wen model grows without bound. An order above 1 is none.
    for (model, bounds, said) in
        [("bouc-wen", "gamma/beta=-3..-2", "gamma/beta -3 … -2"), ("lfdm", "alpha=2..3", "alpha 2 … 3")]
    {
        let message = lab.refuses(&format!("fit train.csv --model {model} --bounds {bounds} -o m.json"), 2);
        assert!(message.contains("finite output") && message.contains(said), "{model}: {message}");
    }
}

#[test]
fn a_fit_that_searches_nothing_takes_no_bounds() {
    let lab = Lab::with_train("");
    for model in ["pi", "preisach", "dpm", "maxwell-slip"] {
        let message = lab.refuses(&format!("fit train.csv --model {model} --bounds gamma=1..2 -o m.json"), 2);
        assert!(message.contains("gamma") && message.contains(&format!("{model} has no such variable")), "{message}");
    }
}
