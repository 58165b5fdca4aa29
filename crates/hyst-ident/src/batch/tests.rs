//! Compares the kernels with the models of `hyst-core`, one candidate at a time.

use hyst_core::{
    Activation, ActivationKind, ActivationParams, BoucWen, BoucWenParams, Build, Env, Pi, Sampling, Stage, TdPi,
    TdPiParams,
};
use proptest::prelude::*;

use super::*;
use crate::optimize::Cost;

const PERIOD: f64 = 1e-3;

struct Data {
    rows: Vec<Row>,
    output: Vec<f64>,
    counts: Vec<bool>,
    segments: Vec<Range<usize>>,
}

impl Data {
    /// Two segments of a drive with minor loops; the temperature changes in the second.
    fn new() -> Self {
        let segments = vec![0..900, 900..2000];
        let mut rows = Vec::new();
        let mut before = 0.0;
        for k in 0..2000usize {
            let t = PERIOD * k as f64;
            let input = 60.0 + 55.0 * (40.0 * t).sin() * (3.0 * t).cos() + 3.0 * (300.0 * t).sin();
            if k == 0 || k == 900 {
                before = input;
            }
            let temperature = if k < 900 { 23.0 } else { 23.0 + 2e-3 * (k - 900) as f64 };
            rows.push(Row { input, rate: (input - before) / PERIOD, temperature });
            before = input;
        }
        let output = rows.iter().map(|r| 0.1 * r.input).collect();
        let counts = (0..2000).map(|k| k % 7 != 3).collect();
        Self { rows, output, counts, segments }
    }

    fn rows(&self) -> Rows<'_> {
        Rows { rows: &self.rows, output: &self.output, counts: &self.counts, segments: &self.segments }
    }

    /// Returns the outputs of a stage of `hyst-core`.
    fn run(&self, stage: &impl Stage<f64>) -> Vec<f64> {
        let mut out = Vec::new();
        for segment in &self.segments {
            let mut s = stage.state();
            for k in segment.clone() {
                let row = &self.rows[k];
                let e = Env { temperature: row.temperature, ..Env::default() };
                let first = k == segment.start;
                out.push(if first { stage.reset(&mut s, &e, row.input) } else { stage.step(&mut s, &e, row.input) });
            }
        }
        out
    }

    fn error(&self, y: &[f64]) -> f64 {
        let counted = || y.iter().zip(&self.output).zip(&self.counts).filter(|(_, c)| **c);
        let sum: f64 = counted().map(|((a, b), _)| (a - b) * (a - b)).sum();
        (sum / counted().count() as f64).sqrt()
    }
}

/// Asserts that outputs and costs of a kernel equal those of a stage for each of eleven candidates.
fn agree<K: Kernel, S: Stage<f64>>(kernel: K, points: &[f64], stage: impl Fn(&[f64]) -> S) {
    let data = Data::new();
    let n = kernel.parameters();
    let errors = Errors::new(kernel, data.rows()).unwrap();
    let count = points.len() / n;
    let mut costs = vec![0.0; count];
    errors.costs(points, &vec![f64::INFINITY; count], &mut costs);
    for (i, point) in points.chunks_exact(n).enumerate() {
        let expected = data.run(&stage(point));
        let span = expected.iter().fold(0.0f64, |m, y| m.max(y.abs()));
        for (a, b) in errors.outputs(point)[0].iter().zip(&expected) {
            assert!((a - b).abs() <= 1e-12 * span, "candidate {i}: {a} {b}");
        }
        let error = data.error(&expected);
        assert!((costs[i] - error).abs() <= 1e-10 * error, "candidate {i}: {} {error}", costs[i]);
    }
    // A candidate has the same cost alone and with others. If it is stopped early, its cost is no better than the
    // limit.
    for (i, point) in points.chunks_exact(n).enumerate() {
        let mut alone = [0.0];
        errors.costs(point, &[f64::INFINITY], &mut alone);
        assert_eq!(alone[0].to_bits(), costs[i].to_bits());
        errors.costs(point, &[0.5 * costs[i]], &mut alone);
        assert!(alone[0] >= costs[i]);
        errors.costs(point, &[costs[i]], &mut alone);
        assert_eq!(alone[0].to_bits(), costs[i].to_bits());
    }
}

fn candidates<const P: usize>(ranges: [(f64, f64); P]) -> impl Strategy<Value = Vec<f64>> {
    proptest::collection::vec(0.0..1.0f64, 11 * P).prop_map(move |x| {
        x.iter().enumerate().map(|(i, x)| ranges[i % P].0 + (ranges[i % P].1 - ranges[i % P].0) * x).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn prandtl_ishlinskii(p in candidates([(0.05, 0.2), (1.0, 10.0), (10.0, 30.0), (30.0, 60.0), (0.0, 0.1), (0.0, 0.1), (0.0, 0.1)])) {
        agree(PiKernel::<3>, &p, |p| Pi::<f64, 3>::new(p[0], &p[1..4], &p[4..7]).unwrap());
    }

    #[test]
    fn temperature_dependent(p in candidates([
        (0.2, 2.0), (0.1, 2.0), (0.0, 1.0), (-0.02, 0.02), (0.01, 0.1), (-0.5, 0.0), (0.01, 0.1), (0.0, 0.5),
    ])) {
        agree(TdPiKernel::<9> { reference_degc: 23.0 }, &p, |p| {
            let [alpha, epsilon, tau, eta, a0, a1, b0, b1] = p.try_into().unwrap();
            let params = TdPiParams { alpha, epsilon, tau, eta, a0, a1, b0, b1, plays: 9, reference_degc: 23.0 };
            Build::<TdPi<f64, 9>>::build(&params, &()).unwrap()
        });
    }

    #[test]
    fn bouc_wen(p in candidates([(0.05, 0.2), (-0.1, 0.1), (0.01, 0.5), (-1.0, 1.0)])) {
        let inside = |p: &[f64]| [p[0], p[1], p[2], p[3] * p[2]];
        let p: Vec<f64> = p.chunks_exact(4).flat_map(inside).collect();
        agree(BoucWenKernel, &p, |p| {
            let params = BoucWenParams { k0: p[0], alpha: p[1], beta: p[2], gamma: p[3], n: 1.0 };
            Build::<BoucWen<f64>>::build(&params, &()).unwrap()
        });
    }

    #[test]
    fn activation_functions(which in 0usize..5, p in candidates([(0.05, 0.2), (-1e-3, 1e-3), (0.0, 1.0), (0.0, 0.2)])) {
        let kind = ActivationKind::ALL[which];
        agree(ActivationKernel { kind }, &p, |p| {
            let params = ActivationParams { k0: p[0], alpha: p[1], beta: p[2], gamma: p[3] };
            Build::<Activation<f64>>::build(&(kind, params), &Sampling { period: PERIOD }).unwrap()
        });
    }
}

#[test]
fn an_invalid_candidate_has_no_finite_cost() {
    let data = Data::new();
    let errors = Errors::new(BoucWenKernel, data.rows()).unwrap();
    let mut costs = [0.0];
    errors.costs(&[0.1, 0.05, 0.1, 0.2], &[f64::INFINITY], &mut costs);
    assert!(!costs[0].is_finite());
}

#[test]
fn invalid_kernels_columns_and_segments_are_refused() {
    let data = Data::new();
    assert_eq!(Errors::new(PiKernel::<32>, data.rows()).unwrap_err(), ErrorsError::Parameters { parameters: 65 });
    assert_eq!(Errors::new(PiKernel::<31>, data.rows()).unwrap().outputs(&[0.1; 63]).len(), 1);
    let short = Rows { output: &data.output[1..], ..data.rows() };
    let lengths = ErrorsError::Lengths { rows: 2000, output: 1999, counts: 2000 };
    assert_eq!(Errors::new(BoucWenKernel, short).unwrap_err(), lengths);
    let beyond = [0..900, 900..2001];
    let beyond = Rows { segments: &beyond, ..data.rows() };
    let segment = ErrorsError::Segment { start: 900, end: 2001, rows: 2000 };
    assert_eq!(Errors::new(BoucWenKernel, beyond).unwrap_err(), segment);
    // With more candidates than lanes, the first ones are used.
    let many = [0.1, 0.05, 0.2, 0.1].repeat(9);
    assert_eq!(Errors::new(BoucWenKernel, data.rows()).unwrap().outputs(&many).len(), LANES);
}

#[test]
fn a_product_and_a_sum_are_rounded_once() {
    let x = 1.0 + f64::EPSILON;
    let once = Lanes::all(x).times_plus(Lanes::all(x), Lanes::all(-1.0 - 2.0 * f64::EPSILON));
    assert_eq!(once, Lanes::all(f64::EPSILON * f64::EPSILON));
}
