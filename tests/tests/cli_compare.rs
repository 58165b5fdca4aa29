//! `compare`: every model on one record.

use hyst_tests::{Lab, WARM};
use serde_json::Value;

/// Returns a lab with `train.csv` and, from another drive, `test.csv`.
fn lab(more: &str) -> Lab {
    let lab = Lab::with_train(more);
    lab.excite_for_test("v.csv");
    lab.ok("run --daq sim:plant.toml --drive v.csv --record test.csv");
    lab
}

fn names(list: &Value) -> Vec<&str> {
    list.as_array().unwrap().iter().map(|m| m["model"].as_str().unwrap()).collect()
}

fn number(v: &Value) -> f64 {
    v.as_f64().unwrap_or_else(|| panic!("{v} is not a number"))
}

/// Returns the report without the times, which differ between runs.
fn without_times(mut report: Value) -> Value {
    for m in report["models"].as_array_mut().unwrap() {
        assert!(number(&m.as_object_mut().unwrap().remove("fit_seconds").unwrap()) >= 0.0);
    }
    report
}

#[test]
fn proposed_commands_have_the_same_reading_options() {
    let lab = Lab::with_train("");
    let printed = lab.ok("compare train.csv --models pi --map voltage_v=voltage_v --zero per-record --seed 3").stdout;
    let reading = "train.csv --map voltage_v=voltage_v --zero per-record";
    for command in [
        format!("hystctl fit {reading} --model pi --seed 3 -o model.json"),
        format!("hystctl diagnose {reading} --model model.json"),
    ] {
        assert!(printed.contains(&command), "\"{command}\" is missing in: {printed}");
    }
}

#[test]
fn every_model_is_fitted_or_skipped_with_the_reason() {
    let lab = lab("");
    let report = lab.ok("compare train.csv --test test.csv --evaluations 200 --json").json();
    let (models, skipped) = (names(&report["models"]), names(&report["skipped"]));
    assert_eq!(models.len() + skipped.len(), 16, "{models:?} {skipped:?}");
    for kind in ["td-pi", "td-em"] {
        let entry = report["skipped"].as_array().unwrap().iter().find(|s| s["model"] == kind);
        let reason = entry.unwrap_or_else(|| panic!("{kind} is not skipped: {skipped:?}"))["reason"].as_str().unwrap();
        assert!(reason.contains("temperature_degc"), "{kind}: {reason}");
    }
    assert_eq!(report["sorted_by"], "test-rmse");
    let rmse: Vec<f64> = report["models"].as_array().unwrap().iter().map(|m| number(&m["test"]["rmse"])).collect();
    assert!(rmse.is_sorted(), "{rmse:?}");
    for m in report["models"].as_array().unwrap() {
        for record in ["train", "test"] {
            let f = &m[record];
            let [rmse, max, pv] = ["rmse", "max_abs", "peak_to_valley"].map(|key| number(&f[key]));
            assert!(0.0 < rmse && rmse <= max && max <= pv && pv <= 2.0 * max, "{m}");
            assert!(number(&f["nrmse_percent"]) > 0.0 && number(&f["mape"]["ratio"]) > 0.0, "{m}");
            assert!((0.0..2.0).contains(&number(&f["smape"])) && f["mape"]["left_out"].is_u64(), "{m}");
        }
        assert!(m["parameters"].as_u64().unwrap() >= 3, "{m}");
    }
    let find = |kind: &str| &report["models"].as_array().unwrap()[models.iter().position(|m| *m == kind).unwrap()];
    assert_eq!(find("tanh")["parameters"], 4);
    assert_eq!(find("bouc-wen")["parameters"], 4);
    assert_eq!(find("pi")["parameters"], 21);
    // Slope and gap of the right side, gain, 16 weights.
    assert_eq!(find("gpi")["parameters"], 19);
    for kind in ["tanh", "pi"] {
        assert!(find(kind)["undetermined"].is_array() && find(kind)["tables"].is_null(), "{}", find(kind));
    }
    // Cells are counted, not named.
    assert_eq!(find("preisach")["undetermined"], Value::Null);
    let cells = &find("preisach")["tables"][0];
    let sum = ["determined", "held", "untouched"].map(|key| cells[key].as_u64().unwrap()).iter().sum::<u64>();
    assert!(cells["of"] == "cells" && cells["elements"] == find("preisach")["parameters"] && sum <= 324, "{cells}");
}

#[test]
fn a_temperature_column_enables_the_temperature_models() {
    let lab = lab(WARM);
    let report = lab.ok("compare train.csv --models td-pi,td-em,pi --evaluations 300 --json").json();
    let mut models = names(&report["models"]);
    models.sort_unstable();
    assert_eq!(models, ["pi", "td-em", "td-pi"]);
    for m in report["models"].as_array().unwrap() {
        // Conventions and dependent parameters are not counted.
        let (parameters, how) = (&m["parameters"], m["how"].as_str().unwrap());
        match m["model"].as_str().unwrap() {
            "td-pi" => assert_eq!(*parameters, 7),
            "td-em" => {
                assert_eq!(*parameters, 13);
                assert!(how.contains("mass, stiffness") && how.contains("are those of the published tube"), "{how}");
            }
            _ => assert_eq!(*parameters, 21),
        }
    }
    assert_eq!(report["skipped"], Value::Array(Vec::new()));
}

#[test]
fn errors_are_those_of_fit_and_simulate_and_the_test_record_changes_no_fit() {
    let lab = lab("");
    let models = "--models bouc-wen,tanh,pi";
    let tested = without_times(lab.ok(&format!("compare train.csv --test test.csv {models} --json")).json());
    assert_eq!(tested, without_times(lab.ok(&format!("compare train.csv --test test.csv {models} --json")).json()));
    let alone = without_times(lab.ok(&format!("compare train.csv {models} --json")).json());
    assert_eq!(alone["sorted_by"], "train-rmse");
    for m in alone["models"].as_array().unwrap() {
        assert_eq!(m["test"], Value::Null);
        let same = tested["models"].as_array().unwrap().iter().find(|t| t["model"] == m["model"]).unwrap();
        assert_eq!((&m["train"], &m["evaluations"], &m["how"]), (&same["train"], &same["evaluations"], &same["how"]));
        let kind = m["model"].as_str().unwrap();
        let fit = lab.ok(&format!("fit train.csv --model {kind} -o {kind}.json --json")).json();
        let test = lab.ok(&format!("simulate --model {kind}.json test.csv -o out.csv --json")).json();
        // Without start-up rows, all models are judged by all rows.
        assert_eq!((&tested["settling_rows"], &tested["test_settling_rows"]), (&0.into(), &0.into()));
        for key in ["rmse", "nrmse_percent", "max_abs", "rmse_all_rows"] {
            assert_eq!(m["train"][key], fit["errors"][key], "{kind} {key}");
            assert_eq!(same["test"][key], test["errors"][key], "{kind} {key}");
        }
        assert_eq!(same["test"]["mape"], test["mape"], "{kind}");
    }
    let other = lab.ok(&format!("compare train.csv {models} --seed 2 --json")).json();
    assert_eq!(other["seed"], 2);
}

#[test]
fn the_text_states_the_sorting_and_the_skipped_models() {
    let lab = lab("");
    let ran = lab.ok("compare train.csv --test test.csv --models tanh,pi,preisach,td-pi --evaluations 200");
    assert_eq!(ran.stderr, "");
    for part in [
        "RMSE",
        "SMAPE",
        "MAPE",
        "PV",
        "params",
        "sorted by RMSE on the test record",
        "skipped td-pi: train.csv",
        "preisach: the record determines",
    ] {
        assert!(ran.stdout.contains(part), "\"{part}\" is missing in: {}", ran.stdout);
    }
    let at = |name: &str| ran.stdout.lines().position(|line| line.starts_with(&format!("{name} "))).unwrap();
    assert!(at("pi") < at("tanh"), "{}", ran.stdout);
    assert!(ran.stdout.contains("tanh: not determined by the record: "), "{}", ran.stdout);
    let alone = lab.ok("compare train.csv --models pi").stdout;
    assert!(alone.contains("sorted by RMSE on the training record"), "{alone}");
}

#[test]
fn the_figure_has_a_panel_for_every_model() {
    let lab = lab("");
    for test in ["", "--test test.csv"] {
        lab.ok(&format!("compare train.csv {test} --models pi,tanh,bouc-wen --evaluations 200 --picture c.svg"));
        let svg = lab.read("c.svg");
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        for name in ["pi, RMS", "tanh, RMS", "bouc-wen, RMS", "pi (", "RMSE [µm]"] {
            assert!(svg.contains(name), "{name} is not in the figure");
        }
        assert_eq!(svg.contains("test record"), !test.is_empty());
    }
}

#[test]
fn unsuitable_models_and_files_are_rejected_by_name() {
    let lab = Lab::with_train("");
    let message = lab.fails("compare train.csv --models pi,preisch", 2);
    assert!(message.contains("preisch") && message.contains("preisach"), "{message}");
    let message = lab.fails("compare train.csv --models td-pi,td-em", 2);
    assert!(message.contains("temperature_degc"), "{message}");
    let message = lab.fails("compare train.csv --models pi --picture train.csv", 2);
    assert!(message.contains("train.csv"), "{message}");
    let message = lab.fails("compare train.csv --test u.csv --models pi", 2);
    assert!(message.contains("displacement_um"), "{message}");
    let message = lab.fails("compare train.csv --models pi --picture - --json", 2);
    assert!(message.contains("stdout"), "{message}");
}
