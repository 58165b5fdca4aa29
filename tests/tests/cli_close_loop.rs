//! `close-loop`: measure, diagnose, extend the model, compensate, measure again.

use hyst_tests::Lab;
use serde_json::Value;

/// Runs `close-loop` on a plant. Returns the folder and the summary.
fn closed(plant: &str, options: &str) -> (Lab, Value) {
    let lab = Lab::new();
    lab.write("plant.toml", plant);
    let summary = lab.ok(&format!("close-loop --daq sim:plant.toml {options} --out loop --json")).json();
    (lab, summary)
}

#[test]
fn a_lag_is_found_and_compensated() {
    let (lab, summary) = closed(hyst_tests::PLANT, "--rate 250 --turns 3");
    let turns = summary["turns"].as_array().unwrap();
    assert_eq!(turns[0]["found"], serde_json::json!(["lag"]), "{summary:#}");
    // With the lag and a base of sufficient resolution, no further effect is found.
    assert_eq!(turns.last().unwrap()["found"], serde_json::json!([]), "{summary:#}");
    assert_eq!(summary["ended"], "no further effect is found");
    let plain = summary["plain_gain_rmse"].as_f64().unwrap();
    let base = summary["base_inverse_rmse"].as_f64().unwrap();
    let last = turns.last().unwrap()["tracking_rmse"].as_f64().unwrap();
    assert!(last < 0.5 * base && base < plain, "{summary:#}");
    let files = std::fs::read_dir(lab.path("loop")).unwrap().count();
    // Record, model, findings, drive and log of each turn, and the summary.
    assert_eq!(files, 5 * turns.len() + 1);
}

/// Planned experiments find the same effects in less time than the standard one of 36 s.
#[test]
fn experiments_are_planned_until_the_aim_is_reached() {
    let (lab, summary) = closed(hyst_tests::PLANT, "--rate 250 --until 0.95 --within 30s");
    let turns = summary["turns"].as_array().unwrap();
    let last = turns.last().unwrap();
    assert_eq!(last["found"], serde_json::json!(["lag"]), "{summary:#}");
    assert!(summary["ended"].as_str().unwrap().starts_with("all questions are answered"), "{summary:#}");
    assert!(summary["seconds"].as_f64().unwrap() <= 30.0, "{summary:#}");
    assert_eq!(turns[0]["experiment"]["why"], "first record");
    // The reference is followed once, at the end.
    assert!(turns[..turns.len() - 1].iter().all(|turn| turn["tracking_rmse"].is_null()), "{summary:#}");
    assert!(
        last["tracking_rmse"].as_f64().unwrap() < 0.5 * summary["base_inverse_rmse"].as_f64().unwrap(),
        "{summary:#}"
    );
    assert!(lab.fails("close-loop --daq sim:plant.toml --out b --within 30", 2).contains("--until"));
    assert!(lab.fails("close-loop --daq sim:plant.toml --out b --until 1.5", 2).contains("probability"));
}

/// If the amplifier does not follow the drive, the record is repeated with a slower drive.
#[test]
fn a_slow_amplifier_is_found_and_the_drive_is_slowed() {
    let plant = format!("{}\n[[disturbance]]\nkind = \"slew-limit\"\nv_per_s = 1500\n", hyst_tests::PLANT);
    let (lab, summary) = closed(&plant, "--rate 250 --turns 2");
    let turns = summary["turns"].as_array().unwrap();
    let limit = turns[0]["slew_limit"].as_f64().unwrap();
    assert!((limit / 1500.0 - 1.0).abs() < 0.1, "{summary:#}");
    assert_eq!(turns[1]["slew_limit"], Value::Null, "{summary:#}");
    assert_eq!(turns[1]["found"], serde_json::json!(["lag"]), "{summary:#}");
    let error = |turn: &Value| turn["tracking_rmse"].as_f64().unwrap();
    assert!(error(turns.last().unwrap()) < 0.5 * summary["base_inverse_rmse"].as_f64().unwrap(), "{summary:#}");
    let drive = lab.read("loop/train-2.csv");
    let volts: Vec<f64> = drive.lines().skip(1).map(|line| line.split(',').nth(1).unwrap().parse().unwrap()).collect();
    assert!(
        volts.windows(2).all(|w| (w[1] - w[0]).abs() * 250.0 < 0.81 * limit),
        "segments start at the voltage at which they end"
    );
}

#[test]
fn a_folder_with_files_is_not_changed() {
    let lab = Lab::new();
    lab.write("plant.toml", hyst_tests::PLANT);
    std::fs::create_dir(lab.path("loop")).unwrap();
    lab.write("loop/mine.txt", "mine");
    let ran = lab.run("close-loop --daq sim:plant.toml --out loop");
    assert_eq!(ran.code, 2);
    assert!(ran.stderr.contains("not empty"), "{}", ran.stderr);
    assert_eq!(lab.read("loop/mine.txt"), "mine");
}

#[test]
fn other_bases_and_zero_turns_are_rejected() {
    let lab = Lab::new();
    for (options, named) in [("--model tanh", "pi or preisach"), ("--turns 0", "turns"), ("--rate -5", "rate")] {
        let ran = lab.run(&format!("close-loop --daq sim:plant.toml --out loop {options}"));
        assert_eq!(ran.code, 2, "{options}");
        assert!(ran.stderr.contains(named), "{options}: {}", ran.stderr);
    }
}
