//! A model that keeps up with its actuator: what has changed since the fit is estimated while the actuator moves, and taken out of what the inverse aims at.
//!
//! Between the output v that the model predicts and the measured one y stands a Prandtl-Ishlinskii operator P, which is the identity as long as the model is
//! true: a gain that has changed is its gain, a loop that has become wider or narrower is in the weights of its plays, a zero is its zero. To reach r, the
//! model's inverse aims at P⁻¹(r). This needs no parameter of the model, so it serves every kind that predicts an output.
//!
//! Output and weights are estimated by recursive least squares (Ljung 1999, ch. 11) with three changes. The drive has to move: what is measured within one
//! `travel` is averaged into one update, so that an actuator at rest teaches nothing, and the past is forgotten by travel, not by time. No variance grows
//! beyond its first value. After each update the numbers are projected onto bounds around the identity and onto what keeps P rising, so that its
//! inverse exists (Kuhnen and Krejčí 2009). The correction r − P⁻¹(r) is bounded as well, whatever was learned.

use crate::error::within;
use crate::{Error, Real};

/// What adaptation may do, in shares of the output's span where nothing else is said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptationOptions {
    /// What the model left of its own record: an update is weighed by that.
    pub sigma: f64,
    /// How far the gain may leave 1, and the weight of each play 0.
    pub gain: f64,
    /// How far the zero may move.
    pub zero: f64,
    /// The largest correction.
    pub correction: f64,
    /// Travel after which an update counts 1/e, in spans.
    pub memory: f64,
}

impl Default for AdaptationOptions {
    fn default() -> Self {
        Self { sigma: 0.01, gain: 0.2, zero: 0.05, correction: 0.1, memory: 20.0 }
    }
}

/// Travel of one update, as a share of the span.
const TRAVEL: f64 = 0.01;
/// Least slope of P: its inverse exists, and asks for at most this much more.
const LEAST_SLOPE: f64 = 0.4;
/// Most samples of one update.
const MOST_SAMPLES: u32 = 1 << 20;

/// How a model is adapted. P has `N` plays and `M = N + 2` numbers: gain, weights, zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptation<T, const N: usize, const M: usize> {
    low: T,
    span: T,
    thresholds: [T; N],
    bounds: [T; M],
    first: [T; M],
    forgetting: T,
    correction: T,
}

impl<T: Real, const N: usize, const M: usize> Adaptation<T, N, M> {
    /// For a model whose output goes from `low` to `high` \[y\].
    ///
    /// # Errors
    /// If `M` is not `N + 2`, the range is empty or an option is out of range; the error names it.
    pub fn new((low, high): (f64, f64), options: &AdaptationOptions) -> Result<Self, Error> {
        if M != N + 2 {
            return Err(Error::Capacity { name: "adapted numbers", needed: N + 2, holds: M });
        }
        let AdaptationOptions { sigma, gain, zero, correction, memory } = *options;
        within("adaptation range", high, low.is_finite() && high.is_finite() && low < high, "finite, and not empty")?;
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
        // A bound is two standard deviations of what is expected beforehand.
        let first = bounds.map(|bound| {
            let ratio = bound.to_f64() / (2.0 * sigma);
            T::from_f64(ratio * ratio)
        });
        let mut thresholds = [T::ZERO; N];
        let steps = (N + 1) as f64;
        for (k, r) in thresholds.iter_mut().enumerate() {
            // Closer together near zero, where small motions turn; a play of half the span hardly moves.
            let share = (k + 1) as f64 / steps;
            *r = T::from_f64(0.5 * share * share);
        }
        Ok(Self {
            low: T::from_f64(low),
            span: T::from_f64(high - low),
            thresholds,
            bounds,
            first,
            forgetting: T::from_f64(1.0 - TRAVEL / memory.max(2.0 * TRAVEL)),
            correction: T::from_f64(correction),
        })
    }

    /// Nothing learned: P is the identity.
    pub fn begin(&self) -> Adapted<T, N, M> {
        let mut numbers = [T::ZERO; M];
        if let Some(gain) = numbers.first_mut() {
            *gain = T::ONE;
        }
        let mut covariance = [[T::ZERO; M]; M];
        for (k, (row, first)) in covariance.iter_mut().zip(&self.first).enumerate() {
            if let Some(own) = row.get_mut(k) {
                *own = *first;
            }
        }
        Adapted {
            numbers,
            covariance,
            seen: None,
            aimed: None,
            sums: [T::ZERO; M],
            outputs: T::ZERO,
            samples: 0,
            from: T::ZERO,
            updates: 0,
        }
    }

    /// From what was learned before, as far as the bounds let it.
    pub fn begin_at(&self, numbers: [T; M]) -> Adapted<T, N, M> {
        let mut begun = self.begin();
        if numbers.iter().all(|x| x.is_finite()) {
            begun.numbers = numbers;
            begun.project(self);
        }
        begun
    }

    /// Takes a zero that is known from elsewhere \[y\], as far as the bounds let it.
    pub fn set_zero(&self, s: &mut Adapted<T, N, M>, zero: T) {
        if let (Some(own), true) = (s.numbers.last_mut(), zero.is_finite()) {
            *own = zero / self.span;
            s.project(self);
        }
    }

    /// Forgets the history of what was seen, as where a device comes from rest, and keeps what was learned.
    pub fn see_anew(&self, s: &mut Adapted<T, N, M>) {
        s.seen = None;
        s.drop_samples(T::ZERO);
    }

    /// Forgets the history of what was aimed at: the next aim continues from what was seen.
    pub fn aim_anew(&self, s: &mut Adapted<T, N, M>) {
        s.aimed = None;
    }

    /// What is measured where the model predicts what [`learn`](Self::learn) took last \[y\]; none before that.
    pub fn expected(&self, s: &Adapted<T, N, M>, predicted: T) -> Option<T> {
        let plays = s.seen?;
        let v = (predicted - self.low) / self.span;
        let sum = plays.iter().zip(s.weights()).fold(s.zero() + s.gain() * v, |sum, (p, w)| sum + *w * *p);
        Some(self.low + self.span * sum)
    }

    /// Predicted output at which the model's inverse has to aim, so that the actuator reaches `reference` \[y\].
    pub fn aim(&self, s: &mut Adapted<T, N, M>, reference: T) -> T {
        if !reference.is_finite() {
            return reference;
        }
        let wanted = (reference - self.low) / self.span;
        // Before the first aim the actuator stands where it was seen last.
        let mut plays = s.aimed.or(s.seen).unwrap_or([wanted; N]);
        let at = self.solve(s, &plays, wanted).at_least(wanted - self.correction).at_most(wanted + self.correction);
        self.move_plays(&mut plays, at);
        s.aimed = Some(plays);
        self.low + self.span * at
    }

    /// Takes the output that the model predicted for what was applied, and the one that was measured \[y\]. `trusted` is whether the measurement tells the
    /// position: not while a limit of the sensor or of the actuator holds it. Gives whether the estimate was updated.
    pub fn learn(&self, s: &mut Adapted<T, N, M>, predicted: T, measured: T, trusted: bool) -> bool {
        if !predicted.is_finite() {
            return false;
        }
        let v = (predicted - self.low) / self.span;
        let starts = s.seen.is_none();
        let mut plays = s.seen.unwrap_or([v; N]);
        self.move_plays(&mut plays, v);
        s.seen = Some(plays);
        if starts || !(trusted && measured.is_finite()) || s.samples >= MOST_SAMPLES {
            s.drop_samples(v);
            return false;
        }
        let of = [v].into_iter().chain(plays).chain([T::ONE]);
        s.sums.iter_mut().zip(of).for_each(|(sum, x)| *sum += x);
        s.outputs += (measured - self.low) / self.span;
        s.samples += 1;
        if (v - s.from).abs() < T::from_f64(TRAVEL) {
            return false;
        }
        let per = T::ONE / T::from_f64(f64::from(s.samples));
        let (x, y) = (s.sums.map(|sum| sum * per), s.outputs * per);
        s.drop_samples(v);
        s.update(self, &x, y);
        s.updates = s.updates.saturating_add(1);
        true
    }

    /// Bounds of gain, weights and zero around 1, 0 and 0.
    pub fn bounds(&self) -> &[T; M] {
        &self.bounds
    }

    /// The largest correction \[y\].
    pub fn largest_correction(&self) -> T {
        self.correction * self.span
    }

    fn move_plays(&self, plays: &mut [T; N], v: T) {
        plays.iter_mut().zip(&self.thresholds).for_each(|(p, r)| *p = p.at_most(v + *r).at_least(v - *r));
    }

    /// The v for which P(v) is `wanted`, with the plays where they are. They are pushed one after the other as v goes up, and pulled as it goes
    /// down, so each part of the curve is a line.
    fn solve(&self, s: &Adapted<T, N, M>, plays: &[T; N], wanted: T) -> T {
        // In the middle of the shortest play nothing is moved.
        let mut at = plays.first().copied().unwrap_or(wanted);
        let mut slope = s.gain();
        let mut height = plays.iter().zip(s.weights()).fold(s.zero() + slope * at, |sum, (p, w)| sum + *w * *p);
        let up = wanted >= height;
        for ((p, r), w) in plays.iter().zip(&self.thresholds).zip(s.weights()) {
            let next = if up { (*p + *r).at_least(at) } else { (*p - *r).at_most(at) };
            let there = height + slope * (next - at);
            if (up && there >= wanted) || (!up && there <= wanted) {
                break;
            }
            (at, height) = (next, there);
            slope += *w;
        }
        at + (wanted - height) / slope
    }
}

/// What was learned, and what it takes to go on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adapted<T, const N: usize, const M: usize> {
    /// Gain, weights, zero.
    numbers: [T; M],
    covariance: [[T; M]; M],
    /// Plays behind the predicted output, and behind what was aimed at.
    seen: Option<[T; N]>,
    aimed: Option<[T; N]>,
    /// The update under way: sums of its rows, and where it began.
    sums: [T; M],
    outputs: T,
    samples: u32,
    from: T,
    updates: u32,
}

impl<T: Real, const N: usize, const M: usize> Adapted<T, N, M> {
    /// Gain, weights of the plays, zero \[spans\]: what [`begin_at`](Adaptation::begin_at) takes.
    pub fn numbers(&self) -> &[T; M] {
        &self.numbers
    }

    /// Gain of P: 1 as long as the model's is right.
    pub fn gain(&self) -> T {
        self.numbers.first().copied().unwrap_or(T::ONE)
    }

    /// Weights of the plays of P: above zero where the loop has become wider.
    pub fn weights(&self) -> &[T] {
        self.numbers.get(1..=N).unwrap_or_default()
    }

    /// Zero of P \[spans\].
    pub fn zero(&self) -> T {
        self.numbers.last().copied().unwrap_or_default()
    }

    /// Gain over a stroke of the whole span: that of P and of the plays that such a stroke moves.
    pub fn stroke_gain(&self, how: &Adaptation<T, N, M>) -> T {
        let two = T::from_f64(2.0);
        let of = |(w, r): (&T, &T)| *w * (T::ONE - two * *r).at_least(T::ZERO);
        self.weights().iter().zip(&how.thresholds).map(of).fold(self.gain(), |sum, w| sum + w)
    }

    /// Width of the loop of a stroke over the whole span, in the middle, beyond what the model has \[spans\].
    pub fn loop_width(&self, how: &Adaptation<T, N, M>) -> T {
        let two = T::from_f64(2.0);
        self.weights().iter().zip(&how.thresholds).fold(T::ZERO, |sum, (w, r)| sum + two * *w * *r)
    }

    /// Updates so far.
    pub fn updates(&self) -> u32 {
        self.updates
    }

    fn drop_samples(&mut self, v: T) {
        (self.sums, self.outputs, self.samples, self.from) = ([T::ZERO; M], T::ZERO, 0, v);
    }

    /// One step of recursive least squares, and the projection.
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
        let mut full = false;
        for (k, (row, p)) in self.covariance.iter_mut().zip(&px).enumerate() {
            row.iter_mut().zip(&px).for_each(|(c, other)| *c -= *p * share * *other);
            let own = row.get(k).copied().unwrap_or_default();
            full |= own * back > how.first.get(k).copied().unwrap_or_default();
        }
        if !full {
            self.covariance.iter_mut().flatten().for_each(|c| *c *= back);
        }
        self.settle();
        self.project(how);
    }

    /// Symmetric, and no variance below zero, whatever rounding does.
    fn settle(&mut self) {
        let half = T::from_f64(0.5);
        for i in 0..M {
            for j in 0..i {
                let of =
                    |a: usize, b: usize| self.covariance.get(a).and_then(|row| row.get(b)).copied().unwrap_or_default();
                let mean = half * (of(i, j) + of(j, i));
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

    /// Within the bounds, and rising with every play that moves. A weight that is raised for that stays at or below zero, so within its bound.
    fn project(&mut self, how: &Adaptation<T, N, M>) {
        let (mut slope, least) = (T::ZERO, T::from_f64(LEAST_SLOPE));
        for (k, (number, bound)) in self.numbers.iter_mut().zip(&how.bounds).enumerate() {
            let middle = if k == 0 { T::ONE } else { T::ZERO };
            *number = number.at_least(middle - *bound).at_most(middle + *bound);
            if k <= N {
                *number = number.at_least(least - slope);
                slope += *number;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Env, Pi, Stage};
    use proptest::prelude::*;

    const N: usize = 4;
    const M: usize = N + 2;
    type How = Adaptation<f64, N, M>;

    fn how() -> How {
        Adaptation::new((2.0, 22.0), &AdaptationOptions { sigma: 1e-3, ..AdaptationOptions::default() }).unwrap()
    }

    /// Loops of several sizes over 2 … 22.
    fn motion(k: usize) -> f64 {
        let t = k as f64 * 1e-3;
        12.0 + 6.0 * (3.1 * t).sin() + 2.5 * (8.3 * t).sin() + 1.0 * (23.0 * t).sin()
    }

    /// What the actuator makes of a prediction: a gain, a wider loop of plays that are not the estimator's, a zero.
    fn changed() -> (Pi<f64, 2>, f64) {
        (Pi::new(0.93, &[1.0, 3.0], &[0.03, 0.02]).unwrap(), 0.2)
    }

    /// Largest error of the last seconds of a minute.
    fn error(adapts: bool) -> (f64, Adapted<f64, N, M>) {
        let (how, (actuator, zero)) = (how(), changed());
        let mut s = how.begin();
        let (mut memory, mut largest) = (actuator.state(), 0.0f64);
        for k in 0..60_000 {
            let reference = motion(k);
            let aimed = how.aim(&mut s, reference);
            let y = actuator.step(&mut memory, &Env::default(), aimed) + zero;
            how.learn(&mut s, aimed, y, adapts);
            if k >= 50_000 {
                largest = largest.max((y - reference).abs());
            }
        }
        (largest, s)
    }

    #[test]
    fn what_has_changed_is_taken_out_of_the_aim() {
        let ((before, _), (after, s)) = (error(false), error(true));
        assert!(before > 0.3 && after < 0.1 * before, "{before} → {after}: {s:?}");
        let how = how();
        assert!((s.stroke_gain(&how) - 0.97).abs() < 0.02, "{}", s.stroke_gain(&how));
        assert!(s.loop_width(&how) > 0.0);
    }

    #[test]
    fn an_actuator_at_rest_teaches_nothing_and_neither_does_what_is_not_trusted() {
        let how = how();
        let mut s = how.begin();
        for k in 0..100_000u32 {
            assert!(!how.learn(&mut s, 7.0, 7.5 + 0.1 * f64::from(k % 7), true));
        }
        for k in 0..10_000 {
            assert!(!how.learn(&mut s, motion(k), 1.2 * motion(k), false));
            assert!(!how.learn(&mut s, motion(k), f64::NAN, true));
        }
        assert_eq!((s.gain(), s.weights(), s.zero(), s.updates()), (1.0, &[0.0; N][..], 0.0, 0));
        assert_eq!(how.aim(&mut s, 9.25), 9.25);
    }

    #[test]
    fn the_aim_undoes_what_was_learned() {
        let how = how();
        let mut s = how.begin();
        s.numbers = [0.95, 0.05, -0.04, 0.03, 0.02, 0.01];
        let mut plays: Option<[f64; N]> = None;
        for k in 0..5000 {
            let r = motion(7 * k);
            let v = (how.aim(&mut s, r) - how.low) / how.span;
            let mut p = plays.unwrap_or([(r - how.low) / how.span; N]);
            how.move_plays(&mut p, v);
            plays = Some(p);
            let y = p.iter().zip(s.weights()).fold(s.zero() + s.gain() * v, |sum, (p, w)| sum + w * p);
            assert!((how.low + how.span * y - r).abs() < 1e-9, "row {k}: {y}");
        }
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        let of = |range, options: AdaptationOptions| Adaptation::<f64, N, M>::new(range, &options).unwrap_err();
        let usual = AdaptationOptions::default();
        assert!(matches!(Adaptation::<f64, N, 5>::new((0.0, 1.0), &usual), Err(Error::Capacity { needed: 6, .. })));
        for range in [(1.0, 1.0), (0.0, f64::NAN), (f64::NEG_INFINITY, 1.0)] {
            let refused = of(range, usual);
            assert!(
                matches!(
                    refused,
                    Error::OutOfRange { name: "adaptation range", .. } | Error::NonFinite("adaptation range")
                ),
                "{range:?}: {refused}"
            );
        }
        for options in [
            AdaptationOptions { sigma: 0.0, ..usual },
            AdaptationOptions { gain: 0.6, ..usual },
            AdaptationOptions { zero: f64::NAN, ..usual },
            AdaptationOptions { correction: -0.1, ..usual },
            AdaptationOptions { memory: 1e5, ..usual },
        ] {
            let refused = of((0.0, 1.0), options);
            assert!(matches!(refused, Error::OutOfRange { .. } | Error::NonFinite(_)), "{options:?}: {refused}");
        }
    }

    #[test]
    fn what_was_learned_is_taken_up_again() {
        let how = how();
        let (_, learned) = error(true);
        let again = how.begin_at(*learned.numbers());
        assert_eq!((again.numbers(), again.updates()), (learned.numbers(), 0));
        assert_eq!(how.begin_at([f64::NAN; M]), how.begin());
        // Beyond a bound is at the bound.
        let mut far = how.begin_at([9.0; M]);
        assert_eq!(far.numbers(), &[1.2, 0.2, 0.2, 0.2, 0.2, 0.05]);
        how.set_zero(&mut far, -0.4);
        assert_eq!(far.zero(), -0.02);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]
        #[test]
        fn whatever_is_measured_the_numbers_keep_to_their_bounds(
            rows in proptest::collection::vec(
                (-1e2..1e2f64, prop_oneof![-1e3..1e3f64, Just(f64::NAN), Just(f64::INFINITY)], any::<bool>()), 1..400),
            memory in 0.1..100.0f64,
            sigma in 1e-6..0.1f64,
        ) {
            let options = AdaptationOptions { sigma, memory, ..AdaptationOptions::default() };
            let how = How::new((2.0, 22.0), &options).unwrap();
            let mut s = how.begin();
            for (k, (aside, measured, trusted)) in rows.iter().enumerate() {
                let v = if k % 5 == 0 { *aside } else { motion(97 * k) };
                how.learn(&mut s, v, *measured, *trusted);
                let middle = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
                for ((number, middle), bound) in s.numbers.iter().zip(middle).zip(how.bounds()) {
                    prop_assert!((number - middle).abs() <= bound * (1.0 + 1e-12), "{:?}", s.numbers);
                }
                let mut slope = 0.0;
                for w in &s.numbers[..=N] {
                    slope += w;
                    prop_assert!(slope >= 0.4 - 1e-12);
                }
                let aimed = how.aim(&mut s, motion(31 * k));
                prop_assert!((aimed - motion(31 * k)).abs() <= how.largest_correction() * (1.0 + 1e-9));
            }
        }
    }
}
