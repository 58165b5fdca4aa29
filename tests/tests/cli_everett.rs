//! `fit` from first-order descent curves and of the dynamic model: messages, files and errors.

use hyst_tests::Lab;

/// A lightly damped mode, which distorts the surface of triangular curves.
const RINGING: &str = "[[mode]]\nhz = 20\ndamping = 0.05\ngain = 0.9\n";

fn curves(plant: &str, options: &str) -> Lab {
    let lab = Lab::new();
    lab.write("plant.toml", format!("{}{plant}", hyst_tests::PLANT.replace("[lag]\nseconds = 0.01\n", "")));
    lab.ok(&format!("excite forc --high 100 --rate 1000 --curves 40 {options} -o u.csv"));
    lab.ok("run --daq sim:plant.toml --drive u.csv --record fod.csv");
    lab
}

#[test]
fn half_sine_curves_of_several_durations_give_a_model() {
    let lab = curves(RINGING, "--seconds 0.8,1,1.25 --rest 0.5");
    let ran = lab.ok("fit fod.csv --model preisach --from fod -o model.json");
    assert_eq!(ran.stderr, "");
    for part in ["40 cells per side", "half-sine of 0.8", "half-sine of 1.25", "conditions violated in 0 cells"] {
        assert!(ran.stdout.contains(part), "\"{part}\" is missing in: {}", ran.stdout);
    }
    let report = lab.ok("fit fod.csv --model preisach --from fod --as-measured -o same.json --json").json();
    assert_eq!(lab.read("model.json"), lab.read("same.json"));
    assert_eq!(report["surface"]["families"].as_array().unwrap().len(), 3);
    assert!(report["surface"]["moved"].is_null());
    assert!(report["errors"]["nrmse_percent"].as_f64().unwrap() < 0.6, "{report}");
    lab.ok("simulate --model model.json fod.csv -o out.csv");
}

#[test]
fn violated_cells_are_listed_and_the_nearest_surface_is_used() {
    let lab = curves(RINGING, "--seconds 1 --rest 0.5 --peak triangle");
    let ran = lab.ok("fit fod.csv --model preisach --from fod -o model.json");
    for part in ["warning: in", "alpha [V]", "sigmas", "half-sine peaks", "nearest monotone surface"] {
        assert!(ran.stderr.contains(part), "\"{part}\" is missing in: {}", ran.stderr);
    }
    let report = lab.ok("fit fod.csv --model preisach --from fod -o model.json --json").json();
    let breaches = report["surface"]["breaches"].as_array().unwrap();
    assert!(breaches.len() > 3);
    for b in breaches {
        assert!(b["sigmas"].as_f64().unwrap() > 3.0 && b["by"].as_f64().unwrap() > 0.0, "{b}");
        assert!(b["alpha"].as_f64().unwrap() > b["beta"].as_f64().unwrap(), "{b}");
    }
    assert!(report["surface"]["moved"]["largest"].as_f64().unwrap() > 0.0);
    let message = lab.fails("fit fod.csv --model preisach --from fod --as-measured -o new.json", 2);
    assert!(message.contains("more than 3 standard errors"), "{message}");
}

#[test]
fn unsuitable_records_are_rejected_and_curves_are_pointed_out() {
    let lab = Lab::with_train("");
    let message = lab.fails("fit train.csv --model preisach --from fod -o m.json", 2);
    assert!(message.contains("excite forc"), "{message}");
    let message = lab.fails("fit train.csv --model pi --from fod -o m.json", 2);
    assert!(message.contains("--model preisach"), "{message}");
    let message = lab.fails("fit train.csv --model preisach --from rows --as-measured -o m.json", 2);
    assert!(message.contains("--from fod"), "{message}");
    // By default, curves are fitted row by row; a note mentions `--from fod`.
    let lab = curves("", "--seconds 1 --rest 0.2");
    let ran = lab.ok("fit fod.csv --model preisach -o rows.json");
    assert!(ran.stderr.contains("--from fod"), "{}", ran.stderr);
    assert_eq!(lab.ok("fit fod.csv --model preisach --from rows -o same.json").stderr, "");
    assert_eq!(lab.read("rows.json"), lab.read("same.json"));
}

#[test]
fn a_dynamic_model_is_fitted_to_records_at_several_rates() {
    let lab = Lab::new();
    let plant = hyst_tests::PLANT.replace("[lag]\nseconds = 0.01\n", "[viscosity]\nvolt_seconds = 5e-3\n");
    lab.write("plant.toml", plant);
    let record = |name: &str, excite: &str| {
        lab.ok(&format!("excite {excite} --high 100 --rate 5000 -o u.csv"));
        lab.ok(&format!("run --daq sim:plant.toml --drive u.csv --record {name}"));
    };
    record("slow.csv", "forc --curves 15 --seconds 0.6 --rest 0.05");
    record("20.csv", "decaying-sine --frequency 20 --seconds 0.4");
    record("35.csv", "decaying-sine --frequency 35 --seconds 0.4");
    record("60.csv", "decaying-sine --frequency 60 --seconds 0.3");
    record("test.csv", "decaying-sine --frequency 45 --seconds 0.3");
    let message = lab.fails("fit slow.csv --model dpm -o m.json", 2);
    assert!(message.contains("at other rates"), "{message}");
    lab.ok("fit slow.csv --model preisach --from fod -o classical.json");
    let report = lab.ok("fit slow.csv 20.csv 35.csv 60.csv --model dpm -o dynamic.json --json").json();
    let found = &report["dynamics"];
    assert_eq!(found["slow_segments"], 1);
    assert_eq!(found["classical"]["fod"]["families"][0]["curves"], 15);
    assert!(found["rmse"].as_f64().unwrap() < 0.6 * found["rmse_classical"].as_f64().unwrap(), "{found}");
    // The classical part is a measured surface with its own standard errors.
    let [nodes] = &report["tables"].as_array().unwrap()[..] else { panic!("{report}") };
    let known = ["determined", "held", "untouched"].map(|key| nodes[key].as_u64().unwrap());
    assert!(nodes["of"] == "nodes" && nodes["elements"] == 72 && known[0] > 10, "{nodes}");
    assert_eq!([&found["bound"], &found["untouched"].as_array().unwrap().len().into()], [known[1], known[2]]);
    let rmse = |model: &str| {
        let report = lab.ok(&format!("simulate --model {model} test.csv -o out.csv --json")).json();
        report["errors"]["rmse_all_rows"].as_f64().unwrap()
    };
    let (dynamic, classical) = (rmse("dynamic.json"), rmse("classical.json"));
    assert!(dynamic < 0.73 * classical, "{dynamic} {classical}");
    let ran = lab.ok("fit slow.csv 60.csv --model dpm -o one.json");
    assert!(ran.stdout.contains("mirror function from"), "{}", ran.stdout);
    // One fast rate leaves many grid nodes without rows, which a warning reports.
    assert!(ran.stderr.contains("no row is near") && ran.stderr.contains("rate [V/s]"), "{}", ran.stderr);
}

#[test]
fn a_dynamic_model_is_fitted_to_one_drive_of_several_rates() {
    let lab = Lab::new();
    let plant = hyst_tests::PLANT.replace("[lag]\nseconds = 0.01\n", "[viscosity]\nvolt_seconds = 5e-3\n");
    lab.write("plant.toml", plant);
    // Periods of random amplitude at frequencies that rise from 2 to 60 Hz, in one segment.
    let record = |name: &str, periods: usize, seed: u64| {
        let (mut drive, mut time, mut draw) = (String::from("time_s,voltage_v\n"), 0.0, seed);
        for period in 0..periods {
            draw = draw.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let amplitude = 50.0 * (0.3 + 0.7 * (draw >> 40) as f64 / f64::from(1 << 24));
            let hz = 2.0 * 30.0_f64.powf(period as f64 / (periods - 1) as f64);
            let rows = (5000.0 / hz).round();
            for k in 0..rows as usize {
                let v = amplitude * (1.0 - (std::f64::consts::TAU * k as f64 / rows).cos());
                drive.push_str(&format!("{time:.4},{v:.5}\n"));
                time += 2e-4;
            }
        }
        lab.write("u.csv", drive);
        lab.ok(&format!("run --daq sim:plant.toml --drive u.csv --record {name}"));
    };
    record("train.csv", 40, 1);
    record("test.csv", 25, 2);
    let report = lab.ok("fit train.csv --model dpm -o dynamic.json --json").json();
    let found = &report["dynamics"];
    let rates: Vec<f64> = found["rates"].as_array().unwrap().iter().map(|r| r.as_f64().unwrap()).collect();
    assert!(found["classical"] == "least-squares" && found["slow_segments"] == 0, "{found}");
    assert!(rates[1] > 4.0 * rates[0], "{found}");
    let ran = lab.ok("fit train.csv --model dpm -o dynamic.json");
    assert!(ran.stdout.contains("branches of") && ran.stdout.contains("RMSE of all rows"), "{}", ran.stdout);
    assert!(found["rmse"].as_f64().unwrap() < 0.75 * found["rmse_classical"].as_f64().unwrap(), "{found}");
    lab.ok("fit train.csv --model preisach -o classical.json");
    let rmse = |model: &str| {
        let report = lab.ok(&format!("simulate --model {model} test.csv -o out.csv --json")).json();
        report["errors"]["rmse_all_rows"].as_f64().unwrap()
    };
    let (dynamic, classical) = (rmse("dynamic.json"), rmse("classical.json"));
    assert!(dynamic < classical, "{dynamic} {classical}");
}
