//! Makes a log of every kind of `hystctl` run, for tests of other programs that read logs.

use std::path::Path;
use std::process::Stdio;
use std::thread::sleep;
use std::time::Duration;

use serde_json::{Value, json};

use crate::served::Served;
use crate::{Lab, PLANT, Ran, WARM};

/// Addition to a plant: a measured load.
const LOADED: &str = "[load]\nnewtons = 3.0\num_per_n = 0.5\nperiod_s = 1.0\n";
/// A fast mode that makes the simulation slow, so that a run can be interrupted.
const SLOW: &str = "[[mode]]\nhz = 4000\ndamping = 0.02\ngain = 0.1\n";
/// Number of logs that are cut off and recovered.
const CUTS: usize = 40;

/// Makes the logs and copies them to `folder`, each with the samples of `hystctl log convert --ramps`. Returns the list
/// that it writes to `logs.json` there.
///
/// # Panics
/// If `hystctl` fails or the folder cannot be written.
pub fn every_log(folder: &Path) -> Value {
    let lab = Lab::with_train(&format!("{WARM}{LOADED}"));
    lab.ok("fit train.csv --model pi -o model.json");
    lab.reference("r.csv", 2.0, 12.0);
    lab.write("plain.toml", PLANT);
    lab.ok("excite sine --rate 500 --high 60 --cycles 2 -o sine.csv");

    lab.ok("run --daq sim:plant.toml --drive u.csv --log drive.mcap");
    lab.ok("run --daq sim:plant.toml --drive u.csv --log again.mcap");
    lab.ok("run --daq sim:plant.toml --drive u.csv --log again.mcap --seed 5");
    lab.ok("run --daq sim:plain.toml --drive sine.csv --log plain.mcap");
    let follow = "--model model.json --reference r.csv";
    for control in ["gain", "feedforward", "pid", "pid+feedforward"] {
        lab.ok(&format!("run --daq sim:plant.toml {follow} --control {control} --log {control}.mcap"));
    }
    stopped_by_sensor_range(&lab);
    interrupted(&lab);
    // Devices in real time, over TCP.
    let device = Served::for_one_host(PLANT, 500.0);
    lab.ok(&format!("run --daq {} --drive sine.csv --log line.mcap", device.daq()));
    device.last_status();
    let device = Served::for_one_host(PLANT, 500.0);
    let control = "--control pid+feedforward --settle 0.2";
    let said = lab.ok(&format!("run --daq {} {follow} {control} --log on-device.mcap --json", device.daq())).json();
    assert_eq!(said["loop_on_device"], true, "{said}");
    device.last_status();

    let whole = std::fs::read(lab.path("pid.mcap")).expect("a log");
    for k in 0..CUTS {
        // From the chunk of the first sample to the last byte.
        let length = whole.len() * (k + CUTS / 4) / (CUTS + CUTS / 4 - 1);
        lab.write("cut.mcap", &whole[..length]);
        lab.ok(&format!("log recover cut.mcap -o recovered-{k}.mcap"));
    }
    copy_logs(&lab, folder)
}

/// Makes a log of a run that stops at the end of the sensor's range.
fn stopped_by_sensor_range(lab: &Lab) {
    lab.write("short.toml", PLANT.replace("[-10, 40]", "[-1, 10]"));
    let ran = lab.run("run --daq sim:short.toml --drive sine.csv --log failed.mcap");
    assert_eq!(ran.code, 3, "{}", ran.stderr);
}

/// Makes a log of a run that a signal interrupts.
fn interrupted(lab: &Lab) {
    lab.write("slow.toml", format!("{PLANT}{SLOW}"));
    lab.ok("excite sine --frequency 0.1 --cycles 40 --high 100 -o long.csv");
    let mut running = lab.command("run --daq sim:slow.toml --drive long.csv --log interrupted.mcap");
    let mut running = running.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("hystctl starts");
    while !lab.path("interrupted.mcap").exists() && running.try_wait().is_ok_and(|ended| ended.is_none()) {
        sleep(Duration::from_millis(5));
    }
    signal("INT", running.id());
    let ran = Ran::from(running.wait_with_output().expect("hystctl ends"));
    assert!(ran.code == 1 && ran.stderr.contains("stopped on request"), "{}", ran.stderr);
}

/// Sends a signal.
///
/// # Panics
/// If the process does not exist.
pub fn signal(name: &str, process: u32) {
    let sent = std::process::Command::new("kill").args([&format!("-{name}"), &process.to_string()]).status();
    assert!(sent.is_ok_and(|status| status.success()), "kill -{name} {process}");
}

fn copy_logs(lab: &Lab, folder: &Path) -> Value {
    std::fs::create_dir_all(folder).expect("the folder can be made");
    let logs: Vec<String> =
        lab.files().into_iter().filter(|name| name.contains(".mcap") && name != "cut.mcap").collect();
    let list: Value = logs
        .iter()
        .map(|name| {
            // A log that was set aside has another extension.
            let log = format!("{}.mcap", name.replace(".mcap", ""));
            let samples = format!("{}.csv", name.replace(".mcap", ""));
            lab.ok(&format!("log convert {name} --ramps -o {samples}"));
            let info = lab.ok(&format!("log info {name} --json")).json();
            for (from, to) in [(name, &log), (&samples, &samples)] {
                std::fs::copy(lab.path(from), folder.join(to)).expect("a copy");
            }
            json!({ "log": log, "samples": samples, "model": info["model"], "metadata": info["metadata"] })
        })
        .collect();
    std::fs::copy(lab.path("model.json"), folder.join("model.json")).expect("a copy");
    std::fs::write(folder.join("logs.json"), list.to_string()).expect("a list");
    list
}
