//! Stable, band-limited inversion of linear stages with preview.
//!
//! The inverse of a sampled lag or resonance has poles on or outside the unit circle: as a causal filter it rings or is
//! unstable. As a two-sided impulse response it is stable. [`Preview`] is that response, truncated to a symmetric
//! number of taps and limited to a band. It needs `lead` samples of the future reference.

use crate::error::within;
use crate::ring::Ring;
use crate::stage::finite_or;
use crate::{Complex, Env, Error, Real, Stage};

/// A two-sided filter `vₖ = Σₙ cₙ yₖ₋ₙ`, n from −lead to +lead, of at most `N` taps.
#[derive(Clone, Debug, PartialEq)]
pub struct Preview<T, const N: usize> {
    taps: [T; N],
    half: usize,
    bandwidth: f64,
    error: f64,
}

/// History of a preview filter: the last `N` inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct PreviewState<T, const N: usize> {
    inputs: Ring<T, N>,
}

impl<T: Real, const N: usize> PreviewState<T, N> {
    pub(crate) fn new() -> Self {
        Self { inputs: Ring::filled(T::ZERO) }
    }
}

/// Taps on each side, in periods of the band edge.
const PERIODS_PER_SIDE: f64 = 6.0;

/// Number of frequencies in the band at which the error is computed.
const ERROR_FREQUENCIES: usize = 200;

impl<T: Real, const N: usize> Preview<T, N> {
    /// Designs the inverse of `response` (of z⁻¹, unit gain at frequency zero) from 0 to `band`. The filter passes
    /// nothing beyond twice `band`, with a raised cosine between. `band` is in cycles per sample, up to 1/4.
    ///
    /// The filter has 6 / `band` taps on each side; fewer, but at least half as many, if `N` is smaller.
    /// [`error`](Self::error) returns the effect of the truncation.
    ///
    /// # Errors
    /// If `band` is not in (0, 1/4], is too narrow for `N` taps, or the response vanishes in the band.
    pub fn new(band: f64, response: impl Fn(Complex) -> Complex) -> Result<Self, Error> {
        const PI2: f64 = 2.0 * core::f64::consts::PI;
        within("preview band", band, band > 0.0 && band <= 0.25, "above 0 and at most a quarter of the sample rate")?;
        let wanted = PERIODS_PER_SIDE / band;
        let capacity = (N.saturating_sub(1)) / 2;
        if wanted > 2.0 * capacity as f64 {
            return Err(Error::Capacity { name: "preview taps", needed: wanted as usize + 1, holds: N });
        }
        let half = capacity.min(wanted as usize);
        let mut filter = Self { taps: [T::ZERO; N], half, bandwidth: band, error: 0.0 };
        // cₙ = 2 ∫₀^½ Re(C e^(jωn)) df by the trapezoidal rule, on a grid fine enough for the taps.
        let points = 8 * half + 16;
        let df = 0.5 / points as f64;
        let mut taps = [0.0; N];
        for k in 0..points {
            let f = df * k as f64;
            let pass = if f <= band {
                1.0
            } else if f < 2.0 * band {
                0.5 + 0.5 * libm::cos(core::f64::consts::PI * (f / band - 1.0))
            } else {
                break;
            };
            let c = Complex::from(pass * if k == 0 { 1.0 } else { 2.0 } * df) / response(Complex::polar(1.0, -PI2 * f));
            // e^(jωn) for n = −half … half by rotation.
            let turn = Complex::polar(1.0, PI2 * f);
            let mut phasor = c * Complex::polar(1.0, -PI2 * f * half as f64);
            for tap in taps.iter_mut().take(2 * half + 1) {
                *tap += phasor.re;
                phasor = phasor * turn;
            }
        }
        let mut sum = 0.0;
        for (i, tap) in taps.iter_mut().enumerate().take(2 * half + 1) {
            // A cosine taper over the outer quarter reduces the ripple of the truncation.
            let x = (i as f64 - half as f64).abs() / (half as f64 + 1.0);
            if x > 0.75 {
                *tap *= 0.5 + 0.5 * libm::cos(core::f64::consts::PI * (x - 0.75) * 4.0);
            }
            sum += *tap;
        }
        // The static gain is exact.
        let scale = response(Complex::from(1.0)).re * sum;
        for tap in taps.iter_mut().take(2 * half + 1) {
            *tap /= scale;
        }
        for k in 0..=ERROR_FREQUENCIES {
            let f = band * k as f64 / ERROR_FREQUENCIES as f64;
            let turn = Complex::polar(1.0, -PI2 * f);
            let mut phasor = Complex::polar(1.0, PI2 * f * half as f64);
            let mut c = Complex::default();
            for tap in taps.iter().take(2 * half + 1) {
                c = c + phasor * *tap;
                phasor = phasor * turn;
            }
            filter.error = filter.error.at_least((c * response(turn) - Complex::from(1.0)).abs());
        }
        // A response that is zero or NaN has no inverse.
        if !filter.error.is_finite() || taps.iter().any(|tap| !tap.is_finite()) {
            return Err(Error::NotInvertible("the response to be inverted is zero at a frequency of the band"));
        }
        for (slot, tap) in filter.taps.iter_mut().zip(taps) {
            *slot = T::from_f64(tap);
        }
        Ok(filter)
    }

    /// Returns the samples of preview that the filter needs.
    pub fn lead(&self) -> usize {
        self.half
    }

    /// Returns the band in which the response is inverted \[cycles per sample\].
    pub fn bandwidth(&self) -> f64 {
        self.bandwidth
    }

    /// Returns the maximum `|C(f) H(f) − 1|` in that band: the relative error of a reference in the band.
    pub fn error(&self) -> f64 {
        self.error
    }
}

impl<T: Real, const N: usize> Stage<T> for Preview<T, N> {
    type State = PreviewState<T, N>;

    fn state(&self) -> Self::State {
        PreviewState::new()
    }

    /// Resets to an input that has always been `u0`.
    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        let u0 = finite_or(u0, T::ZERO);
        s.inputs = Ring::filled(u0);
        u0
    }

    /// Takes the input of time k + lead and returns the output of time k.
    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        s.inputs.push(finite_or(u, s.inputs.back(0, T::ZERO)));
        // The first tap (n = −lead) belongs to the newest sample.
        let (recent, wrapped) = s.inputs.newest_first();
        // The taps sum to one, so the middle sample can be subtracted. An input at rest then passes without rounding
        // errors. An inverse hysteresis that jumps at each reversal would take such an error for a reversal.
        let middle = s.inputs.back(self.half, T::ZERO);
        let mut y = middle;
        for (x, c) in recent.iter().chain(wrapped).zip(&self.taps).take(2 * self.half + 1) {
            y += *c * (*x - middle);
        }
        y
    }
}
