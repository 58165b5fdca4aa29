//! Roots of polynomials in z, and whether they lie inside the unit circle.

use nalgebra::{Complex, DMatrix, Schur};

/// Roots of `zⁿ + p₁ zⁿ⁻¹ + … + pₙ`: eigenvalues of the companion matrix, each polished by Newton's method. `None` where
/// a coefficient is not finite or the eigenvalues do not converge.
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

/// The value and the derivative of `zⁿ + p₁ zⁿ⁻¹ + … + pₙ`.
pub(super) fn value_and_slope(p: &[f64], z: Complex<f64>) -> (Complex<f64>, Complex<f64>) {
    let (one, zero) = (Complex::new(1.0, 0.0), Complex::new(0.0, 0.0));
    p.iter().fold((one, zero), |(value, slope), c| (value * z + *c, slope * z + value))
}

fn polish(p: &[f64], mut z: Complex<f64>) -> Complex<f64> {
    for _ in 0..3 {
        let (value, slope) = value_and_slope(p, z);
        let better = z - value / slope;
        // Where roots coincide the slope vanishes with the value.
        if !(better.re.is_finite() && better.im.is_finite()) || value_and_slope(p, better).0.norm() >= value.norm() {
            break;
        }
        z = better;
    }
    z
}

/// Whether all roots of `zⁿ + p₁ zⁿ⁻¹ + … + pₙ` are inside the unit circle: Schur and Cohn's test, by the step-down
/// recursion on the reflection coefficients.
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

/// `p` with its roots drawn towards zero just far enough to be inside the unit circle.
pub(super) fn drawn_inside(p: &[f64]) -> Vec<f64> {
    let mut drawn = p.to_vec();
    let mut shrink = 1.0;
    while !stable(&drawn) {
        shrink *= 0.97;
        // zⁿ p(z / shrink): every root is multiplied by `shrink`.
        drawn = p.iter().zip(1..).map(|(c, i)| c * f64::powi(shrink, i)).collect();
        if shrink < 1e-3 || !drawn.iter().all(|c| c.is_finite()) {
            return vec![0.0; p.len()];
        }
    }
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficients of the polynomial with these roots, all in conjugate pairs or real.
    fn with_roots(roots: &[Complex<f64>]) -> Vec<f64> {
        let one = Complex::new(1.0, 0.0);
        let p = roots.iter().fold(vec![one], |p, r| {
            let mut next = p.clone();
            next.push(Complex::new(0.0, 0.0));
            p.iter().enumerate().for_each(|(i, c)| next[i + 1] -= r * c);
            next
        });
        p[1..].iter().map(|c| c.re).collect()
    }

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
    fn the_unit_circle_is_the_border() {
        for (radius, inside) in [(0.999_999, true), (1.000_001, false)] {
            let p = with_roots(&[Complex::from_polar(radius, 1.0), Complex::from_polar(radius, -1.0)]);
            assert_eq!(stable(&p), inside);
            assert!(stable(&drawn_inside(&p)));
            assert_eq!(drawn_inside(&p) == p, inside);
        }
        assert!(!stable(&[f64::NAN]));
    }
}
