//! The composite loop: a model's inverse in front, a PID behind it.

use crate::{Build, Delay, DelayParams, DelayState, Env, Error, Pid, PidState, Real, Sampling, Stage};

/// Feedforward by an inverse `F`, corrected by a PID: the inverse does what the model knows, the PID what it does not.
///
/// `F` is any stage from reference to drive: an inverse operator, a compensator with preview. Its lead delays the reference for the PID,
/// so that both speak of the same time; where an output is measured only at the end of a period, by one more sample. `D` holds this delay: at
/// least `late + 2`.
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
    /// History of the PID.
    pub fn pid(&self) -> &PidState<T> {
        &self.pid
    }
}

impl<T: Real, F: Stage<T>, const D: usize> Tracking<T, F, D> {
    /// From an inverse, the samples by which the reference is later for the PID, and that PID.
    ///
    /// # Errors
    /// If `D` does not hold the delay.
    pub fn new(feedforward: F, late: usize, pid: Pid<T>) -> Result<Self, Error> {
        let late = DelayParams { seconds: late as f64 }.build(&Sampling { period: 1.0 })?;
        Ok(Self { feedforward, late, pid })
    }

    /// A history before the first reference.
    pub fn state(&self) -> TrackingState<T, F::State, D> {
        TrackingState { feedforward: self.feedforward.state(), late: self.late.state(), pid: self.pid.state() }
    }

    /// At rest at reference `r0`, the actuator measured at `y` under the drive `drive`: the loop takes over without a bump.
    pub fn reset(&self, s: &mut TrackingState<T, F::State, D>, env: &Env<T>, r0: T, y: T, drive: T) {
        let ff = self.feedforward.reset(&mut s.feedforward, env, r0);
        self.late.reset(&mut s.late, env, r0);
        self.pid.take_over(&mut s.pid, drive, y, ff);
    }

    /// At rest at reference `r0`, the drive where the inverse has it: nothing is taken over. Gives that drive.
    pub fn reset_to_feedforward(&self, s: &mut TrackingState<T, F::State, D>, env: &Env<T>, r0: T) -> T {
        let ff = self.feedforward.reset(&mut s.feedforward, env, r0);
        self.late.reset(&mut s.late, env, r0);
        self.pid.take_over(&mut s.pid, ff, r0, ff);
        ff
    }

    /// The drive of time k from the reference (and surroundings) of time k + lead and the newest measured output.
    #[inline]
    pub fn step(&self, s: &mut TrackingState<T, F::State, D>, env: &Env<T>, reference: T, measured: T) -> T {
        let ff = self.feedforward.step(&mut s.feedforward, env, reference);
        let now = self.late.step(&mut s.late, env, reference);
        self.pid.step(&mut s.pid, now, measured, ff)
    }

    /// What became of the last drive, as [`Pid::applied`].
    #[inline]
    pub fn applied(&self, s: &mut TrackingState<T, F::State, D>, drive: T) {
        self.pid.applied(&mut s.pid, drive);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Invert, Pi, PidParams};

    /// The actuator differs from the model: the loop with both is better than either alone.
    #[test]
    fn feedforward_and_feedback_together_beat_each_alone() {
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
        let nothing = Pi::<f64, 3>::new(0.0, &[], &[]).unwrap();
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
        let (both, open, feedback) = (rms(inverse, pid(1.0)), rms(inverse, pid(0.0)), rms(nothing, pid(1.0)));
        assert!(both < 0.6 * open && both < 0.6 * feedback, "{both} {open} {feedback}");
    }

    #[test]
    fn a_lead_that_does_not_fit_is_refused() {
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
