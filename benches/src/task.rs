//! Identification tasks with known parameters: records simulated with the numbers of a paper, plus noise.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use hyst_core::{ActivationKind, TdPiParams};
use hyst_ident::batch::{ActivationKernel, BoucWenKernel, Errors, Kernel, Row, Rows, TdPiKernel};
use hyst_ident::optimize::{Cost, Space, Variable};
use hyst_ident::record::{Columns, OutputUnit, Record};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Standard deviation of the noise, as a share of the span of the output.
const NOISE: f64 = 1e-3;

/// A model whose parameters are identified.
#[derive(Clone, Copy, Debug)]
pub enum Model {
    /// TD-PI with nine thresholds in addition to r = 0.
    TdPi,
    /// Bouc-Wen with n = 1.
    BoucWen,
    /// The activation-function model with tanh.
    Tanh,
}

/// A record, its true parameters, and the search space.
pub struct Task {
    /// Name in tables and files.
    pub name: &'static str,
    /// The model.
    pub model: Model,
    /// Searched variables with bounds.
    pub space: Space,
    /// True parameters.
    pub truth: Vec<f64>,
    /// Noise floor: RMS of the added noise, the RMSE of the true parameters \[y\].
    pub floor: f64,
    rows: Vec<Row>,
    output: Vec<f64>,
    counts: Vec<bool>,
    segments: Vec<Range<usize>>,
    period: f64,
}

impl Task {
    /// Returns the task of the eight parameters of TD-PI, as in the paper on temperature-dependent models: two periods
    /// of 200 sin(2π 0.1 t) V at 23, 33 and 39 °C, 5000 samples each. The bounds are those of its algorithm 1, 0 … 1
    /// for each. The offsets of the envelopes may also be negative, because one of the printed offsets is negative.
    pub fn td_pi() -> Self {
        let p = TdPiParams::PRINTED;
        let input = |t: f64| 200.0 * (0.1 * TAU * t).sin();
        let (positive, signed) =
            (|name, unit| Variable::linear(name, unit, 0.0, 1.0), |name| Variable::linear(name, "", -1.0, 1.0));
        let variables = vec![
            positive("alpha", ""),
            positive("epsilon", "um"),
            positive("tau", ""),
            positive("eta", "1/K"),
            positive("a0", "1/V"),
            signed("a1"),
            positive("b0", "1/V"),
            signed("b1"),
        ];
        let truth = vec![p.alpha, p.epsilon, p.tau, p.eta, p.a0, p.a1, p.b0, p.b1];
        Self::new("td-pi", Model::TdPi, variables, truth, 4e-3, 5000, &[23.0, 33.0, 39.0], input)
    }

    /// Returns the task of the four parameters of a Bouc-Wen model, for a decaying sine plus a sine of small amplitude,
    /// at 1 kHz.
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

    /// Returns the task of the four parameters of the tanh model, as in the paper on activation functions: five cycles
    /// of 10 Hz, 0 … 40 V, at 1 kHz.
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

    #[expect(clippy::too_many_arguments, reason = "called once for each task above")]
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

    /// Returns the output of the true parameters.
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

    /// Returns the RMSE of candidates, eight in parallel \[y\].
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

    /// Returns the rows for a pass over the record.
    pub fn rows(&self) -> Rows<'_> {
        Rows { rows: &self.rows, output: &self.output, counts: &self.counts, segments: &self.segments }
    }

    fn times(&self) -> Vec<f64> {
        // Between segments the device is at rest for one more sample.
        let pauses = |k: usize| self.segments.iter().filter(|s| s.end <= k).count();
        (0..self.rows.len()).map(|k| (k + pauses(k)) as f64 * self.period).collect()
    }

    /// Returns the record for a fit.
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

    /// Returns the record as a CSV file with all digits.
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
