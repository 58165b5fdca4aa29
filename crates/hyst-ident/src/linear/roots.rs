//! Roots of polynomials in z, and their stability.

use nalgebra::{Complex, DMatrix, Schur};

/// Returns the roots of `zⁿ + p₁ zⁿ⁻¹ + … + pₙ`: eigenvalues of the companion matrix, each improved by Newton's method.
/// `None` if a coefficient is not finite or the eigenvalues do not converge.
pub(super) fn roots(p: &[f64]) -> Option<Vec<Complex<f64>>> {
    let n = p.len();
    if n == 0 {
        return Some(Vec::new());
    }
    if !p.iter().all(|x| x.is_finite()) {
        return None;
    }
    let companion = DMatrix::from_fn(n, n, |i, j| {
        if i == 0 {
            -p[j]
        } else if i == j + 1 {
            1.0
        } else {
            0.0
        }
    });
    let found = Schur::try_new(companion, f64::EPSILON, 10_000)?.complex_eigenvalues();
    Some(found.iter().map(|z| polish(p, *z)).collect())
}

/// Returns value and derivative of `zⁿ + p₁ zⁿ⁻¹ + … + pₙ`.
pub(super) fn value_and_slope(p: &[f64], z: Complex<f64>) -> (Complex<f64>, Complex<f64>) {
    let (one, zero) = (Complex::new(1.0, 0.0), Complex::new(0.0, 0.0));
    p.iter().fold((one, zero), |(value, slope), c| (value * z + *c, slope * z + value))
}

fn polish(p: &[f64], mut z: Complex<f64>) -> Complex<f64> {
    for _ in 0..3 {
        let (value, slope) = value_and_slope(p, z);
        let better = z - value / slope;
        // At multiple roots the slope vanishes too.
        if !(better.re.is_finite() && better.im.is_finite()) || value_and_slope(p, better).0.norm() >= value.norm() {
            break;
        }
        z = better;
    }
    z
}

/// Returns whether all roots of `zⁿ + p₁ zⁿ⁻¹ + … + pₙ` are inside the unit circle, by the Schur-Cohn test (step-down
/// recursion of the reflection coefficients).
pub(super) fn stable(p: &[f64]) -> bool {
    let mut a = p.to_vec();
    while let Some(k) = a.pop() {
        if k.is_nan() || k.abs() >= 1.0 {
            return false;
        }
        let reversed: Vec<f64> = a.iter().rev().copied().collect();
        a.iter_mut().zip(reversed).for_each(|(a, r)| *a = (*a - k * r) / (1.0 - k * k));
    }
    true
}

/// Returns the polynomial with the roots outside the unit circle reflected to the inside, z to 1/z̄. As a filter it has
/// the same gain at every frequency, except for a factor. A stable polynomial is returned without change. If the roots
/// cannot be computed, all coefficients are 0.
pub(super) fn reflected(p: &[f64]) -> Vec<f64> {
    if stable(p) {
        return p.to_vec();
    }
    let inside = |z: Complex<f64>| {
        let reflected = if z.norm() > 1.0 { Complex::new(1.0, 0.0) / z.conj() } else { z };
        // With a root on the circle the recursion does not decay.
        reflected * (MAX_REFLECTED_RADIUS / reflected.norm()).min(1.0)
    };
    let found = roots(p).map(|found| with_roots(&found.into_iter().map(inside).collect::<Vec<_>>()));
    found.filter(|p| stable(p)).unwrap_or_else(|| vec![0.0; p.len()])
}

/// Maximum magnitude of a reflected root.
const MAX_REFLECTED_RADIUS: f64 = 1.0 - 1e-5;

/// Returns the coefficients of the polynomial with these roots, which are real or in conjugate pairs.
fn with_roots(roots: &[Complex<f64>]) -> Vec<f64> {
    let p = roots.iter().fold(vec![Complex::new(1.0, 0.0)], |p, r| {
        let mut next = p.clone();
        next.push(Complex::new(0.0, 0.0));
        p.iter().zip(&mut next[1..]).for_each(|(c, next)| *next -= r * c);
        next
    });
    p[1..].iter().map(|c| c.re).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lightly_damped_pairs_near_one_are_found() {
        let pair = |angle: f64, radius: f64| [Complex::from_polar(radius, angle), Complex::from_polar(radius, -angle)];
        let mut wanted: Vec<_> = [pair(0.126, 0.9987), pair(0.345, 0.997), pair(0.817, 0.99)].concat();
        wanted.push(Complex::new(0.5, 0.0));
        let p = with_roots(&wanted);
        let found = roots(&p).unwrap();
        for w in wanted {
            let near = found.iter().map(|z| (z - w).norm()).fold(f64::INFINITY, f64::min);
            assert!(near < 1e-11, "{w}: {near}");
        }
        assert!(stable(&p));
        assert!(roots(&[f64::NAN, 1.0]).is_none());
        assert_eq!(roots(&[]), Some(Vec::new()));
    }

    #[test]
    fn the_unit_circle_is_the_stability_limit() {
        for (radius, inside) in [(0.999_999, true), (1.000_001, false)] {
            let p = with_roots(&[Complex::from_polar(radius, 1.0), Complex::from_polar(radius, -1.0)]);
            assert_eq!(stable(&p), inside);
            assert!(stable(&reflected(&p)));
            assert_eq!(reflected(&p) == p, inside);
        }
        assert!(!stable(&[f64::NAN]));
        assert_eq!(reflected(&[f64::NAN]), [0.0]);
        // z + 4 becomes z + 1/4.
        assert!((reflected(&[4.0])[0] - 0.25).abs() < 1e-12);
    }
}
