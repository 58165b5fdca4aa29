//! Monotone cubic interpolation.

/// Evaluates the monotone cubic through `(t, y)` (Fritsch and Butland 1984) at increasing times `at`.
///
/// Outside the data it returns the end value. Between two values the result does not leave their range, so a step does
/// not overshoot and a constant stays exactly constant.
pub(super) fn monotone(t: &[f64], y: &[f64], at: &[f64]) -> Vec<f64> {
    let n = t.len();
    let h = |k: usize| t[k + 1] - t[k];
    let secant = |k: usize| (y[k + 1] - y[k]) / h(k);
    let slope = |k: usize| {
        if k == 0 || k + 1 == n {
            return secant(k.min(n - 2));
        }
        let (before, after) = (secant(k - 1), secant(k));
        if before * after <= 0.0 {
            return 0.0;
        }
        let (w0, w1) = (2.0 * h(k) + h(k - 1), h(k) + 2.0 * h(k - 1));
        (w0 + w1) / (w0 / before + w1 / after)
    };
    let mut k = 0;
    at.iter()
        .map(|x| {
            while k + 2 < n && t[k + 1] <= *x {
                k += 1;
            }
            let x = ((x - t[k]) / h(k)).clamp(0.0, 1.0);
            if y[k] == y[k + 1] {
                return y[k];
            }
            let (x2, x3) = (x * x, x * x * x);
            let bend = (x3 - 2.0 * x2 + x) * slope(k) + (x3 - x2) * slope(k + 1);
            y[k] + (3.0 * x2 - 2.0 * x3) * (y[k + 1] - y[k]) + h(k) * bend
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_monotone_cubic_interpolates_without_overshoot() {
        let t: Vec<f64> = (0..30).map(|k| f64::from(k) + 0.3 * f64::from(k % 3)).collect();
        let y: Vec<f64> = t.iter().map(|t| (0.3 * t).sin()).collect();
        let at: Vec<f64> = (0..28).map(f64::from).collect();
        let worst = at.iter().zip(monotone(&t, &y, &at)).map(|(x, y)| ((0.3 * x).sin() - y).abs()).fold(0.0, f64::max);
        assert!(worst < 2e-2, "{worst}");
        for (own, y) in monotone(&t, &y, &t).iter().zip(&y) {
            assert!((own - y).abs() < 1e-12);
        }
        let square: Vec<f64> = (0..30).map(|k| if k % 10 < 5 { 0.0 } else { 100.0 }).collect();
        assert!(monotone(&t, &square, &at).iter().all(|y| (0.0..=100.0).contains(y)));
    }
}
