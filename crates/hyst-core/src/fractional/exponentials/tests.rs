//! Tests of the sum of exponentials against exact weights and closed forms.

use super::*;
use std::vec::Vec;

const ORDERS: [f64; 8] = [0.01, 0.1, 0.176, 0.466, 0.6596, 0.9, 0.9742, 0.999];
const BOTH: [GlOrder; 2] = [GlOrder::First, GlOrder::Second];

/// Returns the derivative times p^μ of `g(1), g(2) …`, from rest at 0.
fn derivative_of<T: Real, W: Memory<T>>(memory: &W, g: impl Iterator<Item = f64>) -> Vec<f64> {
    let (mut s, mut last, mut held) = (memory.state(), T::ZERO, T::ZERO);
    g.map(|g| {
        let g = T::from_f64(g);
        let d = memory.first() * (g - last) + held;
        (last, held) = (g, memory.advance(&mut s, g));
        d.to_f64()
    })
    .collect()
}

#[test]
fn forty_nodes_are_accurate_to_4e_7_over_1e7_samples() {
    for order in BOTH {
        for mu in ORDERS {
            let error = |e: Result<f64, Error>| e.unwrap();
            let at = |horizon: f64| error(Exponentials::<f64, 40>::with_horizon(mu, order, horizon).map(|e| e.error()));
            assert!(at(1e7) < 4e-7 && at(1e5) < 1e-8, "{mu} {order:?}");
            assert!(error(Exponentials::<f64, 32>::new(mu, order).map(|e| e.error())) < 9e-6, "{mu} {order:?}");
            assert!(error(Exponentials::<f64, 24>::new(mu, order).map(|e| e.error())) < 3e-4, "{mu} {order:?}");
            // Coefficients rounded to f32 are no worse.
            assert!(error(Exponentials::<f32, 40>::new(mu, order).map(|e| e.error())) < 5e-7, "{mu} {order:?}");
        }
    }
}

/// The impulse response is the sequence of weights. It is compared with the recursion of eq. 13.
#[test]
fn stated_error_equals_the_error() {
    for order in BOTH {
        for mu in ORDERS {
            let memory = Exponentials::<f64, 24>::with_horizon(mu, order, 1e5).unwrap();
            let impulse = (0..=100_000).map(|k| if k == 0 { 1.0 } else { 0.0 });
            let mut worst: f64 = 0.0;
            let weights = derivative_of(&memory, impulse);
            for (k, (w, exact)) in weights.iter().zip(GlWeights::new(mu, order)).enumerate() {
                if k <= HEAD {
                    assert!((w - exact).abs() < 1e-14);
                } else {
                    worst = worst.max((w / exact - 1.0).abs());
                }
            }
            assert!((worst / memory.error() - 1.0).abs() < 0.03, "{mu} {order:?} {worst} {}", memory.error());
        }
    }
}

/// D^μ t^ν = Γ(ν + 1)/Γ(ν + 1 − μ) t^(ν−μ).
#[test]
fn derivative_of_a_power_equals_the_closed_form() {
    let (h, n) = (1e-3, 20_000);
    for (order, close) in [(GlOrder::First, 2e-4), (GlOrder::Second, 3e-7)] {
        for mu in [0.176, 0.6596, 0.9742] {
            for nu in [1.0, 2.0, 2.5] {
                let memory = Exponentials::<f64, 40>::new(mu, order).unwrap();
                let t = |k: i32| h * f64::from(k);
                let d = derivative_of(&memory, (1..=n).map(|k| libm::pow(t(k), nu)));
                let exact = libm::tgamma(nu + 1.0) / libm::tgamma(nu + 1.0 - mu) * libm::pow(t(n), nu - mu);
                let error = d[n as usize - 1] * libm::pow(h, -mu) / exact - 1.0;
                assert!(error.abs() < close, "{order:?} {mu} {nu}: {error}");
            }
        }
    }
}

/// After a step the derivative is the sum of the weights up to n, Π (1 − μ/i): it decays as n^(−μ).
#[test]
fn derivative_of_a_constant_decays_to_zero() {
    let n = 1_000_000;
    for mu in [0.176, 0.6596, 0.9742] {
        let memory = Exponentials::<f64, 40>::new(mu, GlOrder::First).unwrap();
        let d = derivative_of(&memory, (0..=n).map(|_| 1.0));
        let exact = (1..=n).fold(1.0, |sum, i| sum * (1.0 - mu / f64::from(i)));
        assert!((d[n as usize] / exact - 1.0).abs() < 1e-6, "{mu}");
        // Far beyond a short horizon it is zero, also in f32.
        let short = Exponentials::<f32, 16>::with_horizon(mu, GlOrder::Second, 1e3).unwrap();
        let d = derivative_of(&short, (0..=n).map(|_| 1.0));
        assert!(d[n as usize].abs() < 0.01 * exact, "{mu} {} {exact}", d[n as usize]);
    }
}

#[test]
fn orders_zero_and_one_are_the_signal_and_its_difference() {
    let g = || (1..300).map(|k| libm::sin(0.3 * f64::from(k)));
    for order in BOTH {
        let d = derivative_of(&Exponentials::<f64, 16>::new(0.0, order).unwrap(), g());
        assert!(g().zip(&d).all(|(g, d)| (g - d).abs() < 1e-14));
    }
    let d = derivative_of(&Exponentials::<f64, 16>::new(1.0, GlOrder::First).unwrap(), g());
    let mut last = 0.0;
    for (g, d) in g().zip(d) {
        assert!((d - (g - last)).abs() < 1e-13);
        last = g;
    }
}

#[test]
fn response_is_the_generating_function_within_the_stated_error() {
    for order in BOTH {
        for mu in ORDERS {
            let memory = Exponentials::<f64, 40>::new(mu, order).unwrap();
            for theta in [3.1, 1.0, 0.1, 1e-2, 1e-4, 1e-6] {
                let z1 = Complex::polar(1.0, -theta);
                let exact = order.response(mu, z1);
                assert!((memory.response(z1) - exact).abs() < 4e-7 * exact.abs(), "{mu} {order:?} {theta}");
            }
            assert!(memory.response(Complex::from(1.0)).abs() < 1e-14);
        }
    }
}

#[test]
fn invalid_arguments_are_rejected() {
    assert!(Exponentials::<f64, 7>::new(0.5, GlOrder::First).is_err());
    assert!(Exponentials::<f64, 8>::new(0.5, GlOrder::First).is_ok());
    for mu in [-0.1, 1.1, f64::NAN] {
        assert!(Exponentials::<f64, 16>::new(mu, GlOrder::First).is_err());
    }
    for horizon in [0.0, 99.0, 1e13, f64::INFINITY, f64::NAN] {
        assert!(Exponentials::<f64, 16>::with_horizon(0.5, GlOrder::First, horizon).is_err());
    }
}
