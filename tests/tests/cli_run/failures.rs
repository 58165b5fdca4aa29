//! Runs that are rejected, fail or are interrupted.

use hyst_tests::Lab;

use super::log;

#[test]
fn missing_devices_are_reported() {
    let lab = Lab::with_model();
    for device in ["serial:/dev/tty-of-nobody", "slcan:/dev/tty-of-nobody"] {
        let message = lab.fails(&format!("run --daq {device} --drive u.csv --record out.csv"), 3);
        assert!(message.contains("/dev/tty-of-nobody: there is no such port"), "{message}");
    }
    let message = lab.fails("run --daq usb:3 --drive u.csv --record out.csv", 2);
    assert!(message.contains("sim:PLANT.toml"), "{message}");
    lab.fails("run --daq plant.toml --drive u.csv --record out.csv", 2);
    let message = lab.fails("run --daq sim:absent.toml --drive u.csv --record out.csv", 2);
    assert!(message.contains("absent.toml"), "{message}");
    lab.write("odd.toml", hyst_tests::PLANT.replace("loop_share", "loop_shape"));
    let message = lab.fails("run --daq sim:odd.toml --drive u.csv --record out.csv", 2);
    assert!(message.contains("odd.toml") && message.contains("loop_shape"), "{message}");
}

#[test]
fn inconsistent_arguments_are_rejected() {
    let lab = Lab::with_model();
    lab.reference("reference.csv", 1.0, 12.0);
    for (line, part) in [
        ("--drive u.csv", "--record"),
        ("--drive u.csv --log -", "--log needs a file"),
        ("--record out.csv", "--reference"),
        ("--reference reference.csv --record out.csv", "--model"),
        ("--model model.json --record out.csv", "--reference"),
        ("--model model.json --reference reference.csv --drive u.csv --record out.csv", "--drive"),
        ("--drive u.csv --record out.csv --bandwidth 10", "--bandwidth"),
        ("--drive u.csv --record u.csv", "the same command reads this file"),
        ("--drive u.csv --log plant.toml", "the same command reads this file"),
        ("--drive u.csv --record out.csv --log out.csv", "two outputs"),
        ("--drive train.csv --record out.csv --rest -1", "--rest"),
        ("--drive reference.csv --record out.csv", "reference.csv, line 1"),
    ] {
        let message = lab.fails(&format!("run --daq sim:plant.toml {line}"), 2);
        assert!(message.contains(part), "\"{part}\" is missing in: {message}");
    }
    lab.write("fast.csv", "time_s,voltage_v\n0,0\n0.00001,1\n0.00002,0\n");
    let message = lab.fails("run --daq sim:plant.toml --drive fast.csv --record out.csv --log run.mcap", 2);
    assert!(message.contains("100000 Hz"), "{message}");
}

#[test]
fn samples_before_a_failure_are_in_the_log() {
    let lab = Lab::new();
    // The output exceeds the range of the sensor.
    lab.write("plant.toml", hyst_tests::PLANT.replace("[-10, 40]", "[-1, 10]"));
    lab.ok("excite sine --rate 500 --high 100 --cycles 2 -o u.csv");
    let ran = lab.run("run --daq sim:plant.toml --drive u.csv --record out.csv --log run.mcap");
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    assert!(ran.stderr.contains("error: ") && ran.stderr.contains("sensor.range_um"), "{}", ran.stderr);
    for part in ["all measured data (", " samples) are in run.mcap"] {
        assert!(ran.stderr.contains(part), "\"{part}\" is missing in: {}", ran.stderr);
    }
    assert_eq!(lab.files(), ["out.csv", "plant.toml", "run.mcap", "u.csv"]);
    let samples = log(&lab, "run.mcap");
    assert!(!samples.is_empty() && samples.iter().all(|sample| sample["output"].as_f64().unwrap() <= 10.0));
}

#[cfg(target_os = "linux")]
#[test]
fn a_record_that_cannot_be_written_is_saved_to_the_temporary_folder() {
    let lab = Lab::new();
    lab.write("plant.toml", hyst_tests::PLANT);
    lab.ok("excite sine --rate 500 --high 50 --cycles 1 -o u.csv");
    for line in [
        "run --daq sim:plant.toml --drive u.csv --record /dev/full",
        "record --daq sim:plant.toml --seconds 1 -o /dev/full",
    ] {
        let ran = hyst_tests::Ran::from(lab.command(line).env("TMPDIR", lab.path("")).output().unwrap());
        assert_eq!(ran.code, 3, "{ran:?}");
        let fallback = lab.files().into_iter().find(|name| name.starts_with("full-")).expect("the record is saved");
        assert!(ran.stderr.contains(&format!("/{fallback}; copy that file")), "{ran:?}");
        assert!(hyst_tests::column(&lab.read(&fallback), "displacement_um").len() > 100);
        std::fs::remove_file(lab.path(&fallback)).unwrap();
    }
}

#[cfg(unix)]
#[test]
fn an_interrupt_ramps_the_device_to_rest() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    let lab = Lab::new();
    // A fast mode makes the simulation slow: without the interrupt this run takes seconds.
    let mode = "[[mode]]\nhz = 4000\ndamping = 0.02\ngain = 0.1\n";
    lab.write("plant.toml", format!("{}{mode}", hyst_tests::PLANT));
    lab.ok("excite sine --frequency 0.1 --cycles 40 --high 100 -o u.csv");
    let mut running = lab.command("run --daq sim:plant.toml --drive u.csv --record out.csv --log run.mcap");
    let running = running.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while !lab.path("run.mcap").exists() && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(Command::new("kill").args(["-INT", &running.id().to_string()]).status().unwrap().success());
    let ran = hyst_tests::Ran::from(running.wait_with_output().unwrap());
    assert_eq!(ran.code, 1, "{}", ran.stderr);
    assert_eq!(ran.stderr.matches("stopped on request").count(), 1, "{}", ran.stderr);
    let samples = log(&lab, "run.mcap");
    assert!(samples.len() < 400_000);
    // The measured rows are saved, without the ramps.
    let kept = hyst_tests::column(&lab.read("out.csv"), "voltage_v");
    let logged: Vec<f64> =
        samples.iter().filter(|s| s["phase"] == "record").map(|s| s["drive_v"].as_f64().unwrap()).collect();
    assert_eq!(kept, logged);
    assert!(ran.stderr.contains("are saved in out.csv"), "{}", ran.stderr);
    assert_eq!(samples.last().unwrap()["drive_v"], 0.0);
}

#[test]
fn an_invalid_plant_section_is_named() {
    let lab = Lab::new();
    lab.ok("excite sine --rate 500 --high 50 --cycles 1 -o u.csv");
    for (section, field) in [
        ("[load]\nnewtons = 3\num_per_n = 0\nperiod_s = 1\n", "load.um_per_n"),
        ("[saturation]\nknee_um = 1\n", "saturation.high_um"),
        ("[asymmetry]\nbend = 2\n", "asymmetry.bend"),
        ("[[disturbance]]\nkind = \"slip\"\num = 1\nat_v = 500\n", "disturbance[0].at_v"),
    ] {
        lab.write("odd.toml", format!("{}{section}", hyst_tests::PLANT));
        let message = lab.fails("run --daq sim:odd.toml --drive u.csv --record out.csv", 2);
        assert!(message.contains("odd.toml") && message.contains(field) && message.contains("give"), "{message}");
    }
    for (name, section) in [
        ("mode", "[mode]\nhz = 90\ndamping = 0.1\ngain = 1\n"),
        ("mode", "[ mode ]\nhz = 90\ndamping = 0.1\ngain = 1\n"),
        ("disturbance", "[disturbance]\nkind = \"slip\"\num = 1\nat_v = 50\n"),
    ] {
        lab.write("odd.toml", format!("{}{section}", hyst_tests::PLANT));
        let message = lab.fails("run --daq sim:odd.toml --drive u.csv --record out.csv", 2);
        assert!(message.contains(&format!("write [[{name}]], not [{name}]")), "{message}");
    }
}
