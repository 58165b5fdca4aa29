//! Stable, band-limited inversion of linear stages with preview.
//!
//! The inverse of a sampled lag or resonance has poles on or outside the unit circle: taken causally
//! it rings or grows. As a two-sided impulse response it is stable. [`Preview`] is that response, cut
//! to a symmetric number of taps and to a band, so it needs `lead` samples of the future reference.

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

/// Taps to each side, in periods of the band's edge.
const REACH: f64 = 6.0;

/// Points of the band at which the error is taken.
const CHECKS: usize = 200;

impl<T: Real, const N: usize> Preview<T, N> {
    /// Inverts `response` (of z⁻¹, unit gain at frequency zero) from 0 to `band` and lets nothing
    /// through beyond twice `band`, with a raised cosine between. `band` is in cycles per sample,
    /// up to 1/4.
    ///
    /// Taps: 6 / `band` to each side, or at least half of that where `N` holds no more;
    /// [`error`](Self::error) says what the cut came to.
    ///
    /// # Errors
    /// If `band` is not in (0, 1/4] or so narrow that `N` taps cannot resolve it.
    pub fn new(band: f64, response: impl Fn(Complex) -> Complex) -> Result<Self, Error> {
        const PI2: f64 = 2.0 * core::f64::consts::PI;
        within("preview band", band, band > 0.0 && band <= 0.25, "above 0 and at most a quarter of the sample rate")?;
        let wanted = REACH / band;
        let holds = (N.saturating_sub(1)) / 2;
        if wanted > 2.0 * holds as f64 {
            return Err(Error::Capacity { name: "preview taps", needed: wanted as usize + 1, holds: N });
        }
        let half = holds.min(wanted as usize);
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
            // A Hann-like edge over the outer quarter, so that the cut leaves no ripple.
            let x = (i as f64 - half as f64).abs() / (half as f64 + 1.0);
            if x > 0.75 {
                *tap *= 0.5 + 0.5 * libm::cos(core::f64::consts::PI * (x - 0.75) * 4.0);
            }
            sum += *tap;
        }
        // A constant reference is reached exactly.
        let scale = response(Complex::from(1.0)).re * sum;
        for tap in taps.iter_mut().take(2 * half + 1) {
            *tap /= scale;
        }
        for k in 0..=CHECKS {
            let f = band * k as f64 / CHECKS as f64;
            let turn = Complex::polar(1.0, -PI2 * f);
            let mut phasor = Complex::polar(1.0, PI2 * f * half as f64);
            let mut c = Complex::default();
            for tap in taps.iter().take(2 * half + 1) {
                c = c + phasor * *tap;
                phasor = phasor * turn;
            }
            filter.error = filter.error.at_least((c * response(turn) - Complex::from(1.0)).abs());
        }
        // A response that vanishes or is no number has no inverse.
        if !filter.error.is_finite() || taps.iter().any(|tap| !tap.is_finite()) {
            return Err(Error::NotInvertible("the response to be inverted vanishes at a frequency of the band"));
        }
        for (slot, tap) in filter.taps.iter_mut().zip(taps) {
            *slot = T::from_f64(tap);
        }
        Ok(filter)
    }

    /// Samples of the future that the filter needs.
    pub fn lead(&self) -> usize {
        self.half
    }

    /// Band in which the response is inverted, cycles per sample.
    pub fn bandwidth(&self) -> f64 {
        self.bandwidth
    }

    /// Largest `|C(f) H(f) − 1|` in that band: the relative error of a reference inside it.
    pub fn error(&self) -> f64 {
        self.error
    }
}

impl<T: Real, const N: usize> Stage<T> for Preview<T, N> {
    type State = PreviewState<T, N>;

    fn state(&self) -> Self::State {
        PreviewState::new()
    }

    /// As if the input had been `u0` for ever.
    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        let u0 = finite_or(u0, T::ZERO);
        s.inputs = Ring::filled(u0);
        u0
    }

    /// Takes the input of time k + lead and returns the output of time k.
    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        s.inputs.push(finite_or(u, s.inputs.back(0, T::ZERO)));
        // The first tap (n = −lead) meets the newest sample.
        let (recent, wrapped) = s.inputs.newest_first();
        // The taps add up to one, so the middle can be taken out: an input at rest then passes without rounding, which an inverse
        // with a jump wherever its input turns would take for a turn.
        let middle = s.inputs.back(self.half, T::ZERO);
        let mut y = middle;
        for (x, c) in recent.iter().chain(wrapped).zip(&self.taps).take(2 * self.half + 1) {
            y += *c * (*x - middle);
        }
        y
    }
}
