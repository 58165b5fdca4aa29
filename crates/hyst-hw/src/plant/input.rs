//! The path from drive samples to the actuator: interpolation, dead time, slew limit, first-order lag.

/// The drive at the actuator, at any phase of the present sample period.
///
/// The amplifier interpolates linearly between drive samples. A dead time reads this line at an earlier time, so it is
/// exact.
#[derive(Debug, Clone)]
pub(crate) struct InputPath {
    /// Ring buffer of drive samples; `newest` is the sample at the end of the present period.
    knots: Vec<f64>,
    newest: usize,
    delay_periods: f64,
    slope: Option<Slope>,
    lag: Option<Lag>,
    rest_v: f64,
}

#[derive(Debug, Clone, Copy)]
struct Slope {
    /// Maximum change of the amplifier's output in a fine step (V).
    most: f64,
    value: f64,
}

#[derive(Debug, Clone, Copy)]
struct Lag {
    /// Integration step divided by the time constant.
    step: f64,
    value: f64,
}

impl InputPath {
    /// Returns the path at rest.
    ///
    /// `delay_periods`: dead time in sample periods; `most`: maximum change in a fine step (V); `lag_step`: fine step
    /// divided by the lag's time constant.
    pub(crate) fn new(rest_v: f64, delay_periods: f64, most: Option<f64>, lag_step: Option<f64>) -> Self {
        // Ages from 0 to 1 + delay are read, one more for the interpolation, and one more for rounding.
        let knots = vec![rest_v; delay_periods as usize + 4];
        let slope = most.map(|most| Slope { most, value: rest_v });
        let lag = lag_step.map(|step| Lag { step, value: rest_v });
        Self { knots, newest: 0, delay_periods, slope, lag, rest_v }
    }

    /// Begins a sample period with the drive `v` at its end.
    pub(crate) fn push(&mut self, v: f64) {
        self.newest = if self.newest == 0 { self.knots.len() - 1 } else { self.newest - 1 };
        self.knots[self.newest] = v;
    }

    /// Returns the delayed drive at `phase` (0 to 1) of the present period.
    fn delayed(&self, phase: f64) -> f64 {
        let age = (1.0 - phase) + self.delay_periods;
        let whole = age as usize;
        let (a, b) = (self.knot(whole), self.knot(whole + 1));
        a + (age - whole as f64) * (b - a)
    }

    fn knot(&self, age: usize) -> f64 {
        let index = self.newest + age;
        self.knots[if index >= self.knots.len() { index - self.knots.len() } else { index }]
    }

    /// Integrates the fine step from phase `from` to `to` and returns the voltage at its end.
    pub(crate) fn advance(&mut self, from: f64, to: f64) -> f64 {
        let (begin, middle, end) = self.followed(from, to);
        let Some(lag) = self.lag else { return end };
        let lag = lag.advance(begin, middle, end);
        self.lag = Some(lag);
        lag.value
    }

    /// Returns the output of the amplifier at begin, middle and end of a fine step.
    fn followed(&mut self, from: f64, to: f64) -> (f64, f64, f64) {
        let end = self.delayed(to);
        let Some(slope) = &mut self.slope else {
            return (self.delayed(from), self.delayed(0.5 * (from + to)), end);
        };
        let begin = slope.value;
        slope.value += (end - begin).clamp(-slope.most, slope.most);
        (begin, 0.5 * (begin + slope.value), slope.value)
    }

    pub(crate) fn reset(&mut self) {
        self.knots.fill(self.rest_v);
        if let Some(slope) = &mut self.slope {
            slope.value = self.rest_v;
        }
        if let Some(lag) = &mut self.lag {
            lag.value = self.rest_v;
        }
    }
}

impl Lag {
    /// Computes a classical Runge-Kutta step of `x' = (u - x) / τ` from the input at begin, middle and end.
    fn advance(self, begin: f64, middle: f64, end: f64) -> Self {
        let (x, h) = (self.value, self.step);
        let k1 = begin - x;
        let k2 = middle - (x + 0.5 * h * k1);
        let k3 = middle - (x + 0.5 * h * k2);
        let k4 = end - (x + h * k3);
        Self { value: x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEPS: u32 = 20;

    fn run_period(path: &mut InputPath, v: f64) -> f64 {
        path.push(v);
        let phase = |j| f64::from(j) / f64::from(STEPS);
        (0..STEPS).map(|j| path.advance(phase(j), phase(j + 1))).last().unwrap()
    }

    #[test]
    fn without_delay_and_lag_the_drive_is_unchanged() {
        let mut path = InputPath::new(0.0, 0.0, None, None);
        for v in [1.0, 5.0, -2.0] {
            assert_eq!(run_period(&mut path, v), v);
        }
    }

    #[test]
    fn a_delay_of_fractional_samples_is_exact() {
        let drive = |k: f64| 3.0 * k + 7.0 * (0.3 * k).sin();
        for delay in [0.25, 1.0, 2.6, 5.0] {
            let mut path = InputPath::new(0.0, delay, None, None);
            for k in 1..60 {
                let out = run_period(&mut path, drive(f64::from(k)));
                let t = f64::from(k) - delay;
                let (low, part) = (t.floor(), t - t.floor());
                let knot = |k: f64| if k <= 0.0 { 0.0 } else { drive(k) };
                let expected = knot(low) * (1.0 - part) + knot(low + 1.0) * part;
                let expected = if t <= 0.0 { 0.0 } else { expected };
                assert!((out - expected).abs() < 1e-12, "{delay} {k}: {out} {expected}");
            }
        }
    }

    #[test]
    fn the_lag_has_its_step_response() {
        // A ramp of one period, then constant: 1 - tau/h (e^(h/tau) - 1) e^(-t/tau) after the ramp.
        let (period, tau) = (1.0, 2.5);
        let mut path = InputPath::new(0.0, 0.0, None, Some(period / f64::from(STEPS) / tau));
        for k in 1..40 {
            let t = f64::from(k) * period;
            let expected = 1.0 - tau / period * (period / tau).exp_m1() * (-t / tau).exp();
            let out = run_period(&mut path, 1.0);
            assert!((out - expected).abs() < 1e-9, "{k}: {out} {expected}");
        }
    }

    #[test]
    fn the_slew_limit_delays_a_step_but_not_a_slower_drive() {
        let mut path = InputPath::new(0.0, 0.0, Some(0.5 / f64::from(STEPS)), None);
        // A step of 2 V takes four periods.
        for (k, expected) in [0.5, 1.0, 1.5, 2.0, 2.0].into_iter().enumerate() {
            assert!((run_period(&mut path, 2.0) - expected).abs() < 1e-12, "{k}");
        }
        assert!((run_period(&mut path, -3.0) - 1.5).abs() < 1e-12);
        let mut path = InputPath::new(1.0, 0.0, Some(0.5 / f64::from(STEPS)), None);
        for k in 0..20 {
            let v = 1.0 + (0.4 * f64::from(k)).sin();
            assert!((run_period(&mut path, v) - v).abs() < 1e-12, "{k}");
        }
    }

    #[test]
    fn a_reset_restores_the_initial_state() {
        let mut path = InputPath::new(2.0, 1.5, Some(0.03), Some(0.02));
        let first: Vec<f64> = (0..5).map(|k| run_period(&mut path, f64::from(k))).collect();
        path.reset();
        let second: Vec<f64> = (0..5).map(|k| run_period(&mut path, f64::from(k))).collect();
        assert_eq!(first, second);
    }
}
