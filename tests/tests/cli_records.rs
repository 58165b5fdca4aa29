//! Every way in which a record can be wrong: the message says where, the exit code is 2, and nothing is written.

use hyst_tests::Lab;

/// Fits `content`, which has to be refused with a message that holds all of `parts`.
#[track_caller]
fn refused(content: impl AsRef<[u8]>, parts: &[&str]) {
    refused_with(content, "", parts);
}

#[track_caller]
fn refused_with(content: impl AsRef<[u8]>, options: &str, parts: &[&str]) {
    let lab = Lab::new();
    lab.write("bad.csv", content);
    let model = if options.contains("--model") { "" } else { "--model pi" };
    let message = lab.refuses(&format!("fit bad.csv {model} -o model.json {options}"), 2);
    for part in parts {
        assert!(message.contains(part), "\"{part}\" is missing in: {message}");
    }
    assert_eq!(lab.files(), ["bad.csv"]);
}

/// A sound record of `rows` rows, line `k + 2` holding row `k`.
fn rows(rows: usize) -> Vec<String> {
    let row = |k: usize| {
        let u = 10.0 * ((k as f64 * 0.05).sin() + 1.0);
        format!("{:.3},{u:.4},{:.5}", k as f64 * 0.002, 0.2 * u)
    };
    (0..rows).map(row).collect()
}

fn with_header(header: &str, rows: &[String]) -> String {
    format!("{header}\n{}\n", rows.join("\n"))
}

const HEADER: &str = "time_s,voltage_v,displacement_um";

/// The sound record with row `at` replaced.
fn spoiled(at: usize, row: &str) -> String {
    let mut rows = rows(40);
    rows[at] = row.to_owned();
    with_header(HEADER, &rows)
}

#[test]
fn files_that_are_no_records() {
    refused("", &["bad.csv, line 1", "empty"]);
    refused(format!("{HEADER}\n"), &["bad.csv", "no rows"]);
    refused("time_s;voltage_v;displacement_um\n0;1;2\n", &["bad.csv, line 1", "';'"]);
    refused("time_s\tvoltage_v\tdisplacement_um\n0\t1\t2\n", &["bad.csv, line 1", "tabs"]);
    refused(b"\xff\xfet\0i\0", &["bad.csv, line 1", "UTF-16"]);
    refused(b"time_s,voltage_v,displacement_um\n0,1,\xb52\n", &["bad.csv, line 2", "byte 5", "UTF-8"]);
    let lab = Lab::new();
    let message = lab.refuses("fit absent.csv --model pi -o model.json", 2);
    assert!(message.contains("absent.csv: cannot be read"), "{message}");
}

#[test]
fn columns_that_are_missing_or_wrong() {
    let rows = rows(40);
    let header = |header: &str, parts: &[&str]| refused(with_header(header, &rows), parts);
    header("a,voltage_v,displacement_um", &["bad.csv, line 1", "the time", "time_s"]);
    header("time_s,a,displacement_um", &["bad.csv, line 1", "the input", "voltage_v", "--map"]);
    header("time_s,voltage_v,a", &["bad.csv, line 1", "the output", "displacement_um"]);
    header("time_min,voltage_v,displacement_um", &["bad.csv, line 1, column \"time_min\"", "time_s"]);
    header("time_s,voltage_mv,displacement_um", &["bad.csv, line 1, column \"voltage_mv\"", "voltage_v"]);
    header("time_s,voltage_v,displacement_m", &["bad.csv, line 1, column \"displacement_m\"", "displacement_um"]);
    header("time_s,voltage_v,voltage_v", &["bad.csv, line 1, column \"voltage_v\"", "same name"]);
    header("time_s,force_n,displacement_um", &["bad.csv, line 1"]);
}

#[test]
fn two_outputs_are_one_too_many() {
    let rows: Vec<String> = rows(40).iter().map(|row| format!("{row},1.5")).collect();
    let header = "time_s,voltage_v,displacement_um,force_n";
    let message = [
        "bad.csv, line 1",
        "displacement_um",
        "force_n",
        "--map",
        "the load that acts on the actuator: --map load_n=force_n",
    ];
    refused(with_header(header, &rows), &message);
}

#[test]
fn values_that_are_no_numbers() {
    refused(spoiled(3, "0.006,abc,1.0"), &["bad.csv, line 5, column \"voltage_v\"", "\"abc\" is not a number"]);
    refused(spoiled(3, "0.006,1.0,"), &["bad.csv, line 5, column \"displacement_um\"", "not a number"]);
    refused(spoiled(4, "0.008,NaN,1.0"), &["bad.csv, line 6, column \"voltage_v\"", "not a finite number"]);
    refused(spoiled(5, "0.010,1.0,inf"), &["bad.csv, line 7, column \"displacement_um\"", "not a finite number"]);
    refused(spoiled(6, "nan,1.0,1.0"), &["bad.csv, line 8, column \"time_s\"", "not a finite number"]);
}

#[test]
fn rows_of_another_length() {
    refused(spoiled(7, "0.014,1.0"), &["bad.csv, line 9", "2 fields", "3 columns"]);
    refused(spoiled(7, "0.014,1.0,1.0,1.0"), &["bad.csv, line 9", "4 fields"]);
    refused(spoiled(7, "0.014,\"1.0,1.0"), &["bad.csv, line 9", "quotation mark"]);
}

#[test]
fn time_that_does_not_run_evenly() {
    refused(spoiled(8, "0.013,1.0,1.0"), &["bad.csv, line 10, column \"time_s\"", "increase"]);
    refused(spoiled(8, "0.0165,1.0,1.0"), &["bad.csv, line 10, column \"time_s\"", "uneven time", "0.0165"]);
    let mut gap = rows(40);
    gap.remove(20);
    refused(with_header(HEADER, &gap), &["bad.csv, line 22, column \"time_s\"", "uneven time"]);
}

#[test]
fn segments_that_make_no_sense() {
    let labelled = |label: fn(usize) -> &'static str| {
        let rows: Vec<String> = rows(40).iter().enumerate().map(|(k, row)| format!("{},{row}", label(k))).collect();
        with_header(&format!("segment,{HEADER}"), &rows)
    };
    refused(labelled(|_| "x"), &["bad.csv, line 2, column \"segment\"", "not an integer"]);
    refused(labelled(|k| ["0", "1", "0", "0"][k / 10]), &["bad.csv, line 22, column \"segment\"", "returns"]);
    refused(
        "segment,time_s,voltage_v,displacement_um\n0,0,1,1\n1,1,2,2\n",
        &["bad.csv, line 3", "no segment has two rows"],
    );
}

#[test]
fn sample_periods_that_a_model_cannot_mix() {
    let mut mixed = String::from("segment,time_s,voltage_v,displacement_um\n");
    (0..200).for_each(|k| mixed.push_str(&format!("0,{:.3},{},{}\n", f64::from(k) * 0.002, k % 37, k % 37)));
    (0..200).for_each(|k| mixed.push_str(&format!("1,{:.3},{},{}\n", 1.0 + f64::from(k) * 0.005, k % 41, k % 41)));
    refused_with(&mixed, "--model dpm", &["bad.csv", "one sample period", "segment 1 has 0.005", "segment 0 0.002"]);
}

#[test]
fn maps_that_lead_nowhere() {
    let sound = with_header(HEADER, &rows(40));
    refused_with(&sound, "--map voltage_v=Vin", &["bad.csv, line 1", "--map voltage_v=Vin", "\"time_s\""]);
    refused_with(&sound, "--map voltage_v", &["--map \"voltage_v\"", "NAME=COLUMN"]);
    refused_with(
        &sound,
        "--map displacement_um=displacement_mm",
        &["only renames", "--map displacement_mm=displacement_mm"],
    );
    refused_with(&sound, "--map displacement_um=-displacement_mm", &["--map displacement_mm=-displacement_mm"]);
    refused_with(&sound, "--map colour=a", &["\"colour\"", "voltage_v"]);
    refused_with(&sound, "--map time_s=time_s --map time_ms=x", &["the time", "keep one"]);
}

#[test]
fn records_that_no_model_can_be_fitted_to() {
    refused(with_header(HEADER, &rows(40)), &["bad.csv", "40", "too few"]);
    let constant = |header: &str, row: fn(usize) -> String| with_header(header, &(0..900).map(row).collect::<Vec<_>>());
    let still = constant(HEADER, |k| format!("{:.3},5,{}", k as f64 * 0.002, k as f64 * 0.01));
    refused(still, &["bad.csv", "voltage_v", "constant (5)"]);
    let stuck = constant(HEADER, |k| format!("{:.3},{},7.5", k as f64 * 0.002, (k % 50) as f64));
    refused(stuck, &["bad.csv", "displacement_um", "constant (7.5)"]);
}

#[test]
fn records_that_do_not_go_together() {
    let lab = Lab::new();
    lab.write("a.csv", with_header(HEADER, &rows(600)));
    lab.write("b.csv", with_header("time_s,voltage_v,displacement_nm", &rows(600)));
    let message = lab.refuses("fit a.csv b.csv --model pi -o model.json", 2);
    for part in ["b.csv, line 1", "the output column", "a.csv", "displacement_nm"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn loops_that_are_passed_the_wrong_way_round_are_told() {
    let lab = Lab::with_train("");
    let said = "runs ahead of the input";
    assert!(!lab.ok("fit train.csv --model pi -o a.json").stderr.contains(said));
    let exchanged = lab.read("train.csv").replacen("voltage_v,displacement_um", "displacement_um,voltage_v", 1);
    lab.write("exchanged.csv", exchanged);
    let ran = lab.ok("fit exchanged.csv --model pi -o b.json");
    assert!(ran.stderr.contains(said) && ran.stderr.contains("exchanged?"), "{}", ran.stderr);
    let turned = "--map displacement_um=-displacement_um";
    let ran = lab.ok(&format!("fit train.csv --model pi -o c.json {turned}"));
    assert!(!ran.stderr.contains(said) && ran.stdout.contains("negative gain"), "{}{}", ran.stdout, ran.stderr);
    assert!(lab.ok(&format!("fit exchanged.csv --model pi -o d.json {turned}")).stderr.contains(said));
}
