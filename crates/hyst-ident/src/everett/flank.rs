//! Interpolates the output of one curve at an input, with the standard error due to the sensor noise.

/// A value and the variance of its error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Estimate {
    pub(super) value: f64,
    pub(super) variance: f64,
}

impl Estimate {
    /// Returns `self + share (other − self)`.
    pub(super) fn towards(self, other: Self, share: f64) -> Self {
        let (a, b) = (1.0 - share, share);
        Self { value: a * self.value + b * other.value, variance: a * a * self.variance + b * b * other.variance }
    }
}

/// Rows of one flank: input and output, in order of time.
pub(super) struct Flank<'a> {
    pub(super) input: &'a [f64],
    pub(super) output: &'a [f64],
    /// Variance of the sensor noise.
    pub(super) noise: f64,
}

impl Flank<'_> {
    /// Returns the output at input `at` from a straight line through the rows within `half` of it, by least squares. If
    /// these are too few for a line, interpolates between the nearest rows on either side. `None` beyond the ends of
    /// the flank.
    pub(super) fn at(&self, at: f64, half: f64) -> Option<Estimate> {
        let rows = || self.input.iter().zip(self.output).filter(|(u, _)| (*u - at).abs() <= half);
        let n = rows().count() as f64;
        let (su, sy) = rows().fold((0.0, 0.0), |(su, sy), (u, y)| (su + u, sy + y));
        let (mu, my) = (su / n, sy / n);
        let (suu, suy) =
            rows().fold((0.0, 0.0), |(suu, suy), (u, y)| (suu + (u - mu) * (u - mu), suy + (u - mu) * (y - my)));
        // Rows at one input give no slope. The spread of half a window is enough.
        if n >= 3.0 && suu > n * (0.1 * half) * (0.1 * half) {
            let distance = at - mu;
            let variance = self.noise * (1.0 / n + distance * distance / suu);
            return Some(Estimate { value: my + distance * suy / suu, variance });
        }
        self.between(at, half)
    }

    /// Interpolates between the nearest rows above and below `at`; at an end, takes the nearest row within `half`.
    fn between(&self, at: f64, half: f64) -> Option<Estimate> {
        let rows = || self.input.iter().copied().zip(self.output.iter().copied());
        let above = rows().filter(|(u, _)| *u >= at).min_by(|a, b| a.0.total_cmp(&b.0));
        let below = rows().filter(|(u, _)| *u <= at).max_by(|a, b| a.0.total_cmp(&b.0));
        let own = |y: f64| Estimate { value: y, variance: self.noise };
        match (below, above) {
            (Some(b), Some(a)) if a.0 > b.0 => Some(own(b.1).towards(own(a.1), (at - b.0) / (a.0 - b.0))),
            (Some((u, y)), _) | (_, Some((u, y))) if (u - at).abs() <= half => Some(own(y)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_read_exactly_with_the_error_of_a_regression() {
        let input: Vec<f64> = (0..=20).map(|k| 10.0 - 0.5 * f64::from(k)).collect();
        let output: Vec<f64> = input.iter().map(|u| 3.0 + 0.2 * u).collect();
        let flank = Flank { input: &input, output: &output, noise: 0.01 };
        for at in [10.0, 7.3, 0.0] {
            assert!((flank.at(at, 1.0).unwrap().value - 3.0 - 0.2 * at).abs() < 1e-12);
        }
        // Five rows at −1 … 1 around the middle: σ²/5; three rows to one side of the end: σ² (1/3 + 0.25/0.5).
        assert!((flank.at(5.0, 1.0).unwrap().variance - 0.002).abs() < 1e-12);
        assert!((flank.at(10.0, 1.0).unwrap().variance - 0.01 * (1.0 / 3.0 + 0.5)).abs() < 1e-12);
    }

    #[test]
    fn few_rows_are_interpolated_but_not_extrapolated() {
        let flank = Flank { input: &[10.0, 6.0, 2.0], output: &[5.0, 4.0, 1.0], noise: 1.0 };
        assert_eq!(flank.at(4.0, 0.5), Some(Estimate { value: 2.5, variance: 0.5 }));
        assert_eq!(flank.at(2.0, 0.5), Some(Estimate { value: 1.0, variance: 1.0 }));
        assert_eq!(flank.at(1.0, 0.5), None);
        assert_eq!(flank.at(10.4, 0.5).unwrap().value, 5.0);
    }
}
