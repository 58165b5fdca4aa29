//! Shared helpers of the cross-crate tests: the built `hystctl`, temporary folders, small records.

pub mod activation_study;
pub mod ageing;
pub mod calibration;
pub mod control_study;
pub mod controller;
pub mod dpm_study;
pub mod fod_study;
pub mod force_ranking;
pub mod force_study;
pub mod fuzz;
pub mod guide;
pub mod learning;
pub mod logs;
pub mod other_bench;
pub mod other_physics;
pub mod served;
pub mod structure;

use std::env;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use hyst_hw::{Actuator, Bed, Plant, PlantConfig, Sensor, Viscosity};
use hyst_ident::excite::{Drive, Identification, Limits};
use hyst_ident::record::{Columns, OutputUnit, Record};
use serde_json::{Value, json};
use tempfile::TempDir;

/// Registers the font `sans-serif` of the plots that examples draw with plotters.
pub fn register_font() {
    // Fails only for a damaged font; drawing reports that.
    let _ = plotters::style::register_font("sans-serif", plotters::style::FontStyle::Normal, dejavu::sans::regular());
}

/// A simulated actuator with hysteresis and a lag that simulates quickly: 0 to 100 V, about 20 µm.
pub const PLANT: &str = "\
seed = 3
[actuator]
max_v = 100
gain_um_per_v = 0.2
loop_share = 0.12
relays = 2000
[sensor]
range_um = [-10, 40]
noise_um = 0.005
[lag]
seconds = 0.01
";

/// Addition to [`PLANT`]: a measured temperature that acts on the gain.
pub const WARM: &str = "\
[temperature]
per_k = 0.01
reference_degc = 22.0
mean_degc = 24.0
swing_k = 6.0
period_s = 5.0
noise_k = 0.01
";

/// Returns the path of the binary `hystctl`: the variable `HYSTCTL`, else the binary of the same profile as this test,
/// built up to date.
///
/// # Panics
/// If it cannot be built.
pub fn hystctl() -> &'static Path {
    static BINARY: OnceLock<PathBuf> = OnceLock::new();
    BINARY.get_or_init(|| {
        if let Some(binary) = env::var_os("HYSTCTL").map(PathBuf::from) {
            assert!(binary.is_file(), "HYSTCTL is {}, which is not a file", binary.display());
            return binary;
        }
        let test = env::current_exe().expect("a test has a path");
        // target/PROFILE/deps/TEST
        let folder = test.parent().and_then(Path::parent).expect("tests are two folders deep in the target folder");
        let binary = folder.join(format!("hystctl{}", env::consts::EXE_SUFFIX));
        let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        cargo.args(["build", "--quiet", "--package", "hyst-cli", "--bin", "hystctl"]).current_dir(root());
        cargo.arg("--target-dir").arg(folder.parent().expect("a profile has a target folder"));
        if folder.file_name() != Some(OsStr::new("debug")) {
            cargo.arg("--profile").arg(folder.file_name().expect("a profile has a name"));
        }
        // An older binary would be tested instead of the present sources. Without cargo there is no other.
        match cargo.status() {
            Ok(status) => assert!(status.success(), "hystctl cannot be built"),
            Err(error) => assert!(binary.exists(), "hystctl is not built, and cargo cannot be run: {error}"),
        }
        binary
    })
}

/// Returns the folder of the workspace.
///
/// # Panics
/// Never: this package is one folder deep in it.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the package is in the workspace")
}

/// Returns the folder of measured and practice records: `HYST_DATA`, else a folder next to the workspace. The build
/// script sets `cfg(records)` if it exists; a test that needs it is ignored otherwise.
///
/// # Panics
/// If there is no such folder.
pub fn data() -> PathBuf {
    let folder = env::var_os("HYST_DATA").map_or_else(|| root().join("../shared/data"), PathBuf::from);
    assert!(folder.is_dir(), "there are no records at {}; set HYST_DATA", folder.display());
    folder
}

/// Result of a run of `hystctl`.
#[derive(Debug)]
pub struct Ran {
    /// Exit code; -1 if a signal ended it.
    pub code: i32,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl From<Output> for Ran {
    fn from(output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("hystctl prints UTF-8");
        Self { code: output.status.code().unwrap_or(-1), stdout: text(output.stdout), stderr: text(output.stderr) }
    }
}

impl Ran {
    /// Returns the standard output as JSON.
    ///
    /// # Panics
    /// If it is not valid JSON.
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("not valid JSON ({error}): {self:?}"))
    }
}

const SHORT_DRIVE: &str = "excite identification --rate 500 --high 100 --seconds 4 --slow 4 --hold 0.3 --rest 0.1";

/// A temporary folder in which a test runs `hystctl`.
#[derive(Debug)]
pub struct Lab {
    folder: TempDir,
}

impl Default for Lab {
    fn default() -> Self {
        Self::new()
    }
}

impl Lab {
    /// Creates an empty folder.
    ///
    /// # Panics
    /// If it cannot be created.
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a temporary folder") }
    }

    /// Creates a folder with `plant.toml` ([`PLANT`]), `train.csv` (4 s at 500 Hz) and `model.json` (kind `pi`).
    pub fn with_model() -> Self {
        let lab = Self::with_train("");
        lab.ok("fit train.csv --model pi -o model.json");
        lab
    }

    /// Creates a folder with `plant.toml` ([`PLANT`] and `more`) and `train.csv` (4 s at 500 Hz).
    pub fn with_train(more: &str) -> Self {
        let lab = Self::new();
        lab.write("plant.toml", format!("{PLANT}{more}"));
        lab.excite("u.csv", 1);
        lab.ok("run --daq sim:plant.toml --drive u.csv --record train.csv");
        lab
    }

    /// Writes a short identification drive.
    pub fn excite(&self, name: &str, seed: u64) {
        self.ok(&format!("{SHORT_DRIVE} --seed {seed} -o {name}"));
    }

    /// Writes a short test drive, which differs from the identification drive in every segment.
    pub fn excite_for_test(&self, name: &str) {
        self.ok(&format!("{SHORT_DRIVE} --test -o {name}"));
    }

    /// Writes a reference of `seconds` at 500 Hz: a raised cosine of 1 Hz from 6 to `top` µm.
    pub fn reference(&self, name: &str, seconds: f64, top: f64) {
        let mut text = String::from("time_s,displacement_um\n");
        for k in 0..(seconds * 500.0) as u32 {
            let t = f64::from(k) / 500.0;
            let y = 6.0 + (top - 6.0) * (0.5 - 0.5 * (std::f64::consts::TAU * t).cos());
            text.push_str(&format!("{t:.3},{y:.4}\n"));
        }
        self.write(name, &text);
    }

    /// Returns the path of a file in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file.
    ///
    /// # Panics
    /// If it cannot be written.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).expect("the file can be written");
    }

    /// Reads a file.
    ///
    /// # Panics
    /// If it cannot be read.
    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Returns the sorted names of all files.
    ///
    /// # Panics
    /// If the folder cannot be read.
    pub fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(self.folder.path()).expect("the folder exists");
        let mut names: Vec<String> =
            entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// Returns a `hystctl` command in the folder; `line` has the arguments, separated by spaces.
    pub fn command(&self, line: &str) -> Command {
        let mut command = Command::new(hystctl());
        command.args(line.split(' ').filter(|word| !word.is_empty())).current_dir(self.folder.path());
        command
    }

    /// Runs `hystctl`.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn run(&self, line: &str) -> Ran {
        self.command(line).output().expect("hystctl starts").into()
    }

    /// Runs `hystctl`, which must succeed.
    ///
    /// # Panics
    /// If it fails.
    pub fn ok(&self, line: &str) -> Ran {
        let ran = self.run(line);
        assert_eq!(ran.code, 0, "hystctl {line}: {}", ran.stderr);
        ran
    }

    /// Runs `hystctl`, which must fail with `code`, change no file, print nothing to stdout and one message to stderr.
    /// Returns the message.
    ///
    /// # Panics
    /// If it behaves otherwise.
    pub fn fails(&self, line: &str, code: i32) -> String {
        let before = self.contents();
        let ran = self.run(line);
        assert_eq!(ran.code, code, "hystctl {line}: {} {}", ran.stdout, ran.stderr);
        assert_eq!(ran.stdout, "", "hystctl {line}");
        assert!(ran.stderr.contains("error: "), "hystctl {line}: {}", ran.stderr);
        assert!(!ran.stderr.contains("panicked"), "hystctl {line}: {}", ran.stderr);
        assert!(self.contents() == before, "hystctl {line} has changed files: {:?}", self.files());
        ran.stderr
    }

    fn contents(&self) -> Vec<(String, Vec<u8>)> {
        let content = |name: &String| fs::read(self.path(name)).unwrap_or_default();
        self.files().into_iter().map(|name| (name.clone(), content(&name))).collect()
    }
}

/// Returns the column `name` of a CSV text.
///
/// # Panics
/// If the column is missing or has a cell that is not a number.
pub fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let at = header.iter().position(|column| *column == name).unwrap_or_else(|| panic!("no {name} in {header:?}"));
    lines.map(|line| line.split(',').nth(at).and_then(|cell| cell.parse().ok()).expect("a number")).collect()
}

/// Returns an actuator of 0 to 100 V whose 15,000 relays switch after 5 mV·s of overdrive. Units: gain \[output
/// unit/V\], range and noise of the sensor \[output unit\].
pub fn viscous_relays(seed: u64, gain: f64, range: [f64; 2], noise: f64) -> PlantConfig {
    let actuator = Actuator {
        min_v: 0.0,
        max_v: 100.0,
        rest_v: 0.0,
        gain_um_per_v: gain,
        loop_share: 0.12,
        bed: Bed::Relays,
        relays: 15_000,
    };
    let sensor = Sensor { range_um: range, bits: 16, noise_um: noise, offset_um: 0.0, max_rate_hz: 20_000.0 };
    PlantConfig { viscosity: Some(Viscosity { volt_seconds: 5e-3 }), ..PlantConfig::bare(seed, actuator, sensor) }
}

/// Plays the standard identification drive on an actuator at 1 kHz and returns the record.
///
/// # Panics
/// If the drive or the plant fails, which the configurations of the tests do not cause.
pub fn experiment(plant: &mut Plant, seed: u64, name: &str) -> Record {
    let range = hyst_hw::Daq::capabilities(plant).voltage;
    let limits = Limits { rate_hz: 1000.0, lo_v: range.min_v, hi_v: range.max_v, slew_v_per_s: None };
    let drive = Identification::at_rate(1000.0, seed).drive(&limits).expect("the standard drive fits");
    played(plant, &drive, 1000.0, OutputUnit::Micrometre, name)
}

/// Plays the segments of a drive and returns the record; in newtons, the actuator presses on a sensor of 1 N/µm.
///
/// # Panics
/// If the plant fails.
pub fn played(plant: &mut Plant, drive: &Drive, rate_hz: f64, output: OutputUnit, name: &str) -> Record {
    let segments: Vec<&[f64]> = drive.segments().iter().map(|rows| &drive.voltage()[rows.clone()]).collect();
    measured(plant, &segments, rate_hz, output, name)
}

/// Plays segments of voltages and returns the record.
///
/// # Panics
/// If the plant fails.
pub fn measured(plant: &mut Plant, segments: &[&[f64]], rate_hz: f64, output: OutputUnit, name: &str) -> Record {
    let options = hyst_hw::RecordOptions::at(rate_hz);
    let recording = hyst_hw::record(plant, segments, &options, |_| std::ops::ControlFlow::Continue(()))
        .expect("the drive is in the plant's range");
    let samples = || recording.segments.iter().flat_map(|s| &s.samples);
    let labels = (0..).zip(&recording.segments).flat_map(|(k, s)| std::iter::repeat_n(k, s.samples.len()));
    let columns = Columns {
        name: name.to_owned(),
        segment: Some(labels.collect()),
        time: samples().map(|s| s.time_s).collect(),
        input: Some(samples().map(|s| s.drive_v).collect()),
        output: Some((output, samples().map(|s| s.output).collect())),
        temperature: samples().map(|s| s.temperature_degc).collect(),
        load: samples().map(|s| s.load_n).collect(),
        ..Columns::default()
    };
    Record::from_samples(columns).expect("a recording is a valid record")
}

/// Returns the text of a model file with every stage added around its hysteresis, in the order of the chain.
///
/// # Panics
/// If `model` is not a model file.
pub fn every_stage(model: &str) -> String {
    let mut model: Value = serde_json::from_str(model).expect("a model file is JSON");
    let stages = model["stages"].as_array_mut().expect("a model file has stages");
    let before = [json!({ "stage": "delay", "seconds": 0.002 }), json!({ "stage": "lag", "seconds": 0.001 })];
    let after = [
        json!({ "stage": "asymmetry", "thresholds": [5.0], "weights": [0.02] }),
        json!({ "stage": "temperature", "per_kelvin": 0.004, "reference_degc": 23.0 }),
        json!({ "stage": "creep", "seconds": [0.1, 1.0], "shares": [0.01, 0.02] }),
        json!({ "stage": "load", "per_newton": 0.05 }),
        json!({ "stage": "resonance", "hz": 90.0, "damping": 0.03, "gain": 1.0 }),
        json!({ "stage": "resonance", "hz": 250.0, "damping": 0.01, "gain": 0.2 }),
        json!({ "stage": "saturation", "low": -100.0, "high": 100.0, "knee": 0.1 }),
        json!({ "stage": "drift", "per_second": 0.01 }),
        json!({ "stage": "interference", "hz": 50.0, "amplitude": 0.02, "phase": 0.5 }),
    ];
    stages.splice(0..0, before);
    stages.extend(after);
    model.to_string()
}
