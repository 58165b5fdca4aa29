//! `response`, `gain`, `loop` and `excite separate` on a simulated actuator in a resonant structure.

use hyst_tests::{Lab, column};

/// Two modes, little hysteresis.
const TRUSS: &str = "\
seed = 5
[actuator]
max_v = 100
gain_um_per_v = 0.2
loop_share = 0.05
relays = 3000
[sensor]
range_um = [-60, 90]
noise_um = 0.02
[[mode]]
hz = 20
damping = 0.03
gain = 0.4
[[mode]]
hz = 55
damping = 0.02
gain = 0.3
";

fn recorded(drive: &str) -> Lab {
    let lab = Lab::new();
    lab.write("plant.toml", TRUSS);
    lab.ok(&format!("excite {drive} --rate 400 --high 100 -o u.csv"));
    lab.ok("run --daq sim:plant.toml --drive u.csv --record r.csv");
    lab
}

#[test]
fn modes_of_a_simulated_truss_are_printed_and_drawn() {
    let lab = recorded("multisine --from 1 --to 95 --lines 188 --seconds 20 --periods 5");
    let report = lab.ok("response r.csv -o resp.csv --picture resp.svg --at 10 --json").json();
    let modes = report["modes"].as_array().unwrap();
    for (hz, damping) in [(20.0, 0.03), (55.0, 0.02)] {
        let near = |m: &&serde_json::Value| (m["hz"].as_f64().unwrap() / hz - 1.0).abs() < 0.01;
        let found = modes.iter().find(near).unwrap_or_else(|| panic!("{hz} Hz is not in {modes:?}"));
        assert!((found["damping"].as_f64().unwrap() / damping - 1.0).abs() < 0.1, "{found}");
    }
    let orders = report["orders"].as_array().unwrap();
    assert!(orders.iter().any(|row| row["order"] == report["order"]), "{report}");
    let at = &report["at"][0];
    let static_gain = 0.2;
    assert!(at["gain"].as_f64().unwrap() > 1.05 * static_gain && at["phase_deg"].as_f64().unwrap() < 0.0, "{at}");
    let table = lab.read("resp.csv");
    let coherence = column(&table, "coherence");
    assert!(coherence.len() > 100 && coherence.iter().all(|c| (0.0..=1.0).contains(c)));
    let picture = lab.read("resp.svg");
    for part in ["<svg", "coherence", "95 % band", "gain [µm/V]"] {
        assert!(picture.contains(part), "\"{part}\" is missing");
    }
    let text = lab.ok("response r.csv --period 4 --order 6").stdout;
    for part in ["averages over", "damping ratio", "order: given"] {
        assert!(text.contains(part), "\"{part}\" is missing in: {text}");
    }
}

#[test]
fn gain_grows_with_amplitude_and_the_phase_of_the_structure_is_removed_from_a_loop() {
    let lab = recorded("tones --frequencies 2,10 --amplitudes 0.2,1 --cycles 8");
    let report = lab.ok("gain r.csv -o gain.csv --json").json();
    let points = report["points"].as_array().unwrap();
    assert_eq!(points.len(), 4, "{report}");
    let gain = |i: usize| points[i]["gain"].as_f64().unwrap();
    assert!(gain(1) > 1.02 * gain(0) && gain(3) > 1.02 * gain(2), "{points:?}");
    assert_eq!(column(&lab.read("gain.csv"), "hz").len(), 4);

    lab.ok("excite sine --frequency 10 --cycles 12 --rate 400 --high 100 -o u.csv");
    lab.ok("run --daq sim:plant.toml --drive u.csv --record s.csv");
    let width = |phase: &str| {
        let report = lab.ok(&format!("loop s.csv --phase {phase} --json")).json();
        let figure = |part: &str| report[part]["width_percent"].as_f64().unwrap();
        (figure("raw"), figure("corrected"))
    };
    let (raw, without) = width("-1.5");
    assert!(without < 0.9 * raw, "{raw} {without}");
    let (raw, same) = width("0");
    assert!((raw - same).abs() < 0.05 * raw, "{raw} {same}");
}

#[test]
fn two_effects_get_the_drive_that_separates_them() {
    let lab = Lab::new();
    let limits = "--high 100 --slew 20000 --seconds 10";
    let report = lab.ok(&format!("excite separate lag delay {limits} -o u.csv --json")).json();
    assert_eq!((report["first"].as_str(), report["verdict"].as_str()), (Some("lag"), Some("clear")));
    assert!(report["reason"].as_str().unwrap().contains("high frequency"), "{report}");
    assert!(report["tried"].as_array().unwrap().len() > 10);
    assert!(column(&lab.read("u.csv"), "voltage_v").iter().all(|u| (0.0..=100.0).contains(u)));
    let text = lab.ok(&format!("excite separate load drift {limits} -o u.csv")).stdout;
    assert!(text.contains("load_n") && text.contains("No drive within the limits"), "{text}");
    let verdict = lab.ok(&format!("excite separate load drift {limits} --load-cell -o u.csv --json")).json();
    assert_eq!(verdict["verdict"].as_str(), Some("clear"), "{verdict}");
}

#[test]
fn wrong_options_are_reported() {
    let lab = recorded("sine --frequency 5 --cycles 4");
    for (line, part) in [
        ("response r.csv --order many", "auto"),
        ("response r.csv --order 30", "rows"),
        ("response r.csv --period 0.3333", "whole number"),
        ("gain r.csv --frequency 150", "three cycles"),
        ("loop r.csv --phase 900", "degrees"),
        ("loop r.csv --phase 0 --frequency 0.01", "two cycles"),
        ("excite separate lag lag --high 10 -o v.csv", "both effects are lag"),
        ("excite separate lag noise --high 10 -o v.csv", "rate-dependence"),
        ("excite separate lag delay --seconds 1 --high 10 -o v.csv", "--seconds = 1"),
    ] {
        let message = lab.fails(line, 2);
        assert!(message.contains(part), "\"{part}\" is missing in: {message}");
    }
}
