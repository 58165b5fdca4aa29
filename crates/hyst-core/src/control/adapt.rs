//! Adaptation of a model to its actuator: estimates changes since the fit while the actuator moves, and corrects the
//! reference of the inverse.
//!
//! A Prandtl-Ishlinskii operator P maps the predicted output v to the measured output y. It is the identity as long as
//! the model is correct. Its gain is the change of gain, the weights of its play operators are the change of the loop
//! width, its zero is the change of the sensor zero. To reach r, the model's inverse gets P⁻¹(r) as its reference. This
//! needs no parameter of the model, so it works for every kind that predicts an output.
//!
//! The coefficients (gain, weights, zero) are estimated by recursive least squares (Ljung 1999, ch. 11) with three
//! changes:
//!
//! - The samples within one travel of the output are averaged into one update. An actuator at rest causes no update,
//!   and old data are forgotten with travel, not with time.
//! - No variance exceeds its initial value.
//! - After each update the coefficients are projected onto bounds around the identity and onto a rising P, so that its
//!   inverse exists (Kuhnen and Krejčí 2009). The correction r − P⁻¹(r) is bounded too.

use crate::error::within;
use crate::{Error, Real};

/// Limits of the adaptation, as shares of the span of the output unless another unit is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptationOptions {
    /// RMSE of the model on its training record. It weights an update.
    pub sigma: f64,
    /// Maximum distance of the gain from 1, and of the weight of each play operator from 0 \[ratio\].
    pub gain: f64,
    /// Maximum change of the zero.
    pub zero: f64,
    /// Maximum correction.
    pub correction: f64,
    /// Travel after which the weight of an update has fallen to 1/e \[spans\].
    pub memory: f64,
}

impl Default for AdaptationOptions {
    fn default() -> Self {
        Self { sigma: 0.01, gain: 0.2, zero: 0.05, correction: 0.1, memory: 20.0 }
    }
}

/// Travel of one update, as a share of the span.
const TRAVEL: f64 = 0.01;
/// Minimum slope of P. The inverse then exists, with a slope of at most 1 / 0.4.
const MIN_SLOPE: f64 = 0.4;
/// Maximum number of samples of one update.
const MAX_SAMPLES: u32 = 1 << 20;

/// Settings of the adaptation. P has `N` play operators and `M = N + 2` coefficients: gain, weights, zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptation<T, const N: usize, const M: usize> {
    low: T,
    span: T,
    thresholds: [T; N],
    bounds: [T; M],
    initial_variances: [T; M],
    forgetting: T,
    correction: T,
}

impl<T: Real, const N: usize, const M: usize> Adaptation<T, N, M> {
    /// Returns the settings for a model with outputs from `low` to `high` \[y\].
    ///
    /// # Errors
    /// If `M` is not `N + 2`, the range is empty or an option is out of range. The error names it.
    pub fn new((low, high): (f64, f64), options: &AdaptationOptions) -> Result<Self, Error> {
        if M != N + 2 {
            return Err(Error::Capacity { name: "adaptation coefficients", needed: N + 2, holds: M });
        }
        let AdaptationOptions { sigma, gain, zero, correction, memory } = *options;
        within(
            "adaptation range",
            high,
            low.is_finite() && high.is_finite() && low < high,
            "finite, with the minimum below the maximum",
        )?;
        within("adaptation sigma", sigma, (1e-6..=1.0).contains(&sigma), "from 1e-6 to 1 of the span")?;
        within("adaptation gain", gain, gain > 0.0 && gain <= 0.5, "above 0 and at most 0.5")?;
        within("adaptation zero", zero, zero > 0.0 && zero <= 0.5, "above 0 and at most 0.5 of the span")?;
        within(
            "adaptation correction",
            correction,
            correction > 0.0 && correction <= 0.5,
            "above 0 and at most 0.5 of the span",
        )?;
        within("adaptation memory", memory, (0.1..=1e4).contains(&memory), "from 0.1 to 10,000 spans of travel")?;
        let mut bounds = [T::from_f64(gain); M];
        if let Some(last) = bounds.last_mut() {
            *last = T::from_f64(zero);
        }
        // A bound is two standard deviations of the coefficient before the first update.
        let initial_variances = bounds.map(|bound| {
            let ratio = bound.to_f64() / (2.0 * sigma);
            T::from_f64(ratio * ratio)
        });
        let mut thresholds = [T::ZERO; N];
        let steps = (N + 1) as f64;
        for (k, r) in thresholds.iter_mut().enumerate() {
            // Closer together near zero, for small motions. A play operator of half the span hardly moves.
            let share = (k + 1) as f64 / steps;
            *r = T::from_f64(0.5 * share * share);
        }
        Ok(Self {
            low: T::from_f64(low),
            span: T::from_f64(high - low),
            thresholds,
            bounds,
            initial_variances,
            forgetting: T::from_f64(1.0 - TRAVEL / memory.max(2.0 * TRAVEL)),
            correction: T::from_f64(correction),
        })
    }

    /// Returns the start without updates: P is the identity.
    pub fn begin(&self) -> Adapted<T, N, M> {
        let mut numbers = [T::ZERO; M];
        if let Some(gain) = numbers.first_mut() {
            *gain = T::ONE;
        }
        let mut covariance = [[T::ZERO; M]; M];
        for (k, (row, variance)) in covariance.iter_mut().zip(&self.initial_variances).enumerate() {
            if let Some(diagonal) = row.get_mut(k) {
                *diagonal = *variance;
            }
        }
        Adapted {
            numbers,
            covariance,
            predicted_plays: None,
            aimed_plays: None,
            sums: [T::ZERO; M],
            output_sum: T::ZERO,
            samples: 0,
            start: T::ZERO,
            updates: 0,
        }
    }

    /// Returns the start from earlier coefficients, limited to the bounds.
    pub fn begin_at(&self, numbers: [T; M]) -> Adapted<T, N, M> {
        let mut begun = self.begin();
        if numbers.iter().all(|x| x.is_finite()) {
            begun.numbers = numbers;
            begun.project(self);
        }
        begun
    }

    /// Sets a known zero \[y\], limited to its bounds.
    pub fn set_zero(&self, s: &mut Adapted<T, N, M>, zero: T) {
        if let (Some(own), true) = (s.numbers.last_mut(), zero.is_finite()) {
            *own = zero / self.span;
            s.project(self);
        }
    }

    /// Forgets the history of the predicted output, for a device that starts from rest. Keeps the coefficients.
    pub fn see_anew(&self, s: &mut Adapted<T, N, M>) {
        s.predicted_plays = None;
        s.drop_samples(T::ZERO);
    }

    /// Forgets the history of the corrected reference. The next [`aim`](Self::aim) continues from the predicted output.
    pub fn aim_anew(&self, s: &mut Adapted<T, N, M>) {
        s.aimed_plays = None;
    }

    /// Returns the expected measurement \[y\] for `predicted`, the last predicted output that [`learn`](Self::learn)
    /// took; `None` before the first.
    pub fn expected(&self, s: &Adapted<T, N, M>, predicted: T) -> Option<T> {
        let plays = s.predicted_plays?;
        let v = (predicted - self.low) / self.span;
        let sum = plays.iter().zip(s.weights()).fold(s.zero() + s.gain() * v, |sum, (p, w)| sum + *w * *p);
        Some(self.low + self.span * sum)
    }

    /// Returns the reference for the model's inverse \[y\] with which the actuator reaches `reference` \[y\].
    pub fn aim(&self, s: &mut Adapted<T, N, M>, reference: T) -> T {
        if !reference.is_finite() {
            return reference;
        }
        let wanted = (reference - self.low) / self.span;
        // At the first call the actuator is at the last predicted output.
        let mut plays = s.aimed_plays.or(s.predicted_plays).unwrap_or([wanted; N]);
        let at = self.solve(s, &plays, wanted).at_least(wanted - self.correction).at_most(wanted + self.correction);
        self.move_plays(&mut plays, at);
        s.aimed_plays = Some(plays);
        self.low + self.span * at
    }

    /// Takes the output that the model predicted for the applied drive, and the measured output \[y\]. `trusted` is
    /// false while a limit of the sensor or the actuator acts: the measurement is then not used. Returns whether the
    /// coefficients were updated.
    pub fn learn(&self, s: &mut Adapted<T, N, M>, predicted: T, measured: T, trusted: bool) -> bool {
        if !predicted.is_finite() {
            return false;
        }
        let v = (predicted - self.low) / self.span;
        let is_first = s.predicted_plays.is_none();
        let mut plays = s.predicted_plays.unwrap_or([v; N]);
        self.move_plays(&mut plays, v);
        s.predicted_plays = Some(plays);
        if is_first || !(trusted && measured.is_finite()) || s.samples >= MAX_SAMPLES {
            s.drop_samples(v);
            return false;
        }
        let regressors = [v].into_iter().chain(plays).chain([T::ONE]);
        s.sums.iter_mut().zip(regressors).for_each(|(sum, x)| *sum += x);
        s.output_sum += (measured - self.low) / self.span;
        s.samples += 1;
        if (v - s.start).abs() < T::from_f64(TRAVEL) {
            return false;
        }
        let per = T::ONE / T::from_f64(f64::from(s.samples));
        let (x, y) = (s.sums.map(|sum| sum * per), s.output_sum * per);
        s.drop_samples(v);
        s.update(self, &x, y);
        s.updates = s.updates.saturating_add(1);
        true
    }

    /// Returns the bounds of gain, weights and zero around 1, 0 and 0.
    pub fn bounds(&self) -> &[T; M] {
        &self.bounds
    }

    /// Returns the maximum correction \[y\].
    pub fn largest_correction(&self) -> T {
        self.correction * self.span
    }

    fn move_plays(&self, plays: &mut [T; N], v: T) {
        plays.iter_mut().zip(&self.thresholds).for_each(|(p, r)| *p = p.at_most(v + *r).at_least(v - *r));
    }

    /// Returns the v for which P(v) is `wanted`, from the present play operators. They start to move one after the
    /// other with v, so the curve is piecewise linear.
    fn solve(&self, s: &Adapted<T, N, M>, plays: &[T; N], wanted: T) -> T {
        // In the middle of the narrowest play operator, no play operator moves.
        let mut at = plays.first().copied().unwrap_or(wanted);
        let mut slope = s.gain();
        let mut output = plays.iter().zip(s.weights()).fold(s.zero() + slope * at, |sum, (p, w)| sum + *w * *p);
        let up = wanted >= output;
        for ((p, r), w) in plays.iter().zip(&self.thresholds).zip(s.weights()) {
            let next = if up { (*p + *r).at_least(at) } else { (*p - *r).at_most(at) };
            let next_output = output + slope * (next - at);
            if (up && next_output >= wanted) || (!up && next_output <= wanted) {
                break;
            }
            (at, output) = (next, next_output);
            slope += *w;
        }
        at + (wanted - output) / slope
    }
}

/// State of the adaptation: coefficients, covariance, histories and the update in progress.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adapted<T, const N: usize, const M: usize> {
    /// Gain, weights, zero.
    numbers: [T; M],
    covariance: [[T; M]; M],
    /// Play operators of the predicted output.
    predicted_plays: Option<[T; N]>,
    /// Play operators of the corrected reference.
    aimed_plays: Option<[T; N]>,
    /// The update in progress: sums of regressors and measured outputs, number of samples, start \[spans\].
    sums: [T; M],
    output_sum: T,
    samples: u32,
    start: T,
    updates: u32,
}

impl<T: Real, const N: usize, const M: usize> Adapted<T, N, M> {
    /// Returns gain, weights and zero \[spans\]: the argument of [`begin_at`](Adaptation::begin_at).
    pub fn numbers(&self) -> &[T; M] {
        &self.numbers
    }

    /// Returns the gain of P: 1 if the gain of the model is correct.
    pub fn gain(&self) -> T {
        self.numbers.first().copied().unwrap_or(T::ONE)
    }

    /// Returns the weights of the play operators of P: positive if the loop has become wider.
    pub fn weights(&self) -> &[T] {
        self.numbers.get(1..=N).unwrap_or_default()
    }

    /// Returns the zero of P \[spans\].
    pub fn zero(&self) -> T {
        self.numbers.last().copied().unwrap_or_default()
    }

    /// Returns the gain of P over a stroke of the whole span, with the play operators that such a stroke moves.
    pub fn stroke_gain(&self, how: &Adaptation<T, N, M>) -> T {
        let two = T::from_f64(2.0);
        let of = |(w, r): (&T, &T)| *w * (T::ONE - two * *r).at_least(T::ZERO);
        self.weights().iter().zip(&how.thresholds).map(of).fold(self.gain(), |sum, w| sum + w)
    }

    /// Returns the increase of the loop width of a stroke over the whole span, in the middle of the loop \[spans\].
    pub fn loop_width(&self, how: &Adaptation<T, N, M>) -> T {
        let two = T::from_f64(2.0);
        self.weights().iter().zip(&how.thresholds).fold(T::ZERO, |sum, (w, r)| sum + two * *w * *r)
    }

    /// Returns the number of updates.
    pub fn updates(&self) -> u32 {
        self.updates
    }

    fn drop_samples(&mut self, v: T) {
        (self.sums, self.output_sum, self.samples, self.start) = ([T::ZERO; M], T::ZERO, 0, v);
    }

    /// Performs one step of recursive least squares, then the projection.
    fn update(&mut self, how: &Adaptation<T, N, M>, x: &[T; M], y: T) {
        let sum = |a: &[T; M], b: &[T; M]| a.iter().zip(b).fold(T::ZERO, |sum, (a, b)| sum + *a * *b);
        let mut px = [T::ZERO; M];
        px.iter_mut().zip(&self.covariance).for_each(|(to, row)| *to = sum(row, x));
        let share = T::ONE / (how.forgetting + sum(&px, x).at_least(T::ZERO));
        let error = y - sum(&self.numbers, x);
        for (number, p) in self.numbers.iter_mut().zip(&px) {
            let change = *p * share * error;
            if change.is_finite() {
                *number += change;
            }
        }
        let back = T::ONE / how.forgetting;
        let mut at_initial_variance = false;
        for (k, (row, p)) in self.covariance.iter_mut().zip(&px).enumerate() {
            row.iter_mut().zip(&px).for_each(|(c, other)| *c -= *p * share * *other);
            let variance = row.get(k).copied().unwrap_or_default();
            at_initial_variance |= variance * back > how.initial_variances.get(k).copied().unwrap_or_default();
        }
        if !at_initial_variance {
            self.covariance.iter_mut().flatten().for_each(|c| *c *= back);
        }
        self.symmetrise();
        self.project(how);
    }

    /// Removes the effect of rounding: makes the covariance symmetric and the variances non-negative.
    fn symmetrise(&mut self) {
        let half = T::from_f64(0.5);
        for i in 0..M {
            for j in 0..i {
                let element =
                    |a: usize, b: usize| self.covariance.get(a).and_then(|row| row.get(b)).copied().unwrap_or_default();
                let mean = half * (element(i, j) + element(j, i));
                for (a, b) in [(i, j), (j, i)] {
                    if let Some(c) = self.covariance.get_mut(a).and_then(|row| row.get_mut(b)) {
                        *c = mean;
                    }
                }
            }
            if let Some(c) = self.covariance.get_mut(i).and_then(|row| row.get_mut(i)) {
                *c = c.at_least(T::ZERO);
            }
        }
    }

    /// Projects the coefficients onto their bounds and onto a slope of at least [`MIN_SLOPE`], however many play
    /// operators move. A weight that is raised for the slope remains at or below zero, so it remains within its bound.
    fn project(&mut self, how: &Adaptation<T, N, M>) {
        let (mut slope, least) = (T::ZERO, T::from_f64(MIN_SLOPE));
        for (k, (number, bound)) in self.numbers.iter_mut().zip(&how.bounds).enumerate() {
            let nominal = if k == 0 { T::ONE } else { T::ZERO };
            *number = number.at_least(nominal - *bound).at_most(nominal + *bound);
            if k <= N {
                *number = number.at_least(least - slope);
                slope += *number;
            }
        }
    }
}

#[cfg(test)]
mod tests;
