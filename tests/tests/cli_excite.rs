//! `excite`: drives of every kind, as records.

use hyst_tests::{Lab, column};

const KINDS: [&str; 13] = [
    "identification",
    "sine",
    "decaying-sine",
    "triangle",
    "stairs",
    "multisine",
    "sweep",
    "forc",
    "am-sine",
    "tones",
    "minor-loops",
    "raster",
    "spiral",
];

#[test]
fn every_kind_makes_a_drive_within_its_limits() {
    let lab = Lab::new();
    for kind in KINDS {
        let report = lab.ok(&format!("excite {kind} --low -20 --high 100 -o u.csv --json")).json();
        let drive = lab.read("u.csv");
        assert!(drive.starts_with("segment,time_s,voltage_v\n"), "{kind}");
        let volts = column(&drive, "voltage_v");
        assert_eq!(report["rows"].as_u64().unwrap() as usize, volts.len(), "{kind}");
        assert!(volts.iter().all(|u| (-20.0..=100.0).contains(u)), "{kind}");
        assert_eq!((volts[0], volts[volts.len() - 1]), (-20.0, -20.0), "{kind}");
        assert!(!report["segments"].as_array().unwrap().is_empty(), "{kind}");
    }
}

#[test]
fn the_seed_determines_the_drive() {
    let lab = Lab::new();
    let drive = |seed: u32| lab.ok(&format!("excite stairs --high 100 --seed {seed} -o -")).stdout;
    assert_eq!(drive(1), drive(1));
    assert_ne!(drive(1), drive(2));
}

#[test]
fn options_set_rate_cycles_and_output() {
    let lab = Lab::new();
    let ran = lab.ok("excite sine --frequency 4 --cycles 2 --rate 200 --high 10 -o u.csv");
    assert!(ran.stdout.contains("101 rows at 200 Hz"), "{}", ran.stdout);
    let ran = lab.ok("excite sine --frequency 4 --cycles 2 --rate 200 --high 10 -o -");
    assert_eq!(ran.stdout, lab.read("u.csv"));
    assert!(ran.stderr.contains("101 rows"), "{}", ran.stderr);
}

#[test]
fn durations_and_tones_are_segments_and_the_crest_factor_is_reported() {
    let lab = Lab::new();
    let segments = |line: &str| {
        let report = lab.ok(&format!("excite {line} --high 100 -o u.csv --json")).json();
        report["segments"].as_array().unwrap().len()
    };
    assert_eq!(segments("forc --curves 3 --seconds 0.5,1,2 --peak triangle"), 3);
    assert_eq!(segments("tones --frequencies 1,10 --amplitudes 0.2,0.6,1 --cycles 3"), 6);
    let crest = lab.ok("excite multisine --high 100 --periods 2 -o u.csv --json").json()["crest_factor"].as_f64();
    assert!(crest.unwrap() < 1.5, "{crest:?}");
}

#[test]
fn messages_name_the_options() {
    let lab = Lab::new();
    for (line, parts) in [
        ("sine --rate 0 --high 10", ["--rate = 0", "positive"]),
        ("sine --high 0", ["--high = 0", "above --low"]),
        ("sine --frequency 300 --high 10", ["--frequency = 300", "quarter of --rate"]),
        ("sine --cycles 0 --high 10", ["--cycles = 0", "at least 1"]),
        ("sine --frequency 10 --high 100 --slew 100", ["--slew = 100", "lower --frequency"]),
        ("identification --seconds 3 --high 10", ["--seconds = 3", "at least"]),
        ("identification --slow 5 --fast 4 --high 10", ["--fast = 4", "above --slow"]),
        ("multisine --from 9 --to 8 --high 10", ["--to = 8", "at least --from"]),
        ("forc --seconds 0.001 --high 10", ["--seconds = 0.001", "four rows"]),
        ("forc --seconds 1,0.001 --high 10", ["--seconds = 0.001", "four rows"]),
        ("am-sine --modulation 9 --high 10", ["--modulation = 9", "fifth of --frequency"]),
        ("tones --amplitudes 0.5,2 --high 10", ["--amplitudes = 2", "at most 1"]),
    ] {
        let message = lab.fails(&format!("excite {line} -o u.csv"), 2);
        assert!(parts.iter().all(|part| message.contains(part)), "{line}: {message}");
        assert!(!message.contains("_hz") && !message.contains("_v") && !message.contains("_s"), "{line}: {message}");
    }
    lab.fails("excite noise --high 10 -o u.csv", 2);
    lab.fails("excite sine -o u.csv", 2);
}
