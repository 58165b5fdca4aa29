//! `learn`: passes, files, errors, and the result when a limit stops it.

use hyst_tests::Lab;

const MODEL: &str = "excite identification --high 100 --rate 500 -o u.csv
run --daq sim:plant.toml --drive u.csv --record train.csv
fit train.csv --model pi -o model.json";

fn lab() -> Lab {
    let lab = Lab::new();
    lab.write("plant.toml", hyst_tests::PLANT);
    for line in MODEL.lines() {
        lab.ok(line);
    }
    lab
}

#[test]
fn the_error_falls_and_the_learned_drive_is_played() {
    let lab = lab();
    let ran = lab.ok(
        "learn --daq sim:plant.toml --model model.json --reference triangle:3,9,5,1 --passes 5 --logs logs --extended extended.json -o learned.csv --json",
    );
    let summary = ran.json();
    let passes = summary["passes"].as_array().unwrap();
    let best = summary["best"].as_u64().unwrap() as usize;
    let rmse = |k: usize| passes[k - 1]["rmse"].as_f64().unwrap();
    assert!(rmse(best) < 0.2 * rmse(1), "{summary:#}");
    assert!((1..=passes.len()).all(|k| rmse(best) <= rmse(k)), "{summary:#}");
    // The plant has a lag, the fitted model has none.
    assert_eq!(summary["found"][0]["effect"], "lag", "{summary:#}");
    assert!(lab.read("extended.json").contains("\"lag\""));
    assert_eq!(std::fs::read_dir(lab.path("logs")).unwrap().count(), passes.len());
    assert_eq!(ran.stderr.matches("times the repeatability").count(), passes.len(), "{}", ran.stderr);
    // The learned drive reaches the learned error.
    lab.ok("run --daq sim:plant.toml --drive learned.csv --settle 2 --record measured.csv");
    let column = |file: &str, name: &str| -> Vec<f64> {
        let text = lab.read(file);
        let at = text.lines().next().unwrap().split(',').position(|column| column == name).unwrap();
        text.lines().skip(1).map(|line| line.split(',').nth(at).unwrap().parse().unwrap()).collect()
    };
    let (wanted, got) = (column("learned.csv", "displacement_um"), column("measured.csv", "displacement_um"));
    assert_eq!(wanted.len(), got.len());
    let error = (wanted.iter().zip(&got).map(|(w, y)| (w - y).powi(2)).sum::<f64>() / got.len() as f64).sqrt();
    assert!(error < 1.5 * rmse(best) + 1e-3, "{error} {summary:#}");
}

#[test]
fn too_large_an_error_stops_at_rest_and_writes_nothing() {
    let lab = lab();
    let ran = lab.run(
        "learn --daq sim:plant.toml --model model.json --reference triangle:3,9,0.5,4 --max-error 0.001 --logs logs -o learned.csv",
    );
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    assert_eq!(crate::cli_run::log(&lab, "logs/pass-1.mcap").last().unwrap()["drive_v"], 0.0);
    // The reference of 0.3 s is shorter than the 0.5 s for which an error must last.
    let short = lab.run(
        "learn --daq sim:plant.toml --model model.json --reference triangle:3,9,30,0.3 --max-error 0.001 -o learned.csv",
    );
    assert!(short.code == 3 && short.stderr.contains("further from the reference"), "{}", short.stderr);
    assert!(ran.stderr.contains("further from the reference") && !lab.path("learned.csv").exists(), "{}", ran.stderr);
}

#[test]
fn unsuitable_references_and_options_are_rejected_before_the_run() {
    let lab = lab();
    std::fs::create_dir(lab.path("logs")).unwrap();
    lab.write("logs/mine.txt", "mine");
    lab.write("two.csv", "segment,time_s,displacement_um\n0,0,3\n0,0.002,4\n1,1,3\n1,1.002,4\n");
    for (options, named) in [
        ("--reference triangle:3,900,5,1", "outside what the actuator reaches"),
        ("--reference two.csv", "2 segments"),
        ("--reference triangle:3,9,5,1 --logs logs", "not empty"),
        ("--reference triangle:3,9,5,1 --plays 1", "--plays"),
        ("--reference absent.csv", "absent.csv"),
    ] {
        let ran = lab.run(&format!("learn --daq sim:plant.toml --model model.json -o learned.csv {options}"));
        assert_eq!(ran.code, 2, "{options}: {}", ran.stderr);
        assert!(ran.stderr.contains(named), "{options}: {}", ran.stderr);
        assert!(!lab.path("learned.csv").exists());
    }
}
