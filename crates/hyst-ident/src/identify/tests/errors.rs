//! Standard errors, held variables and undetermined parameters.

use super::*;

/// Over twelve noise realisations the parameters scatter about the truth by their standard errors.
#[test]
fn standard_errors_equal_the_scatter_over_repeated_records() {
    let truth = Base::BoucWen(BoucWenParams { k0: 0.12, alpha: -0.05, beta: 0.02, gamma: -0.008, n: 1.0 });
    let drive = |t: f64| 50.0 + 50.0 * (31.0 * t).sin() * (2.0 * t).cos();
    let true_values = parameters_of(&truth);
    let mut squares = [0.0; 4];
    for seed in 0..12 {
        let (samples, _) = record(&truth, 1e-3, 3000, &[23.0], drive, seed);
        let found = identified(Kind::BoucWen, &samples, &Form::default(), "de");
        for ((sum, p), (_, t)) in squares.iter_mut().zip(&found.estimate.parameters).zip(&true_values) {
            *sum += ((p.value - t) / p.std_error).powi(2) / 12.0;
            assert_eq!(p.determined, Determined::Yes, "{p:?}");
        }
    }
    // χ² with twelve degrees of freedom: outside of these limits with a probability of 1/1000.
    assert!(squares.iter().all(|s| (0.18..2.75).contains(s)), "{squares:?}");
}

#[test]
fn the_exponent_of_bouc_wen_is_identified() {
    let truth = Base::BoucWen(BoucWenParams { k0: 0.12, alpha: -0.05, beta: 0.02, gamma: -0.008, n: 1.6 });
    let drive = |t: f64| 50.0 + 50.0 * (31.0 * t).sin() * (2.0 * t).cos();
    let (samples, sigma) = record(&truth, 1e-3, 2000, &[23.0], drive, 2);
    let found = identified(Kind::BoucWen, &samples, &Form { bouc_wen_n: None, ..Form::default() }, "de");
    agrees(&found, &truth, &samples, sigma, &[]);
    assert_eq!(found.estimate.parameter("n").unwrap().determined, Determined::Yes);
}

/// A drive with nested loops.
fn loops(t: f64) -> f64 {
    50.0 + 50.0 * (31.0 * t).sin() * (2.0 * t).cos()
}

#[test]
fn errors_belong_to_sorted_thresholds() {
    let truth = Base::Pi(PiParams { gain: 0.1, thresholds: vec![3.0, 15.0], weights: vec![0.05, 0.01] });
    let (samples, sigma) = record(&truth, 1e-3, 3000, &[23.0], loops, 4);
    let form = Form { elements: Some(2), ..Form::default() };
    let family = family_of(Kind::Pi, &samples, largest_input(&samples), &form).unwrap();
    let identification = Identification::new(family.as_ref(), &samples, false, "record").unwrap();
    let one = located(&identification, &search("de", 2));
    let mut other = one.clone();
    other.values.reverse();
    let [one, other] = [one, other].map(|at| identification.conclude(at));
    agrees(&one, &truth, &samples, sigma, &[]);
    assert_eq!(one.estimate, other.estimate);
    // Another seed ends at the same thresholds.
    let again = located(&identification, &SearchOptions { seed: 4, ..search("de", 2) });
    let again = identification.conclude(again);
    for (p, q) in one.estimate.parameters.iter().zip(&again.estimate.parameters) {
        assert!((p.std_error / q.std_error - 1.0).abs() < 1e-2, "{p:?} {q:?}");
    }
}

#[test]
fn a_zero_parameter_is_determined_to_be_zero() {
    let drive = |t: f64| 20.0 - 20.0 * (20.0 * std::f64::consts::PI * t).cos();
    let tanh = ActivationParams { k0: 0.1461, alpha: 0.0, beta: 0.3857, gamma: 0.05 };
    let alone = ActivationParams { k0: 0.0, ..tanh };
    let straight = ActivationParams { beta: 0.0, ..tanh };
    for (truth, zeros, undetermined) in [
        (tanh, &["alpha"][..], &[][..]),
        (alone, &["k0", "alpha"], &[]),
        // The activation is determined to be zero, its shape is undetermined.
        (straight, &["alpha"], &["gamma"]),
    ] {
        let (samples, sigma) = record(&Base::Tanh(truth), 1e-3, 2000, &[23.0], drive, 5);
        let found = identified(Kind::Tanh, &samples, &Form::default(), "de");
        agrees(&found, &Base::Tanh(truth), &samples, sigma, undetermined);
        for name in zeros {
            assert_eq!(found.estimate.parameter(name).unwrap().determined, Determined::NearZero, "{name}");
        }
    }
    let memory = BoucWenParams { k0: 0.0, alpha: 0.05, beta: 0.02, gamma: 0.0, n: 1.0 };
    let (samples, sigma) = record(&Base::BoucWen(memory), 1e-3, 3000, &[23.0], loops, 5);
    let found = identified(Kind::BoucWen, &samples, &Form::default(), "de");
    agrees(&found, &Base::BoucWen(memory), &samples, sigma, &[]);
    for name in ["k0", "gamma"] {
        assert_eq!(found.estimate.parameter(name).unwrap().determined, Determined::NearZero, "{name}");
    }
}

#[test]
fn dependent_parameters_count_once_and_bound_ones_are_held() {
    // The thresholds of the family.
    let (low, high) = crate::statistics::range((0..3000).map(|k| loops(f64::from(k) * 1e-3)));
    let thresholds: Vec<f64> = (1..=4).map(|i| 0.5 * (high - low) * f64::from(i) / 5.0).collect();
    let gap = 8.0;
    let truth = Base::Gpi(GpiParams {
        left: Curve::Linear { slope: 1.0, offset: -0.5 * gap },
        right: Curve::Linear { slope: 1.1, offset: 0.5 * gap },
        gain: 0.1,
        thresholds,
        weights: vec![0.03, 0.0, 0.02, 0.0],
    });
    let form = Form { elements: Some(4), ..Form::default() };
    let mut held = 0;
    for seed in 0..4 {
        let (samples, sigma) = record(&truth, 1e-3, 3000, &[23.0], loops, seed);
        let found = identified(Kind::Gpi, &samples, &form, "de");
        let estimate = &found.estimate;
        agrees(&found, &truth, &samples, sigma, &[]);
        let error = |name: &str| estimate.parameter(name).unwrap().std_error;
        assert!((error("left.linear.offset") / error("right.linear.offset") - 1.0).abs() < 1e-6);
        // Slope and gap of the right envelope, gain, four weights.
        assert_eq!(estimate.fitted, 7);
        let Base::Gpi(p) = &found.base else { panic!() };
        for (i, w) in p.weights.iter().enumerate() {
            let name = format!("weights[{i}]");
            assert_eq!(*w == 0.0, estimate.held.contains(&name) && estimate.parameter(&name).is_none(), "{name}: {w}");
        }
        held += estimate.held.len();
    }
    assert!(held > 0);
}

#[test]
fn a_variable_at_a_side_of_its_box_is_held_and_reported() {
    /// A family with other bounds of its first variable.
    struct Within<'a>(Box<dyn Family + 'a>, f64, f64);
    impl Family for Within<'_> {
        fn variables(&self) -> Vec<crate::optimize::Variable> {
            let mut list = self.0.variables();
            (list[0].lower, list[0].upper) = (self.1, self.2);
            list
        }
        fn linear(&self) -> Vec<Linear> {
            self.0.linear()
        }
        fn columns(&self, values: &[f64], columns: &mut nalgebra::DMatrix<f64>) -> Result<(), Error> {
            self.0.columns(values, columns)
        }
        fn base(&self, values: &[f64], linear: &[f64]) -> Base {
            self.0.base(values, linear)
        }
    }
    let ends = |kind: Kind, truth: &Base, form: &Form, low: f64, high: f64| {
        let (samples, _) = record(truth, 1e-3, 2000, &[23.0], loops, 2);
        let family = Within(family_of(kind, &samples, largest_input(&samples), form).unwrap(), low, high);
        let identification = Identification::new(&family, &samples, false, "record").unwrap();
        let found = identification.conclude(located(&identification, &search("de", family.variables().len())));
        (found.ended.clone(), found.estimate)
    };
    let truth = Base::BoucWen(BoucWenParams { k0: 0.12, alpha: -0.05, beta: 0.02, gamma: -0.008, n: 1.0 });
    let (ended, estimate) = ends(Kind::BoucWen, &truth, &Form::default(), 0.03, 0.5);
    let name = "beta |alpha|^(n-1)".to_owned();
    assert_eq!(ended, [Ended { name, bound: 0.03, beyond: true }]);
    // γ = β γ/β still has an error, β has none.
    assert_eq!((&estimate.held[..], estimate.fitted), (&["beta".to_owned()][..], 4));
    assert!(estimate.parameter("gamma").is_some() && estimate.parameter("beta").is_none());
    // Inside of the box nothing is held.
    let (ended, estimate) = ends(Kind::BoucWen, &truth, &Form::default(), 0.01, 0.5);
    assert!(ended.is_empty() && estimate.held.is_empty());
    // The same for a threshold.
    let tight = Base::Pi(PiParams { gain: 0.1, thresholds: vec![20.0], weights: vec![0.05] });
    let form = Form { elements: Some(1), ..Form::default() };
    let (ended, _) = ends(Kind::Pi, &tight, &form, 25.0, 30.0);
    assert_eq!(ended, [Ended { name: "thresholds[0]".into(), bound: 25.0, beyond: true }]);
}

#[test]
fn repeated_rows_add_no_information() {
    let truth = Base::BoucWen(BoucWenParams { k0: 0.12, alpha: -0.05, beta: 0.02, gamma: -0.008, n: 1.0 });
    let (samples, _) = record(&truth, 1e-3, 400, &[23.0], |t| loops(7.0 * t), 3);
    let held = |times: usize| {
        let again = |x: &[f64]| x.iter().flat_map(|x| vec![*x; times]).collect::<Vec<f64>>();
        let rows = times * samples.len();
        Samples {
            period: samples.period / times as f64,
            time: (0..rows).map(|k| k as f64 * samples.period / times as f64).collect(),
            input: again(&samples.input),
            output: again(&samples.output),
            temperature: samples.temperature.as_deref().map(again),
            segments: std::slice::from_ref(&(0..rows)).to_vec(),
            settling: vec![false; rows],
            falls: false,
            blind: vec![false; rows],
            ..samples.clone()
        }
    };
    let form = Form::default();
    let family = family_of(Kind::BoucWen, &samples, largest_input(&samples), &form).unwrap();
    let identification = Identification::new(family.as_ref(), &samples, false, "record").unwrap();
    let at = located(&identification, &search("de", 2));
    let once = identification.conclude(at.clone()).estimate;
    for times in [10, 1000] {
        let samples = held(times);
        let family = family_of(Kind::BoucWen, &samples, largest_input(&samples), &form).unwrap();
        let identification = Identification::new(family.as_ref(), &samples, false, "record").unwrap();
        let estimate = identification.conclude(identification.polish(&at).unwrap()).estimate;
        for (p, q) in once.parameters.iter().zip(&estimate.parameters) {
            assert!((p.std_error / q.std_error - 1.0).abs() < 0.2, "{times}: {p:?} {q:?}");
        }
    }
}
