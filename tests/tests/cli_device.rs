//! `run` and `record` on a device in real time at the other end of a line, and what watches over a run.

use std::collections::HashSet;
use std::fs;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::process::{Child, Stdio};
use std::sync::Arc;
use std::thread::{self, sleep};
use std::time::Duration;

use hyst_hw::wire::{Fault, State};
use hyst_tests::served::Served;
use hyst_tests::{Lab, PLANT, WARM, column};
use serde_json::Value;

const RATE_HZ: f64 = 500.0;
/// A machine on which other tests run may leave a device alone for a while.
const PATIENT: &str = "--silence 30";

/// With a model of kind `pi` that holds the plant's lag.
fn lab() -> Lab {
    let lab = Lab::with_model();
    lab.ok("diagnose train.csv --model model.json -o extended.json");
    fs::rename(lab.path("extended.json"), lab.path("model.json")).unwrap();
    lab
}

/// All events of a log, by kind.
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
fn a_drive_over_a_socket_is_played_as_it_stands_and_looking_moves_nothing() {
    let (lab, device) = (Lab::new(), Served::plant(PLANT, RATE_HZ));
    let daq = device.daq();
    let said = lab.ok(&format!("record --daq {daq} --seconds 0.5 -o rest.csv --log rest.mcap --json")).json();
    assert_eq!(said["samples"], 250);
    assert!(said["deviation"].as_f64().unwrap() > 0.0);
    assert_eq!(lab.read("rest.csv").lines().count(), 251);
    assert_eq!(device.put_out(), [0.0; 0], "nothing may be put out by a command that looks");

    lab.ok(&format!("excite sine --rate {RATE_HZ} --high 80 --frequency 2 --cycles 2 -o u.csv"));
    let said = lab
        .ok(&format!("run --daq {daq} --drive u.csv --record y.csv --log y.mcap --slew 5000 {PATIENT} --json"))
        .json();
    let (sent, played) = (column(&lab.read("u.csv"), "voltage_v"), column(&lab.read("y.csv"), "voltage_v"));
    assert_eq!(sent.len(), played.len());
    assert!(sent.iter().zip(&played).all(|(a, b)| *a as f32 == *b as f32));
    assert!(said["clock"]["uncertainty_s"].as_f64().unwrap() < 0.1, "{said}");
    let steepest = device.put_out().windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    assert!(steepest <= 10.001, "{steepest} V in a period of 2 ms at 5000 V/s");
    assert_eq!(device.put_out().last(), Some(&0.0));
    let info = lab.ok("log info y.mcap").stdout;
    assert!(info.contains("clock.began_unix_s"), "{info}");
    assert_eq!(device.end().state, State::Idle);
}

#[test]
fn a_loop_that_the_device_closes_follows_better_than_its_inverse_alone_and_tells_the_force() {
    let lab = lab();
    let loaded =
        format!("{PLANT}[load]\nnewtons = 2\num_per_n = 0.8\nperiod_s = 1.7\nshape = \"sine\"\nrecorded = false\n");
    let device = Served::plant(&loaded, RATE_HZ);
    let run = |control: &str, more: &str| {
        lab.ok(&format!(
            "run --daq {} --model model.json --reference sine:4,14,1,3 --control {control} --settle 0.5 --log run.mcap --json {PATIENT} {more}",
            device.daq()
        ))
        .json()
    };
    let alone = run("feedforward", "");
    let looped = run("pid+feedforward", "--kout 1.25 --record looped.csv");
    let rmse = |said: &Value| said["tracking"]["rmse"].as_f64().unwrap();
    assert!(rmse(&looped) < 0.2 * rmse(&alone), "{looped}\n{alone}");
    assert_eq!((&looped["loop_on_device"], &alone["loop_on_device"]), (&true.into(), &false.into()));
    // What the log has of it is the record, without the rows in which the output had not come to the reference yet.
    let (converted, record) = (lab.ok("log convert run.mcap").stdout, lab.read("looped.csv"));
    let header = |text: &str| text.lines().next().unwrap().split(',').map(str::to_owned).collect::<HashSet<_>>();
    assert_eq!(header(&converted), header(&record));
    for name in ["voltage_v", "displacement_um", "reference_um"] {
        assert_eq!(column(&converted, name), column(&record, name), "{name}");
    }
    // The force that acts goes from −2 to 2 N; what acts when the run begins is where the estimate begins.
    let force = column(&lab.read("looped.csv"), "estimated_force_n");
    let (low, high) = force.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), f| (l.min(*f), h.max(*f)));
    assert!((3.0..5.5).contains(&(high - low)), "{low} {high}");

    let refused = |control: &str| {
        let line =
            format!("run --daq {} --model model.json --reference sine:4,14,1,3 --control {control}", device.daq());
        lab.refuses(&line, 2)
    };
    assert!(refused("pid").contains("--control pid+feedforward"));
    let line = format!(
        "run --daq {} --model model.json --reference sine:4,14,1,3 --control pid+feedforward --pid=0,-5",
        device.daq()
    );
    assert!(lab.refuses(&line, 2).contains("wrong sign"));
    // An output that does not come to its reference ends the run on the device.
    let line = format!(
        "run --daq {} --model model.json --reference sine:4,14,1,3 --control pid+feedforward --pid 0,0.001 --max-error 0.2 --log astray.mcap --record astray.csv {PATIENT}",
        device.daq()
    );
    let ran = lab.run(&line);
    assert_eq!(ran.code, 3, "{ran:?}");
    assert!(ran.stderr.contains(&Fault::TrackingError.to_string()), "{ran:?}");
    assert!(ran.stderr.contains("astray.csv is not written"), "it never came to its reference: {ran:?}");
    // Nor does one for which the drive may not go far enough.
    let line = format!(
        "run --daq {} --model model.json --reference triangle:4,18,0.1,10 --control pid+feedforward --limit 0,40 --clear --log held.mcap --record held.csv {PATIENT}",
        device.daq()
    );
    let ran = lab.run(&line);
    assert_eq!(ran.code, 3, "{ran:?}");
    assert!(ran.stderr.contains(&Fault::Saturation.to_string()), "{ran:?}");
    // Each row that was measured stands beside what was wanted there, also where the device looks ahead.
    let (logged, kept) = (lab.ok("log convert held.mcap").stdout, lab.read("held.csv"));
    for name in ["reference_um", "voltage_v"] {
        let kept = column(&kept, name);
        assert!(!kept.is_empty() && kept.len() < 5000, "{}", kept.len());
        assert_eq!(kept, column(&logged, name), "{name}");
    }
    let steepest = device.put_out().windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    // A fault is about as gentle as the run.
    assert!(steepest < 5.0, "{steepest} V in 2 ms");
    assert!(device.put_out().iter().rev().take_while(|v| **v <= 40.0).count() > 500, "{:?}", device.put_out());
    assert_eq!(device.put_out().last(), Some(&0.0));
}

#[test]
fn a_loop_on_the_device_begins_where_it_rests_also_with_a_model_of_a_part_of_the_range() {
    let (lab, device) = (Lab::new(), Served::plant(PLANT, RATE_HZ));
    lab.write("plant.toml", PLANT);
    lab.ok("excite identification --rate 500 --low 20 --high 90 --seconds 8 --slow 4 --hold 0.3 -o u.csv");
    lab.ok("run --daq sim:plant.toml --drive u.csv --record train.csv");
    lab.ok("fit train.csv --model pi -o model.json");
    lab.ok(&format!(
        "run --daq {} --model model.json --reference sine:6,14,1,2 --control pid+feedforward --record y.csv {PATIENT}",
        device.daq()
    ));
    let put_out = device.put_out();
    let steepest = put_out.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    assert!(steepest < 5.0 && put_out[0].abs() < 5.0, "{steepest} V in 2 ms, from {} V", put_out[0]);
}

#[test]
fn what_earlier_runs_left_in_the_actuator_is_no_news_and_both_loops_follow() {
    let (lab, device) = (lab(), Served::plant(PLANT, RATE_HZ));
    let run = |control: &str| {
        lab.ok(&format!(
            "run --daq {} --model model.json --reference sine:4,14,2,5 --control {control} --log run.mcap --json {PATIENT}",
            device.daq()
        ))
        .json()
    };
    let late = ["feedforward", "feedforward", "pid+feedforward"].map(|control| {
        let said = run(control);
        assert_eq!(said["watch"]["explains"], true, "{control}: {said}");
        assert_eq!(events(&lab, "run.mcap"), [], "{control}");
        said["tracking"]["rmse_last_half"].as_f64().unwrap()
    });
    // Once the start is over the output is where the reference is, row by row; a loop that were off by a row would be worse than no loop.
    assert!(late[1] < 0.15 && late[2] < 0.5 * late[1], "{late:?} µm");
}

#[test]
fn a_gain_that_follows_a_temperature_needs_a_thermometer() {
    let (lab, device) = (Lab::with_train(WARM), Served::plant(PLANT, RATE_HZ));
    lab.ok("fit train.csv --model pi -o model.json");
    lab.ok("diagnose train.csv --model model.json -o extended.json");
    let line = format!("run --daq {} --model extended.json --reference sine:6,14,1,2 --record y.csv", device.daq());
    let message = lab.refuses(&format!("{line} --control pid+feedforward"), 2);
    assert!(message.contains("does not measure") && message.contains("--temperature"), "{message}");
    assert_eq!(device.put_out(), [0.0; 0]);
}

#[test]
fn a_drive_steeper_than_the_amplifier_is_refused() {
    let (lab, device) = (Lab::new(), Served::plant(PLANT, RATE_HZ));
    // 120,000 V/s; the device's amplifier can do 100,000.
    lab.write("u.csv", "time_s,voltage_v\n0,0\n0.0005,60\n0.001,0\n");
    let message = lab.refuses(&format!("run --daq {} --drive u.csv --record y.csv", device.daq()), 2);
    assert!(message.contains("steeper than 100000 V/s"), "{message}");
    lab.ok("excite sine --rate 700 --high 80 --frequency 2 --cycles 2 -o u.csv");
    let message = lab.refuses(&format!("run --daq {} --drive u.csv --record y.csv", device.daq()), 2);
    assert!(message.contains("700 Hz is outside the device's 500 to 500 Hz"), "{message}");
    assert!(!message.contains("warning"), "{message}");
    assert_eq!(device.put_out(), [0.0; 0]);
}

#[test]
fn a_line_that_is_too_slow_is_told_and_a_fault_is_as_gentle_as_the_run() {
    let (lab, device) = (Lab::new(), Served::plant(PLANT, RATE_HZ));
    lab.ok(&format!("excite sine --rate {RATE_HZ} --high 80 --frequency 0.5 --cycles 1 -o u.csv"));
    let line = slowed(&device, Duration::from_millis(600));
    let said = lab.ok(&format!("run --daq {line} --drive u.csv --record y.csv --log y.mcap {PATIENT} --json"));
    assert!(said.stderr.contains("the line is too slow for this sample rate"), "{said:?}");
    assert!(said.json()["gaps"]["periods"].as_u64().unwrap() > 0, "{said:?}");
    assert_eq!(events(&lab, "y.mcap")[0].0, "gap");
    let kept = lab.ok("log convert y.mcap").stdout;
    assert_eq!(column(&kept, "segment"), column(&lab.read("y.csv"), "segment"));
    // Each drive was played all the same, in its order.
    let (sent, played) = (column(&lab.read("u.csv"), "voltage_v"), column(&lab.read("y.csv"), "voltage_v"));
    assert!(sent.iter().zip(&played).all(|(a, b)| *a as f32 == *b as f32) && sent.len() == played.len());

    // 80 V come within a second, at 126 V/s: so steep, half as much added, may the way to rest be.
    let before = device.put_out().len();
    let line = slowed(&device, Duration::from_secs(4));
    let ran = lab.run(&format!("run --daq {line} --drive u.csv --record z.csv"));
    assert_eq!(ran.code, 3, "{ran:?}");
    let put_out = device.put_out().split_off(before);
    let steepest = put_out.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    assert!(steepest < 1.51 * 126.0 / RATE_HZ as f32, "{steepest} V in 2 ms");
    assert_eq!(put_out.last(), Some(&0.0));
}

/// A way to `device` that keeps everything back for so long, once, when it has put out 400 drives more.
fn slowed(device: &Served, pause: Duration) -> String {
    let (told, before) = (Arc::clone(&device.told), device.put_out().len());
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
            if !paused && told.lock().unwrap().put_out.len() > before + 400 {
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

/// Waits until a run has driven the device so far \[V\].
fn until_beyond(volts: f32, device: &Served, host: &mut Child) {
    while device.put_out().last().is_none_or(|v| *v < volts) {
        sleep(Duration::from_millis(20));
        assert!(host.try_wait().unwrap().is_none(), "the run has ended by itself");
    }
}

#[test]
fn a_host_that_is_killed_leaves_the_device_to_its_watchdog_and_the_next_one_is_told() {
    let (lab, device) = (Lab::new(), Served::plant(PLANT, RATE_HZ));
    lab.ok(&format!("excite sine --rate {RATE_HZ} --high 80 --frequency 0.2 --cycles 2 -o u.csv"));
    let line = format!("run --daq {} --drive u.csv --log killed.mcap --slew 400", device.daq());
    let mut host = lab.command(&line).stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
    until_beyond(40.0, &device, &mut host);
    host.kill().unwrap();
    host.wait().unwrap();
    while device.put_out().last() != Some(&0.0) {
        sleep(Duration::from_millis(20));
    }
    let steepest = device.put_out().windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    assert!(steepest <= 0.8001, "{steepest} V in a period of 2 ms at 400 V/s");
    let ran = lab.run(&line.replace("killed", "next"));
    assert_eq!(ran.code, 2, "{ran:?}");
    assert!(ran.stderr.contains("--clear"), "{ran:?}");
    lab.ok(&format!("excite sine --rate {RATE_HZ} --high 20 --frequency 5 --cycles 2 -o short.csv"));
    lab.ok(&format!("{line} --clear").replace("killed", "next").replace("u.csv", "short.csv"));
    assert_eq!(device.end().state, State::Idle);
}

#[test]
fn an_emergency_stop_brings_a_device_to_rest_and_keeps_it_there() {
    let (lab, device) = (Lab::with_model(), Served::plant(PLANT, RATE_HZ));
    let status = |of: &str| {
        let said = lab.ok(&format!("status --daq {} --json", device.daq())).json();
        assert_eq!((&said["present_v"], &said["high_v"]), (&0.0.into(), &100.0.into()), "{said}");
        said[of].clone()
    };
    assert_eq!(status("state"), "idle");
    let said = lab.ok(&format!("stop --daq {}", device.daq())).stdout;
    assert!(said.contains("--clear"), "{said}");
    assert_eq!(status("fault")["code"], 2);
    let said = lab.ok(&format!("status --daq {}", device.daq())).stdout;
    assert!(said.contains("fault 2: an emergency stop was requested"), "{said}");
    lab.refuses("status --daq sim:plant.toml", 2);
    let run = format!("run --daq {} --drive u.csv --record y.csv {PATIENT}", device.daq());
    let message = lab.refuses(&run, 2);
    assert!(message.contains(&Fault::Emergency.to_string()), "{message}");
    assert_eq!(device.put_out(), [0.0; 0]);
    lab.refuses("stop --daq sim:plant.toml", 2);
    lab.ok(&format!("excite sine --rate {RATE_HZ} --high 20 --frequency 5 --cycles 2 -o u.csv"));
    // What cannot be played clears nothing.
    lab.refuses(&format!("{run} --clear").replace("u.csv", "absent.csv"), 2);
    assert_eq!(status("state"), "fault");
    let ran = lab.ok(&format!("{run} --clear --log y.mcap"));
    assert!(ran.stderr.contains("cleared fault 2"), "{ran:?}");
    let info = lab.ok("log info y.mcap").stdout;
    assert!(info.contains("cleared.fault"), "{info}");
    let said = lab.ok(&format!("stop --daq {} --clear", device.daq())).stdout;
    assert!(said.contains("no fault to clear"), "{said}");
}

/// As on a bus, who sees that something goes wrong stops what somebody else has started.
#[test]
fn an_emergency_stop_from_another_terminal_ends_a_run() {
    let (lab, device) = (Lab::new(), Served::plant(PLANT, RATE_HZ));
    lab.ok(&format!("excite sine --rate {RATE_HZ} --high 80 --frequency 0.05 --cycles 1 -o u.csv"));
    let line = format!("run --daq {} --drive u.csv --record y.csv --slew 100 {PATIENT}", device.daq());
    let mut host = lab.command(&line).stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
    until_beyond(30.0, &device, &mut host);
    let said = lab.ok(&format!("status --daq {}", device.daq())).stdout;
    assert!(said.contains(": runs\n"), "{said}");
    // To clear is not to stop, and is not put off until there is something to clear.
    for clear in [format!("stop --daq {} --clear", device.daq()), format!("{line} --clear").replace("y.csv", "z.csv")] {
        let message = lab.refuses(&clear, 2);
        assert!(message.contains("busy with another run"), "{message}");
    }
    lab.ok(&format!("stop --daq {}", device.daq()));
    let said = lab.ok(&format!("status --daq {}", device.daq())).stdout;
    assert!(said.contains("fault 2"), "{said}");
    let ended = host.wait_with_output().unwrap();
    let message = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(3), "{message}");
    assert!(message.contains("fault 2") && message.contains("y.csv"), "{message}");
    while device.put_out().last() != Some(&0.0) {
        sleep(Duration::from_millis(20));
    }
}

#[test]
fn a_run_that_gets_too_hot_or_astray_is_ended_with_a_code_and_a_sentence() {
    let lab = Lab::with_model();
    lab.write("warm.toml", format!("{PLANT}{WARM}"));
    let run = |more: &str| {
        lab.run(&format!(
            "run --daq sim:{more} --model model.json --reference sine:4,14,1,6 --control gain --log run.mcap --record run.csv"
        ))
    };
    for (more, fault) in [
        ("warm.toml --hottest 27 --temperature 22", Fault::Temperature),
        ("plant.toml --max-error 0.001", Fault::TrackingError),
    ] {
        let ran = run(more);
        assert_eq!(ran.code, 3, "{more}: {ran:?}");
        let sentence = format!("(fault {}): {fault}", fault.code());
        assert!(ran.stderr.contains(&sentence), "{sentence} is missing in {ran:?}");
        let events = events(&lab, "run.mcap");
        assert_eq!(events.len(), 1);
        assert_eq!(events[0].0, "fault");
        // The ramp to rest is in the log, too.
        let all = lab.ok("log convert run.mcap --ramps").stdout;
        assert_eq!(column(&all, "voltage_v").last(), Some(&0.0));
        // Each row that was measured stands beside what was wanted there.
        let logged = column(&lab.ok("log convert run.mcap").stdout, "reference_um");
        assert!(logged.len() < 6 * RATE_HZ as usize && !logged.is_empty(), "{}", logged.len());
        assert_eq!(column(&lab.read("run.csv"), "reference_um"), logged);
    }
    assert_eq!(run("warm.toml --hottest 60 --temperature 22").code, 0);
    // A reference beyond what the drive can do holds the loop at its limit.
    let ran = lab.run("run --daq sim:plant.toml --model model.json --reference steps:4,60,1,3 --control pid");
    assert_eq!(ran.code, 3, "{ran:?}");
    assert!(ran.stderr.contains(&Fault::Saturation.to_string()), "{ran:?}");
}

#[test]
fn a_model_that_stops_explaining_its_device_is_told_logged_and_can_be_diagnosed() {
    let lab = lab();
    let run = |plant: &str| {
        lab.ok(&format!(
            "run --daq sim:{plant} --model model.json --reference triangle:4,14,0.7,20 --log run.mcap --record run.csv --json"
        ))
    };
    let said = run("plant.toml").json();
    assert_eq!((&said["watch"]["explains"], &said["watch"]["lost_at_s"]), (&true.into(), &Value::Null), "{said}");
    assert_eq!(events(&lab, "run.mcap"), []);

    // Half way its gain falls by a tenth, as when a joint comes loose.
    lab.write("loose.toml", format!("{PLANT}[[disturbance]]\nkind = \"gain-step\"\nshare = -0.1\nat_s = 12.0\n"));
    let ran = run("loose.toml");
    assert!(ran.stderr.contains("has stopped explaining the output"), "{ran:?}");
    let said = ran.json();
    let at = said["watch"]["lost_at_s"].as_f64().unwrap();
    assert!((12.0..16.0).contains(&at), "{said}");
    assert_eq!(events(&lab, "run.mcap")[0].0, "model-lost");
    let text =
        lab.ok("run --daq sim:loose.toml --model model.json --reference triangle:4,14,0.7,20 --log again.mcap").stdout;
    let next = text.lines().find_map(|line| line.strip_prefix("next: hystctl ")).unwrap_or_else(|| panic!("{text}"));
    lab.ok(next);
}

#[test]
fn a_force_is_estimated_while_a_plant_runs() {
    let lab = lab();
    lab.write("loaded.toml", format!("{PLANT}[load]\nnewtons = 3\num_per_n = 0.8\nperiod_s = 2\nshape = \"wander\"\n"));
    let said = lab
        .ok("run --daq sim:loaded.toml --model model.json --reference sine:4,14,0.5,6 --kout 1.25 --record run.csv --json")
        .json();
    assert!(said["watch"].is_null());
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
fn references_come_from_shapes_and_stdin() {
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
    assert!(lab.refuses(&format!("{line} sine:6,14,1"), 2).contains("FORM:LOW,HIGH,HZ,SECONDS"));
    assert!(lab.refuses(&format!("{line} r.csv --rate 1000"), 2).contains("--rate"));
    let mut empty = lab.command(&format!("{line} -")).stdin(Stdio::null()).output().unwrap();
    assert_eq!(empty.status.code(), Some(2));
    empty.stderr.make_ascii_lowercase();
    assert!(String::from_utf8_lossy(&empty.stderr).contains("stdin"));
}
