//! Test for a stable causal inverse of a sampled model: the argument principle on the unit circle.

use crate::{Complex, Real};
use core::f64::consts::PI;

/// Returns whether `response`, given at e^(−jθ), has no zero on or outside the unit circle of z. It must be the
/// response of a stable model with real coefficients.
///
/// As a function of z⁻¹ the response is analytic inside the unit circle. The number of its zeros there is the number of
/// its turns about 0 along the circle; half the circle is sufficient. A step from A to B is accepted if |B − A| ≤
/// |A|/2, else it is halved. With a zero on the circle (or close to it) the steps run out, and the result is false.
/// `widest` is the largest step \[rad\].
pub(crate) fn none_outside(widest: f64, response: impl Fn(f64) -> Complex) -> bool {
    let steps = (4.0 * PI / widest).at_most(1e6).index(1_000_000) + 4096;
    let (mut theta, mut step, mut turned) = (0.0, widest.at_most(1e-9), 0.0);
    let mut here = response(theta);
    for _ in 0..steps {
        let next = (theta + step).at_most(PI);
        let there = response(next);
        let near = (there - here).abs() <= 0.5 * here.abs() && here.abs() > 0.0;
        if !near {
            step *= 0.5;
            continue;
        }
        turned += (there / here).arg();
        if next >= PI {
            // The response is real at both ends, so the angle is a multiple of π.
            return turned.abs() < 1.0;
        }
        (theta, here) = (next, there);
        step = (step * 2.0).at_most(widest);
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polynomial(roots: &[f64], theta: f64) -> Complex {
        // Roots in z⁻¹: the inside of the unit circle of z⁻¹ is the outside of the unit circle of z.
        let z1 = Complex::polar(1.0, -theta);
        roots.iter().fold(Complex::from(1.0), |p, r| p * (z1 - Complex::from(*r)))
    }

    #[test]
    fn zeros_are_counted_from_the_response_on_the_circle() {
        for (roots, stable) in [
            (&[1.5, -3.0][..], true),
            (&[1.0001], true),
            (&[0.9999], false),
            (&[0.5, -0.5], false),
            (&[-0.99, 1.2], false),
            (&[1.0], false),
            (&[-1.0, 2.0], false),
            (&[0.0; 9], false),
        ] {
            assert_eq!(none_outside(0.05, |theta| polynomial(roots, theta)), stable, "{roots:?}");
        }
    }

    #[test]
    fn an_echo_is_invertible_if_its_gain_is_below_one() {
        for (echo, stable) in [(0.99, true), (1.01, false), (-0.99, true), (-1.01, false)] {
            let response = |theta: f64| Complex::from(1.0) + Complex::polar(echo, -15.0 * theta);
            assert_eq!(none_outside(PI / 16.0 / 17.0, response), stable, "{echo}");
        }
    }
}
