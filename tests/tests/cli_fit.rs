//! `fit`: the files it writes, its report, and the files it does not change.

use hyst_tests::{Lab, column, data};
use serde_json::Value;

#[test]
fn a_model_is_written_and_reported() {
    let lab = Lab::with_train("");
    for kind in ["pi", "preisach"] {
        let ran = lab.ok(&format!("fit train.csv --model {kind} -o {kind}.json"));
        for part in [kind, "1769 rows", "RMSE", "µm", "% of span"] {
            assert!(ran.stdout.contains(part), "\"{part}\" is missing in: {}", ran.stdout);
        }
        assert_eq!(ran.stderr, "");
        let model: Value = serde_json::from_str(&lab.read(&format!("{kind}.json"))).unwrap();
        assert_eq!(model["schema"], "hyst.model/1");
        assert_eq!(model["kind"], kind);
        assert_eq!(model["fitted_on"][0]["file"], "train.csv");
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let lab = Lab::with_train("");
    for kind in ["pi", "preisach"] {
        lab.ok(&format!("fit train.csv --model {kind} --seed 7 -o a.json"));
        lab.ok(&format!("fit train.csv --model {kind} --seed 7 -o b.json"));
        assert_eq!(lab.read("a.json"), lab.read("b.json"));
        lab.ok(&format!("fit train.csv --model {kind} --seed 8 -o b.json"));
        assert_eq!(lab.read("a.json").replace("\"seed\": 7", "\"seed\": 8"), lab.read("b.json"));
    }
}

#[test]
fn the_report_as_json_agrees_with_a_simulation() {
    let lab = Lab::with_train("");
    let report = lab.ok("fit train.csv --model pi -o model.json --json").json();
    assert_eq!(report["rows"], 1769);
    assert_eq!(report["unit"], "um");
    assert!(report["base"]["p0"].as_f64().unwrap() > 0.0);
    let simulated = lab.ok("simulate --model model.json train.csv -o out.csv --json").json();
    assert_eq!(report["errors"], simulated["errors"]);
    assert_eq!(report["settling_rows"], simulated["settling_rows"]);
}

#[test]
fn standard_errors_are_reported_and_stored() {
    let lab = Lab::with_train("");
    let report = lab.ok("fit train.csv --model pi -o pi.json --json").json();
    let estimate = &report["estimate"];
    let (parameters, held) = (estimate["parameters"].as_array().unwrap(), estimate["held"].as_array().unwrap());
    let plays = report["base"]["plays"].as_u64().unwrap() as usize;
    assert_eq!(parameters.len() + held.len(), 1 + plays + 1, "gain, weights and the zero: {estimate}");
    assert_eq!(estimate["correlations"].as_array().unwrap().len(), parameters.len());
    let model: Value = serde_json::from_str(&lab.read("pi.json")).unwrap();
    for p in parameters {
        let stored = match p["name"].as_str().unwrap() {
            "zero" => &model["zero_std_error"],
            name => &model["stages"][0]["std_errors"][name],
        };
        assert!(*stored == p["std_error"] && stored.as_f64().unwrap() > 0.0, "{p}: {stored}");
    }
    // A file with standard errors can be read.
    lab.ok("simulate --model pi.json train.csv -o out.csv");
    let ran = lab.ok("fit train.csv --model pi -o pi.json");
    for part in ["  weights[0] ", "  zero ", " ± ", "at a bound: "] {
        assert!(ran.stdout.contains(part), "\"{part}\" is missing in: {}", ran.stdout);
    }

    let report = lab.ok("fit train.csv --model preisach -o preisach.json --json").json();
    let cells = &report["tables"][0];
    assert_eq!(report["estimate"], Value::Null);
    assert_eq!(cells["std_errors"].as_array().unwrap().len() as u64, cells["elements"].as_u64().unwrap());
    let ran = lab.ok("fit train.csv --model preisach -o preisach.json");
    let line = format!("the record determines {} of {} cells", cells["determined"], cells["elements"]);
    assert!(ran.stdout.contains(&line), "{line}: {}", ran.stdout);
}

#[test]
fn thresholds_and_widths_are_chosen_by_the_record() {
    let lab = Lab::with_train("");
    let plain = lab.ok("fit train.csv --model pi -o plain.json --json").json();
    // A smooth density: the default of even thresholds.
    assert_eq!(plain["base"]["plays"], 20);
    let report = lab.ok("fit train.csv --model pi --thresholds 3 -o few.json --json").json();
    let plays = report["base"]["plays"].as_u64().unwrap();
    assert!((1..=3).contains(&plays), "{report}");
    assert!(report["how"].as_str().unwrap().contains("thresholds chosen by the record (3 at most)"), "{report}");
    let estimate = report["estimate"]["parameters"].as_array().unwrap();
    assert!(estimate.iter().any(|p| p["name"].as_str().unwrap().starts_with("thresholds")), "{report}");
    for (line, part) in [
        ("--model preisach --thresholds 3", "preisach: a number of thresholds applies only to the convex fit of pi"),
        ("--model pi --optimizer de --seed 1 --thresholds 3", "elements"),
        ("--model pi --elements 3", "give a number of thresholds"),
        ("--model preisach --elements 3", "a number of elements applies only to gpi"),
        ("--model pi --thresholds 0", "1 to 64"),
        ("--model dpm --thresholds 4", "dpm: a number of thresholds"),
    ] {
        let message = lab.fails(&format!("fit train.csv {line} -o no.json"), 2);
        assert!(message.contains(part), "{line}: {message}");
    }
    let report = lab.ok("fit train.csv --model maxwell-slip --elements 3 -o slip.json --json").json();
    assert!(report["how"].as_str().unwrap().contains("widths chosen by the record"), "{report}");
    let model: Value = serde_json::from_str(&lab.read("slip.json")).unwrap();
    assert!((1..=3).contains(&model["stages"][0]["widths"].as_array().unwrap().len()), "{model}");
}

#[test]
fn a_dash_sends_the_model_to_stdout_and_the_report_to_stderr() {
    let lab = Lab::with_train("");
    let ran = lab.ok("fit train.csv --model pi -o -");
    assert_eq!(ran.json()["kind"], "pi");
    assert!(ran.stderr.contains("RMSE"), "{}", ran.stderr);
    let message = lab.fails("fit train.csv --model pi -o - --json", 2);
    assert!(message.contains("--json"), "{message}");
}

#[test]
fn columns_can_have_other_names() {
    let lab = Lab::with_train("");
    lab.ok("fit train.csv --model pi -o a.json");
    lab.write("other.csv", lab.read("train.csv").replace("voltage_v,displacement_um", "Vin,pos"));
    lab.ok("fit other.csv --model pi --map voltage_v=Vin --map displacement_um=pos -o b.json");
    let stages = |name: &str| serde_json::from_str::<Value>(&lab.read(name)).unwrap()["stages"].clone();
    assert_eq!(stages("a.json"), stages("b.json"));
}

#[test]
fn several_records_are_fitted_as_one() {
    let lab = Lab::with_train("");
    // The same record with another zero: one zero for each file removes it.
    let train = lab.read("train.csv");
    let volts = column(&train, "voltage_v");
    let moved: Vec<f64> = column(&train, "displacement_um").iter().map(|y| y + 5.0).collect();
    let mut text = String::from("segment,time_s,voltage_v,displacement_um\n");
    let (labels, times) = (column(&train, "segment"), column(&train, "time_s"));
    for k in 0..volts.len() {
        text.push_str(&format!("{},{:.3},{},{}\n", labels[k], times[k], volts[k], moved[k]));
    }
    lab.write("moved.csv", text);
    let fit = |options: &str| {
        let report = lab.ok(&format!("fit train.csv moved.csv --model pi -o m.json --json {options}")).json();
        assert_eq!(report["rows"], 2 * 1769);
        report["errors"]["rmse"].as_f64().unwrap()
    };
    let (one, own) = (fit(""), fit("--zero per-record"));
    assert!((own * own + 2.5 * 2.5).sqrt() < 1.05 * one, "{own} {one}");
}

#[test]
fn inputs_are_never_overwritten() {
    let lab = Lab::with_train("");
    for output in ["train.csv", "./train.csv"] {
        let message = lab.fails(&format!("fit train.csv --model pi -o {output}"), 2);
        assert!(message.contains("the same command reads this file"), "{message}");
    }
    let message = lab.fails("fit train.csv --model pi -o absent/model.json", 2);
    assert!(message.contains("absent/model.json") && message.contains("does not exist"), "{message}");
}

#[test]
fn a_failed_fit_keeps_the_previous_model() {
    let lab = Lab::with_model();
    lab.write("bad.csv", "time_s,voltage_v,displacement_um\n0,1,x\n");
    lab.fails("fit bad.csv --model pi -o model.json", 2);
}

#[test]
#[cfg_attr(not(records), ignore = "no records: set HYST_DATA, see CONTRIBUTING.md")]
fn measured_records_are_fitted() {
    let data = data();
    let lab = Lab::new();
    let train = data.join("measured/micromanipulator-train.csv");
    let report = lab.ok(&format!("fit {} --model preisach -o model.json --json", train.display())).json();
    assert!(report["errors"]["nrmse_percent"].as_f64().unwrap() < 2.0, "{report}");
    assert_eq!(report["rows"], 8027);
}

#[test]
fn the_trace_of_a_search_has_every_trial() {
    let lab = Lab::with_train("");
    let search = "--model bouc-wen --optimizer pso --seed 3 --trials 3 --evaluations 400";
    let report = lab.ok(&format!("fit train.csv {search} --trace t.csv --picture t.svg -o model.json --json")).json();
    let trace = lab.read("t.csv");
    assert_eq!(
        trace.lines().next().unwrap().split(',').take(4).collect::<Vec<_>>(),
        ["trial", "generation", "evaluations", "cost"]
    );
    let columns = ["trial", "generation", "evaluations", "cost", "gamma/beta"].map(|name| column(&trace, name));
    let [trial, generation, evaluations, cost, ratio] = &columns;
    assert!(trial.is_sorted() && trial.last() == Some(&2.0));
    assert!(ratio.windows(2).any(|w| w[0] != w[1]), "the search changes the parameter");
    let mut ends = Vec::new();
    for k in 0..trial.len() {
        if k + 1 < trial.len() && trial[k + 1] == trial[k] {
            assert!(
                cost[k + 1] <= cost[k]
                    && generation[k + 1] == generation[k] + 1.0
                    && evaluations[k + 1] > evaluations[k]
            );
        } else {
            ends.push(cost[k]);
            assert!(evaluations[k] <= 400.0);
        }
    }
    ends.sort_by(f64::total_cmp);
    let costs = &report["trials"]["costs"];
    assert_eq!([&costs["lowest"], &costs["median"], &costs["highest"]].map(|c| c.as_f64().unwrap()), ends[..]);
    let svg = lab.read("t.svg");
    for part in ["</svg>", "best trial", "other trials", "final costs", "beta", "evaluations"] {
        assert!(svg.contains(part), "{part} is not in the figure");
    }
    lab.ok(&format!("fit train.csv {search} --trace again.csv -o model.json"));
    assert_eq!(trace, lab.read("again.csv"));
    let message = lab.fails("fit train.csv --model pi --trace no.csv -o no.json", 2);
    assert!(message.contains("--trace") && message.contains("without"), "{message}");
}
