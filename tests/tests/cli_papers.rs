//! Every kind of model with the numbers of its paper (`docs/models`): simulated, compensated, exported.

use std::fmt::Write;
use std::fs;

use hyst_core::{Kind, List, read_block};
use hyst_tests::{Lab, column, root};
use serde_json::Value;

struct Paper {
    lab: Lab,
    input: String,
    output: String,
    predicted: String,
    /// Lowest and highest input in the file.
    range: [f64; 2],
    rate: f64,
}

const ROWS: usize = 4000;

impl Paper {
    fn new(kind: Kind) -> Self {
        let lab = Lab::new();
        let file = root().join(format!("docs/models/{kind}.json"));
        let text = fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        lab.write("model.json", &text);
        let model: Value = serde_json::from_str(&text).unwrap();
        let name = |end: &str| model[end]["column"].as_str().unwrap().to_owned();
        let number = |v: &Value| v.as_f64().unwrap();
        let paper = Self {
            lab,
            input: name("input"),
            output: name("output"),
            predicted: format!("predicted_{}", model["output"]["unit"].as_str().unwrap()),
            range: [number(&model["input"]["low"]), number(&model["input"]["high"])],
            rate: number(&model["recorded_at_hz"]),
        };
        // A slow sine with smaller, faster ones, from near the low end (activation functions switch at 0), and a
        // temperature ramp.
        let [low, high] = paper.range;
        let swing = |k: usize| {
            let t = k as f64 / ROWS as f64;
            let slow = 0.5 - 0.5 * (std::f64::consts::TAU * 2.0 * t).cos();
            let fast = 0.5 - 0.5 * (std::f64::consts::TAU * 13.0 * t).cos();
            low + (high - low) * (0.02 + 0.75 * slow + 0.2 * fast)
        };
        paper.write("drive.csv", &paper.input, &(0..ROWS).map(swing).collect::<Vec<_>>());
        paper
    }

    fn write(&self, file: &str, column: &str, values: &[f64]) {
        let mut text = format!("time_s,{column},temperature_degc\n");
        for (k, v) in values.iter().enumerate() {
            let _ = writeln!(text, "{:.6},{v:?},{:.3}", k as f64 / self.rate, 23.0 + 10.0 * k as f64 / ROWS as f64);
        }
        self.lab.write(file, text);
    }

    fn simulated(&self, drive: &str) -> Vec<f64> {
        self.lab.ok(&format!("simulate --model model.json {drive} -o out.csv"));
        column(&self.lab.read("out.csv"), &self.predicted)
    }
}

fn span(y: &[f64]) -> f64 {
    y.iter().copied().fold(f64::NEG_INFINITY, f64::max) - y.iter().copied().fold(f64::INFINITY, f64::min)
}

/// For the files with round numbers.
#[test]
fn the_stated_output_range_is_that_of_the_model() {
    for kind in [Kind::Pi, Kind::Gpi] {
        let paper = Paper::new(kind);
        paper.write("full.csv", &paper.input, &(0..=1000).map(|k| 0.12 * f64::from(k)).collect::<Vec<_>>());
        let text = paper.lab.read("model.json");
        let stated = serde_json::from_str::<Value>(&text).unwrap()["output"]["high"].as_f64().unwrap();
        let reached = paper.simulated("full.csv").pop().unwrap();
        assert!((stated - reached).abs() < 0.05, "{kind}: {stated} in the file, {reached} reached");
    }
}

#[test]
fn every_kind_is_simulated_and_exported() {
    for kind in Kind::ALL {
        let paper = Paper::new(kind);
        let y = paper.simulated("drive.csv");
        assert!(y.len() == ROWS && y.iter().all(|y| y.is_finite()) && span(&y) > 0.1, "{kind}");
        for format in ["c", "rust", "postcard"] {
            paper.lab.ok(&format!("export model.json --format {format} -o exported.{format}"));
        }
        let block = fs::read(paper.lab.path("exported.postcard")).unwrap();
        let read = read_block::<List<256>, List<8>>(&block).unwrap_or_else(|e| panic!("{kind}: {e}"));
        assert_eq!(read.operator.kind(), kind);
    }
}

/// Kinds with a band-limited or anti-causal inverse, and the tolerance away from the ends, as a share of the span.
const PREVIEWED: &[(Kind, f64)] = &[
    (Kind::TdEm, 2e-3),
    (Kind::Atan, 1e-9),
    (Kind::Sigmoid, 1e-9),
    (Kind::Softplus, 1e-9),
    (Kind::Softsign, 1e-9),
    (Kind::Tanh, 1e-9),
];

#[test]
fn the_inverse_of_every_kind_reproduces_the_output() {
    for kind in Kind::ALL {
        let paper = Paper::new(kind);
        let y = paper.simulated("drive.csv");
        paper.write("reference.csv", &paper.output, &y);
        let [low, high] = paper.range;
        let reach = high - low;
        let command = format!(
            "compensate --model model.json reference.csv -o found.csv --limit {},{}",
            low - 2.0 * reach,
            high + 2.0 * reach
        );
        if kind == Kind::BoucWenOscillator {
            let message = paper.lab.fails(&command, 1);
            assert!(message.contains("no inverse"), "{message}");
            continue;
        }
        paper.lab.ok(&command);
        let again = column(&paper.lab.read("found.csv"), &paper.input);
        paper.write("again.csv", &paper.input, &again);
        let reached = paper.simulated("again.csv");
        let previewed = PREVIEWED.iter().find(|(k, _)| *k == kind);
        let (edge, tolerance) = previewed.map_or((0, 1e-9), |(_, tolerance)| (200, *tolerance));
        let errors = y.iter().zip(&reached).map(|(a, b)| (a - b).abs());
        let worst = errors.skip(edge).take(ROWS - 2 * edge).fold(0.0, f64::max);
        assert!(worst <= tolerance * span(&y), "{kind}: {worst} of {}", span(&y));
    }
}
