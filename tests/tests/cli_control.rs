//! `run --control`, `force` and `log` on the command line.

use std::fs;

use hyst_tests::Lab;
use serde_json::Value;

/// Returns a folder with a `model.json` that includes the plant's lag.
fn lab() -> Lab {
    let lab = Lab::with_model();
    lab.ok("diagnose train.csv --model model.json -o extended.json");
    fs::rename(lab.path("extended.json"), lab.path("model.json")).unwrap();
    lab
}

fn run(lab: &Lab, control: &str, more: &str) -> Value {
    let line = format!(
        "run --daq sim:plant.toml --model model.json --reference r.csv --control {control} --json --log run.mcap {more}"
    );
    lab.ok(&line).json()
}

#[test]
fn a_pid_with_feedforward_is_better_than_either_and_than_a_gain() {
    let lab = lab();
    lab.reference("r.csv", 3.0, 14.0);
    let rmse = |report: &Value| report["tracking"]["rmse"].as_f64().unwrap();
    let [gain, forward, pid, both] =
        ["gain", "feedforward", "pid", "pid+feedforward"].map(|control| run(&lab, control, ""));
    assert!(
        rmse(&both) < 0.5 * rmse(&gain) && rmse(&both) < rmse(&forward) && rmse(&both) < rmse(&pid),
        "{both} {pid} {forward} {gain}"
    );
    assert_eq!(gain["control"], "gain");
    assert_eq!(both["control"], "pid+feedforward");
    assert!(gain["pid"].is_null() && gain["compensation"].is_null());
    assert!(both["pid"]["integral"].as_f64().unwrap() > 0.0 && !both["compensation"].is_null());
    assert_eq!(both["loop_on_device"], false);
    // The random numbers are the same in each run.
    assert_eq!(rmse(&both), rmse(&run(&lab, "pid+feedforward", "")));
    let given = run(&lab, "pid", "--pid 0,40");
    assert_eq!((given["pid"]["integral"].as_f64(), given["pid"]["why"].as_str()), (Some(40.0), Some("as given")));
    assert!(rmse(&given) != rmse(&pid));
}

#[test]
fn gains_without_a_pid_and_bandwidths_without_an_inverse_are_rejected() {
    let lab = Lab::with_model();
    lab.reference("r.csv", 1.0, 14.0);
    let base = "run --daq sim:plant.toml --model model.json --reference r.csv";
    assert!(lab.fails(&format!("{base} --pid 1,2"), 2).contains("--control pid"));
    assert!(lab.fails(&format!("{base} --control pid --bandwidth 10"), 2).contains("--control feedforward"));
    assert!(lab.fails(&format!("{base} --control pid --pid 1"), 2).contains("KP,KI"));
}

#[test]
fn a_log_gives_the_same_model_as_the_record() {
    let lab = Lab::with_model();
    lab.reference("r.csv", 2.0, 14.0);
    run(&lab, "feedforward", "--record run.csv");
    lab.ok("fit run.csv --model pi -o of-record.json");
    lab.ok("fit run.mcap --model pi -o of-log.json");
    let model = |name: &str| -> Value { serde_json::from_str(&lab.read(name)).unwrap() };
    let (record, log) = (model("of-record.json"), model("of-log.json"));
    let weights = |model: &Value| model.pointer("/chain/hysteresis").or(model.get("base")).cloned();
    assert_eq!(weights(&record), weights(&log), "{record} {log}");
    lab.ok("log convert run.mcap -o converted.csv");
    let converted = lab.read("converted.csv");
    assert_eq!(converted.lines().next(), Some("segment,time_s,voltage_v,displacement_um,reference_um"));
    assert_eq!(converted.lines().count(), 1001);
    let all = lab.ok("log convert run.mcap --ramps").stdout;
    assert!(all.lines().count() > 1001);

    let info = lab.ok("log info run.mcap --json").json();
    assert_eq!(
        (info["closed"].as_bool(), info["record_samples"].as_u64(), info["model"].as_bool()),
        (Some(true), Some(1000), Some(true))
    );
    assert_eq!(info["metadata"]["output_column"], "displacement_um");
}

#[test]
fn a_truncated_log_is_recovered_except_for_its_last_second() {
    let lab = Lab::with_model();
    lab.reference("r.csv", 6.0, 14.0);
    run(&lab, "feedforward", "");
    let whole = fs::read(lab.path("run.mcap")).unwrap();
    let samples = |name: &str| lab.ok(&format!("log info {name} --json")).json()["samples"].as_u64().unwrap();
    let all = samples("run.mcap");
    for share in [0.3, 0.5, 0.77, 0.93] {
        lab.write("cut.mcap", &whole[..(share * whole.len() as f64) as usize]);
        let ran = lab.ok("log info cut.mcap");
        assert!(ran.stdout.contains("cut off"), "{ran:?}");
        lab.ok("log recover cut.mcap -o recovered.mcap");
        let recovered = lab.ok("log info recovered.mcap --json").json();
        assert_eq!(recovered["closed"], true);
        let count = recovered["samples"].as_u64().unwrap();
        assert_eq!(count, samples("cut.mcap"));
        // 500 samples per second; at most one chunk is lost.
        assert!(count as f64 + 501.0 >= share * all as f64 * 0.9, "{count} of {all} at {share}");
    }
    // A fit reports the damage too.
    let fitted = |name: &str| lab.ok(&format!("fit {name} --model pi -o of-{name}.json")).stderr;
    assert!(fitted("cut.mcap").contains("note: cut.mcap: the log was cut off"));
    assert!(!fitted("recovered.mcap").contains("cut off"));
    let mut damaged = whole.clone();
    let chunks = mcap::Summary::read(&whole).unwrap().unwrap().chunk_indexes;
    let chunk = chunks.get(chunks.len() / 2).unwrap();
    damaged[(chunk.chunk_start_offset + chunk.chunk_length / 2) as usize] ^= 0xff;
    lab.write("damaged.mcap", damaged);
    let messages = fitted("damaged.mcap");
    for part in
        ["damaged.mcap: 1 damaged piece of the log left out", "damaged.mcap: 1 gap in time", "drive history is unknown"]
    {
        assert!(messages.contains(part), "{part}: {messages}");
    }
    lab.write("no.mcap", "time_s,voltage_v\n");
    assert!(lab.fails("log info no.mcap", 2).contains("no.mcap"));
    assert!(lab.fails("log info absent.mcap", 2).contains("absent.mcap"));
}

#[test]
fn a_force_is_estimated_and_compared() {
    let lab = lab();
    lab.write(
        "loaded.toml",
        format!("{}[load]\nnewtons = 4\num_per_n = 0.8\nperiod_s = 0.9\nshape = \"wander\"\n", hyst_tests::PLANT),
    );
    let ran = lab.run("run --daq sim:loaded.toml --drive u.csv --record loaded.csv");
    assert_eq!(ran.code, 0, "{ran:?}");
    let ran = lab.ok("force --model model.json loaded.csv --kout 1.25 -o force.csv --json");
    let report: Value = serde_json::from_str(&ran.stderr).or_else(|_| serde_json::from_str(&ran.stdout)).unwrap();
    assert!(report["errors"]["rmse"].as_f64().unwrap() < 0.5, "{report}");
    assert!(lab.read("force.csv").lines().next().unwrap().ends_with("estimated_force_n"));
    assert!(lab.fails("force --model model.json loaded.csv -o f.csv", 2).contains("--kout"));
}
