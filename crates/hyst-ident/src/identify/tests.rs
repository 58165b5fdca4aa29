//! Recovers published parameters from records simulated with them plus noise.

mod errors;

use crate::stop::Stop;
use std::ops::ControlFlow;

use super::search::Identified;
use super::*;
use crate::Samples;
use crate::model::{Base, Operator};
use crate::optimize::Method;
use hyst_core::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Standard normal noise.
fn noise(rng: &mut ChaCha8Rng) -> f64 {
    let (a, b): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}

/// Simulates a record of `base`: one segment per temperature, noise of 0.1 % of the output's span.
fn record(
    base: &Base,
    period: f64,
    rows: usize,
    degc: &[f64],
    drive: impl Fn(f64) -> f64,
    seed: u64,
) -> (Samples, f64) {
    let mut samples = Samples {
        period,
        periods: Vec::new(),
        time: Vec::new(),
        input: Vec::new(),
        output: Vec::new(),
        temperature: Some(Vec::new()),
        load: None,
        segments: Vec::new(),
        pasts: Vec::new(),
        file_of_segment: Vec::new(),
        settling: Vec::new(),
        falls: false,
        blind: Vec::new(),
        stop: Stop::default(),
    };
    for t in degc {
        let start = samples.time.len();
        for k in 0..rows {
            samples.time.push((start + k) as f64 * period);
            samples.input.push(drive(k as f64 * period));
            samples.temperature.as_mut().unwrap().push(*t);
        }
        samples.segments.push(start..start + rows);
        samples.file_of_segment.push(0);
    }
    let (low, high) = samples.input_range();
    let mut y = vec![0.0; samples.len()];
    family::run(&samples, |sampling| Operator::new(base, [low, high], sampling), &mut y).unwrap();
    let (least, most) = crate::statistics::range(y.iter().copied());
    let sigma = 1e-3 * (most - least);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    samples.output = y.iter().map(|y| y + sigma * noise(&mut rng)).collect();
    samples.settling = vec![false; samples.len()];
    samples.blind = samples.settling.clone();
    (samples, sigma)
}

fn search(method: &str, dimensions: usize) -> SearchOptions {
    let method = Method::named(method, dimensions).unwrap();
    SearchOptions { method, evaluations: 1500 * dimensions as u64, seed: 1, trials: 1 }
}

fn located(identification: &Identification<'_>, how: &SearchOptions) -> Located {
    let located = identification.search(None, how, &mut |_| ControlFlow::Continue(())).unwrap();
    identification.polish(&located).unwrap()
}

fn identified(kind: Kind, samples: &Samples, form: &Form, method: &str) -> Identified {
    let family = family_of(kind, samples, largest_input(samples), form).unwrap();
    let how = search(method, family.variables().len().max(1));
    let identification = Identification::new(family.as_ref(), samples, false, "record").unwrap();
    identification.conclude(located(&identification, &how))
}

/// Asserts that exactly these parameters are undetermined, that every other one is within three standard errors of the
/// truth, and that the residual is the noise.
fn agrees(found: &Identified, truth: &Base, samples: &Samples, sigma: f64, undetermined: &[&str]) {
    assert_eq!(found.estimate.undetermined(), undetermined, "{:#?}", found.estimate.parameters);
    let true_values = parameters_of(truth);
    for p in &found.estimate.parameters {
        let (_, true_value) = true_values.iter().find(|(n, _)| *n == p.name).unwrap();
        let off = (p.value - true_value).abs();
        if !undetermined.contains(&p.name.as_str()) {
            assert!(off <= 3.0 * p.std_error, "{}: {} ± {}, {true_value} expected", p.name, p.value, p.std_error);
        }
    }
    let (left, rows) = (found.estimate.left, samples.len() as f64);
    assert!((left / sigma - 1.0).abs() < 4.0 / (2.0 * rows).sqrt(), "left {left}, noise {sigma}");
}

#[test]
fn bouc_wen_of_the_paper_by_particle_swarm() {
    let truth = Base::BoucWen(BoucWenClassicParams::PRINTED.general());
    let drive = |t: f64| 10.0 + 8.0 * (62.0 * t).sin() * (5.0 * t).sin() - 10.0 * (-30.0 * t).exp();
    let (samples, sigma) = record(&truth, 1e-3, 4000, &[23.0], drive, 3);
    let found = identified(Kind::BoucWen, &samples, &Form::default(), "pso");
    agrees(&found, &truth, &samples, sigma, &[]);
    // Γ is printed as zero and found to be zero.
    assert_eq!(found.estimate.parameter("gamma").unwrap().determined, Determined::NearZero);
}

#[test]
fn activation_functions_at_10_hz_by_particle_swarm() {
    // Tables 6 and 5 (the latter as softsign(γu) of size β/γ), 10 Hz, 40 V, five cycles at 1 kHz.
    let drive = |t: f64| 20.0 - 20.0 * (20.0 * std::f64::consts::PI * t).cos();
    let tanh = ActivationParams { k0: 0.1461, alpha: -9e-5, beta: 0.3857, gamma: 500_032.0 };
    let (samples, sigma) = record(&Base::Tanh(tanh), 1e-3, 500, &[23.0], drive, 5);
    let found = identified(Kind::Tanh, &samples, &Form::default(), "pso");
    // Saturated over the whole range: γ has no effect and is undetermined.
    agrees(&found, &Base::Tanh(tanh), &samples, sigma, &["gamma"]);

    let softsign = ActivationParams::from_scaled_softsign(0.1516, -0.00017, 100.0, 318.2799);
    let (samples, sigma) = record(&Base::Softsign(softsign), 1e-3, 500, &[23.0], drive, 6);
    let found = identified(Kind::Softsign, &samples, &Form::default(), "pso");
    agrees(&found, &Base::Softsign(softsign), &samples, sigma, &[]);
    // Its long tails determine γ, which tanh hides.
    let gamma = found.estimate.parameter("gamma").unwrap();
    assert!(gamma.determined == Determined::Yes && gamma.std_error > 0.05 * gamma.value, "{gamma:?}");
    // A tanh that bends within the range is determined.
    let bent = ActivationParams { gamma: 0.05, ..tanh };
    let (samples, sigma) = record(&Base::Tanh(bent), 1e-3, 500, &[23.0], drive, 7);
    let found = identified(Kind::Tanh, &samples, &Form::default(), "pso");
    agrees(&found, &Base::Tanh(bent), &samples, sigma, &[]);
}

/// Five sines about 50 V, as in the paper on fractional models.
fn five_sines(t: f64) -> f64 {
    let wave = |hz: f64, phase: f64| (std::f64::consts::TAU * hz * t + phase).sin() - phase.sin();
    50.0 + 8.0 * (wave(5.0, 0.0) + wave(10.0, 1.0) + wave(15.0, 2.0) + wave(20.0, 3.0) + wave(30.0, 4.0))
}

/// Returns the largest relative distance of two responses over 5 … 30 Hz.
fn apart(a: impl Fn(f64) -> Complex, b: impl Fn(f64) -> Complex) -> f64 {
    (5..=30).map(|hz| (a(f64::from(hz)) - b(f64::from(hz))).abs() / b(f64::from(hz)).abs()).fold(0.0, f64::max)
}

#[test]
fn linear_fractional_model_by_particle_swarm() {
    let truth = LfdmParams::PRINTED;
    let (samples, sigma) = record(&Base::Lfdm(truth), 1e-3, 3000, &[23.0], five_sines, 8);
    let found = identified(Kind::Lfdm, &samples, &Form::default(), "pso");
    agrees(&found, &Base::Lfdm(truth), &samples, sigma, &[]);
    let Base::Lfdm(p) = found.base else { panic!() };
    let off = apart(|hz| p.response(hz), |hz| truth.response(hz));
    assert!(off < 1e-3, "{off}");
}

#[test]
fn improved_fractional_model_by_differential_evolution() {
    let truth = IfmParams::PRINTED;
    let (samples, sigma) = record(&Base::Ifm(truth), 2e-4, 10_000, &[23.0], five_sines, 9);
    let found = identified(Kind::Ifm, &samples, &Form::default(), "de");
    agrees(&found, &Base::Ifm(truth), &samples, sigma, &["a", "b", "c", "alpha", "beta"]);
    for (name, expected) in [("tau", truth.tau), ("delta", truth.delta)] {
        let p = found.estimate.parameter(name).unwrap();
        assert!(p.determined == Determined::Yes, "{p:?}");
        assert!((p.value - expected).abs() < (1e-3 * expected).max(p.std_error), "{p:?}, {expected} expected");
    }
    let Base::Ifm(p) = found.base else { panic!() };
    let off = apart(|hz| p.response(hz), |hz| truth.response(hz));
    assert!(off < 1e-3, "{off}");
}

/// The seven numbers that determine the output of TD-PI.
fn invariants(p: &TdPiParams) -> [f64; 7] {
    [p.epsilon * p.alpha, p.alpha * p.tau, p.a0 / p.alpha, p.a1 / p.alpha, p.b0 / p.alpha, p.b1 / p.alpha, p.eta]
}

#[test]
fn td_pi_by_grey_wolves_predicts_other_temperatures() {
    let truth = TdPiParams::PRINTED;
    let drive = |t: f64| 200.0 * (0.2 * std::f64::consts::PI * t).sin();
    let (samples, sigma) = record(&Base::TdPi(truth), 4e-3, 5000, &[23.0, 33.0, 39.0], drive, 10);
    let found = identified(Kind::TdPi, &samples, &Form::default(), "gwo");
    let Base::TdPi(p) = &found.base else { panic!() };
    assert!((found.estimate.left / sigma - 1.0).abs() < 0.02);
    // α is one by convention; in that unit each of the others is one of the invariants.
    let own = ["epsilon", "tau", "a0", "a1", "b0", "b1", "eta"];
    for ((name, value), expected) in own.iter().zip(invariants(p)).zip(invariants(&truth)) {
        let gradient: Vec<f64> =
            found.estimate.parameters.iter().map(|q| invariant_gradient(p, name, &q.name)).collect();
        let error = found.estimate.std_error_of(&gradient);
        assert!(
            (value - expected).abs() < 3.0 * error && error < 0.2 * expected.abs(),
            "{name}: {value} ± {error}, {expected}"
        );
    }
    // The scale and the parameters that it moves are undetermined; seven numbers were fitted.
    let scaled = ["alpha", "epsilon", "tau", "a0", "a1", "b0", "b1"];
    assert_eq!((found.estimate.undetermined(), found.estimate.fitted), (scaled.to_vec(), 7));
    let free = &found.estimate.trade_offs[0];
    let sign = |name: &str| free.changes.iter().find(|(n, _)| n == name).map(|(_, x)| x.signum());
    assert!(sign("alpha").is_some() && sign("alpha") == sign("a0") && sign("alpha") != sign("epsilon"), "{free:?}");
    assert_eq!(sign("epsilon"), sign("tau"));
    // Temperatures outside of the record.
    let (other, _) = record(&Base::TdPi(truth), 4e-3, 2500, &[29.0, 35.0], drive, 11);
    let mut y = vec![0.0; other.len()];
    family::run(&other, |sampling| Operator::new(&found.base, [-200.0, 200.0], sampling), &mut y).unwrap();
    let zero = found.zeros[0];
    let squares: f64 = y.iter().zip(&other.output).map(|(a, b)| (a + zero - b).powi(2)).sum();
    assert!((squares / y.len() as f64).sqrt() < 1.05 * sigma);
}

/// Derivative of one of [`invariants`] (named after its parameter) with respect to a parameter.
fn invariant_gradient(p: &TdPiParams, invariant: &str, by: &str) -> f64 {
    match (invariant, by) {
        ("epsilon", "epsilon") | ("tau", "tau") => p.alpha,
        ("epsilon", "alpha") => p.epsilon,
        ("tau", "alpha") => p.tau,
        ("eta", "eta") => 1.0,
        ("a0" | "a1" | "b0" | "b1", own) if own == invariant => 1.0 / p.alpha,
        ("a0", "alpha") => -p.a0 / p.alpha.powi(2),
        ("a1", "alpha") => -p.a1 / p.alpha.powi(2),
        ("b0", "alpha") => -p.b0 / p.alpha.powi(2),
        ("b1", "alpha") => -p.b1 / p.alpha.powi(2),
        _ => 0.0,
    }
}

#[test]
fn the_electromechanical_model_is_recovered_as_products() {
    let printed = TdEmParams::PRINTED;
    let truth = Base::TdEm(TdEmParams {
        slip: MaxwellSlipParams {
            reading: printed.slip.reading,
            // Multiples of the first width, to the printed digits.
            widths: (1..=10).map(|i| 7.9475 * f64::from(i)).collect(),
            gains: printed.slip.gains.to_vec(),
        },
        capacitance: printed.capacitance,
        resistance: printed.resistance,
        mass: printed.mass,
        stiffness: printed.stiffness,
        damping: printed.damping,
        coupling: printed.coupling,
        per_metre: printed.per_metre,
    });
    let drive = |t: f64| 200.0 * (0.2 * std::f64::consts::PI * t).sin();
    let (samples, sigma) = record(&truth, 2e-2, 1500, &[23.0, 33.0, 39.0], drive, 12);
    let found = identified(Kind::TdEm, &samples, &Form::default(), "de");
    assert!((found.estimate.left / sigma - 1.0).abs() < 0.03, "{} {sigma}", found.estimate.left);
    let (Base::TdEm(p), Base::TdEm(q)) = (&found.base, &truth) else { panic!() };
    assert!((p.slip.widths[0] - q.slip.widths[0]).abs() < 0.01 * q.slip.widths[0]);
    let psi = |p: &TdEmParams<Vec<f64>>, t: f64| p.coupling[0] + t * (p.coupling[1] + t * p.coupling[2]);
    // ψ(T) R Σ gᵢ: the joint gain of all elements at each temperature.
    for t in [23.0, 29.0, 33.0, 35.0, 39.0] {
        let product =
            |p: &TdEmParams<Vec<f64>>| psi(p, t) * p.resistance * p.slip.gains.iter().sum::<f64>() / p.stiffness;
        assert!((product(p) / product(q) - 1.0).abs() < 2e-3, "{t}: {} {}", product(p), product(q));
    }
    // ψ and the gains are determined only together.
    let estimate = &found.estimate;
    let free = (0..10).filter(|i| p.slip.gains[*i] > 0.0);
    let mut scaled: Vec<String> = free.map(|i| format!("slip.gains[{i}]")).collect();
    scaled.extend((0..3).map(|i| format!("coupling[{i}]")));
    assert_eq!(estimate.undetermined(), scaled, "{:#?}", estimate.parameters);
    // One width was searched, two numbers of the coupling, and ten gains were solved for; the other widths are
    // multiples.
    assert_eq!(estimate.fitted, 13);
    let width = |i: usize| estimate.parameters.iter().position(|p| p.name == format!("slip.widths[{i}]")).unwrap();
    for i in 1..10 {
        let ratio = estimate.parameters[width(i)].std_error / estimate.parameters[width(0)].std_error;
        assert!((ratio - (i as f64 + 1.0)).abs() < 1e-6, "{i}: {ratio}");
        assert!((estimate.correlations[width(0)][width(i)] - 1.0).abs() < 1e-6, "{i}");
    }
    assert!(estimate.parameter("mass").is_none());
}

/// The printed widths and a bank of springs, each with a drive that makes all of them slip.
#[test]
fn maxwell_slip_fits_its_own_record_to_the_noise() {
    let printed = TdEmParams::PRINTED.slip;
    let banks = [
        (printed.widths.to_vec(), printed.gains.to_vec(), SlipReading::Backlash),
        (vec![8.0, 37.0, 121.0], vec![0.08, 0.02, 0.01], SlipReading::ElastoSlip),
    ];
    let drive = |t: f64| 200.0 * (0.7 * t).sin() * (11.0 * t).sin();
    for (widths, gains, reading) in banks {
        let elements = widths.len();
        let truth = Base::MaxwellSlip(MaxwellSlipParams { reading, widths: widths.clone(), gains });
        let (samples, sigma) = record(&truth, 1e-3, 6000, &[23.0], drive, 14);
        let form = Form { slip: reading, elements: Some(elements), ..Form::default() };
        let found = identified(Kind::MaxwellSlip, &samples, &form, "de");
        assert!((found.estimate.left / sigma - 1.0).abs() < 0.03, "left {}, noise {sigma}", found.estimate.left);
        let Base::MaxwellSlip(p) = &found.base else { panic!() };
        assert!(p.widths.len() <= elements && p.gains.iter().all(|g| *g > 0.0), "{p:?}");
        if reading == SlipReading::ElastoSlip {
            agrees(&found, &truth, &samples, sigma, &[]);
        }
        assert_eq!(found.estimate.fitted, 2 * p.widths.len());
    }
}
