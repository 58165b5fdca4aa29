//! Every error in a record: the message states the place, the exit code is 2, and nothing is written.

use hyst_tests::Lab;

/// Asserts that a fit to `content` is rejected with a message that contains all of `parts`.
#[track_caller]
fn rejected(content: impl AsRef<[u8]>, parts: &[&str]) {
    rejected_with(content, "", parts);
}

#[track_caller]
fn rejected_with(content: impl AsRef<[u8]>, options: &str, parts: &[&str]) {
    let lab = Lab::new();
    lab.write("bad.csv", content);
    let model = if options.contains("--model") { "" } else { "--model pi" };
    let message = lab.fails(&format!("fit bad.csv {model} -o model.json {options}"), 2);
    for part in parts {
        assert!(message.contains(part), "\"{part}\" is missing in: {message}");
    }
    assert_eq!(lab.files(), ["bad.csv"]);
}

/// Returns a valid record of `rows` rows; row `k` is in line `k + 2`.
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

/// Returns the valid record with row `at` replaced.
fn with_row(at: usize, row: &str) -> String {
    let mut rows = rows(40);
    rows[at] = row.to_owned();
    with_header(HEADER, &rows)
}

/// Asserts that `content` is read with a note that contains all of `parts`, and fits it.
#[track_caller]
fn noted(content: impl AsRef<[u8]>, options: &str, parts: &[&str]) {
    let lab = Lab::new();
    lab.write("odd.csv", content);
    let ran = lab.ok(&format!("convert odd.csv record.csv {options}"));
    for part in parts {
        assert!(ran.stderr.contains(part), "\"{part}\" is missing in: {}", ran.stderr);
    }
    lab.ok("fit record.csv --model pi -o model.json");
}

#[test]
fn files_that_are_not_records_are_rejected() {
    rejected("", &["bad.csv, line 1", "empty"]);
    rejected(format!("{HEADER}\n"), &["bad.csv", "no rows"]);
    rejected("some words\nand no numbers\n", &["bad.csv", "no row of numbers"]);
    rejected(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", &["bad.csv", "not recognised", "to_csv"]);
    let lab = Lab::new();
    let message = lab.fails("fit absent.csv --model pi -o model.json", 2);
    assert!(message.contains("absent.csv: cannot be read"), "{message}");
}

/// Returns a valid record that is long enough for a fit.
fn long() -> Vec<String> {
    let row = |k: usize| {
        let u = 10.0 * ((k as f64 * 0.05).sin() + 1.0);
        format!("{:.3},{u:.4},{:.5}", k as f64 * 0.002, 0.2 * u + 0.02 * (k as f64 * 0.05 - 0.4).sin())
    };
    (0..900).map(row).collect()
}

#[test]
fn dialects_are_read_without_options() {
    let rows = long();
    noted(with_header(HEADER, &rows), "", &[]);
    let european: Vec<String> = rows.iter().map(|row| row.replace(',', ";").replace('.', ",")).collect();
    noted(with_header("Time (s);Voltage [V];Position (nm)", &european), "", &["decimal comma", "displacement_nm"]);
    noted(with_header("% taken by hand\nt_ms,U_mV,disp_nm", &rows), "", &["from mV to V", "displacement_nm"]);
    noted(with_header("Time,Drive,Sensor\n(s),(V),(µm)", &rows), "", &["voltage_v"]);
    let utf16: Vec<u8> =
        format!("\u{feff}{}", with_header(HEADER, &rows)).encode_utf16().flat_map(u16::to_le_bytes).collect();
    noted(utf16, "", &[]);
    noted(rows.join("\n"), "--map time_s=1 --map voltage_v=2 --map displacement_um=3", &["read as time_s"]);
    let without_time: Vec<&str> = rows.iter().map(|row| row.split_once(',').unwrap().1).collect();
    noted(format!("voltage_v,displacement_um\n{}", without_time.join("\n")), "--rate 500", &[]);
}

#[test]
fn clocks_and_sensors_are_repaired_with_a_note() {
    let with = |at: usize, row: &str| {
        let mut rows = long();
        rows[at] = row.to_owned();
        with_header(HEADER, &rows)
    };
    noted(with(100, "0.200,9.5,NaN"), "", &["1 row without displacement_um is not fitted"]);
    noted(with(100, "0.200,,1.9"), "", &["1 row without voltage_v: interpolated"]);
    noted(with(100, "0.200,9.5,95"), "", &["1 spike of the output not fitted", "row 101"]);
    let jitter = |k: usize, row: &String| {
        format!("{:.6},{}", 0.002 * k as f64 + 1e-6 * (k % 3) as f64, row.split_once(',').unwrap().1)
    };
    let rows: Vec<String> = long().iter().enumerate().map(|(k, row)| jitter(k, row)).collect();
    noted(with_header(HEADER, &rows), "", &["jitter by 0.0", "monotone cubic"]);
    let mut rows = long();
    rows.remove(500);
    noted(with_header(HEADER, &rows), "", &["1 row missing in the time grid"]);
    rows.drain(500..600);
    noted(with_header(HEADER, &rows), "", &["an interruption of 0.204 s"]);
    let mut rows = long();
    rows.insert(300, rows[300].clone());
    noted(with_header(HEADER, &rows), "", &["1 row with the time of the row before"]);
}

#[test]
fn missing_and_ambiguous_columns_are_rejected() {
    let rows = rows(40);
    let header = |header: &str, parts: &[&str]| rejected(with_header(header, &rows), parts);
    header("a,voltage_v,displacement_um", &["bad.csv, line 1", "the time", "--map time_s=a"]);
    header("time_s,a,displacement_um", &["bad.csv, line 1", "the input", "--map voltage_v=a"]);
    header("time_s,voltage_v,a", &["bad.csv, line 1", "the output", "--map displacement_um=a"]);
    header("t,u,x", &["--map time_s=t --map voltage_v=u --map displacement_um=x"]);
    header("time_s,voltage_v,voltage_v", &["bad.csv, line 1", "the output"]);
    header("time_s,force_n,displacement_um", &["bad.csv, line 1"]);
    let wide: Vec<String> = (0..100_000).map(|k| format!("c{k}")).collect();
    let lab = Lab::new();
    lab.write("wide.csv", format!("{}\n{}\n", wide.join(","), vec!["1"; 100_000].join(",")));
    assert!(lab.fails("fit wide.csv --model pi -o model.json", 2).len() < 2000);
}

#[test]
fn two_output_columns_are_rejected() {
    let rows: Vec<String> = rows(40).iter().map(|row| format!("{row},1.5")).collect();
    let header = "time_s,voltage_v,displacement_um,force_n";
    let message = [
        "bad.csv, line 1",
        "displacement_um",
        "force_n",
        "--map",
        "the load that acts on the actuator: --map load_n=force_n",
    ];
    rejected(with_header(header, &rows), &message);
}

#[test]
fn values_that_are_not_numbers_are_rejected() {
    rejected(with_row(3, "0.006,abc,1.0"), &["bad.csv, line 5, column \"voltage_v\"", "\"abc\" is not a number"]);
    let empty: Vec<String> = rows(40).iter().map(|row| format!("{},", row.rsplit_once(',').unwrap().0)).collect();
    rejected(with_header(HEADER, &empty), &["bad.csv", "displacement_um", "40 of 40 rows have no value"]);
}

#[test]
fn rows_of_another_length_are_rejected() {
    rejected(with_row(7, "0.014,1.0"), &["bad.csv, line 9", "2 fields", "3 columns"]);
    rejected(with_row(7, "0.014,1.0,1.0,1.0"), &["bad.csv, line 9", "4 fields"]);
    rejected(with_row(7, "0.014,\"1.0,1.0"), &["bad.csv, line 9", "quotation mark"]);
}

#[test]
fn decreasing_times_are_rejected() {
    rejected(with_row(8, "0.013,1.0,1.0"), &["bad.csv, line 10, column \"time_s\"", "increase"]);
}

#[test]
fn invalid_segments_are_rejected() {
    let labelled = |label: fn(usize) -> &'static str| {
        let rows: Vec<String> = rows(40).iter().enumerate().map(|(k, row)| format!("{},{row}", label(k))).collect();
        with_header(&format!("segment,{HEADER}"), &rows)
    };
    rejected(labelled(|_| "x"), &["bad.csv", "column \"segment\"", "not a"]);
    rejected(labelled(|k| ["0", "1", "0", "0"][k / 10]), &["bad.csv, line 22, column \"segment\"", "returns"]);
    rejected(
        "segment,time_s,voltage_v,displacement_um\n0,0,1,1\n1,1,2,2\n",
        &["bad.csv, line 3", "no segment has two rows"],
    );
}

#[test]
fn different_sample_periods_are_rejected_for_dpm() {
    let mut mixed = String::from("segment,time_s,voltage_v,displacement_um\n");
    (0..200).for_each(|k| mixed.push_str(&format!("0,{:.3},{},{}\n", f64::from(k) * 0.002, k % 37, k % 37)));
    (0..200).for_each(|k| mixed.push_str(&format!("1,{:.3},{},{}\n", 1.0 + f64::from(k) * 0.005, k % 41, k % 41)));
    rejected_with(&mixed, "--model dpm", &["bad.csv", "one sample period", "segment 1 has 0.005", "segment 0 0.002"]);
}

#[test]
fn invalid_maps_are_rejected() {
    let valid = with_header(HEADER, &rows(40));
    rejected_with(&valid, "--map voltage_v=Vin", &["bad.csv, line 1", "--map voltage_v=Vin", "\"time_s\""]);
    rejected_with(&valid, "--map voltage_v", &["--map \"voltage_v\"", "NAME=COLUMN"]);
    rejected_with(&valid, "--map displacement_um=voltage_v", &["is in V", "not a unit of displacement_um"]);
    rejected_with(&valid, "--map colour=a", &["\"colour\"", "voltage_v"]);
    rejected_with(&valid, "--map time_s=time_s --map time_ms=x", &["the time", "keep one"]);
}

#[test]
fn short_and_constant_records_are_rejected() {
    rejected(with_header(HEADER, &rows(40)), &["bad.csv", "40", "too few"]);
    let constant = |header: &str, row: fn(usize) -> String| with_header(header, &(0..900).map(row).collect::<Vec<_>>());
    let still = constant(HEADER, |k| format!("{:.3},5,{}", k as f64 * 0.002, k as f64 * 0.01));
    rejected(still, &["bad.csv", "voltage_v", "constant (5)"]);
    let stuck = constant(HEADER, |k| format!("{:.3},{},7.5", k as f64 * 0.002, (k % 50) as f64));
    rejected(stuck, &["bad.csv", "displacement_um", "constant (7.5)"]);
}

#[test]
fn records_with_different_outputs_are_rejected() {
    let lab = Lab::new();
    lab.write("a.csv", with_header(HEADER, &rows(600)));
    lab.write("b.csv", with_header("time_s,voltage_v,displacement_nm", &rows(600)));
    let message = lab.fails("fit a.csv b.csv --model pi -o model.json", 2);
    for part in ["b.csv, line 1", "the output column", "a.csv", "displacement_nm"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn loops_in_the_wrong_direction_are_reported() {
    let lab = Lab::with_train("");
    let note = "the output leads the input";
    assert!(!lab.ok("fit train.csv --model pi -o a.json").stderr.contains(note));
    let exchanged = lab.read("train.csv").replacen("voltage_v,displacement_um", "displacement_um,voltage_v", 1);
    lab.write("exchanged.csv", exchanged);
    let ran = lab.ok("fit exchanged.csv --model pi -o b.json");
    assert!(ran.stderr.contains(note) && ran.stderr.contains("are exchanged"), "{}", ran.stderr);
    let inverted = "--map displacement_um=-displacement_um";
    let ran = lab.ok(&format!("fit train.csv --model pi -o c.json {inverted}"));
    assert!(!ran.stderr.contains(note) && ran.stdout.contains("negative gain"), "{}{}", ran.stdout, ran.stderr);
    assert!(lab.ok(&format!("fit exchanged.csv --model pi -o d.json {inverted}")).stderr.contains(note));
}
