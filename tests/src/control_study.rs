//! Tracking errors of five controllers for three references on one simulated actuator: constant gain, two inverses,
//! PID, and PID with an inverse.

use std::f64::consts::TAU;

use serde_json::Value;

use crate::Lab;

/// The compared controllers, in the order of the columns.
pub const CONTROLS: [&str; 5] = ["gain", "base inverse", "extended inverse", "PID", "PID + extended inverse"];

/// Sample rate \[Hz\].
const RATE_HZ: f64 = 2000.0;

/// Errors of one controller on one reference \[µm\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Error {
    /// Root mean square.
    pub rmse: f64,
    /// Largest.
    pub max: f64,
}

/// One reference.
#[derive(Clone, Debug)]
pub struct Row {
    /// Description.
    pub name: &'static str,
    /// Highest frequency of its content \[Hz\].
    pub band_hz: f64,
    /// Time \[s\].
    pub time: Vec<f64>,
    /// Reference values \[µm\].
    pub wanted: Vec<f64>,
    /// Measured output with each controller \[µm\].
    pub measured: Vec<Vec<f64>>,
    /// Errors of each controller.
    pub errors: Vec<Error>,
}

/// Result of the study.
#[derive(Clone, Debug)]
pub struct Study {
    /// Effects named by the diagnosis.
    pub named: Vec<String>,
    /// Explanation of the PID gains that the program prints.
    pub gains: String,
    /// Bandwidth of the PID \[Hz\].
    pub pid_hz: f64,
    /// The references.
    pub rows: Vec<Row>,
}

/// Returns the description of an actuator with random relays, a lag, creep and a mode.
fn plant(seed: u64) -> String {
    format!(
        "seed = {seed}\n\
         [actuator]\nmax_v = 120\ngain_um_per_v = 0.2\nloop_share = 0.13\nrelays = 4000\n\
         [sensor]\nrange_um = [-10, 45]\nnoise_um = 0.004\n\
         [lag]\nseconds = 0.0015\n\
         [creep]\nstrength = 0.06\ntau_min_s = 0.05\ntau_max_s = 60\n\
         [[mode]]\nhz = 180.0\ndamping = 0.03\ngain = 0.9\n"
    )
}

/// Name, band \[Hz\] and shape (0 to 1 over time) of a reference.
type Shape = (&'static str, f64, fn(f64) -> f64);

const REFERENCES: [Shape; 3] = [
    ("steps with holds, below 2 Hz", 2.0, |t| {
        let smooth = |x: f64| 0.5 - 0.5 * (std::f64::consts::PI * x.clamp(0.0, 1.0)).cos();
        [(0.0, 0.35), (1.5, 0.4), (3.0, -0.55), (4.5, 0.45)].iter().map(|(at, by)| by * smooth((t - at) / 0.5)).sum()
    }),
    ("sine of 10 Hz that swells and fades", 10.5, |t| {
        0.5 - 0.4 * (TAU * 0.25 * t).sin().abs() * (TAU * 10.0 * t).sin()
    }),
    ("five sines, 5 to 30 Hz", 30.0, |t| {
        let sines = [5.0, 10.0, 15.0, 20.0, 30.0].iter().enumerate();
        0.5 + 0.09 * sines.map(|(k, hz)| (TAU * hz * t + 1.3 * k as f64).sin()).sum::<f64>()
    }),
];

/// Runs the study.
///
/// # Panics
/// If a command fails.
pub fn run(seed: u64) -> Study {
    let lab = Lab::new();
    lab.write("plant.toml", plant(seed));
    lab.ok(&format!("excite identification --low 0 --high 120 --rate {RATE_HZ} --seconds 16 -o u.csv"));
    lab.ok("run --daq sim:plant.toml --drive u.csv --record train.csv");
    lab.ok("fit train.csv --model pi -o base.json");
    lab.ok("diagnose train.csv --model base.json -o extended.json --findings findings.json");
    let findings: Value = serde_json::from_str(&lab.read("findings.json")).expect("findings are JSON");
    let named = findings["effects"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|effect| effect["name"].as_str().map(str::to_owned))
        .collect();
    let (mut gains, mut pid_hz) = (String::new(), 0.0);
    let rows = REFERENCES.iter().map(|(name, band_hz, shape)| {
        let time: Vec<f64> = (0..(6.0 * RATE_HZ) as usize).map(|k| k as f64 / RATE_HZ).collect();
        let wanted: Vec<f64> = time.iter().map(|t| 3.0 + 15.0 * shape(*t)).collect();
        let mut text = String::from("time_s,displacement_um\n");
        time.iter().zip(&wanted).for_each(|(t, y)| text += &format!("{t:.4},{y:.6}\n"));
        lab.write("reference.csv", text);
        let mut row = Row { name, band_hz: *band_hz, time, wanted, measured: Vec::new(), errors: Vec::new() };
        for (model, control) in [
            ("base", "gain"),
            ("base", "feedforward"),
            ("extended", "feedforward"),
            ("extended", "pid"),
            ("extended", "pid+feedforward"),
        ] {
            let line = format!(
                "run --daq sim:plant.toml --model {model}.json --reference reference.csv --control {control} --settle 4 --json --record run.csv"
            );
            let said = lab.ok(&line).json();
            let number = |key: &str| said["tracking"][key].as_f64().expect("a number");
            row.errors.push(Error { rmse: number("rmse"), max: number("max_abs") });
            row.measured.push(column(&lab.read("run.csv"), "displacement_um"));
            if let Some(hz) = said["pid"]["crossover_hz"].as_f64() {
                pid_hz = hz;
                gains = said["pid"]["why"].as_str().unwrap_or_default().to_owned();
            }
        }
        row
    });
    let rows: Vec<Row> = rows.collect();
    Study { named, gains, pid_hz, rows }
}

fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines();
    let at = lines.next().and_then(|header| header.split(',').position(|c| c == name)).expect("the column exists");
    lines.map(|line| line.split(',').nth(at).and_then(|x| x.parse().ok()).expect("a number")).collect()
}
