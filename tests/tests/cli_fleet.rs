//! `fleet`: one row for each actuator, also after a killed command and for a bad file.

use std::fs;
use std::process::Stdio;
use std::thread::sleep;
use std::time::Duration;

use hyst_tests::Lab;
use serde_json::Value;

/// Returns a lab with the records of `n` actuators, which differ in the scale of their output, and two invalid files.
fn lab(n: usize) -> Lab {
    let lab = Lab::with_train("");
    fs::create_dir(lab.path("fleet")).unwrap();
    let text = lab.read("train.csv");
    let (header, rows) = text.split_once('\n').unwrap();
    for k in 0..n {
        let scaled = rows.lines().map(|row| {
            let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
            let last = cells.len() - 1;
            cells[last] = (cells[last].parse::<f64>().unwrap() * (1.0 + 0.1 * k as f64)).to_string();
            cells.join(",")
        });
        lab.write(&format!("fleet/p{k}.csv"), format!("{header}\n{}\n", scaled.collect::<Vec<_>>().join("\n")));
    }
    lab.write("fleet/torn.csv", "time_s,voltage_v,displacement_um\n0,1\n");
    lab.write("fleet/noise.mat", [7_u8; 300]);
    lab
}

/// Returns the rows of a journal by file, without the values that differ between runs; the last row of each file.
fn rows(lab: &Lab, journal: &str) -> std::collections::BTreeMap<String, Value> {
    let row = |line: &str| {
        let mut row: Value = serde_json::from_str(line).unwrap();
        row.as_object_mut().unwrap().remove("took_s");
        (row["file"].as_str().unwrap().to_owned(), row)
    };
    lab.read(journal).lines().map(row).collect()
}

#[test]
fn every_actuator_has_a_row_that_agrees_with_its_diagnosis() {
    let lab = lab(3);
    let printed =
        lab.ok("fleet fleet -o results.parquet --page fleet.html --reports reports --model pi --jobs 2").stdout;
    assert!(printed.contains("5 of 5 actuators finished") && printed.contains("2 without a diagnosis"), "{printed}");
    for line in ["fleet/p1.csv: explained: lag", "fleet/torn.csv: failed: line 2"] {
        assert!(printed.lines().any(|own| own.starts_with(line)), "{line} is missing in {printed}");
    }
    let rows = rows(&lab, "results.parquet.journal");
    assert_eq!(rows.len(), 5);
    let failed = |name: &str| rows[name]["outcome"]["Err"].as_str().unwrap().to_owned();
    for (name, why) in [("fleet/torn.csv", "line 2"), ("fleet/noise.mat", "fleet/noise.mat: ")] {
        assert!(failed(name).contains(why), "{}", failed(name));
    }
    // The same numbers as from single commands, bit for bit.
    lab.ok("fit fleet/p1.csv --model pi -o one.json");
    let one = lab.ok("diagnose fleet/p1.csv --model one.json --json").json();
    let own = &rows["fleet/p1.csv"]["outcome"]["Ok"];
    assert_eq!(own["rmse_before"], one["before"]["train"]["rmse"]);
    assert_eq!(own["rmse_after"], one["after"]["train"]["rmse"]);
    assert_eq!(own["verdict"], one["verdict"]);
    let names = |list: &Value| list.as_array().unwrap().iter().map(|e| e["name"].clone()).collect::<Vec<_>>();
    assert_eq!(names(&own["effects"]), names(&one["effects"]));
    assert_eq!(
        own["effects"][0]["parameters"]["seconds"]["value"],
        one["effects"][0]["parameters"]["seconds"]["value"]
    );
    let page = lab.read("fleet.html");
    for part in ["3 of 5 actuators diagnosed", "Records without a diagnosis", "torn.csv", "href=\"reports/p1-"] {
        assert!(page.contains(part), "{part}");
    }
    assert_eq!(fs::read_dir(lab.path("reports")).unwrap().count(), 3);
}

#[test]
fn a_killed_fleet_continues_and_a_changed_file_is_repeated() {
    let lab = lab(2);
    let line = "fleet fleet -o results.parquet --model pi --jobs 1";
    let mut child = lab.command(line).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let journal = lab.path("results.parquet.journal");
    let lines = || fs::read_to_string(&journal).map_or(0, |text| text.lines().count());
    while lines() < 2 && child.try_wait().unwrap().is_none() {
        sleep(Duration::from_millis(5));
    }
    // SIGKILL cannot be handled.
    child.kill().unwrap();
    child.wait().unwrap();
    let kept = fs::read_to_string(&journal).unwrap();
    let whole = kept.split_inclusive('\n').filter(|line| line.ends_with('\n')).count();
    assert!((1..4).contains(&whole), "{whole} rows done");
    let again = lab.ok(&format!("{line} --json")).json();
    assert_eq!((again["done"].as_u64(), again["failed"].as_u64()), (Some(4), Some(2)), "{again}");
    assert_eq!(again["kept"].as_u64(), Some(whole as u64), "{again}");
    let whole_rows: String = kept.split_inclusive('\n').take(whole).collect();
    assert!(lab.read("results.parquet.journal").starts_with(&whole_rows), "finished rows do not change");
    let continued = rows(&lab, "results.parquet.journal");
    lab.ok("fleet fleet -o fresh.parquet --model pi --jobs 2");
    assert_eq!(continued, rows(&lab, "fresh.parquet.journal"));
    // No file is due; then one changed file; then all files because of another option.
    assert_eq!(lab.ok(&format!("{line} --json")).json()["kept"].as_u64(), Some(4));
    lab.write("fleet/torn.csv", lab.read("fleet/p0.csv"));
    let fixed = lab.ok(&format!("{line} --json")).json();
    assert_eq!((fixed["kept"].as_u64(), fixed["failed"].as_u64()), (Some(3), Some(1)), "{fixed}");
    assert_eq!(lab.ok(&format!("{line} --seed 2 --json")).json()["kept"].as_u64(), Some(0));
}

#[test]
fn rows_of_another_version_are_computed_again() {
    let lab = lab(1);
    let line = "fleet fleet -o results.parquet --page pages/fleet.html --reports reports --model pi";
    fs::create_dir(lab.path("pages")).unwrap();
    lab.ok(line);
    assert!(lab.read("pages/fleet.html").contains("href=\"../reports/p0-"));
    let journal = lab.read("results.parquet.journal");
    let before = journal.find("\"options\":\"").unwrap() + 11;
    let version = &journal[before..before + journal[before..].find(" {").unwrap()];
    lab.write("results.parquet.journal", journal.replace(version, "0.0.1 (older)"));
    let again = lab.ok(line);
    let note = "note: 3 actuators finished by another version of hystctl; this version computes them again";
    assert_eq!(again.stderr.matches(note).count(), 1, "{}", again.stderr);
    let last = lab.ok(line);
    assert!(
        !last.stderr.contains("another version") && last.stderr.contains("3 actuators already finished"),
        "{last:?}"
    );
}

#[test]
fn unsuitable_folders_and_files_are_rejected() {
    let lab = lab(1);
    assert!(lab.fails("fleet absent -o r.parquet", 2).contains("give a folder"));
    assert!(lab.fails("fleet fleet -o r.parquet --model nonsense", 2).contains("auto"));
    assert!(lab.fails("fleet fleet -o fleet/none/r.parquet", 2).contains("does not exist"));
    lab.write("r.parquet.journal", "time_s,voltage_v\n0,1\n");
    assert!(lab.fails("fleet fleet -o r.parquet", 2).contains("not a row of a fleet"));
    fs::create_dir(lab.path("empty")).unwrap();
    assert!(lab.fails("fleet empty -o s.parquet", 2).contains("no records"));
}
