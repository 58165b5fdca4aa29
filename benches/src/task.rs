//! Identification tasks with a known answer: a record simulated with the numbers that a paper prints, plus noise.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use hyst_core::{ActivationKind, TdPiParams};
use hyst_ident::batch::{ActivationKernel, BoucWenKernel, Errors, Kernel, Row, Rows, TdPiKernel};
use hyst_ident::optimize::{Cost, Space, Variable};
use hyst_ident::record::{Columns, OutputUnit, Record};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Standard deviation of the noise, as a share of the output's span.
const NOISE: f64 = 1e-3;

/// A model whose parameters are sought.
#[derive(Clone, Copy, Debug)]
pub enum Model {
    /// TD-PI with nine thresholds besides r = 0.
    TdPi,
    /// Bouc-Wen with n = 1.
    BoucWen,
    /// The activation-function model with tanh.
    Tanh,
}

/// A record, the box in which its parameters lie, and the parameters.
pub struct Task {
    /// Its name in tables and files.
    pub name: &'static str,
    /// The model.
    pub model: Model,
    /// What is sought, with bounds.
    pub space: Space,
    /// What the record was simulated with.
    pub truth: Vec<f64>,
    /// Root mean square of the noise that was drawn: what the true parameters leave \[y\].
    pub floor: f64,
    rows: Vec<Row>,
    output: Vec<f64>,
    counts: Vec<bool>,
    segments: Vec<Range<usize>>,
    period: f64,
}

impl Task {
    /// The eight parameters of TD-PI as in the paper on temperature-dependent models: two periods of 200 sin(2π 0.1 t) V at 23, 33
    /// and 39 °C, 5000 samples each. The box is that of its algorithm 1, 0 … 1 for each; the offsets of the envelopes
    /// may be negative too, for one of those it prints is.
    pub fn td_pi() -> Self {
        let p = TdPiParams::PRINTED;
        let input = |t: f64| 200.0 * (0.1 * TAU * t).sin();
        let (one, both) =
            (|name, unit| Variable::linear(name, unit, 0.0, 1.0), |name| Variable::linear(name, "", -1.0, 1.0));
        let variables = vec![
            one("alpha", ""),
            one("epsilon", "um"),
            one("tau", ""),
            one("eta", "1/K"),
            one("a0", "1/V"),
            both("a1"),
            one("b0", "1/V"),
            both("b1"),
        ];
        let truth = vec![p.alpha, p.epsilon, p.tau, p.eta, p.a0, p.a1, p.b0, p.b1];
        Self::new("td-pi", Model::TdPi, variables, truth, 4e-3, 5000, &[23.0, 33.0, 39.0], input)
    }

    /// The four parameters of a Bouc-Wen model over a decaying sine and a slow one of small amplitude on top, at 1 kHz.
    pub fn bouc_wen(rows: usize) -> Self {
        let variables = vec![
            Variable::linear("k0", "um/V", 0.0, 1.0),
            Variable::linear("alpha", "um/V", -1.0, 1.0),
            Variable::linear("beta", "1/V", 0.0, 1.0),
            Variable::linear("gamma", "1/V", -1.0, 1.0),
        ];
        let length = 1e-3 * rows as f64;
        let input = move |t: f64| {
            50.0 * (1.0 - (-2.0 * t / length).exp() * (40.0 * PI * t / length).cos())
                + 4.0 * (TAU * 70.0 * t / length).sin()
        };
        Self::new("bouc-wen", Model::BoucWen, variables, vec![0.12, -0.05, 0.06, 0.02], 1e-3, rows, &[23.0], input)
    }

    /// The four parameters of the tanh model as in the paper on activation functions: five cycles of 10 Hz, 0 … 40 V, at 1 kHz.
    pub fn tanh() -> Self {
        let variables = vec![
            Variable::linear("k0", "um/V", 0.0, 1.0),
            Variable::linear("alpha", "um s/V", -1e-3, 1e-3),
            Variable::linear("beta", "um", 0.0, 1.0),
            Variable::log("gamma", "1/V", 1e-3, 1e6),
        ];
        let input = |t: f64| 20.0 - 20.0 * (10.0 * TAU * t).cos();
        Self::new("tanh", Model::Tanh, variables, vec![0.1461, -9e-5, 0.3857, 0.05], 1e-3, 500, &[23.0], input)
    }

    #[expect(clippy::too_many_arguments, reason = "one call for each task above, all in the same order")]
    fn new(
        name: &'static str,
        model: Model,
        variables: Vec<Variable>,
        truth: Vec<f64>,
        period: f64,
        rows_each: usize,
        temperatures: &[f64],
        input: impl Fn(f64) -> f64,
    ) -> Self {
        let mut rows = Vec::new();
        for temperature in temperatures {
            let mut before = input(0.0);
            for k in 0..rows_each {
                let u = input(k as f64 * period);
                rows.push(Row { input: u, rate: (u - before) / period, temperature: *temperature });
                before = u;
            }
        }
        let segments: Vec<Range<usize>> = (0..temperatures.len()).map(|i| i * rows_each..(i + 1) * rows_each).collect();
        let (output, counts) = (vec![0.0; rows.len()], vec![true; rows.len()]);
        let space = Space::new(variables).unwrap_or_else(|e| panic!("{name}: {e}"));
        let mut task = Self { name, model, space, truth, floor: 0.0, rows, output, counts, segments, period };
        let clean = task.simulated();
        let (low, high) = clean.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(*y), h.max(*y)));
        let mut rng = ChaCha8Rng::seed_from_u64(2024);
        let mut squares = 0.0;
        for (measured, y) in task.output.iter_mut().zip(&clean) {
            let (a, b): (f64, f64) = (rng.random(), rng.random());
            let noise = NOISE * (high - low) * (-2.0 * (1.0 - a).ln()).sqrt() * (TAU * b).cos();
            *measured = y + noise;
            squares += noise * noise;
        }
        task.floor = (squares / clean.len() as f64).sqrt();
        task
    }

    /// What the true parameters give.
    fn simulated(&self) -> Vec<f64> {
        let mut lists = match self.model {
            Model::TdPi => self.td_pi_errors().outputs(&self.truth),
            Model::BoucWen => self.errors(BoucWenKernel).outputs(&self.truth),
            Model::Tanh => self.errors(TANH).outputs(&self.truth),
        };
        lists.swap_remove(0)
    }

    fn errors<K: Kernel>(&self, kernel: K) -> Errors<'_, K> {
        Errors::new(kernel, self.rows()).unwrap_or_else(|e| panic!("{}: {e}", self.name))
    }

    fn td_pi_errors(&self) -> Errors<'_, TdPiKernel<9>> {
        self.errors(TdPiKernel { reference_degc: TdPiParams::PRINTED.reference_degc })
    }

    /// Root mean square error of candidates, eight side by side \[y\].
    pub fn cost(&self) -> Box<dyn Cost + '_> {
        fn boxed<'a, K: Kernel + 'a>(errors: Errors<'a, K>) -> Box<dyn Cost + 'a>
        where
            Errors<'a, K>: Cost,
        {
            Box::new(errors)
        }
        match self.model {
            Model::TdPi => boxed(self.td_pi_errors()),
            Model::BoucWen => boxed(self.errors(BoucWenKernel)),
            Model::Tanh => boxed(self.errors(TANH)),
        }
    }

    /// What a pass over the record sees.
    pub fn rows(&self) -> Rows<'_> {
        Rows { rows: &self.rows, output: &self.output, counts: &self.counts, segments: &self.segments }
    }

    fn times(&self) -> Vec<f64> {
        // The device rests for one sample more between segments.
        let rested = |k: usize| self.segments.iter().filter(|s| s.end <= k).count();
        (0..self.rows.len()).map(|k| (k + rested(k)) as f64 * self.period).collect()
    }

    /// The record as a fit reads it.
    pub fn record(&self) -> Record {
        let segment = |k: usize| self.segments.iter().position(|s| s.contains(&k)).unwrap_or(0) as i64;
        Record::from_samples(Columns {
            name: self.name.into(),
            segment: Some((0..self.rows.len()).map(segment).collect()),
            time: self.times(),
            input: Some(self.rows.iter().map(|r| r.input).collect()),
            output: Some((OutputUnit::Micrometre, self.output.clone())),
            temperature: Some(self.rows.iter().map(|r| r.temperature).collect()),
            ..Columns::default()
        })
        .unwrap_or_else(|e| panic!("{}: {e}", self.name))
    }

    /// The record as a CSV file with every digit.
    pub fn csv(&self) -> String {
        let mut text = String::from("segment,time_s,voltage_v,displacement_um,temperature_degc\n");
        let times = self.times();
        for (segment, range) in self.segments.iter().enumerate() {
            for k in range.clone() {
                let Row { input, temperature, .. } = self.rows[k];
                text += &format!("{segment},{},{input},{},{temperature}\n", times[k], self.output[k]);
            }
        }
        text
    }
}

const TANH: ActivationKernel = ActivationKernel { kind: ActivationKind::Tanh };
