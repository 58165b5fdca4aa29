//! `compensate`: the drive, its limits, and the messages about them.

use hyst_tests::{Lab, column};

fn lab() -> Lab {
    let lab = Lab::with_model();
    lab.reference("reference.csv", 2.0, 12.0);
    lab
}

#[test]
fn the_drive_is_a_column_next_to_the_reference() {
    let lab = lab();
    let ran = lab.ok("compensate --model model.json reference.csv -o drive.csv");
    assert_eq!(ran.stdout, "");
    for part in ["1000 rows", "limited by voltage in 0 rows, by slew in 0 rows", "preview 0 samples"] {
        assert!(ran.stderr.contains(part), "\"{part}\" is missing in: {}", ran.stderr);
    }
    let (reference, drive) = (lab.read("reference.csv"), lab.read("drive.csv"));
    assert_eq!(drive.lines().next(), Some("time_s,displacement_um,voltage_v"));
    assert!(reference.lines().zip(drive.lines()).all(|(before, after)| after.starts_with(before)));
    // The model's prediction for the drive is the reference.
    lab.ok("simulate --model model.json drive.csv -o check.csv");
    let check = lab.read("check.csv");
    let (wanted, predicted) = (column(&check, "displacement_um"), column(&check, "predicted_um"));
    assert!(wanted.iter().zip(&predicted).all(|(y, p)| (y - p).abs() < 1e-6));
}

/// The report has the row of the largest error (from 1 in text and JSON), the file of the drive, and the errors with
/// and without the start.
#[test]
fn the_predicted_error_is_reported() {
    let lab = lab();
    lab.ok("diagnose train.csv --model model.json -o extended.json");
    let line = "compensate --model extended.json reference.csv -o drive.csv --limit 0,50";
    let ran = lab.ok(line);
    let missed = &lab.ok(&format!("{line} --json")).json()["missed"];
    assert!(ran.stderr.contains(&format!("at most (row {})", missed["row"])), "{missed} {}", ran.stderr);
    assert!(ran.stderr.contains("written: drive.csv"), "{}", ran.stderr);
    lab.ok("simulate --model extended.json drive.csv -o check.csv");
    let check = lab.read("check.csv");
    let errors: Vec<f64> = column(&check, "displacement_um")
        .iter()
        .zip(column(&check, "predicted_um"))
        .map(|(y, p)| (y - p).abs())
        .collect();
    let row = missed["row"].as_u64().unwrap() as usize;
    assert!(errors.iter().all(|other| *other <= errors[row - 1] + 1e-9), "{missed}");
    let number = |key: &str| missed[key].as_f64().unwrap();
    assert!(number("settled_largest") <= number("largest") && number("settled_rmse") > 0.0, "{missed}");
}

#[test]
fn a_band_beyond_the_sample_rate_names_the_option() {
    let lab = lab();
    lab.write("model.json", hyst_tests::every_stage(&lab.read("model.json")));
    lab.write(
        "reference.csv",
        "time_s,displacement_um,temperature_degc,load_n\n0,4,23,0\n0.002,4,23,0\n0.004,4,23,0\n",
    );
    let message = lab.fails("compensate --model model.json reference.csv -o drive.csv --bandwidth 5000", 2);
    assert!(message.contains("--bandwidth 5000") && message.contains(" 125 Hz"), "{message}");
}

#[test]
fn temperatures_below_absolute_zero_are_rejected() {
    let lab = lab();
    let message = lab.fails("compensate --model model.json reference.csv -o drive.csv --temperature -300", 2);
    assert!(message.contains("--temperature") && message.contains("-273.15"), "{message}");
    lab.write("cold.csv", "time_s,voltage_v,temperature_degc\n0,4,23\n0.002,4,-273.2\n");
    let message = lab.fails("simulate --model model.json cold.csv -o predicted.csv", 2);
    assert!(message.contains("cold.csv, line 3") && message.contains("temperature_degc"), "{message}");
}

#[test]
fn a_misspelt_kind_is_named_with_its_line() {
    let lab = lab();
    let model = lab.read("model.json");
    lab.write("pii.json", model.replacen("\"kind\": \"pi\"", "\"kind\": \"pii\"", 1));
    let message = lab.fails("compensate --model pii.json reference.csv -o drive.csv", 2);
    assert!(message.contains("pii") && message.contains("correct that field"), "{message}");
    assert!(message.matches("line 3").count() == 1 && !message.contains("truncated"), "{message}");
    lab.write("cut.json", &model[..model.len() / 2]);
    let message = lab.fails("compensate --model cut.json reference.csv -o drive.csv", 2);
    assert!(message.contains("truncated"), "{message}");
}

#[test]
fn limits_are_kept_and_reported() {
    let lab = lab();
    let report = lab.ok("compensate --model model.json reference.csv -o drive.csv --limit 0,50 --json").json();
    let volts = column(&lab.read("drive.csv"), "voltage_v");
    assert!(volts.iter().all(|u| (0.0..=50.0).contains(u)));
    let limited = report["voltage_limited_rows"].as_u64().unwrap();
    assert!(limited > 0 && report["highest"] == 50.0, "{report}");

    let report = lab.ok("compensate --model model.json reference.csv -o drive.csv --slew 120 --json").json();
    let volts = column(&lab.read("drive.csv"), "voltage_v");
    assert!(volts.windows(2).all(|w| (w[1] - w[0]).abs() <= 120.0 / 500.0 + 1e-9));
    assert!(report["slew_limited_rows"].as_u64().unwrap() > 0, "{report}");

    let ran = lab.ok("compensate --model model.json reference.csv -o drive.csv --limit 0,50");
    assert!(ran.stderr.contains(&format!("limited by voltage in {limited} rows")), "{}", ran.stderr);
    assert!(ran.stderr.contains("the reference needs more than 50.00 V"), "{}", ran.stderr);
}

#[test]
fn voltage_limits_hold_from_the_first_row_with_a_slew_limit() {
    let lab = lab();
    lab.ok("compensate --model model.json reference.csv -o drive.csv --limit 45,50 --slew 200");
    let volts = column(&lab.read("drive.csv"), "voltage_v");
    assert!(volts.iter().all(|u| (45.0..=50.0).contains(u)), "{:?}", &volts[..5]);
}

#[test]
fn references_out_of_reach_are_rejected() {
    let lab = lab();
    lab.reference("far.csv", 1.0, 400.0);
    let message = lab.fails("compensate --model model.json far.csv -o drive.csv", 2);
    for part in ["far.csv", "row", "time", "µm", "scale or shift"] {
        assert!(message.contains(part), "\"{part}\" is missing in: {message}");
    }
    lab.write("nothing.csv", "time_s,voltage_v\n0,1\n0.002,2\n");
    let message = lab.fails("compensate --model model.json nothing.csv -o drive.csv", 2);
    assert!(message.contains("nothing.csv, line 1"), "{message}");
    lab.write("other.csv", lab.read("reference.csv").replace("displacement_um", "displacement_mm"));
    let message = lab.fails("compensate --model model.json other.csv -o drive.csv", 2);
    assert!(message.contains("displacement_um"), "{message}");
}

#[test]
fn options_out_of_range_are_rejected() {
    let lab = lab();
    for options in ["--limit 50,0", "--limit 50", "--slew 0", "--slew -5", "--bandwidth 0", "--limit 0,nan"] {
        lab.fails(&format!("compensate --model model.json reference.csv -o drive.csv {options}"), 2);
    }
    lab.fails("compensate --model model.json reference.csv -o - --json", 2);
    lab.fails("compensate --model model.json reference.csv -o reference.csv", 2);
    lab.fails("compensate --model model.json reference.csv -o model.json", 2);
}

#[test]
fn a_drive_in_the_reference_is_replaced_only_in_the_copy() {
    let lab = lab();
    let before = lab.read("train.csv");
    let ran = lab.ok("compensate --model model.json train.csv -o drive.csv");
    assert!(ran.stderr.contains("train.csv already has voltage_v"), "{}", ran.stderr);
    assert_eq!(lab.read("train.csv"), before);
    let drive = lab.read("drive.csv");
    assert_eq!(drive.lines().next(), Some("segment,time_s,displacement_um,voltage_v"));
    assert_ne!(column(&drive, "voltage_v"), column(&before, "voltage_v"));
}

#[test]
fn a_dash_sends_the_drive_to_stdout() {
    let lab = lab();
    lab.ok("compensate --model model.json reference.csv -o drive.csv");
    assert_eq!(lab.ok("compensate --model model.json reference.csv -o -").stdout, lab.read("drive.csv"));
}

#[test]
fn a_sensor_drift_is_not_compensated() {
    let lab = lab();
    let model = lab.read("model.json");
    let drift = r#"{ "stage": "drift", "per_second": 0.02, "units": { "per_second": "um/s" } }"#;
    let end = model.rfind(']').unwrap();
    lab.write("drift.json", format!("{},{drift}{}", model[..end].trim_end(), &model[end..]));
    let ran = lab.ok("compensate --model drift.json reference.csv -o drive.csv");
    assert!(ran.stderr.contains("drift is in the sensor"), "{}", ran.stderr);
    let report = lab.ok("compensate --model drift.json reference.csv -o drift.csv --json").json();
    assert_eq!(report["not_compensated"], serde_json::json!(["drift"]));
    lab.ok("compensate --model model.json reference.csv -o plain.csv");
    assert_eq!(lab.read("plain.csv"), lab.read("drift.csv"));
}

#[test]
fn lead_and_bandwidth_are_stated() {
    let lab = lab();
    lab.ok("diagnose train.csv --model model.json -o extended.json");
    let report = lab.ok("compensate --model extended.json reference.csv -o drive.csv --json").json();
    assert!(report["lead_samples"].as_u64().unwrap() > 0, "{report}");
    let band = report["bandwidth_hz"].as_f64().unwrap();
    assert!(band > 0.0 && report["band_error"].as_f64().unwrap() < 0.1, "{report}");
    let narrow = lab.ok("compensate --model extended.json reference.csv -o drive.csv --bandwidth 20 --json").json();
    assert!(narrow["bandwidth_hz"].as_f64().unwrap() <= band, "{narrow}");
}

#[test]
fn a_drive_beyond_the_fitted_range_is_reported() {
    let lab = Lab::with_model();
    lab.reference("reference.csv", 2.0, 24.0);
    let line = "compensate --model model.json reference.csv -o drive.csv --limit 0,150";
    let ran = lab.ok(line);
    assert!(ran.stderr.contains("the drive is outside 0 to 100.0 V"), "{}", ran.stderr);
    let found = &lab.ok(&format!("{line} --json")).json()["extrapolated"];
    let rows = found["rows"].as_u64().unwrap();
    assert!((1..1000).contains(&rows) && found["largest"].as_f64().unwrap() > 5.0, "{found}");
    lab.reference("reference.csv", 2.0, 15.0);
    assert!(!lab.ok(line).stderr.contains("the drive is outside"));
}
