//! Runs that end early: a killed host, an emergency stop, a temperature or an error above its limit.

use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::Duration;

use hyst_hw::wire::{Fault, State};
use hyst_tests::served::Served;
use hyst_tests::{Lab, PLANT, WARM, column};

use super::{LONG_SILENCE, RATE_HZ, events};

/// Waits until the drive of a run has reached `volts`.
fn wait_for_drive(volts: f32, device: &Served, host: &mut Child) {
    while device.put_out().last().is_none_or(|v| *v < volts) {
        sleep(Duration::from_millis(20));
        assert!(host.try_wait().unwrap().is_none(), "the run has ended early");
    }
}

#[test]
fn after_a_killed_host_the_watchdog_stops_the_device_and_the_next_host_is_informed() {
    let (lab, device) = (Lab::new(), Served::plant(PLANT, RATE_HZ));
    lab.ok(&format!("excite sine --rate {RATE_HZ} --high 80 --frequency 0.2 --cycles 2 -o u.csv"));
    let line = format!("run --daq {} --drive u.csv --log killed.mcap --slew 400", device.daq());
    let mut host = lab.command(&line).stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
    wait_for_drive(40.0, &device, &mut host);
    host.kill().unwrap();
    host.wait().unwrap();
    while device.put_out().last() != Some(&0.0) {
        sleep(Duration::from_millis(20));
    }
    let steepest = device.put_out().windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    assert!(steepest <= 0.8001, "{steepest} V per period of 2 ms at 400 V/s");
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
        let report = lab.ok(&format!("status --daq {} --json", device.daq())).json();
        assert_eq!((&report["present_v"], &report["high_v"]), (&0.0.into(), &100.0.into()), "{report}");
        report[of].clone()
    };
    assert_eq!(status("state"), "idle");
    let printed = lab.ok(&format!("stop --daq {}", device.daq())).stdout;
    assert!(printed.contains("--clear"), "{printed}");
    assert_eq!(status("fault")["code"], 2);
    let printed = lab.ok(&format!("status --daq {}", device.daq())).stdout;
    assert!(printed.contains("fault 2: an emergency stop was requested"), "{printed}");
    lab.fails("status --daq sim:plant.toml", 2);
    let run = format!("run --daq {} --drive u.csv --record y.csv {LONG_SILENCE}", device.daq());
    let message = lab.fails(&run, 2);
    assert!(message.contains(&Fault::Emergency.to_string()), "{message}");
    assert_eq!(device.put_out(), [0.0; 0]);
    lab.fails("stop --daq sim:plant.toml", 2);
    lab.ok(&format!("excite sine --rate {RATE_HZ} --high 20 --frequency 5 --cycles 2 -o u.csv"));
    // A rejected run does not clear the fault.
    lab.fails(&format!("{run} --clear").replace("u.csv", "absent.csv"), 2);
    assert_eq!(status("state"), "fault");
    let ran = lab.ok(&format!("{run} --clear --log y.mcap"));
    assert!(ran.stderr.contains("cleared fault 2"), "{ran:?}");
    let info = lab.ok("log info y.mcap").stdout;
    assert!(info.contains("cleared.fault"), "{info}");
    let printed = lab.ok(&format!("stop --daq {} --clear", device.daq())).stdout;
    assert!(printed.contains("no fault to clear"), "{printed}");
}

#[test]
fn an_emergency_stop_from_another_terminal_stops_a_run() {
    let (lab, device) = (Lab::new(), Served::plant(PLANT, RATE_HZ));
    lab.ok(&format!("excite sine --rate {RATE_HZ} --high 80 --frequency 0.05 --cycles 1 -o u.csv"));
    let line = format!("run --daq {} --drive u.csv --record y.csv --slew 100 {LONG_SILENCE}", device.daq());
    let mut host = lab.command(&line).stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
    wait_for_drive(30.0, &device, &mut host);
    let printed = lab.ok(&format!("status --daq {}", device.daq())).stdout;
    assert!(printed.contains(": running\n"), "{printed}");
    // `--clear` does not stop a run, and does not wait for its end.
    for clear in [format!("stop --daq {} --clear", device.daq()), format!("{line} --clear").replace("y.csv", "z.csv")] {
        let message = lab.fails(&clear, 2);
        assert!(message.contains("busy with another run"), "{message}");
    }
    lab.ok(&format!("stop --daq {}", device.daq()));
    let printed = lab.ok(&format!("status --daq {}", device.daq())).stdout;
    assert!(printed.contains("fault 2"), "{printed}");
    let ended = host.wait_with_output().unwrap();
    let message = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(3), "{message}");
    assert!(message.contains("fault 2") && message.contains("y.csv"), "{message}");
    while device.put_out().last() != Some(&0.0) {
        sleep(Duration::from_millis(20));
    }
}

#[test]
fn too_high_a_temperature_or_error_stops_a_run_with_a_fault() {
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
        assert_eq!(ran.stderr.matches(&fault.to_string()).count(), 1, "{ran:?}");
        let events = events(&lab, "run.mcap");
        assert_eq!(events.len(), 1);
        assert_eq!(events[0].0, "fault");
        // The ramp to rest is in the log too.
        let all = lab.ok("log convert run.mcap --ramps").stdout;
        assert_eq!(column(&all, "voltage_v").last(), Some(&0.0));
        // Each measured row has its own reference value.
        let logged = column(&lab.ok("log convert run.mcap").stdout, "reference_um");
        assert!(logged.len() < 6 * RATE_HZ as usize && !logged.is_empty(), "{}", logged.len());
        assert_eq!(column(&lab.read("run.csv"), "reference_um"), logged);
    }
    assert_eq!(run("warm.toml --hottest 60 --temperature 22").code, 0);
    // A reference out of reach saturates the drive.
    let ran = lab.run("run --daq sim:plant.toml --model model.json --reference steps:4,60,1,3 --control pid");
    assert_eq!(ran.code, 3, "{ran:?}");
    assert!(ran.stderr.contains(&Fault::Saturation.to_string()), "{ran:?}");
}
