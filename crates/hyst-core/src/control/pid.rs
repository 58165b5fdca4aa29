//! PID with a filtered derivative and anti-windup.

use crate::error::{coefficient, finite, within};
use crate::stage::{finite_or, hold};
use crate::{Build, Error, Meta, Params, Real, Sampling};

/// Parameters of `u = u_ff + kₚ (b r − y) + kᵢ ∫ (r − y) dt + k_d d/dt (c r − y)`, with a first-order filter of the
/// derivative, limited drive and back-calculation anti-windup (Åström and Hägglund 2006, ch. 3).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PidParams {
    /// Proportional gain kₚ \[u/y\].
    pub proportional: f64,
    /// Integral gain kᵢ \[u/(y s)\].
    pub integral: f64,
    /// Derivative gain k_d \[u s/y\].
    pub derivative: f64,
    /// Corner frequency of the derivative filter \[Hz\], positive.
    pub derivative_hz: f64,
    /// Weight b of the reference in the proportional part, 0 to 1.
    pub proportional_weight: f64,
    /// Weight c of the reference in the derivative part, 0 to 1. With 0 a step of the reference causes no derivative
    /// kick.
    pub derivative_weight: f64,
    /// Tracking time constant T_t of the anti-windup \[s\], positive.
    pub anti_windup_seconds: f64,
    /// Lowest drive \[u\].
    pub low: f64,
    /// Highest drive \[u\].
    pub high: f64,
}

impl Params for PidParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        const INF: f64 = f64::INFINITY;
        let mut visit = |name, unit, lower, upper, x: &mut f64| f(&Meta { name, unit, lower, upper }, x);
        visit("proportional", "u/y", 0.0, INF, &mut self.proportional);
        visit("integral", "u/(y s)", 0.0, INF, &mut self.integral);
        visit("derivative", "u s/y", 0.0, INF, &mut self.derivative);
        visit("derivative_hz", "Hz", 0.0, INF, &mut self.derivative_hz);
        visit("proportional_weight", "", 0.0, 1.0, &mut self.proportional_weight);
        visit("derivative_weight", "", 0.0, 1.0, &mut self.derivative_weight);
        visit("anti_windup_seconds", "s", 0.0, INF, &mut self.anti_windup_seconds);
    }
}

/// Coefficients of a PID at one sample period.
///
/// ```
/// use hyst_core::{Build, Pid, PidParams, Sampling};
/// let params = PidParams {
///     proportional: 0.5, integral: 200.0, derivative: 0.0, derivative_hz: 100.0, proportional_weight: 1.0,
///     derivative_weight: 0.0, anti_windup_seconds: 0.01, low: 0.0, high: 120.0,
/// };
/// let pid: Pid<f64> = params.build(&Sampling { period: 1e-3 })?;
/// let mut s = pid.state();
/// let mut y = 0.0;
/// for _ in 0..2000 {
///     let drive = pid.step(&mut s, 5.0, y, 0.0); // reference 5 µm
///     y = 0.1 * drive;                           // an actuator of 0.1 µm/V
/// }
/// assert!((y - 5.0).abs() < 1e-9);
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pid<T> {
    proportional: T,
    /// kᵢ h
    integral: T,
    /// k_d / (T_f + h)
    derivative: T,
    /// T_f / (T_f + h)
    filter: T,
    weights: [T; 2],
    /// h / T_t, at most 1
    tracking: T,
    low: T,
    high: T,
}

impl<T: Real> Build<Pid<T>> for PidParams {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<Pid<T>, Error> {
        let h = cx.checked()?;
        finite("pid.low", self.low)?;
        within("pid.high", self.high, self.high > self.low, "above pid.low")?;
        let corner = within("pid.derivative_hz", self.derivative_hz, self.derivative_hz > 0.0, "positive")?;
        let tracking_time = self.anti_windup_seconds;
        within("pid.anti_windup_seconds", tracking_time, tracking_time > 0.0, "positive")?;
        for (name, w) in
            [("pid.proportional_weight", self.proportional_weight), ("pid.derivative_weight", self.derivative_weight)]
        {
            within(name, w, (0.0..=1.0).contains(&w), "from 0 to 1")?;
        }
        let filter_time = 1.0 / (2.0 * core::f64::consts::PI * corner);
        Ok(Pid {
            proportional: coefficient("pid.proportional", self.proportional)?,
            integral: coefficient("pid.integral", self.integral * h)?,
            derivative: coefficient("pid.derivative", self.derivative / (filter_time + h))?,
            filter: T::from_f64(filter_time / (filter_time + h)),
            weights: [T::from_f64(self.proportional_weight), T::from_f64(self.derivative_weight)],
            tracking: T::from_f64((h / tracking_time).at_most(1.0)),
            low: coefficient("pid.low", self.low)?,
            high: coefficient("pid.high", self.high)?,
        })
    }
}

/// History of a PID.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PidState<T> {
    integral: T,
    derivative: T,
    /// c r − y of the last sample; `None` before the first.
    last: Option<T>,
    reference: T,
    measured: T,
    feedforward: T,
    /// The last drive.
    drive: T,
    limited: bool,
}

impl<T> PidState<T> {
    /// Returns whether a limit acted on the last drive.
    pub fn limited(&self) -> bool {
        self.limited
    }
}

impl<T: Real> Pid<T> {
    /// Returns a history with the integral at zero.
    pub fn state(&self) -> PidState<T> {
        PidState::default()
    }

    /// Bumpless transfer: sets the history so that the next drive at reference = measured = `y` and feedforward
    /// `feedforward` is `drive`.
    pub fn take_over(&self, s: &mut PidState<T>, drive: T, y: T, feedforward: T) {
        // If the sensor drops out at this moment, use its last value.
        let y = finite_or(y, s.measured);
        let feedforward = finite_or(feedforward, s.feedforward);
        let proportional = self.proportional * (self.weights[0] * y - y);
        *s = PidState {
            integral: finite_or(drive - feedforward - proportional, T::ZERO),
            last: Some(self.weights[1] * y - y),
            reference: y,
            measured: y,
            feedforward,
            ..PidState::default()
        };
    }

    /// Returns the drive for a reference and a measured output \[y\], added to a feedforward \[u\], within the limits.
    /// The last finite value replaces a value that is not finite.
    #[inline]
    pub fn step(&self, s: &mut PidState<T>, reference: T, measured: T, feedforward: T) -> T {
        let r = hold(&mut s.reference, reference);
        let y = hold(&mut s.measured, measured);
        let ff = hold(&mut s.feedforward, feedforward);
        let differentiated = self.weights[1] * r - y;
        let change = s.last.map_or(T::ZERO, |last| differentiated - last);
        s.last = Some(differentiated);
        // An overflow must not remain in the history.
        s.derivative = finite_or(self.filter * s.derivative + self.derivative * change, T::ZERO);
        let wanted = ff + self.proportional * (self.weights[0] * r - y) + s.integral + s.derivative;
        let drive = wanted.at_least(self.low).at_most(self.high);
        s.limited = drive != wanted;
        s.drive = drive;
        s.integral = finite_or(s.integral + self.integral * (r - y) + self.tracking * (drive - wanted), s.integral);
        drive
    }

    /// Takes the drive \[u\] that was applied instead of the last one, for example after a slew-rate limit. The
    /// anti-windup corrects the integral for the difference.
    #[inline]
    pub fn applied(&self, s: &mut PidState<T>, drive: T) {
        s.integral = finite_or(s.integral + self.tracking * (drive - s.drive), s.integral);
        s.drive = finite_or(drive, s.drive);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const PARAMS: PidParams = PidParams {
        proportional: 2.0,
        integral: 1000.0,
        derivative: 0.001,
        derivative_hz: 200.0,
        proportional_weight: 1.0,
        derivative_weight: 0.0,
        anti_windup_seconds: 0.02,
        low: 0.0,
        high: 100.0,
    };

    fn pid() -> Pid<f64> {
        PARAMS.build(&Sampling { period: 1e-3 }).unwrap()
    }

    /// A plant with a lag of 5 ms and a gain of 0.1.
    fn closed_loop(pid: &Pid<f64>, reference: impl Fn(u32) -> f64, rows: u32) -> Vec<f64> {
        let (mut s, mut y) = (pid.state(), 0.0);
        (0..rows)
            .map(|k| {
                let u = pid.step(&mut s, reference(k), y, 0.0);
                y += (0.1 * u - y) * 0.2;
                y
            })
            .collect()
    }

    #[test]
    fn a_constant_reference_is_reached() {
        let y = closed_loop(&pid(), |_| 6.0, 3000);
        assert!((y[2999] - 6.0).abs() < 1e-6);
    }

    /// 100 V cannot reach 20 µm. When the reference falls again, a wound-up integral would keep the drive at its limit.
    #[test]
    fn the_integral_does_not_wind_up() {
        let y = closed_loop(&pid(), |k| if k < 2000 { 20.0 } else { 5.0 }, 2300);
        assert!((y[1999] - 10.0).abs() < 1e-3);
        let settled = y[2000..].iter().position(|y| (y - 5.0).abs() < 0.1).unwrap();
        assert!(settled < 100, "{settled} samples");
        let slow: Pid<f64> =
            PidParams { anti_windup_seconds: 1e9, ..PARAMS }.build(&Sampling { period: 1e-3 }).unwrap();
        let y = closed_loop(&slow, |k| if k < 2000 { 20.0 } else { 5.0 }, 2300);
        assert!(y[2000..].iter().all(|y| (y - 5.0).abs() > 0.1));
    }

    #[test]
    fn the_derivative_of_a_ramp_is_its_slope() {
        let only = PidParams {
            proportional: 0.0,
            integral: 0.0,
            derivative: 0.5,
            derivative_weight: 1.0,
            low: -1e3,
            ..PARAMS
        };
        let pid: Pid<f64> = only.build(&Sampling { period: 1e-3 }).unwrap();
        let mut s = pid.state();
        let mut u = 0.0;
        for k in 0..200 {
            u = pid.step(&mut s, 30.0 * 1e-3 * f64::from(k), 0.0, 0.0);
        }
        assert!((u - 0.5 * 30.0).abs() < 1e-9);
    }

    #[test]
    fn the_transfer_is_bumpless_and_a_dropout_is_held() {
        let pid = pid();
        let mut s = pid.state();
        pid.take_over(&mut s, 40.0, 4.0, 10.0);
        assert!((pid.step(&mut s, 4.0, 4.0, 10.0) - 40.0).abs() < 1e-12);
        assert!((pid.step(&mut s, f64::NAN, f64::NAN, f64::NAN) - 40.0).abs() < 1e-12);
    }

    #[test]
    fn a_glitch_does_not_remain_in_the_history() {
        let pid: Pid<f32> = PARAMS.build(&Sampling { period: 1e-3 }).unwrap();
        let mut s = pid.state();
        pid.take_over(&mut s, 40.0, f32::NAN, 10.0);
        let mut y = 4.0;
        for glitch in [-3e38, 3e38, f32::INFINITY, f32::NAN] {
            for k in 0..6000 {
                let u = pid.step(&mut s, 4.0, if k == 0 { glitch } else { y }, 10.0);
                y += (0.1 * u - y) * 0.2;
            }
            assert!((y - 4.0).abs() < 1e-3, "{y} after {glitch}");
        }
    }

    /// Plant with gain one and a slew-rate limit of 0.002 per sample. With `applied` the peak is small.
    #[test]
    fn a_slew_rate_limit_does_not_wind_up_the_integral() {
        let params = PidParams { proportional: 0.0, integral: 20.0, low: -100.0, high: 100.0, ..PARAMS };
        let pid: Pid<f64> = params.build(&Sampling { period: 1e-3 }).unwrap();
        let peak = |reports: bool| {
            let (mut s, mut y, mut highest) = (pid.state(), 0.0f64, 0.0f64);
            for _ in 0..2000 {
                let wanted = pid.step(&mut s, 1.0, y, 0.0);
                y = wanted.clamp(y - 0.002, y + 0.002);
                if reports {
                    pid.applied(&mut s, y);
                }
                highest = highest.max(y);
            }
            highest
        };
        assert!(peak(true) < 1.2 && peak(false) > 1.5, "{} {}", peak(true), peak(false));
    }

    #[test]
    fn invalid_limits_are_rejected_with_their_name() {
        let built: Result<Pid<f64>, _> = PidParams { high: -1.0, ..PARAMS }.build(&Sampling { period: 1e-3 });
        assert!(matches!(built, Err(Error::OutOfRange { name: "pid.high", .. })));
    }
}
