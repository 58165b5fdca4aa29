//! `diagnose`: findings that agree with simulations, the extended model, and the printed text.

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
    for part in ["explained in part by lag", "train  before", "test   before", "±", "noise floor", "remainder:"] {
        assert!(ran.stdout.contains(part), "\"{part}\" is missing in: {}", ran.stdout);
    }
    assert_eq!(ran.stderr, "");
    assert!(
        ran.stdout.contains("\nnext: ") && ran.stdout.contains("\n  hystctl fit train.csv --model preisach"),
        "{}",
        ran.stdout
    );
    let findings: Value = serde_json::from_str(&lab.read("findings.json")).unwrap();
    assert_eq!(findings["schema"], "hyst.findings/2");
    assert_eq!(findings["verdict"], "explained");
    assert_eq!(findings["effects"].as_array().unwrap().len(), 1);
    let lag = &findings["effects"][0];
    assert_eq!(lag["name"], "lag");
    let seconds = lag["parameters"]["seconds"]["value"].as_f64().unwrap();
    assert!((seconds - 0.01).abs() < 2e-4, "{seconds}");
    assert_eq!((&lag["kind"], &lag["law"]), (&"linear-dynamics".into(), &"first-order".into()));
    assert!((0.9..=1.0).contains(&lag["probability"].as_f64().unwrap()), "{lag}");
    // For each other effect, either its limit of detection or the reason why it is not visible.
    let limits = findings["limits"].as_object().unwrap();
    assert!(!limits.contains_key("lag") && limits["load"]["not_visible"].is_string(), "{limits:?}");
    assert!(limits["drift"]["size"].as_f64().unwrap() > 0.0 && limits["drift"]["unit"] == "um", "{limits:?}");
    let rows = &findings["rows"];
    let left_out: u64 = rows["left_out"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum();
    let all = lab.read("train.csv").lines().count() as u64 - 1;
    assert_eq!(rows["used"].as_u64().unwrap() + left_out, all, "{rows}");

    // The errors before and after are those of simulations of the same files.
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
    assert!(piped.stderr.contains("explained in part by lag"), "{}", piped.stderr);
}

#[test]
fn unsuitable_test_records_are_reported() {
    let lab = lab();
    let ran = lab.ok("diagnose test.csv --model model.json --json");
    assert_eq!(ran.json()["schema"], "hyst.findings/2");
    assert!(ran.stderr.contains("was not fitted to test.csv"), "{}", ran.stderr);
    let ran = lab.ok("diagnose train.csv --test train.csv --model model.json");
    assert!(ran.stderr.contains("do not hold for new data"), "{}", ran.stderr);
    // Drives of different seeds have the same sines and triangles.
    lab.excite("u3.csv", 3);
    lab.ok("run --daq sim:plant.toml --drive u3.csv --record alike.csv --seed 5");
    let ran = lab.ok("diagnose train.csv --test alike.csv --model model.json");
    assert!(ran.stderr.contains("repeat a segment"), "{}", ran.stderr);
}

/// If the gain or the zero has changed since the fit, a finer base does not help.
#[test]
fn a_changed_device_and_a_changed_zero_are_reported() {
    let lab = lab();
    lab.ok("diagnose train.csv --model model.json -o extended.json");
    let record = lab.read("test.csv");
    let moved = |name: &str, of: &dyn Fn(f64) -> f64| {
        let mut lines = record.lines();
        let head = lines.next().unwrap();
        let column = head.split(',').position(|name| name == "displacement_um").unwrap();
        let mut text = format!("{head}\n");
        for line in lines {
            let mut cells: Vec<String> = line.split(',').map(ToOwned::to_owned).collect();
            cells[column] = of(cells[column].parse().unwrap()).to_string();
            text += &format!("{}\n", cells.join(","));
        }
        lab.write(name, &text);
    };
    moved("tired.csv", &|y| 0.9 * y);
    moved("zeroed.csv", &|y| y + 2.0);
    let number = |text: &str, behind: &str| -> f64 {
        let from = text.find(behind).unwrap_or_else(|| panic!("no \"{behind}\" in: {text}")) + behind.len();
        text[from..].split_whitespace().next().unwrap().parse().unwrap()
    };

    let ran = lab.ok("diagnose tired.csv --model extended.json -o same.json --findings tired.json");
    let findings: Value = serde_json::from_str(&lab.read("tired.json")).unwrap();
    assert!(ran.stdout.starts_with("changed: the device"), "{}", ran.stdout);
    assert_eq!((&findings["verdict"], &findings["remainder"]["change"]), (&"base-too-coarse".into(), &"device".into()));
    assert!((number(&ran.stdout, "its output is ") - 0.9).abs() < 0.01, "{}", ran.stdout);
    assert!(ran.stdout.contains("  hystctl fit tired.csv --model pi -o refitted.json"), "{}", ran.stdout);
    assert!(ran.stdout.contains("unchanged model, no effect was added: same.json"), "{}", ran.stdout);
    assert_eq!(lab.read("same.json"), lab.read("extended.json"));
    // The advised command works.
    lab.ok("fit tired.csv --model pi -o refitted.json");
    lab.ok("diagnose tired.csv --model refitted.json --findings tired.json");
    let findings: Value = serde_json::from_str(&lab.read("tired.json")).unwrap();
    assert_eq!(findings["effects"][0]["name"], "lag");

    let ran = lab.ok("diagnose zeroed.csv --model extended.json --findings zeroed.json");
    let findings: Value = serde_json::from_str(&lab.read("zeroed.json")).unwrap();
    assert!(ran.stdout.starts_with("changed: the sensor zero"), "{}", ran.stdout);
    assert_eq!((&findings["verdict"], &findings["remainder"]["change"]), (&"base-too-coarse".into(), &"zero".into()));
    assert!((number(&ran.stdout, "zero differs by ") - 2.0).abs() < 0.1, "{}", ran.stdout);
    let advised = "hystctl diagnose zeroed.csv --zero per-record --model extended.json";
    assert!(ran.stdout.contains(advised), "{}", ran.stdout);
    let findings = lab.ok("diagnose zeroed.csv --zero per-record --model extended.json --json").json();
    assert_eq!(findings["remainder"]["change"], Value::Null);
}

/// A model of small loops does not describe large ones, although the device is the same.
#[test]
fn a_record_beyond_the_range_of_the_fit_is_not_a_changed_device() {
    let lab = lab();
    lab.ok("excite identification --low 0 --high 30 --rate 1000 -o small.csv");
    lab.ok("run --daq sim:plant.toml --drive small.csv --record small-train.csv");
    lab.ok("fit small-train.csv --model pi -o small.json");
    lab.ok("diagnose small-train.csv --model small.json -o small-extended.json");
    let ran = lab.ok("diagnose train.csv --model small-extended.json --json");
    assert_eq!(ran.json()["remainder"]["change"], Value::Null, "{ran:?}");
    assert!(ran.stdout.contains("beyond the fitted range of 0 to 30.00 V"), "{}", ran.stdout);
}

#[test]
fn outputs_must_not_share_a_file() {
    let lab = lab();
    for (outputs, part) in [
        ("-o model.json", "the same command reads this file"),
        ("-o train.csv", "the same command reads this file"),
        ("--test test.csv -o test.csv", "the same command reads this file"),
        ("-o a.json --findings a.json", "two outputs"),
        ("-o - --findings -", "both go to stdout"),
        ("-o - --json", "--json"),
        ("-o absent/a.json", "does not exist"),
        ("-o .", "folder"),
    ] {
        let message = lab.fails(&format!("diagnose train.csv --model model.json {outputs}"), 2);
        assert!(message.contains(part), "\"{part}\" is missing in: {message}");
    }
}

#[test]
fn a_bad_test_record_writes_nothing() {
    let lab = lab();
    lab.write("bad.csv", "time_s,voltage_v,displacement_um\n0,1,2\n0.002,1,x\n");
    let message =
        lab.fails("diagnose train.csv --test bad.csv --model model.json -o extended.json --findings f.json", 2);
    assert!(message.contains("bad.csv, line 3, column \"displacement_um\""), "{message}");
}

#[test]
#[cfg_attr(not(records), ignore = "no records: set HYST_DATA, see CONTRIBUTING.md")]
fn the_lag_of_a_practice_record_is_named() {
    let data = data();
    let lab = Lab::new();
    let file = |name: &str| data.join("practice/04-lag").join(name).display().to_string();
    let (train, test) = (file("train.csv"), file("test.csv"));
    lab.ok(&format!("fit {train} --model pi -o model.json"));
    let findings = lab.ok(&format!("diagnose {train} --test {test} --model model.json --json")).json();
    assert_eq!(findings["effects"][0]["name"], "lag", "{findings}");
    assert!(findings["after"]["test"]["nrmse_percent"].as_f64().unwrap() < 0.2, "{findings}");
}

#[test]
fn auto_selects_the_kind_that_explains_the_record() {
    let lab = lab();
    let ran = lab.ok("diagnose train.csv --test test.csv --model auto -o auto.json --json");
    let findings = ran.json();
    assert_eq!(findings["effects"][0]["name"], "lag", "{findings}");
    // Auto must select the kind that is advised for pi.
    let of_pi = lab.ok("diagnose train.csv --test test.csv --model model.json --json").json();
    let advised = &of_pi["base_advice"];
    let expected = advised["model"].as_str().unwrap_or("pi");
    assert_eq!(findings["base"], expected, "{advised}");
    let error = |f: &Value| f["after"]["test"]["rmse"].as_f64().unwrap();
    assert!(error(&findings) <= error(&of_pi), "{findings}");
    assert!(lab.read("auto.json").contains("\"lag\""));
}
