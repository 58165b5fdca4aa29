//! `close-loop`: measure, find, add, compensate, measure again.

use hyst_tests::Lab;
use serde_json::Value;

/// The folder in which the loop was closed on a plant, and the summary.
fn closed(plant: &str, options: &str) -> (Lab, Value) {
    let lab = Lab::new();
    lab.write("plant.toml", plant);
    let summary = lab.ok(&format!("close-loop --daq sim:plant.toml {options} --out loop --json")).json();
    (lab, summary)
}

#[test]
fn the_loop_closes_on_an_actuator_with_a_lag() {
    let (lab, summary) = closed(hyst_tests::PLANT, "--rate 250 --turns 3");
    let turns = summary["turns"].as_array().unwrap();
    assert_eq!(turns[0]["found"], serde_json::json!(["lag"]), "{summary:#}");
    // With the lag in the model of a base that is fine enough nothing more is found.
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

/// Chosen experiments reach the same names in less time than the usual one of 36 s takes.
#[test]
fn experiments_are_chosen_until_all_is_known() {
    let (lab, summary) = closed(hyst_tests::PLANT, "--rate 250 --until 0.95 --within 30s");
    let turns = summary["turns"].as_array().unwrap();
    let last = turns.last().unwrap();
    assert_eq!(last["found"], serde_json::json!(["lag"]), "{summary:#}");
    assert!(summary["ended"].as_str().unwrap().starts_with("all that was asked is known"), "{summary:#}");
    assert!(summary["seconds"].as_f64().unwrap() <= 30.0, "{summary:#}");
    assert_eq!(turns[0]["experiment"]["why"], "a first look");
    // The reference is followed once, in the end.
    assert!(turns[..turns.len() - 1].iter().all(|turn| turn["tracking_rmse"].is_null()), "{summary:#}");
    assert!(
        last["tracking_rmse"].as_f64().unwrap() < 0.5 * summary["base_inverse_rmse"].as_f64().unwrap(),
        "{summary:#}"
    );
    assert!(lab.refuses("close-loop --daq sim:plant.toml --out b --within 30", 2).contains("--until"));
    assert!(lab.refuses("close-loop --daq sim:plant.toml --out b --until 1.5", 2).contains("probability"));
}

/// What an amplifier has not followed is measured anew with a drive that it follows.
#[test]
fn the_loop_closes_on_an_amplifier_that_is_slow() {
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
    assert!(volts.windows(2).all(|w| (w[1] - w[0]).abs() * 250.0 < 0.81 * limit), "segments begin where they end");
}

#[test]
fn a_folder_with_files_is_left_alone() {
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
fn other_bases_and_no_turns_are_refused() {
    let lab = Lab::new();
    for (options, named) in [("--model tanh", "pi or preisach"), ("--turns 0", "turns"), ("--rate -5", "rate")] {
        let ran = lab.run(&format!("close-loop --daq sim:plant.toml --out loop {options}"));
        assert_eq!(ran.code, 2, "{options}");
        assert!(ran.stderr.contains(named), "{options}: {}", ran.stderr);
    }
}
