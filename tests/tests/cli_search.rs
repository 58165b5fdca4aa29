//! `fit` by search: the result does not depend on the number of threads, and impossible searches are rejected.

use hyst_tests::{Lab, Ran};

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
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
fn impossible_searches_are_rejected_with_the_option() {
    let lab = Lab::with_train("");
    for (options, parts) in [
        // The command line's own check, before any file is read.
        ("--bounds alpha=2..1", &["--bounds", "alpha", "lower bound 2 must be below", "upper bound 1"][..]),
        ("--bounds gamma/beta", &["--bounds", "gamma=0.01..5"]),
        ("--optimizer de", &["--optimizer de", "--seed"]),
        // Errors that depend on the model and the record.
        ("--bounds alpha=1..2", &["alpha", "bouc-wen", "gamma/beta"]),
        ("--bounds gamma/beta=0..inf", &["train.csv", "gamma/beta", "finite range"]),
        ("--population 0", &["train.csv", "population = 0", "at least"]),
        ("--evaluations 0", &["train.csv", "0 evaluations"]),
        ("--trials 0", &["train.csv", "trials = 0", "at least 1"]),
    ] {
        let message = lab.fails(&format!("fit train.csv --model bouc-wen {options} -o m.json"), 2);
        for part in parts {
            assert!(message.contains(part), "{options}: \"{part}\" is missing in: {message}");
        }
    }
}

#[test]
fn bounds_within_which_no_model_is_finite_are_named() {
    let lab = Lab::with_train("");
    // With |γ| > β the memory of a Bouc-Wen model grows without bound. An order above 1 is invalid.
    for (model, bounds, named) in
        [("bouc-wen", "gamma/beta=-3..-2", "gamma/beta -3 … -2"), ("lfdm", "alpha=2..3", "alpha 2 … 3")]
    {
        let message = lab.fails(&format!("fit train.csv --model {model} --bounds {bounds} -o m.json"), 2);
        assert!(message.contains("finite output") && message.contains(named), "{model}: {message}");
    }
}

#[test]
fn a_fit_without_search_rejects_bounds() {
    let lab = Lab::with_train("");
    for model in ["pi", "preisach", "dpm", "maxwell-slip"] {
        let message = lab.fails(&format!("fit train.csv --model {model} --bounds gamma=1..2 -o m.json"), 2);
        assert!(message.contains("gamma") && message.contains(&format!("{model} has no such variable")), "{message}");
    }
}

#[test]
fn a_variable_at_its_bound_is_named_with_advice() {
    let lab = Lab::with_train("");
    let free = lab.ok("fit train.csv --model bouc-wen -o m.json --json").json();
    // |γ| is at most β, so no wider bounds are advised.
    let how = free["how"].as_str().unwrap();
    assert!(how.ends_with("; gamma/beta ended at its bound 1"), "{how}");
    let beta = free["estimate"]["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "beta").unwrap();
    let (low, high) = (2.0 * beta["value"].as_f64().unwrap(), 20.0 * beta["value"].as_f64().unwrap());
    let name = "beta |alpha|^(n-1)";
    let mut command = lab.command("fit train.csv --model bouc-wen -o m.json --json");
    let ran: Ran =
        command.args(["--bounds", &format!("{name}={low}..{high}")]).output().expect("hystctl starts").into();
    let report = ran.json();
    let how = report["how"].as_str().unwrap();
    let note = format!("{name} ended at its bound {low}; widen it with --bounds {name}=LOW..HIGH");
    assert!(how.contains(&note), "{note}: {how}");
    assert!(report["estimate"]["held"].as_array().unwrap().contains(&"beta".into()), "{report}");
    // The weights of play operators are held at zero; no search bounds are involved.
    let report = lab.ok("fit train.csv --model gpi --evaluations 300 -o m.json --json").json();
    let held: Vec<&str> = report["estimate"]["held"].as_array().unwrap().iter().filter_map(|n| n.as_str()).collect();
    let parameters = report["estimate"]["parameters"].as_array().unwrap();
    assert!(held.iter().any(|name| name.starts_with("weights")), "{held:?}");
    assert!(parameters.iter().all(|p| !held.contains(&p["name"].as_str().unwrap())));
    assert!(parameters.iter().all(|p| p["value"] != 0.0 || p["determined"] == "near-zero"), "{parameters:?}");
}
