//! Composite loop: feedforward by the inverse of a model, feedback by a PID.

use crate::{Build, Delay, DelayParams, DelayState, Env, Error, Pid, PidState, Real, Sampling, Stage};

/// Feedforward by an inverse `F`, corrected by a PID: the PID compensates the model error.
///
/// `F` is any stage from reference to drive: an inverse operator or a compensator with preview. The reference of the
/// PID is delayed by the lead of `F`, and by one more sample if the output is measured at the end of a period, so that
/// reference and measurement belong to the same time. `D` is the capacity of this delay: at least `late + 2`.
///
/// ```
/// use hyst_core::{Build, Env, Invert, Pi, PidParams, Sampling, Stage, Tracking};
/// let model = Pi::<f64, 1>::new(0.1, &[10.0], &[0.02])?;
/// let pid = PidParams {
///     proportional: 0.5, integral: 200.0, derivative: 0.0, derivative_hz: 100.0, proportional_weight: 1.0,
///     derivative_weight: 0.0, anti_windup_seconds: 0.01, low: -150.0, high: 150.0,
/// };
/// let tracking: Tracking<f64, _, 4> = Tracking::new(model.invert()?, 0, pid.build(&Sampling { period: 1e-3 })?)?;
/// let (mut s, mut plant, env) = (tracking.state(), model.state(), Env::default());
/// let mut y = 0.0;
/// for k in 0..100 {
///     let drive = tracking.step(&mut s, &env, 0.05 * f64::from(k), y);
///     y = model.step(&mut plant, &env, drive);
/// }
/// assert!((y - 4.95).abs() < 0.05);
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracking<T, F, const D: usize> {
    feedforward: F,
    late: Delay<T, D>,
    pid: Pid<T>,
}

/// History of a composite loop.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackingState<T, S, const D: usize> {
    feedforward: S,
    late: DelayState<T, D>,
    pid: PidState<T>,
}

impl<T, S, const D: usize> TrackingState<T, S, D> {
    /// Returns the history of the PID.
    pub fn pid(&self) -> &PidState<T> {
        &self.pid
    }
}

impl<T: Real, F: Stage<T>, const D: usize> Tracking<T, F, D> {
    /// Returns the loop of an inverse, the delay of the PID's reference \[samples\], and the PID.
    ///
    /// # Errors
    /// If the delay exceeds the capacity `D`.
    pub fn new(feedforward: F, late: usize, pid: Pid<T>) -> Result<Self, Error> {
        let late = DelayParams { seconds: late as f64 }.build(&Sampling { period: 1.0 })?;
        Ok(Self { feedforward, late, pid })
    }

    /// Returns a history before the first reference.
    pub fn state(&self) -> TrackingState<T, F::State, D> {
        TrackingState { feedforward: self.feedforward.state(), late: self.late.state(), pid: self.pid.state() }
    }

    /// Resets to rest at reference `r0`, with bumpless transfer from an actuator with measured output `y` and drive
    /// `drive`.
    pub fn reset(&self, s: &mut TrackingState<T, F::State, D>, env: &Env<T>, r0: T, y: T, drive: T) {
        let ff = self.feedforward.reset(&mut s.feedforward, env, r0);
        self.late.reset(&mut s.late, env, r0);
        self.pid.take_over(&mut s.pid, drive, y, ff);
    }

    /// Resets to rest at reference `r0` and the drive of the inverse, without a transfer. Returns that drive.
    pub fn reset_to_feedforward(&self, s: &mut TrackingState<T, F::State, D>, env: &Env<T>, r0: T) -> T {
        let ff = self.feedforward.reset(&mut s.feedforward, env, r0);
        self.late.reset(&mut s.late, env, r0);
        self.pid.take_over(&mut s.pid, ff, r0, ff);
        ff
    }

    /// Returns the drive of time k from the reference (and environment) of time k + lead and the newest measured
    /// output.
    #[inline]
    pub fn step(&self, s: &mut TrackingState<T, F::State, D>, env: &Env<T>, reference: T, measured: T) -> T {
        let ff = self.feedforward.step(&mut s.feedforward, env, reference);
        let delayed = self.late.step(&mut s.late, env, reference);
        self.pid.step(&mut s.pid, delayed, measured, ff)
    }

    /// Takes the drive that was applied instead of the last one, as [`Pid::applied`].
    #[inline]
    pub fn applied(&self, s: &mut TrackingState<T, F::State, D>, drive: T) {
        self.pid.applied(&mut s.pid, drive);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Invert, Pi, PidParams};

    /// The actuator differs from the model.
    #[test]
    fn feedforward_with_feedback_has_a_smaller_error_than_either_alone() {
        let model = Pi::<f64, 3>::new(0.1, &[5.0, 15.0, 30.0], &[0.03, 0.02, 0.02]).unwrap();
        let plant = Pi::<f64, 3>::new(0.09, &[6.0, 14.0, 33.0], &[0.03, 0.03, 0.02]).unwrap();
        let pid = |gain: f64| -> Pid<f64> {
            PidParams {
                proportional: 0.0,
                integral: 400.0 * gain,
                derivative: 0.0,
                derivative_hz: 100.0,
                proportional_weight: 1.0,
                derivative_weight: 0.0,
                anti_windup_seconds: 0.01,
                low: -200.0,
                high: 200.0,
            }
            .build(&Sampling { period: 1e-3 })
            .unwrap()
        };
        let zero = Pi::<f64, 3>::new(0.0, &[], &[]).unwrap();
        let rms = |feedforward: Pi<f64, 3>, pid: Pid<f64>| {
            let tracking: Tracking<f64, _, 4> = Tracking::new(feedforward, 0, pid).unwrap();
            let (mut s, mut p, e) = (tracking.state(), plant.state(), Env::default());
            tracking.reset(&mut s, &e, 0.0, 0.0, 0.0);
            let (mut y, mut sum) = (0.0, 0.0);
            for k in 0..4000 {
                let reference = 4.0 * libm::sin(0.01 * f64::from(k)) + libm::sin(0.003 * f64::from(k));
                let drive = tracking.step(&mut s, &e, reference, y);
                y = plant.step(&mut p, &e, drive);
                sum += (y - reference) * (y - reference);
            }
            libm::sqrt(sum / 4000.0)
        };
        let inverse = model.invert().unwrap();
        let (both, open, feedback) = (rms(inverse, pid(1.0)), rms(inverse, pid(0.0)), rms(zero, pid(1.0)));
        assert!(both < 0.6 * open && both < 0.6 * feedback, "{both} {open} {feedback}");
    }

    #[test]
    fn a_delay_beyond_the_capacity_is_rejected() {
        let pi = Pi::<f64, 1>::new(1.0, &[], &[]).unwrap();
        let pid = PidParams {
            proportional: 0.0,
            integral: 0.0,
            derivative: 0.0,
            derivative_hz: 1.0,
            proportional_weight: 1.0,
            derivative_weight: 0.0,
            anti_windup_seconds: 1.0,
            low: 0.0,
            high: 1.0,
        };
        let pid = pid.build(&Sampling { period: 1.0 }).unwrap();
        assert!(matches!(Tracking::<f64, _, 4>::new(pi, 8, pid), Err(Error::Capacity { .. })));
    }
}
