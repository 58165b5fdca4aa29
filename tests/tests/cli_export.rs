//! `export`: what it writes is read by firmware, by a C compiler and by rustc.

use std::path::Path;
use std::process::Command;

use hyst_core::{Build, Kind, List, OperatorParams, Pi, Sampling, read_block};
use hyst_tests::{Lab, root};

fn lab() -> Lab {
    let lab = Lab::with_model();
    let model = lab.read("model.json");
    // Stages that no fit adds: a list, an option, a second mode.
    let extra = r#""stages": [
    {"stage": "creep", "seconds": [0.1, 1.0], "shares": [0.01, 0.02]},
    {"stage": "resonance", "hz": 90.0, "damping": 0.03, "gain": 1.0},
    {"stage": "resonance", "hz": 250.0, "damping": 0.01, "gain": 0.2},
    {"stage": "asymmetry", "thresholds": [5.0], "weights": [0.02]},"#;
    lab.write("model.json", model.replacen("\"stages\": [", extra, 1));
    lab
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
    let pi: Pi<f32, 64> = p.build(&()).unwrap();
    let model: serde_json::Value = serde_json::from_str(&lab.read("model.json")).unwrap();
    let stages = model["stages"].as_array().unwrap();
    let stage = stages.iter().find(|s| s["stage"] == "pi").unwrap();
    assert_eq!(stage["gain"].as_f64(), Some(p.gain));
    assert_eq!(stage["weights"].as_array().unwrap().len(), p.weights.len());
    assert_eq!(chain.effects.resonances[1].unwrap().hz, 250.0);
    assert!(chain.effects.around::<f32, _, 16, 8>(pi, &Sampling { period: 1e-3 }).is_ok());
}

#[test]
fn a_c_compiler_takes_the_header() {
    let lab = lab();
    lab.ok("export model.json --format c -o model.h");
    lab.write(
        "main.c",
        "#include <stdio.h>\n#include \"model.h\"\nint main(void) {\n\
         (void)hyst_zero; (void)hyst_input_low; (void)hyst_input_high;\n\
         printf(\"%s %c%c%c%c %.17g\\n\", HYST_KIND, hyst_block[0], hyst_block[1], hyst_block[2], hyst_block[3], \
         hyst_resonance_hz + hyst_resonance_2_hz);\n return 0;\n}\n",
    );
    let folder = lab.path("");
    run(
        "cc",
        &folder,
        &[
            "-std=c99",
            "-Wall",
            "-Wextra",
            "-pedantic",
            "-Wno-unused-const-variable",
            "-Wno-unused-variable",
            "-Werror",
            "main.c",
            "-o",
            "main",
        ],
    );
    let said = run(lab.path("main").to_str().unwrap(), &folder, &[]);
    assert_eq!(said, "pi HYST 340\n", "{}", lab.read("model.h"));
}

/// Every kind of model, and one with all that surrounds it, as a program for a board that runs it.
#[test]
fn rustc_takes_the_source() {
    let lab = lab();
    lab.ok("export model.json --format rust -o fitted.rs");
    let mut modules = vec!["fitted".to_owned()];
    for kind in Kind::ALL {
        let module = kind.name().replace('-', "_");
        let file = root().join(format!("docs/models/{kind}.json"));
        lab.write("paper.json", std::fs::read(file).unwrap());
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
    let mut main = String::from("use hyst_core::*;\n");
    for module in &modules {
        main += &format!("mod {module};\n");
    }
    main += "fn main() -> Result<(), Error> {\n    let env = Env { temperature: 23.0, ..Env::default() };\n";
    for module in &modules {
        main += &format!(
            "    let model = Box::new({module}::chain::<f64, 64>(&Sampling {{ period: 1e-3 }})?);\n    \
             let mut state = Box::new(model.state());\n    \
             model.reset(&mut state, &env, {module}::INPUT[0]);\n    \
             println!(\"{module} {{:e}}\", model.step(&mut state, &env, {module}::INPUT[1]));\n"
        );
    }
    lab.write("main.rs", main + "    Ok(())\n}\n");
    // The lock file of the workspace pins what the registry has at hand.
    std::fs::copy(root().join("Cargo.lock"), lab.path("Cargo.lock")).unwrap();
    let target = root().join("target/export");
    let said = run(
        &std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()),
        &lab.path(""),
        &["run", "--quiet", "--target-dir", target.to_str().unwrap()],
    );
    let outputs: Vec<&str> = said.lines().collect();
    assert_eq!(outputs.len(), modules.len(), "{said}");
    for line in outputs {
        let (_, y) = line.split_once(' ').unwrap();
        assert!(y.parse::<f64>().is_ok_and(f64::is_finite), "{line}");
    }
    // An exported function is the one of the file.
    assert!(
        lab.read("atan.rs").contains("ActivationKind::Atan") && lab.read("tanh.rs").contains("ActivationKind::Tanh")
    );
}

#[test]
fn what_is_no_model_is_refused() {
    let lab = Lab::new();
    lab.write("bad.json", "{}");
    let message = lab.refuses("export bad.json --format c -o model.h", 2);
    assert!(message.contains("bad.json"), "{message}");
    assert!(!lab.path("model.h").exists());
}
