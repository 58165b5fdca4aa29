//! `run` on the simulated plant, with log and record.

use std::fs;

use hyst_tests::{Lab, WARM, column};
use serde_json::Value;

/// Checks channel and schema of a log and returns all its messages.
pub(crate) fn log(lab: &Lab, name: &str) -> Vec<Value> {
    let bytes = fs::read(lab.path(name)).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().expect("the log has a summary");
    let channel = summary.channels.values().find(|channel| channel.topic == "/actuator/sample").unwrap();
    assert_eq!(channel.message_encoding, "json");
    assert_eq!(channel.metadata["unit.output"], "µm");
    let schema = channel.schema.as_ref().unwrap();
    assert_eq!(schema.encoding, "jsonschema");
    let schema: Value = serde_json::from_slice(&schema.data).unwrap();
    assert_eq!(schema["type"], "object");
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let messages = messages.filter(|message| message.channel.topic == channel.topic);
    let mut time = 0;
    messages
        .map(|message| {
            assert!(message.log_time > time, "the log time increases");
            time = message.log_time;
            let sample: Value = serde_json::from_slice(&message.data).unwrap();
            let seconds = sample["time_s"].as_f64().unwrap();
            assert!((seconds - message.log_time as f64 * 1e-9).abs() < 1e-6);
            for field in sample.as_object().unwrap().keys() {
                assert!(schema["properties"][field].is_object(), "{field} is not in the schema");
            }
            sample
        })
        .collect()
}

#[test]
fn a_drive_is_played_and_its_record_is_fitted() {
    let lab = Lab::new();
    lab.write("plant.toml", hyst_tests::PLANT);
    lab.excite("u.csv", 1);
    let ran = lab.ok("run --daq sim:plant.toml --drive u.csv --record train.csv --log run.mcap");
    assert!(ran.stdout.contains("simulated plant") && ran.stdout.contains("6 segments"), "{}", ran.stdout);
    let (drive, record) = (lab.read("u.csv"), lab.read("train.csv"));
    assert_eq!(record.lines().next(), Some("segment,time_s,voltage_v,displacement_um"));
    assert_eq!(column(&drive, "voltage_v"), column(&record, "voltage_v"));
    assert_eq!(column(&drive, "segment"), column(&record, "segment"));
    // The drive of time 0 is reached and measured one period later; no row is lost.
    assert_eq!((column(&drive, "time_s")[0], column(&record, "time_s")[0]), (0.0, 0.002));
    lab.ok("fit train.csv --model preisach -o model.json");

    let samples = log(&lab, "run.mcap");
    let recorded: Vec<&Value> = samples.iter().filter(|sample| sample["phase"] == "record").collect();
    let outputs: Vec<f64> = recorded.iter().map(|sample| sample["output"].as_f64().unwrap()).collect();
    assert_eq!(outputs, column(&record, "displacement_um"));
    assert!(recorded.iter().all(|sample| sample.get("reference").is_none()));
}

#[test]
fn earlier_records_and_logs_are_kept() {
    let lab = Lab::new();
    lab.write("plant.toml", hyst_tests::PLANT);
    lab.excite("u.csv", 1);
    let run = "run --daq sim:plant.toml --drive u.csv --record train.csv --log run.mcap";
    assert_eq!(lab.ok(run).stderr, "");
    let first = lab.read("train.csv");
    let ran = lab.ok(&format!("{run} --seed 4"));
    for note in
        ["train.csv existed and was renamed to train.csv.~1~", "run.mcap existed and was renamed to run.mcap.~1~"]
    {
        assert!(ran.stderr.contains(note), "{}", ran.stderr);
    }
    assert_eq!(lab.read("train.csv.~1~"), first);
    assert_eq!(log(&lab, "run.mcap.~1~").len(), log(&lab, "run.mcap").len());
    // The same drive with another noise.
    let second = lab.read("train.csv");
    assert_eq!(column(&second, "voltage_v"), column(&first, "voltage_v"));
    let (one, other) = (column(&first, "displacement_um"), column(&second, "displacement_um"));
    assert!(one.iter().zip(&other).filter(|(a, b)| a != b).count() > one.len() / 2);
    assert!(one.iter().zip(&other).all(|(a, b)| (a - b).abs() < 0.1));
    // A rejected run renames no file.
    lab.fails("run --daq sim:plant.toml --drive u.csv --record train.csv --log run.mcap --limit 0,1", 2);
    assert_eq!(lab.read("train.csv"), second);
}

#[test]
fn a_reference_is_followed_and_logged() {
    let lab = Lab::with_model();
    lab.reference("reference.csv", 2.5, 12.0);
    lab.ok("diagnose train.csv --model model.json -o extended.json");
    let follow = "run --daq sim:plant.toml --reference reference.csv";
    let report = lab.ok(&format!("{follow} --model extended.json --log run.mcap --record out.csv --json")).json();
    let out = lab.read("out.csv");
    let (measured, wanted) = (column(&out, "displacement_um"), column(&out, "reference_um"));
    assert_eq!(wanted, column(&lab.read("reference.csv"), "displacement_um"));
    let squares: f64 = measured.iter().zip(&wanted).map(|(y, r)| (y - r).powi(2)).sum();
    let rmse = (squares / wanted.len() as f64).sqrt();
    let tracking = &report["tracking"];
    assert!((tracking["rmse"].as_f64().unwrap() / rmse - 1.0).abs() < 1e-9, "{report}");
    assert!(tracking["nrmse_percent"].as_f64().unwrap() < 5.0, "{report}");
    let plain = lab.ok(&format!("{follow} --model model.json --json")).json();
    let better = plain["tracking"]["rmse"].as_f64().unwrap() / rmse;
    assert!(better > 1.5, "the extended model tracks {better} times better");

    let samples = log(&lab, "run.mcap");
    assert_eq!(report["log"], "run.mcap");
    let recorded: Vec<&Value> = samples.iter().filter(|sample| sample["phase"] == "record").collect();
    assert_eq!(recorded.len(), wanted.len());
    for (sample, wanted) in recorded.iter().zip(&wanted) {
        assert_eq!(sample["reference"].as_f64(), Some(*wanted));
        let error = sample["output"].as_f64().unwrap() - wanted;
        assert!((sample["error"].as_f64().unwrap() - error).abs() < 1e-12);
    }
    // The default settling time at the first voltage is 2 s.
    let held = |name: &str| log(&lab, name).iter().filter(|s| s["phase"] == "approach").count();
    let default = held("run.mcap");
    lab.ok(&format!("{follow} --model extended.json --log short.mcap --settle 0.5"));
    assert_eq!(default - held("short.mcap"), 750);
    let late = tracking["rmse_last_half"].as_f64().unwrap();
    let half = wanted.len() / 2;
    let squares: f64 = measured[half..].iter().zip(&wanted[half..]).map(|(y, r)| (y - r).powi(2)).sum();
    assert!((late / (squares / (wanted.len() - half) as f64).sqrt() - 1.0).abs() < 1e-9, "{report}");
    // The model without the lag has a wider loop instead and leads at 1 Hz. That is an error, or with `--allow-delay` a
    // separate figure.
    let allowed = lab.ok(&format!("{follow} --model model.json --allow-delay --json")).json();
    let of = |report: &Value, key: &str| report["tracking"][key].as_f64();
    assert_eq!(of(&plain, "delay_s"), None);
    assert!(of(&allowed, "delay_s").unwrap() < -1e-3 && of(&allowed, "rmse") < of(&plain, "rmse"), "{allowed}");
    let printed = lab.ok(&format!("{follow} --model model.json --allow-delay")).stdout;
    assert!(printed.contains("ms earlier (--allow-delay)") && printed.contains("turning point"), "{printed}");
    // Ramps to the first voltage and back to rest are in the log and not in the record.
    assert!(samples.iter().any(|sample| sample["phase"] == "approach"));
    assert_eq!(samples.last().unwrap()["phase"], "retreat");
    assert_eq!(samples.last().unwrap()["drive_v"], 0.0);

    let bytes = fs::read(lab.path("run.mcap")).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let attachment = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
    assert_eq!(attachment.name, "model.json");
    assert_eq!(attachment.data, lab.read("extended.json").into_bytes());
    let metadata = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap().metadata;
    assert_eq!((metadata["unit"].as_str(), metadata["model_kind"].as_str()), ("µm", "pi"));
    assert_eq!(metadata["sample_rate_hz"], "500");
    assert_eq!(metadata["model_sha256"].len(), 64);
}

#[test]
fn a_measured_temperature_is_followed() {
    let lab = Lab::with_train(WARM);
    lab.ok("fit train.csv --model pi -o model.json");
    lab.ok("diagnose train.csv --model model.json -o extended.json");
    lab.reference("reference.csv", 3.0, 12.0);
    let follow = |model: &str| {
        let line =
            format!("run --daq sim:plant.toml --model {model} --reference reference.csv --record out.csv --json");
        lab.ok(&line).json()
    };
    let (warm, plain) = (follow("extended.json"), follow("model.json"));
    // The drive was planned for another temperature than the device has: it changes to the right one as a slow ramp.
    lab.ok("run --daq sim:plant.toml --model extended.json --reference reference.csv --log warm.mcap --temperature 10");
    let samples = log(&lab, "warm.mcap");
    let first = samples.iter().position(|sample| sample["phase"] == "record").unwrap();
    let volts: Vec<f64> = samples[first - 1..first + 30].iter().map(|s| s["drive_v"].as_f64().unwrap()).collect();
    assert!(volts.windows(2).all(|w| (w[1] - w[0]).abs() < 0.3), "{volts:?}");
    assert!(volts[0] - volts[30] > 2.0, "{volts:?}");
    assert_eq!(
        (&warm["temperature_followed"], &plain["temperature_followed"]),
        (&Value::Bool(true), &Value::Bool(false))
    );
    assert!(lab.read("out.csv").lines().next().unwrap().contains("temperature_degc"));
    let rmse = |report: &Value| report["tracking"]["rmse"].as_f64().unwrap();
    assert!(rmse(&warm) < 0.7 * rmse(&plain), "{} {}", rmse(&warm), rmse(&plain));
}

#[test]
fn a_constant_temperature_replaces_a_measured_one() {
    let lab = Lab::with_train(WARM);
    lab.ok("fit train.csv --model pi -o model.json");
    lab.ok("diagnose train.csv --model model.json -o extended.json");
    lab.reference("reference.csv", 1.0, 12.0);
    lab.write("blind.toml", hyst_tests::PLANT);
    let follow = "run --daq sim:blind.toml --model extended.json --reference reference.csv --record out.csv";
    let message = lab.fails(follow, 2);
    assert!(message.contains("temperature_degc") && message.contains("--temperature"), "{message}");
    let report = lab.ok(&format!("{follow} --temperature 19.5 --json")).json();
    assert_eq!(report["temperature_followed"], false);
    lab.ok("compensate --model extended.json reference.csv --temperature 19.5 -o drive.csv --limit 0,100");
    assert_eq!(column(&lab.read("out.csv"), "voltage_v"), column(&lab.read("drive.csv"), "voltage_v"));
    let message = lab.fails("run --daq sim:blind.toml --drive u.csv --record out.csv --temperature 20", 2);
    assert!(message.contains("--temperature needs --model"), "{message}");
}

#[test]
fn drives_beyond_the_limits_are_rejected() {
    let lab = Lab::new();
    lab.write("plant.toml", hyst_tests::PLANT);
    lab.ok("excite sine --rate 500 --high 130 --cycles 1 -o high.csv");
    lab.ok("excite sine --rate 500 --high 90 --cycles 1 -o fine.csv");
    let run = "run --daq sim:plant.toml --record out.csv --log run.mcap --drive";
    let message = lab.fails(&format!("{run} high.csv"), 2);
    for part in ["high.csv", "outside 0 to 100 V", "nothing was played"] {
        assert!(message.contains(part), "\"{part}\" is missing in: {message}");
    }
    let message = lab.fails(&format!("{run} fine.csv --limit 0,80"), 2);
    assert!(message.contains("outside 0 to 80 V"), "{message}");
    let message = lab.fails(&format!("{run} fine.csv --limit 0,120"), 2);
    assert!(message.contains("exceeds the range of the device"), "{message}");
    let message = lab.fails(&format!("{run} fine.csv --slew 100"), 2);
    assert!(message.contains("steeper than 100 V/s"), "{message}");
    lab.ok(&format!("{run} fine.csv --limit 0,95 --slew 1000"));
}

#[test]
fn the_limits_of_a_reference_are_kept() {
    let lab = Lab::with_model();
    lab.reference("reference.csv", 1.0, 12.0);
    let follow = "run --daq sim:plant.toml --model model.json --reference reference.csv --record out.csv --json";
    let limited = lab.ok(&format!("{follow} --limit 0,40"));
    // The predicted error is reported before the run.
    let prediction = "note: for the planned drive the model predicts a tracking error of ";
    assert!(limited.stderr.contains(prediction) && limited.stderr.contains("the voltage is limited in"), "{limited:?}");
    let report = limited.json();
    assert!(report["compensation"]["voltage_limited_rows"].as_u64().unwrap() > 0, "{report}");
    assert!(column(&lab.read("out.csv"), "voltage_v").iter().all(|u| (0.0..=40.0).contains(u)));
    lab.fails(&format!("{follow} --limit -10,40"), 2);
    assert!(!lab.ok(follow).stderr.contains(prediction));
}

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
        assert!(column(&lab.read(&fallback), "displacement_um").len() > 100);
        fs::remove_file(lab.path(&fallback)).unwrap();
    }
}

#[test]
fn a_measured_record_is_not_overwritten_by_a_drive() {
    let lab = Lab::with_model();
    let record = lab.read("train.csv");
    let drive = "excite sine --rate 500 --high 50 --cycles 1 -o train.csv";
    assert!(lab.ok(drive).stderr.contains("train.csv existed and was renamed to train.csv.~1~"));
    assert_eq!(lab.read("train.csv.~1~"), record);
    // A new drive replaces the older one.
    assert!(!lab.ok(drive).stderr.contains("note: "));
    lab.write("train.csv", &record);
    lab.ok("compensate --model model.json sine:6,14,1,2 -o train.csv");
    assert_eq!(lab.read("train.csv.~2~"), record);
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
    assert!(ran.stderr.contains("stopped on request"), "{}", ran.stderr);
    let samples = log(&lab, "run.mcap");
    assert!(samples.len() < 400_000);
    // The measured rows are saved, without the ramps.
    let kept = column(&lab.read("out.csv"), "voltage_v");
    let logged: Vec<f64> =
        samples.iter().filter(|s| s["phase"] == "record").map(|s| s["drive_v"].as_f64().unwrap()).collect();
    assert_eq!(kept, logged);
    assert!(ran.stderr.contains("are saved in out.csv"), "{}", ran.stderr);
    assert_eq!(samples.last().unwrap()["drive_v"], 0.0);
}

#[test]
fn the_plant_in_the_help_works() {
    let lab = Lab::new();
    let help = lab.ok("run --help").stdout;
    let lines = help.lines().skip_while(|line| line.trim() != "seed = 7").map(str::trim);
    lab.write("plant.toml", lines.collect::<Vec<_>>().join("\n"));
    lab.ok("excite sine --rate 500 --high 120 --cycles 1 -o u.csv");
    lab.ok("run --daq sim:plant.toml --drive u.csv --record out.csv");
    assert!(lab.read("out.csv").starts_with("segment,time_s,voltage_v,displacement_um,temperature_degc\n"));
    // The upper stop in the help, plus jump, drift, interference and noise.
    let highest = column(&lab.read("out.csv"), "displacement_um").into_iter().fold(0.0, f64::max);
    assert!((23.5..24.5).contains(&highest), "{highest}");
}

#[test]
fn a_recorded_load_is_in_the_record_and_in_the_log() {
    let lab = Lab::new();
    let load = "[load]\nnewtons = 3.0\num_per_n = 0.5\nperiod_s = 1.0\n";
    lab.write("plant.toml", format!("{}{load}", hyst_tests::PLANT));
    lab.ok("excite sine --rate 500 --high 50 --cycles 2 -o u.csv");
    lab.ok("run --daq sim:plant.toml --drive u.csv --record out.csv --log run.mcap");
    let record = lab.read("out.csv");
    assert!(record.starts_with("segment,time_s,voltage_v,displacement_um,load_n\n"), "{record}");
    let loads = column(&record, "load_n");
    let (low, high) = loads.iter().fold((0.0_f64, 0.0_f64), |(low, high), f| (low.min(*f), high.max(*f)));
    assert!((-3.0..-2.9).contains(&low) && (2.9..=3.0).contains(&high), "{low} {high}");
    let samples = log(&lab, "run.mcap");
    let logged: Vec<f64> =
        samples.iter().filter(|s| s["phase"] == "record").map(|s| s["load_n"].as_f64().unwrap()).collect();
    assert_eq!(logged, loads);

    lab.write("plant.toml", format!("{}{load}recorded = false\n", hyst_tests::PLANT));
    lab.ok("run --daq sim:plant.toml --drive u.csv --record hidden.csv");
    let hidden = lab.read("hidden.csv");
    assert!(hidden.starts_with("segment,time_s,voltage_v,displacement_um\n"), "{hidden}");
    assert_eq!(column(&hidden, "displacement_um"), column(&record, "displacement_um"));
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
