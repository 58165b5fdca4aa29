//! `run` and `record` on a device in real time over TCP, and the monitoring of a run.

mod stops;

use std::collections::HashSet;
use std::fs;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::process::Stdio;
use std::sync::Arc;
use std::thread::{self, sleep};
use std::time::Duration;

use hyst_hw::wire::{Fault, State};
use hyst_tests::served::Served;
use hyst_tests::{Lab, PLANT, WARM, column};
use serde_json::Value;

const RATE_HZ: f64 = 500.0;
/// A long watchdog time: other tests may delay the host.
const LONG_SILENCE: &str = "--silence 30";

/// Returns a folder with a model of kind `pi` that includes the plant's lag.
fn lab() -> Lab {
    let lab = Lab::with_model();
    lab.ok("diagnose train.csv --model model.json -o extended.json");
    fs::rename(lab.path("extended.json"), lab.path("model.json")).unwrap();
    lab
}

/// Returns kind and text of all events of a log.
fn events(lab: &Lab, name: &str) -> Vec<(String, String)> {
    let bytes = fs::read(lab.path(name)).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let events = messages.filter(|message| message.channel.topic == "/actuator/event");
    events
        .map(|message| {
            let event: Value = serde_json::from_slice(&message.data).unwrap();
            let text = |key: &str| event[key].as_str().unwrap().to_owned();
            (text("kind"), text("text"))
        })
        .collect()
}

#[test]
fn a_drive_over_a_socket_is_played_exactly_and_recording_outputs_nothing() {
    let (lab, device) = (Lab::new(), Served::plant(PLANT, RATE_HZ));
    let daq = device.daq();
    let report = lab.ok(&format!("record --daq {daq} --seconds 0.5 -o rest.csv --log rest.mcap --json")).json();
    assert_eq!(report["samples"], 250);
    assert!(report["deviation"].as_f64().unwrap() > 0.0);
    assert_eq!(lab.read("rest.csv").lines().count(), 251);
    assert_eq!(device.put_out(), [0.0; 0], "record must not output a voltage");

    lab.ok(&format!("excite sine --rate {RATE_HZ} --high 80 --frequency 2 --cycles 2 -o u.csv"));
    let report = lab
        .ok(&format!("run --daq {daq} --drive u.csv --record y.csv --log y.mcap --slew 5000 {LONG_SILENCE} --json"))
        .json();
    let (sent, played) = (column(&lab.read("u.csv"), "voltage_v"), column(&lab.read("y.csv"), "voltage_v"));
    assert_eq!(sent.len(), played.len());
    assert!(sent.iter().zip(&played).all(|(a, b)| *a as f32 == *b as f32));
    assert!(report["clock"]["uncertainty_s"].as_f64().unwrap() < 0.1, "{report}");
    let steepest = device.put_out().windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    assert!(steepest <= 10.001, "{steepest} V per period of 2 ms at 5000 V/s");
    assert_eq!(device.put_out().last(), Some(&0.0));
    let info = lab.ok("log info y.mcap").stdout;
    assert!(info.contains("clock.began_unix_s"), "{info}");
    assert_eq!(device.end().state, State::Idle);
}

#[test]
fn a_loop_on_the_device_follows_better_than_feedforward_and_estimates_the_force() {
    let lab = lab();
    let loaded =
        format!("{PLANT}[load]\nnewtons = 2\num_per_n = 0.8\nperiod_s = 1.7\nshape = \"sine\"\nrecorded = false\n");
    let device = Served::plant(&loaded, RATE_HZ);
    let run = |control: &str, more: &str| {
        lab.ok(&format!(
            "run --daq {} --model model.json --reference sine:4,14,1,3 --control {control} --settle 0.5 --log run.mcap --json {LONG_SILENCE} {more}",
            device.daq()
        ))
        .json()
    };
    let alone = run("feedforward", "");
    let looped = run("pid+feedforward", "--kout 1.25 --record looped.csv");
    let rmse = |report: &Value| report["tracking"]["rmse"].as_f64().unwrap();
    assert!(rmse(&looped) < 0.2 * rmse(&alone), "{looped}\n{alone}");
    assert_eq!((&looped["loop_on_device"], &alone["loop_on_device"]), (&true.into(), &false.into()));
    // The log and the record have the same rows, without those before the output has reached the reference.
    let (converted, record) = (lab.ok("log convert run.mcap").stdout, lab.read("looped.csv"));
    let header = |text: &str| text.lines().next().unwrap().split(',').map(str::to_owned).collect::<HashSet<_>>();
    assert_eq!(header(&converted), header(&record));
    for name in ["voltage_v", "displacement_um", "reference_um"] {
        assert_eq!(column(&converted, name), column(&record, name), "{name}");
    }
    // The force varies from −2 to 2 N. The estimate starts at zero for the force at the start of the run.
    let force = column(&lab.read("looped.csv"), "estimated_force_n");
    let (low, high) = force.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), f| (l.min(*f), h.max(*f)));
    assert!((3.0..5.5).contains(&(high - low)), "{low} {high}");

    let rejected = |control: &str| {
        let line =
            format!("run --daq {} --model model.json --reference sine:4,14,1,3 --control {control}", device.daq());
        lab.fails(&line, 2)
    };
    assert!(rejected("pid").contains("--control pid+feedforward"));
    let line = format!(
        "run --daq {} --model model.json --reference sine:4,14,1,3 --control pid+feedforward --pid=0,-5",
        device.daq()
    );
    assert!(lab.fails(&line, 2).contains("wrong sign"));
    // If the output does not reach the reference, the device stops the run.
    let line = format!(
        "run --daq {} --model model.json --reference sine:4,14,1,3 --control pid+feedforward --pid 0,0.001 --max-error 0.2 --log astray.mcap --record astray.csv {LONG_SILENCE}",
        device.daq()
    );
    let ran = lab.run(&line);
    assert_eq!(ran.code, 3, "{ran:?}");
    assert!(ran.stderr.contains(&Fault::TrackingError.to_string()), "{ran:?}");
    assert!(ran.stderr.contains("astray.csv is not written"), "the output never reached the reference: {ran:?}");
    // The same if the limits of the drive are too narrow.
    let line = format!(
        "run --daq {} --model model.json --reference triangle:4,18,0.1,10 --control pid+feedforward --limit 0,40 --clear --log held.mcap --record held.csv {LONG_SILENCE}",
        device.daq()
    );
    let ran = lab.run(&line);
    assert_eq!(ran.code, 3, "{ran:?}");
    assert!(ran.stderr.contains(&Fault::Saturation.to_string()), "{ran:?}");
    // Each measured row has its own reference value, also with a preview on the device.
    let (logged, kept) = (lab.ok("log convert held.mcap").stdout, lab.read("held.csv"));
    for name in ["reference_um", "voltage_v"] {
        let kept = column(&kept, name);
        assert!(!kept.is_empty() && kept.len() < 5000, "{}", kept.len());
        assert_eq!(kept, column(&logged, name), "{name}");
    }
    let steepest = device.put_out().windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    // The ramp of a fault is about as slow as the run.
    assert!(steepest < 5.0, "{steepest} V in 2 ms");
    assert!(device.put_out().iter().rev().take_while(|v| **v <= 40.0).count() > 500, "{:?}", device.put_out());
    assert_eq!(device.put_out().last(), Some(&0.0));
}

#[test]
fn a_loop_on_the_device_starts_at_rest_with_a_model_of_a_part_of_the_range() {
    let (lab, device) = (Lab::new(), Served::plant(PLANT, RATE_HZ));
    lab.write("plant.toml", PLANT);
    lab.ok("excite identification --rate 500 --low 20 --high 90 --seconds 8 --slow 4 --hold 0.3 -o u.csv");
    lab.ok("run --daq sim:plant.toml --drive u.csv --record train.csv");
    lab.ok("fit train.csv --model pi -o model.json");
    lab.ok(&format!(
        "run --daq {} --model model.json --reference sine:6,14,1,2 --control pid+feedforward --record y.csv {LONG_SILENCE}",
        device.daq()
    ));
    let put_out = device.put_out();
    let steepest = put_out.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    assert!(steepest < 5.0 && put_out[0].abs() < 5.0, "{steepest} V in 2 ms, from {} V", put_out[0]);
}

#[test]
fn memory_of_earlier_runs_is_not_reported_and_both_controls_follow() {
    let (lab, device) = (lab(), Served::plant(PLANT, RATE_HZ));
    let run = |control: &str| {
        lab.ok(&format!(
            "run --daq {} --model model.json --reference sine:4,14,2,5 --control {control} --log run.mcap --json {LONG_SILENCE}",
            device.daq()
        ))
        .json()
    };
    let late = ["feedforward", "feedforward", "pid+feedforward"].map(|control| {
        let report = run(control);
        assert_eq!(report["watch"]["explains"], true, "{control}: {report}");
        assert_eq!(events(&lab, "run.mcap"), [], "{control}");
        report["tracking"]["rmse_last_half"].as_f64().unwrap()
    });
    // After the start, the output follows the reference row by row. A loop that is off by one row would be worse than
    // no loop.
    assert!(late[1] < 0.15 && late[2] < 0.5 * late[1], "{late:?} µm");
}

#[test]
fn a_temperature_effect_needs_a_measured_temperature_on_the_device() {
    let (lab, device) = (Lab::with_train(WARM), Served::plant(PLANT, RATE_HZ));
    lab.ok("fit train.csv --model pi -o model.json");
    lab.ok("diagnose train.csv --model model.json -o extended.json");
    let line = format!("run --daq {} --model extended.json --reference sine:6,14,1,2 --record y.csv", device.daq());
    let message = lab.fails(&format!("{line} --control pid+feedforward"), 2);
    assert!(message.contains("does not measure") && message.contains("--temperature"), "{message}");
    assert_eq!(device.put_out(), [0.0; 0]);
}

#[test]
fn a_drive_steeper_than_the_amplifier_is_rejected() {
    let (lab, device) = (Lab::new(), Served::plant(PLANT, RATE_HZ));
    // 120,000 V/s; the limit of the device is 100,000 V/s.
    lab.write("u.csv", "time_s,voltage_v\n0,0\n0.0005,60\n0.001,0\n");
    let message = lab.fails(&format!("run --daq {} --drive u.csv --record y.csv", device.daq()), 2);
    assert!(message.contains("steeper than 100000 V/s"), "{message}");
    lab.ok("excite sine --rate 700 --high 80 --frequency 2 --cycles 2 -o u.csv");
    let message = lab.fails(&format!("run --daq {} --drive u.csv --record y.csv", device.daq()), 2);
    assert!(message.contains("700 Hz is outside the device's 500 to 500 Hz"), "{message}");
    assert!(!message.contains("warning"), "{message}");
    assert_eq!(device.put_out(), [0.0; 0]);
}

#[test]
fn a_slow_line_is_reported_and_a_fault_ramps_as_slowly_as_the_run() {
    let (lab, device) = (Lab::new(), Served::plant(PLANT, RATE_HZ));
    lab.ok(&format!("excite sine --rate {RATE_HZ} --high 80 --frequency 0.5 --cycles 1 -o u.csv"));
    let line = slowed(&device, Duration::from_millis(600));
    let ran = lab.ok(&format!("run --daq {line} --drive u.csv --record y.csv --log y.mcap {LONG_SILENCE} --json"));
    assert!(ran.stderr.contains("the line is too slow for this sample rate"), "{ran:?}");
    assert!(ran.json()["gaps"]["periods"].as_u64().unwrap() > 0, "{ran:?}");
    assert_eq!(events(&lab, "y.mcap")[0].0, "gap");
    let kept = lab.ok("log convert y.mcap").stdout;
    assert_eq!(column(&kept, "segment"), column(&lab.read("y.csv"), "segment"));
    // All drives were still played in order.
    let (sent, played) = (column(&lab.read("u.csv"), "voltage_v"), column(&lab.read("y.csv"), "voltage_v"));
    assert!(sent.iter().zip(&played).all(|(a, b)| *a as f32 == *b as f32) && sent.len() == played.len());

    // The drive rises to 80 V within 1 s, at most at 126 V/s. The ramp to rest may be 1.5 times as steep.
    let before = device.put_out().len();
    let line = slowed(&device, Duration::from_secs(4));
    let ran = lab.run(&format!("run --daq {line} --drive u.csv --record z.csv"));
    assert_eq!(ran.code, 3, "{ran:?}");
    let put_out = device.put_out().split_off(before);
    let steepest = put_out.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    assert!(steepest < 1.51 * 126.0 / RATE_HZ as f32, "{steepest} V in 2 ms");
    assert_eq!(put_out.last(), Some(&0.0));
}

/// Starts a relay to `device` that pauses once, after the device has output 400 more drives. Returns its address.
fn slowed(device: &Served, pause: Duration) -> String {
    let (activity, before) = (Arc::clone(&device.activity), device.put_out().len());
    let device = TcpStream::connect(device.daq().trim_start_matches("tcp:")).unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    thread::spawn(move || {
        let (host, _) = listener.accept().unwrap();
        let (mut back_from, mut back_to) = (device.try_clone().unwrap(), host.try_clone().unwrap());
        let back = thread::spawn(move || io::copy(&mut back_from, &mut back_to));
        let (mut from, mut to, mut bytes) = (host, device, [0; 4096]);
        let mut paused = false;
        while let Ok(count @ 1..) = from.read(&mut bytes) {
            if !paused && activity.lock().unwrap().put_out.len() > before + 400 {
                sleep(pause);
                paused = true;
            }
            if to.write_all(&bytes[..count]).is_err() {
                break;
            }
        }
        let _ = to.shutdown(Shutdown::Both);
        let _ = back.join();
    });
    format!("tcp:{address}")
}

#[test]
fn a_model_that_no_longer_explains_its_device_is_reported_and_diagnosed() {
    let lab = lab();
    let run = |plant: &str| {
        lab.ok(&format!(
            "run --daq sim:{plant} --model model.json --reference triangle:4,14,0.7,20 --log run.mcap --record run.csv --json"
        ))
    };
    let report = run("plant.toml").json();
    assert_eq!((&report["watch"]["explains"], &report["watch"]["lost_at_s"]), (&true.into(), &Value::Null), "{report}");
    assert_eq!(events(&lab, "run.mcap"), []);

    // Halfway the gain falls by 10 %, as with a loose joint.
    lab.write("loose.toml", format!("{PLANT}[[disturbance]]\nkind = \"gain-step\"\nshare = -0.1\nat_s = 12.0\n"));
    let ran = run("loose.toml");
    assert!(ran.stderr.contains("has stopped explaining the output"), "{ran:?}");
    let report = ran.json();
    let at = report["watch"]["lost_at_s"].as_f64().unwrap();
    assert!((12.0..16.0).contains(&at), "{report}");
    assert_eq!(events(&lab, "run.mcap")[0].0, "model-lost");
    let text =
        lab.ok("run --daq sim:loose.toml --model model.json --reference triangle:4,14,0.7,20 --log again.mcap").stdout;
    let next = text.lines().find_map(|line| line.strip_prefix("next: hystctl ")).unwrap_or_else(|| panic!("{text}"));
    lab.ok(next);
}

#[test]
fn a_force_is_estimated_during_a_run() {
    let lab = lab();
    lab.write("loaded.toml", format!("{PLANT}[load]\nnewtons = 3\num_per_n = 0.8\nperiod_s = 2\nshape = \"wander\"\n"));
    let report = lab
        .ok("run --daq sim:loaded.toml --model model.json --reference sine:4,14,0.5,6 --kout 1.25 --record run.csv --json")
        .json();
    assert!(report["watch"].is_null());
    let text = lab.read("run.csv");
    let (load, force) = (column(&text, "load_n"), column(&text, "estimated_force_n"));
    let rms = |x: &mut dyn Iterator<Item = f64>| {
        let (sum, count) = x.fold((0.0, 0.0), |(sum, count), x| (sum + x * x, count + 1.0));
        f64::sqrt(sum / count)
    };
    let (error, signal) = (rms(&mut load.iter().zip(&force).map(|(a, b)| a - b)), rms(&mut load.iter().copied()));
    assert!(error < 0.35 * signal, "{error} of {signal} N");
}

#[test]
fn references_can_be_shapes_and_stdin() {
    let lab = Lab::with_model();
    lab.reference("r.csv", 2.0, 14.0);
    let line = "run --daq sim:plant.toml --model model.json --json --reference";
    let of_file = lab.ok(&format!("{line} r.csv")).json();
    let mut piped = lab
        .command(&format!("{line} -"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    piped.stdin.take().unwrap().write_all(lab.read("r.csv").as_bytes()).unwrap();
    let output = piped.wait_with_output().unwrap();
    let of_stdin: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(of_file["tracking"], of_stdin["tracking"]);
    let shaped = lab.ok(&format!("{line} sine:6,14,1,2")).json();
    assert_eq!(shaped["samples"], 1000);
    let close = |key: &str| {
        (shaped["tracking"][key].as_f64().unwrap() / of_file["tracking"][key].as_f64().unwrap() - 1.0).abs()
    };
    assert!(close("rmse") < 0.05, "{shaped} {of_file}");
    assert_eq!(lab.ok(&format!("{line} steps:6,14,1,2 --rate 1000")).json()["samples"], 2000);
    assert!(lab.fails(&format!("{line} sine:6,14,1"), 2).contains("FORM:LOW,HIGH,HZ,SECONDS"));
    assert!(lab.fails(&format!("{line} r.csv --rate 1000"), 2).contains("--rate"));
    let mut empty = lab.command(&format!("{line} -")).stdin(Stdio::null()).output().unwrap();
    assert_eq!(empty.status.code(), Some(2));
    empty.stderr.make_ascii_lowercase();
    assert!(String::from_utf8_lossy(&empty.stderr).contains("stdin"));
}
