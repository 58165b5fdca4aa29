//! `diagnose`: findings that agree with simulations, an extended model, and what is said.

use hyst_tests::{Lab, data};
use serde_json::Value;

fn lab() -> Lab {
    let lab = Lab::with_model();
    lab.excite_for_test("u2.csv");
    lab.ok("run --daq sim:plant.toml --drive u2.csv --record test.csv");
    lab
}

#[test]
fn a_lag_is_found_named_and_added() {
    let lab = lab();
    let line = "diagnose train.csv --test test.csv --model model.json -o extended.json --findings findings.json";
    let ran = lab.ok(line);
    for part in
        ["explained in part: the model lacks lag", "train  before", "test   before", "±", "noise floor", "remainder:"]
    {
        assert!(ran.stdout.contains(part), "\"{part}\" is missing in: {}", ran.stdout);
    }
    assert_eq!(ran.stderr, "");
    assert!(
        ran.stdout.contains("\nnext: ") && ran.stdout.contains("\n  hystctl fit train.csv --model preisach"),
        "{}",
        ran.stdout
    );
    let findings: Value = serde_json::from_str(&lab.read("findings.json")).unwrap();
    assert_eq!(findings["schema"], "hyst.findings/1");
    assert_eq!(findings["verdict"], "explained");
    assert_eq!(findings["effects"].as_array().unwrap().len(), 1);
    let lag = &findings["effects"][0];
    assert_eq!(lag["name"], "lag");
    let seconds = lag["parameters"]["seconds"]["value"].as_f64().unwrap();
    assert!((seconds - 0.01).abs() < 2e-4, "{seconds}");

    // Before and after are what simulations of the same files give.
    for (model, when) in [("model.json", "before"), ("extended.json", "after")] {
        for record in ["train", "test"] {
            let simulated = lab.ok(&format!("simulate --model {model} {record}.csv -o out.csv --json")).json();
            assert_eq!(findings[when][record], simulated["errors"], "{when} {record}");
        }
    }
    let rmse = |when: &str| findings[when]["test"]["rmse"].as_f64().unwrap();
    assert!(rmse("after") < 0.2 * rmse("before"));

    // The same seed gives the same bytes.
    let piped = lab.ok("diagnose train.csv --test test.csv --model model.json -o again.json --findings -");
    assert_eq!(piped.stdout, lab.read("findings.json"));
    assert_eq!(lab.read("extended.json"), lab.read("again.json"));
    assert!(piped.stderr.contains("the model lacks lag"), "{}", piped.stderr);
}

#[test]
fn files_that_mislead_are_told() {
    let lab = lab();
    let ran = lab.ok("diagnose test.csv --model model.json --json");
    assert_eq!(ran.json()["schema"], "hyst.findings/1");
    assert!(ran.stderr.contains("was not fitted to test.csv"), "{}", ran.stderr);
    let ran = lab.ok("diagnose train.csv --test train.csv --model model.json");
    assert!(ran.stderr.contains("say nothing about new data"), "{}", ran.stderr);
    // The sines and triangles of another seed are the same.
    lab.excite("u3.csv", 3);
    lab.ok("run --daq sim:plant.toml --drive u3.csv --record alike.csv --seed 5");
    let ran = lab.ok("diagnose train.csv --test alike.csv --model model.json");
    assert!(ran.stderr.contains("repeat a segment"), "{}", ran.stderr);
}

#[test]
fn outputs_have_places_of_their_own() {
    let lab = lab();
    for (outputs, part) in [
        ("-o model.json", "read by the same command"),
        ("-o train.csv", "read by the same command"),
        ("--test test.csv -o test.csv", "read by the same command"),
        ("-o a.json --findings a.json", "two outputs"),
        ("-o - --findings -", "both go to stdout"),
        ("-o - --json", "--json"),
        ("-o absent/a.json", "does not exist"),
        ("-o .", "folder"),
    ] {
        let message = lab.refuses(&format!("diagnose train.csv --model model.json {outputs}"), 2);
        assert!(message.contains(part), "\"{part}\" is missing in: {message}");
    }
}

#[test]
fn a_bad_test_record_leaves_nothing() {
    let lab = lab();
    lab.write("bad.csv", "time_s,voltage_v,displacement_um\n0,1,2\n0.002,1,x\n");
    let message =
        lab.refuses("diagnose train.csv --test bad.csv --model model.json -o extended.json --findings f.json", 2);
    assert!(message.contains("bad.csv, line 3, column \"displacement_um\""), "{message}");
}

#[test]
fn practice_records_show_their_effect() {
    let Some(data) = data() else { return };
    let lab = Lab::new();
    let file = |name: &str| data.join("practice/04-lag").join(name).display().to_string();
    let (train, test) = (file("train.csv"), file("test.csv"));
    lab.ok(&format!("fit {train} --model pi -o model.json"));
    let findings = lab.ok(&format!("diagnose {train} --test {test} --model model.json --json")).json();
    assert_eq!(findings["effects"][0]["name"], "lag", "{findings}");
    assert!(findings["after"]["test"]["nrmse_percent"].as_f64().unwrap() < 0.2, "{findings}");
}
