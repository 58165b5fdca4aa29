//! `export`: firmware, a C compiler and rustc can read its files.

use std::path::Path;
use std::process::{Command, Output};

use hyst_core::{Build, Chain, Env, Kind, List, OperatorParams, Pi, Sampling, Stage, read_block};
use hyst_tests::{Lab, column, every_stage, root};

/// Returns a folder with a fitted model that has every stage.
fn lab() -> Lab {
    let lab = Lab::with_model();
    lab.write("model.json", every_stage(&lab.read("model.json")));
    lab
}

/// Returns the model file with the numbers of a paper.
fn paper(kind: Kind) -> Vec<u8> {
    std::fs::read(root().join(format!("docs/models/{kind}.json"))).unwrap()
}

/// Compiles C files of the folder with the strict options that the headers support.
fn cc(lab: &Lab, arguments: &[&str]) -> Output {
    let strict = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"];
    Command::new("cc").args(strict).args(arguments).current_dir(lab.path("")).output().expect("cc runs")
}

fn run(program: &str, folder: &Path, arguments: &[&str]) -> String {
    let out = Command::new(program).args(arguments).current_dir(folder).output().unwrap_or_else(|e| {
        panic!("{program} cannot be run: {e}");
    });
    assert!(out.status.success(), "{program} {arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

#[test]
fn firmware_reads_the_block() {
    let lab = lab();
    lab.ok("export model.json --format postcard -o model.bin");
    let bytes = std::fs::read(lab.path("model.bin")).unwrap();
    let chain = read_block::<List<64>, List<8>>(&bytes).unwrap();
    let OperatorParams::Pi(p) = &chain.operator else { panic!("{chain:?}") };
    let pi: Pi<f64, 64> = p.build(&()).unwrap();
    let model: serde_json::Value = serde_json::from_str(&lab.read("model.json")).unwrap();
    let stages = model["stages"].as_array().unwrap();
    let stage = stages.iter().find(|s| s["stage"] == "pi").unwrap();
    assert_eq!(stage["gain"].as_f64(), Some(p.gain));
    assert_eq!(stage["weights"].as_array().unwrap().len(), p.weights.len());
    assert_eq!(chain.effects.resonances[1].unwrap().hz, 250.0);
    // The chain on the board gives the same output as the command, with the zero of the sensor.
    assert!(chain.zero != 0.0);
    let board: Chain<f64, Pi<f64, 64>, 16, 8> = chain.around(pi, &Sampling { period: 1e-3 }).unwrap();
    let mut text = "time_s,voltage_v,temperature_degc,load_n\n".to_owned();
    let drive = |k: u32| 60.0 - 60.0 * (0.05 * f64::from(k)).cos();
    for k in 0..400 {
        text += &format!("{:.3},{},25,1\n", 1e-3 * f64::from(k), drive(k));
    }
    lab.write("u.csv", text);
    lab.ok("simulate --model model.json u.csv -o out.csv");
    let (mut s, mut first) = (board.state(), true);
    for (k, host) in column(&lab.read("out.csv"), "predicted_um").into_iter().enumerate() {
        let env = Env { time: 1e-3 * k as f64, temperature: 25.0, load: 1.0 };
        let u = drive(k as u32);
        let y = if first { board.reset(&mut s, &env, u) } else { board.step(&mut s, &env, u) };
        first = false;
        assert!((y - host).abs() < 1e-9, "row {k}: {y} on the board, {host} by the command");
    }
}

#[test]
#[cfg_attr(not(c_compiler), ignore = "there is no C compiler `cc`")]
fn a_c_compiler_accepts_the_header() {
    let lab = lab();
    lab.ok("export model.json --format c -o model.h");
    lab.write(
        "main.c",
        "#include <stdio.h>\n#include \"model.h\"\nint main(void) {\n\
         (void)hyst_zero; (void)hyst_input_low; (void)hyst_input_high;\n\
         printf(\"%s %c%c%c%c %.17g\\n\", HYST_KIND, hyst_block[0], hyst_block[1], hyst_block[2], hyst_block[3], \
         hyst_resonance_hz + hyst_resonance_2_hz);\n return 0;\n}\n",
    );
    // The program does not use every constant.
    let unused = ["-Wno-unused-const-variable", "-Wno-unused-variable"];
    let out = cc(&lab, &[&unused[..], &["main.c", "-o", "main"]].concat());
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let printed = run(lab.path("main").to_str().unwrap(), &lab.path(""), &[]);
    assert_eq!(printed, "pi HYST 340\n", "{}", lab.read("model.h"));
}

/// A header describes its chain, and for each stage the equation and the layout of lists.
#[test]
fn a_header_explains_its_constants() {
    let lab = lab();
    let contains = |model: &str, parts: &[&str]| {
        lab.ok(&format!("export {model} --format c -o exported.h"));
        let header = lab.read("exported.h");
        for part in parts {
            assert!(header.contains(part), "no {part:?} in\n{header}");
        }
        header
    };
    let order = "voltage_v -> delay -> lag -> pi -> ";
    let end = "-> drift -> interference -> + hyst_zero -> displacement_um";
    let weights = "weights[i] play[i]";
    let header =
        contains("model.json", &[order, end, weights, "hyst_core::read_block (feature block)", "shares[i] x[i]"]);
    assert_eq!(header.matches("Sensor zero (reading at rest)").count(), 1, "{header}");
    lab.write("pi.json", paper(Kind::Pi));
    contains("pi.json", &["sqrt(volt_seconds v) = o", "hyst_rate_dependence_volt_seconds = 0.001; /* V s */"]);
    lab.write("preisach.json", paper(Kind::Preisach));
    contains("preisach.json", &["density[a (a + 1) / 2 + b]", "once[a]", "voltage_v -> preisach -> + hyst_zero"]);
    // A file with the unit `n` of its column: the header writes N, because n could be read as nano.
    let force =
        lab.read("preisach.json").replace("displacement_um", "force_n").replace("\"unit\": \"um\"", "\"unit\": \"n\"");
    lab.write("force.json", force);
    let header = contains("force.json", &["output force_n [N]", "/* N */"]);
    assert!(!header.contains("/* n */") && !header.contains("n/V") && !header.contains("[n]"), "{header}");
}

/// Every constant has its unit, for a fitted model with every stage and for every kind.
#[test]
fn constants_in_c_have_their_units() {
    let lab = lab();
    let mut seen = 0;
    let mut check = |model: &str, expected: &[&str]| {
        lab.ok(&format!("export {model} --format c -o {model}.h"));
        let header = lab.read(&format!("{model}.h"));
        for line in header.lines() {
            let number = line.starts_with("static const double")
                || line.strip_prefix("#define hyst_").is_some_and(|rest| {
                    let (name, value) = rest.split_once(' ').unwrap();
                    !name.ends_with("_length") && !value.starts_with('"')
                });
            if number {
                let unit = line.split_once(" /* ").and_then(|(_, unit)| unit.strip_suffix(" */"));
                assert!(unit.is_some_and(|unit| !unit.is_empty()), "{model}: {line}");
                seen += 1;
            }
        }
        for line in expected {
            assert!(header.lines().any(|l| l == *line), "{model}: no {line:?} in\n{header}");
        }
    };
    check(
        "model.json",
        &[
            "static const double hyst_lag_seconds = 0.001; /* s */",
            "static const double hyst_creep_shares[2] = {0.01, 0.02}; /* 1 */",
            "static const double hyst_resonance_2_hz = 250.0; /* Hz */",
            "static const double hyst_temperature_reference_degc = 23.0; /* degC */",
            "static const double hyst_load_per_newton = 0.05; /* um/N */",
        ],
    );
    for kind in Kind::ALL {
        let expected = match kind {
            Kind::Gpi => "static const double hyst_gpi_left_linear_slope = 1.0; /* 1/V */",
            Kind::Dpm => "#define hyst_dpm_preisach_cells 8 /* 1 */",
            Kind::TdEm => {
                "static const double hyst_td_em_coupling[3] = {0.000883, -1.466e-5, 3.477e-7}; /* N/V, N/(V K), N/(V K^2) */"
            }
            Kind::TdPi => "static const double hyst_td_pi_eta = 0.0091; /* 1/K */",
            _ => "/* Parameter block for hyst_core::read_block. */",
        };
        lab.write(kind.name(), paper(kind));
        check(kind.name(), &[expected]);
    }
    assert!(seen > 100, "{seen}");
}

#[test]
#[cfg_attr(not(c_compiler), ignore = "there is no C compiler `cc`")]
fn a_c_program_can_have_two_models() {
    let lab = lab();
    lab.write("tube.json", paper(Kind::TdEm));
    lab.ok("export model.json --format c -o model.h");
    lab.ok("export tube.json --format c --name x-axis -o tube.h");
    let header = lab.read("tube.h");
    assert!(!header.replace("hyst_core", "").to_lowercase().contains("hyst_"), "{header}");
    let main = "int main(void) { return x_axis_block[0] == hyst_block[0] && sizeof X_AXIS_KIND == 6 \
                && x_axis_td_em_coupling_length == 3 && hyst_input_low <= x_axis_input_high ? 0 : 1; }\n";
    let program = |headers: &[&str]| {
        let lines: String = headers.iter().map(|name| format!("#include \"{name}\"\n")).collect();
        lab.write("main.c", lines + main);
        cc(&lab, &["main.c", "-o", "main"])
    };
    // A header may be included twice.
    let out = program(&["model.h", "tube.h", "model.h"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    run(lab.path("main").to_str().unwrap(), &lab.path(""), &[]);
    // Two models with the same name are an error.
    lab.ok("export tube.json --format c -o other.h");
    let out = program(&["model.h", "tube.h", "other.h"]);
    let printed = String::from_utf8_lossy(&out.stderr);
    assert!(!out.status.success() && printed.contains("two models are called hyst"), "{printed}");
}

#[test]
fn an_invalid_or_unused_name_is_rejected() {
    let lab = Lab::new();
    lab.write("tube.json", paper(Kind::TdEm));
    for name in ["2nd", "_x", "é", "--"] {
        let message = lab.fails(&format!("export tube.json --format c --name={name} -o tube.h"), 2);
        assert!(message.contains("--name") && message.contains("letter"), "{message}");
    }
    for format in ["rust", "postcard"] {
        let message = lab.fails(&format!("export tube.json --format {format} --name tube -o tube.out"), 2);
        assert!(message.contains("--name") && message.contains("--format c"), "{message}");
    }
}

/// Test of the example: computes the drive of a reference and returns the largest error of the model's output.
const TRACKING: &str = "use hyst_core::*;
fn tracking_error<M: Stage<f32>, I: Stage<f32>>(model: &M, inverse: &I, lead: usize, env: &Env<f32>, input: [f64; 2]) -> f32 {
    let (mut m, mut i) = (model.state(), inverse.state());
    let ends = input.map(|u| model.reset(&mut m, env, u as f32));
    let (middle, swing) = (0.5 * (ends[0] + ends[1]), 0.3 * (ends[1] - ends[0]));
    let at = |k: usize| middle - swing * (0.01 * k as f32).cos();
    let mut worst = 0.0f32;
    let mut drives = vec![inverse.reset(&mut i, env, at(0))];
    for k in 1..3000 + lead {
        drives.push(inverse.step(&mut i, env, at(k)));
    }
    for (k, drive) in drives.iter().enumerate() {
        let y = if k == 0 { model.reset(&mut m, env, *drive) } else { model.step(&mut m, env, *drive) };
        if k > lead + 1000 {
            worst = worst.max((y - at(k - lead)).abs());
        }
    }
    assert!(worst < 0.02 * swing.abs(), \"{worst} of {swing}\");
    worst
}
";

/// Compiles and runs the exported source of every kind of model and of one with every stage, as a board would.
#[test]
fn rustc_accepts_the_source() {
    let lab = lab();
    lab.ok("export model.json --format rust -o fitted.rs");
    let mut modules = vec!["fitted".to_owned()];
    for kind in Kind::ALL {
        let module = kind.name().replace('-', "_");
        lab.write("paper.json", paper(kind));
        lab.ok(&format!("export paper.json --format rust -o {module}.rs"));
        modules.push(module);
    }
    let core = root().join("crates/hyst-core");
    lab.write(
        "Cargo.toml",
        format!(
            "[package]\nname = \"board\"\nversion = \"0.0.0\"\nedition = \"2024\"\n[workspace]\n\
             [[bin]]\nname = \"board\"\npath = \"main.rs\"\n[dependencies]\nhyst-core = {{ path = {core:?} }}\n"
        ),
    );
    let mut main = String::from(TRACKING);
    for module in &modules {
        // The example in the head of the file, as a function of the values that the board supplies.
        let source = lab.read(&format!("{module}.rs"));
        let example: String =
            source.lines().filter_map(|line| line.strip_prefix("//   ")).map(|line| format!("    {line}\n")).collect();
        let inverts = example.contains("let inverse = ");
        assert_eq!(inverts, !source.contains("No drive can be computed"), "{module}:\n{source}");
        main += &format!(
            "mod {module};\n#[allow(unused_assignments, unused_variables)]\n\
             fn example_{module}(env: &Env<f32>, drive: f32, reference: f32) -> Result<f32, Error> {{\n    \
             use {module}::*;\n    let env = *env;\n{example}    {}\n}}\n",
            if inverts { "Ok(drive + tracking_error(&model, &inverse, inverse.lead(), &env, INPUT))" } else { "Ok(y)" }
        );
    }
    main += "fn main() -> Result<(), Error> {\n    let env = Env { temperature: 23.0, ..Env::default() };\n";
    for module in &modules {
        main += &format!(
            "    let model = Box::new({module}::chain::<f64, 64>(&Sampling {{ period: 1e-3 }})?);\n    \
             let mut state = Box::new(model.state());\n    \
             model.reset(&mut state, &env, {module}::INPUT[0]);\n    \
             let of_example = example_{module}(&Env {{ temperature: 23.0, ..Env::default() }}, 1.0, 1.0)?;\n    \
             println!(\"{module} {{:e}} {{of_example:e}}\", model.step(&mut state, &env, {module}::INPUT[1]));\n"
        );
    }
    lab.write("main.rs", main + "    Ok(())\n}\n");
    // The lock file of the workspace selects versions that are available offline.
    std::fs::copy(root().join("Cargo.lock"), lab.path("Cargo.lock")).unwrap();
    let target = root().join("target/export");
    let printed = run(
        &std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()),
        &lab.path(""),
        &["run", "--quiet", "--target-dir", target.to_str().unwrap()],
    );
    let outputs: Vec<&str> = printed.lines().collect();
    assert_eq!(outputs.len(), modules.len(), "{printed}");
    for line in outputs {
        let numbers: Vec<f64> = line.split(' ').skip(1).map(|x| x.parse().unwrap()).collect();
        assert!(numbers.len() == 2 && numbers.iter().all(|x| x.is_finite()), "{line}");
    }
    // The exported function is that of the model file.
    assert!(
        lab.read("atan.rs").contains("ActivationKind::Atan") && lab.read("tanh.rs").contains("ActivationKind::Tanh")
    );
}

#[test]
fn a_file_that_is_not_a_model_is_rejected() {
    let lab = Lab::new();
    lab.write("bad.json", "{}");
    let message = lab.fails("export bad.json --format c -o model.h", 2);
    assert!(message.contains("bad.json"), "{message}");
    assert!(!lab.path("model.h").exists());
}
