//! `run --adapt`: the model adapts to an actuator that has changed.

use hyst_tests::Lab;
use hyst_tests::ageing::aged;
use hyst_tests::other_bench::Bench;
use hyst_tests::other_physics::Law;
use serde_json::Value;

fn plant(gain: f64, loop_share: f64) -> String {
    format!(
        "seed = 3\n[actuator]\nmax_v = 100\ngain_um_per_v = {gain}\nloop_share = {loop_share}\nrelays = 2000\n[sensor]\nrange_um = [-10, 40]\nnoise_um = 0.005\n"
    )
}

/// Returns a folder with a model of an actuator, that actuator, and an aged one: gain 5 % lower, loop 20 % wider.
fn lab() -> Lab {
    let lab = Lab::new();
    lab.write("new.toml", plant(0.2, 0.12));
    lab.write("aged.toml", plant(0.19, 0.144));
    lab.ok("excite identification --high 100 --rate 500 -o u.csv");
    lab.ok("run --daq sim:new.toml --drive u.csv --record train.csv");
    lab.ok("fit train.csv --model pi -o model.json");
    lab
}

fn number(report: &Value, path: &str) -> f64 {
    report.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path}: {report:#}"))
}

const FOLLOW: &str = "run --daq sim:aged.toml --model model.json --reference sine:3,15,1,20 --json";

#[test]
fn the_model_adapts_to_an_aged_actuator_and_the_state_is_kept() {
    let lab = lab();
    let plain = lab.ok(FOLLOW).json();
    let adapted = lab.ok(&format!("{FOLLOW} --adapt kept.json --log run.mcap")).json();
    let (before, after) = (number(&plain, "/tracking/rmse_last_half"), number(&adapted, "/tracking/rmse_last_half"));
    assert!(after < 0.3 * before, "{before} → {after}: {adapted:#}");
    // The adaptation also corrects errors of the model for the new actuator.
    let new = lab.ok(&format!("{} --adapt", FOLLOW.replace("aged", "new"))).json();
    let change = |path: &str| number(&adapted, path) - number(&new, path);
    assert!((change("/adapted/gain_percent") + 5.0).abs() < 1.0, "{new:#} {adapted:#}");
    assert!(change("/adapted/loop_width") > 0.2, "{new:#} {adapted:#}");
    assert!(plain["adapted"].is_null() && !plain["watch"]["explains"].as_bool().unwrap(), "{plain:#}");
    // The next run starts from the stored state.
    let again = lab.ok(&format!("{FOLLOW} --adapt kept.json")).json();
    let whole = number(&again, "/tracking/rmse");
    assert!(whole < 0.7 * number(&adapted, "/tracking/rmse"), "{whole}: {adapted:#}");
    let printed = lab.ok(&format!("{} --adapt", FOLLOW.trim_end_matches(" --json"))).stdout;
    assert!(printed.contains("adapted: gain -") && printed.contains("%, loop wider by"), "{printed}");
}

#[test]
fn adaptation_does_not_degrade_an_unchanged_actuator() {
    let lab = lab();
    let follow = FOLLOW.replace("aged", "new");
    let (plain, adapted) = (lab.ok(&follow).json(), lab.ok(&format!("{follow} --adapt")).json());
    let late = |report: &Value| number(report, "/tracking/rmse_last_half");
    assert!(late(&adapted) < late(&plain), "{plain:#} {adapted:#}");
    assert!(number(&adapted, "/adapted/gain_percent").abs() < 2.0, "{adapted:#}");
}

#[test]
fn unsuitable_files_and_options_are_rejected_before_the_run() {
    let lab = lab();
    lab.ok(&format!("{FOLLOW} --adapt kept.json"));
    lab.ok("fit train.csv --model preisach -o other.json");
    let kept = lab.read("kept.json");
    lab.write("broken.json", "{\"numbers\": 3}");
    for (line, named) in [
        (FOLLOW.replace("model.json", "other.json") + " --adapt kept.json", "another model"),
        (format!("{FOLLOW} --adapt broken.json"), "broken.json"),
        (format!("{FOLLOW} --adapt --control pid+feedforward"), "--control feedforward"),
        ("run --daq sim:aged.toml --drive u.csv --record x.csv --adapt".to_owned(), "--adapt"),
        (format!("{FOLLOW} --adapt model.json"), "model.json"),
    ] {
        let ran = lab.run(&line);
        assert_eq!(ran.code, 2, "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(named), "{line}: {}", ran.stderr);
    }
    assert_eq!(lab.read("kept.json"), kept);
}

#[test]
fn on_other_physics_adaptation_is_as_accurate_as_a_refit() {
    let bench = Bench {
        seed: 4,
        law: Law::ColemanHodgdon,
        rate_hz: 200.0,
        volts: 100.0,
        stroke_um: 12.0,
        noise_um: 0.005,
        delay_s: 0.0,
        lag_s: 0.0,
        creep: 0.0,
        mode: None,
    };
    let found = aged(bench, 60.0);
    assert!(found.adapted < 1.5 * found.refitted && found.adapted < 0.7 * found.initial, "{found:?}");
}
