//! Means over bins of another quantity.

/// Equal bins of an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bins {
    low: f64,
    high: f64,
    count: usize,
    log: bool,
}

/// Minimum number of rows of a bin that has a mean.
const MIN_ROWS: usize = 5;

impl Bins {
    /// Returns `count` bins over the finite values; `None` if all values are equal.
    pub(super) fn over(values: impl Iterator<Item = f64>, count: usize) -> Option<Self> {
        let (low, high) = crate::statistics::range(values.filter(|v| v.is_finite()));
        (low < high).then_some(Self { low, high, count, log: false })
    }

    /// Returns bins of equal ratio from `low` to `high` (both positive), `per_decade` in each decade.
    pub(super) fn of_ratio(low: f64, high: f64, per_decade: f64) -> Option<Self> {
        let usable = low > 0.0 && high > low && high.is_finite();
        let count = (per_decade * (high / low).log10()).ceil().max(1.0) as usize;
        usable.then(|| Self { low: low.ln(), high: high.ln(), count, log: true })
    }

    /// Returns the number of bins.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Returns the bin that contains `x`.
    pub(super) fn index(&self, x: f64) -> Option<usize> {
        let x = if self.log { x.ln() } else { x };
        let inside = x >= self.low && x <= self.high;
        let at = (x - self.low) / (self.high - self.low) * self.count as f64;
        inside.then(|| (at as usize).min(self.count - 1))
    }

    /// Returns the start of bin `i`.
    pub(super) fn edge(&self, i: usize) -> f64 {
        let x = self.low + (self.high - self.low) * i as f64 / self.count as f64;
        if self.log { x.exp() } else { x }
    }

    /// Returns the means of x and of y in every bin with enough pairs.
    pub(super) fn means(&self, pairs: impl Iterator<Item = (f64, f64)>) -> (Vec<f64>, Vec<f64>) {
        let mut sums = vec![(0.0, 0.0, 0_usize); self.count];
        for (x, y) in pairs {
            if let Some(sum) = self.index(x).and_then(|i| sums.get_mut(i)) {
                *sum = (sum.0 + x, sum.1 + y, sum.2 + 1);
            }
        }
        let enough = sums.into_iter().filter(|s| s.2 >= MIN_ROWS);
        enough.map(|(x, y, n)| (x / n as f64, y / n as f64)).unzip()
    }

    /// Returns the slope of y over m in every bin of x in which m varies: takes `(x, m, y)`, returns the means of x and
    /// the slopes.
    pub(super) fn slopes(&self, rows: impl Iterator<Item = (f64, f64, f64)>) -> (Vec<f64>, Vec<f64>) {
        let mut sums = vec![Line::default(); self.count];
        let mut whole = Line::default();
        for (x, m, y) in rows {
            if let Some(sum) = self.index(x).and_then(|i| sums.get_mut(i)) {
                sum.add(x, m, y);
                whole.add(x, m, y);
            }
        }
        let least = MIN_VARIANCE_SHARE * whole.variance();
        let enough = sums.into_iter().filter(|s| s.n >= 4.0 * MIN_ROWS as f64 && s.variance() > least);
        enough.map(|s| (s.x / s.n, s.slope())).unzip()
    }
}

/// Minimum variance of m in a bin, as a share of its overall variance.
const MIN_VARIANCE_SHARE: f64 = 0.1;

/// Sums of a least-squares line.
#[derive(Clone, Copy, Default)]
struct Line {
    n: f64,
    x: f64,
    m: f64,
    y: f64,
    mm: f64,
    my: f64,
}

impl Line {
    fn add(&mut self, x: f64, m: f64, y: f64) {
        self.n += 1.0;
        self.x += x;
        self.m += m;
        self.y += y;
        self.mm += m * m;
        self.my += m * y;
    }

    fn variance(&self) -> f64 {
        (self.mm - self.m * self.m / self.n) / self.n
    }

    fn slope(&self) -> f64 {
        (self.my - self.m * self.y / self.n) / (self.mm - self.m * self.m / self.n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_and_slopes_of_bins() {
        let x: Vec<f64> = (0..1000).map(|k| f64::from(k) / 999.0).collect();
        let bins = Bins::over(x.iter().copied(), 10).unwrap();
        let (at, mean) = bins.means(x.iter().map(|x| (*x, 3.0 * x + 1.0)));
        assert_eq!(at.len(), 10);
        assert!(at.iter().zip(&mean).all(|(x, y)| (3.0 * x + 1.0 - y).abs() < 1e-12));
        // A constant gain under an offset that changes with x.
        let motion = |k: usize| (0.37 * k as f64).sin();
        let (at, slope) = bins.slopes((0..1000).map(|k| (x[k], motion(k), 5.0 + x[k].floor() + 2.0 * motion(k))));
        assert_eq!(at.len(), 10);
        assert!(slope.iter().all(|s| (s - 2.0).abs() < 0.2), "{slope:?}");
        assert!(Bins::over([1.0, 1.0].into_iter(), 3).is_none());
        assert!(Bins::of_ratio(1.0, 100.0, 5.0).is_some_and(|b| b.count() == 10 && b.index(10.5) == Some(5)));
        assert_eq!(bins.index(1.0), Some(9));
        assert_eq!(bins.index(1.1), None);
    }
}
