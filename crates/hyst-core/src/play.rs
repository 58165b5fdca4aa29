//! The play and stop operators (Visintin 1994; Brokate and Sprekels 1996, ch. 2).

use crate::Real;

/// Computes one step of the play operator with half-width `r ≥ 0`: `p ← max(u − r, min(u + r, p))`. `p`, `u` and `r`
/// have the unit of the input.
#[inline]
pub fn play<T: Real>(p: T, u: T, r: T) -> T {
    p.at_most(u + r).at_least(u - r)
}

/// Computes one step of the stop operator (elasto-slip element) with yield `r ≥ 0`: `s ← clamp(s + Δu, −r, r)`. The sum
/// of play and stop is the input: `play + stop = u`.
#[inline]
pub fn stop<T: Real>(s: T, du: T, r: T) -> T {
    (s + du).at_most(r).at_least(-r)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    /// Describing function of the play for `u = A sin θ` (Gelb and Vander Velde 1968, app. B):
    /// with k = 1 − 2r/A, Re N = (1/2 + (asin k + k √(1−k²))/π) and Im N = −(1 − k²)/π.
    #[test]
    fn fundamental_of_the_play_equals_the_closed_form() {
        let (amplitude, n) = (1.0, 200_000);
        for r in [0.05, 0.2, 0.5, 0.8] {
            let (mut p, mut re, mut im) = (0.0, 0.0, 0.0);
            for k in 0..2 * n {
                let theta = 2.0 * PI * f64::from(k) / f64::from(n);
                p = play(p, amplitude * libm::sin(theta), r);
                // The first cycle settles the memory. The second is measured.
                if k >= n {
                    re += p * libm::sin(theta);
                    im += p * libm::cos(theta);
                }
            }
            let scale = 2.0 / f64::from(n) / amplitude;
            let k = 1.0 - 2.0 * r / amplitude;
            let expected_re = 0.5 + (libm::asin(k) + k * libm::sqrt(1.0 - k * k)) / PI;
            let expected_im = -(1.0 - k * k) / PI;
            assert!((re * scale - expected_re).abs() < 1e-8, "r = {r}: {} {expected_re}", re * scale);
            assert!((im * scale - expected_im).abs() < 1e-8, "r = {r}: {} {expected_im}", im * scale);
        }
    }

    #[test]
    fn play_and_stop_add_up_to_the_input() {
        let (mut p, mut s, mut last) = (0.0, 0.0, 0.0);
        for k in 0..1000 {
            let u = libm::sin(0.37 * f64::from(k)) + 0.6 * libm::sin(0.011 * f64::from(k));
            p = play(p, u, 0.3);
            s = stop(s, u - last, 0.3);
            last = u;
            assert!((p + s - u).abs() < 1e-12);
        }
    }
}
