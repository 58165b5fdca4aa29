//! `simulate`: the columns of the record, the prediction, and the errors.

use hyst_tests::{Lab, WARM, column, data};

#[test]
fn columns_of_the_record_are_copied_unchanged() {
    let lab = Lab::with_model();
    // Unusual notation, an unused column and a quoted comment are not changed.
    let odd: Vec<String> = lab
        .read("train.csv")
        .lines()
        .enumerate()
        .map(|(k, line)| match k {
            0 => format!("{line},note"),
            1 => format!("{line}00,\"a, \"\"b\"\"\""),
            _ => format!("{line},{k}"),
        })
        .collect();
    lab.write("odd.csv", odd.join("\n"));
    let ran = lab.ok("simulate --model model.json odd.csv -o out.csv");
    assert_eq!(ran.stdout, "");
    assert!(ran.stderr.contains("RMSE") && ran.stderr.contains("% of span"), "{}", ran.stderr);
    let out = lab.read("out.csv");
    assert_eq!(out.lines().count(), odd.len());
    assert_eq!(out.lines().next().unwrap(), format!("{},predicted_um,settling", odd[0]));
    for (before, after) in odd.iter().zip(out.lines()) {
        assert!(after.starts_with(&format!("{before},")), "{before}\n{after}");
        assert_eq!(after[before.len() + 1..].split(',').count(), 2);
    }
}

#[test]
fn the_errors_are_those_of_the_columns() {
    let lab = Lab::with_model();
    let report = lab.ok("simulate --model model.json train.csv -o out.csv --json").json();
    let out = lab.read("out.csv");
    let (measured, predicted) = (column(&out, "displacement_um"), column(&out, "predicted_um"));
    let settling = column(&out, "settling");
    assert!(settling.iter().all(|flag| *flag == 0.0 || *flag == 1.0));
    let squares: Vec<f64> = measured
        .iter()
        .zip(&predicted)
        .zip(&settling)
        .filter(|(_, settling)| **settling == 0.0)
        .map(|((y, p), _)| (y - p).powi(2))
        .collect();
    let rmse = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    assert!((report["errors"]["rmse"].as_f64().unwrap() / rmse - 1.0).abs() < 1e-9);
    assert_eq!(report["rows"].as_u64().unwrap() as usize, measured.len());
    let settled: Vec<f64> = measured.iter().zip(&settling).filter(|(_, s)| **s == 0.0).map(|(y, _)| *y).collect();
    let span = settled.iter().fold(f64::MIN, |m, y| m.max(*y)) - settled.iter().fold(f64::MAX, |m, y| m.min(*y));
    let near_zero = settled.iter().filter(|y| y.abs() < 0.01 * span).count();
    assert!(near_zero > 0, "the record rests at zero");
    assert_eq!(report["mape"]["left_out"].as_u64().unwrap() as usize, near_zero);
    assert!(report["mape"]["ratio"].as_f64().unwrap() < 1.0, "{report}");
}

#[test]
fn without_a_file_the_csv_goes_to_stdout() {
    let lab = Lab::with_model();
    let ran = lab.ok("simulate --model model.json train.csv");
    lab.ok("simulate --model model.json train.csv -o out.csv");
    assert_eq!(ran.stdout, lab.read("out.csv"));
    assert!(ran.stderr.contains("RMSE"), "{}", ran.stderr);
    assert_eq!(lab.ok("simulate --model model.json train.csv -o -").stdout, ran.stdout);
    lab.fails("simulate --model model.json train.csv --json", 2);
}

#[test]
fn a_drive_without_output_is_predicted_too() {
    let lab = Lab::with_model();
    let ran = lab.ok("simulate --model model.json u.csv -o out.csv --zero per-record");
    assert!(!ran.stderr.contains("RMSE") && ran.stderr.contains("no effect"), "{}", ran.stderr);
    assert!(lab.read("out.csv").starts_with("segment,time_s,voltage_v,predicted_um,settling\n"));
    let report = lab.ok("simulate --model model.json u.csv -o out.csv --json").json();
    assert!(report["errors"].is_null());
}

#[test]
fn an_older_prediction_is_replaced_with_a_note() {
    let lab = Lab::with_model();
    lab.ok("simulate --model model.json train.csv -o once.csv");
    let ran = lab.ok("simulate --model model.json once.csv -o twice.csv");
    assert!(ran.stderr.contains("predicted_um and settling"), "{}", ran.stderr);
    assert_eq!(lab.read("once.csv"), lab.read("twice.csv"));
}

#[test]
fn a_zero_per_record_removes_the_mean_error() {
    let lab = Lab::with_model();
    let rmse = |options: &str| {
        let line = format!("simulate --model model.json train.csv -o out.csv --json {options}");
        lab.ok(&line).json()["errors"]["rmse"].as_f64().unwrap()
    };
    assert!(rmse("--zero per-record") <= rmse("--zero none") * (1.0 + 1e-9));
    assert_eq!(rmse(""), rmse("--zero none"));
}

#[test]
fn records_unsuitable_for_the_model_are_rejected() {
    let lab = Lab::with_model();
    let record = lab.read("train.csv");
    for (from, to, parts) in [
        ("displacement_um", "displacement_nm", ["displacement_um", "displacement_nm"]),
        ("voltage_v", "force_in_n", ["voltage_v", "--map"]),
    ] {
        lab.write("other.csv", record.replace(from, to));
        let message = lab.fails("simulate --model model.json other.csv -o out.csv", 2);
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    }
    let message = lab.fails("simulate --model model.json train.csv -o train.csv", 2);
    assert!(message.contains("the same command reads this file"), "{message}");
}

#[test]
fn a_model_with_temperature_needs_a_temperature() {
    let lab = Lab::with_train(WARM);
    lab.ok("fit train.csv --model pi -o model.json");
    lab.ok("diagnose train.csv --model model.json -o extended.json");
    lab.ok("simulate --model extended.json train.csv -o out.csv");
    lab.write("cold.csv", without_last_column(&lab.read("train.csv")));
    let message = lab.fails("simulate --model extended.json cold.csv -o cold-out.csv", 2);
    for part in ["temperature_degc", "cold.csv", "--temperature"] {
        assert!(message.contains(part), "\"{part}\" is missing in: {message}");
    }
    lab.reference("reference.csv", 1.0, 12.0);
    let message = lab.fails("compensate --model extended.json reference.csv -o drive.csv", 2);
    assert!(message.contains("temperature_degc"), "{message}");
    lab.ok("compensate --model extended.json reference.csv --temperature 23.5 -o drive.csv");
}

#[test]
fn a_constant_temperature_replaces_a_column() {
    let lab = Lab::with_train(WARM);
    lab.ok("fit train.csv --model pi -o model.json");
    lab.ok("diagnose train.csv --model model.json -o extended.json");
    let cold = without_last_column(&lab.read("train.csv"));
    let with = |degc: &str| {
        let column = |(k, line): (usize, &str)| format!("{line},{}", if k == 0 { "temperature_degc" } else { degc });
        cold.lines().enumerate().map(column).collect::<Vec<_>>().join("\n")
    };
    lab.write("cold.csv", &cold);
    lab.write("column.csv", with("19.5"));
    let predicted = |line: &str| {
        lab.ok(&format!("simulate --model extended.json {line} -o out.csv"));
        column(&lab.read("out.csv"), "predicted_um")
    };
    let given = predicted("cold.csv --temperature 19.5");
    assert_eq!(
        lab.read("out.csv").lines().next(),
        Some("segment,time_s,voltage_v,displacement_um,predicted_um,settling")
    );
    assert_eq!(given, predicted("column.csv"));
    assert_ne!(given, predicted("cold.csv --temperature -3"));
    // An existing column is kept, with a note.
    let ran = lab.ok("simulate --model extended.json column.csv --temperature 30 -o out.csv");
    assert!(ran.stderr.contains("column.csv has temperature_degc"), "{}", ran.stderr);
    assert_eq!(column(&lab.read("out.csv"), "predicted_um"), given);
    let ran = lab.ok("simulate --model model.json cold.csv --temperature 30 -o out.csv");
    assert!(ran.stderr.contains("does not depend on temperature"), "{}", ran.stderr);
    lab.fails("simulate --model extended.json cold.csv -o out2.csv --temperature warm", 2);
}

#[test]
fn inputs_beyond_the_models_range_are_reported() {
    let lab = Lab::with_model();
    let within = lab.ok("simulate --model model.json train.csv -o out.csv");
    assert!(!within.stderr.contains("warning"), "{}", within.stderr);
    lab.ok("excite sine --rate 500 --low -20 --high 130 --cycles 1 -o far.csv");
    let model: serde_json::Value = serde_json::from_str(&lab.read("model.json")).unwrap();
    let end = |end: &str| model["input"][end].as_f64().unwrap();
    let beyond: Vec<f64> = column(&lab.read("far.csv"), "voltage_v")
        .iter()
        .map(|u| (u - end("high")).max(end("low") - u))
        .filter(|beyond| *beyond > 0.0)
        .collect();
    let largest = beyond.iter().copied().fold(0.0, f64::max);
    assert!(largest > 29.0 && beyond.len() > 100, "{largest} {}", beyond.len());
    let ran = lab.ok("simulate --model model.json far.csv -o out.csv --json");
    let warning = format!("warning: in {} rows the input is outside 0 to 100.0 V", beyond.len());
    assert!(ran.stderr.contains(&warning), "{}", ran.stderr);
    let report = &ran.json()["extrapolated"];
    assert_eq!((report["rows"].as_u64(), report["largest"].as_f64()), (Some(beyond.len() as u64), Some(largest)));
    assert!(ran.stderr.contains(&format!("(row {})", report["row"])), "{report} {}", ran.stderr);
    let ran = lab.ok("simulate --model model.json far.csv -o out.csv");
    assert!(ran.stderr.contains("written: out.csv"), "{}", ran.stderr);
}

fn without_last_column(csv: &str) -> String {
    csv.lines().map(|line| line.rsplit_once(',').map_or(line, |(rest, _)| rest)).collect::<Vec<_>>().join("\n")
}

#[test]
#[cfg_attr(not(records), ignore = "no records: set HYST_DATA, see CONTRIBUTING.md")]
fn measured_records_are_simulated() {
    let data = data();
    let lab = Lab::new();
    let file = |name: &str| data.join("measured").join(name).display().to_string();
    let (train, test) = (file("micromanipulator-train.csv"), file("micromanipulator-test.csv"));
    lab.ok(&format!("fit {train} --model preisach -o model.json"));
    let report = lab.ok(&format!("simulate --model model.json {test} --zero per-record -o out.csv --json")).json();
    assert!(report["errors"]["nrmse_percent"].as_f64().unwrap() < 2.0, "{report}");
    assert_eq!(report["zeros"].as_array().unwrap().len(), 1);
}
