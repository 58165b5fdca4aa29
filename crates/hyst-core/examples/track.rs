//! Follows a reference with the inverse of a Prandtl-Ishlinskii model: `cargo run -p hyst-core --example track`.
//!
//! The functions `plays` and `follow` use neither heap nor standard library, so they also compile for firmware. The
//! actuator of the example has 40 plays in `f64`. The model has 8 plays in `f32`, so that its inverse is not exact.

use hyst_core::{Env, Error, Invert, Pi, Real, Stage};

/// Sample period \[s\].
const PERIOD_S: f64 = 1e-3;
/// Highest voltage \[V\].
const TOP_V: f64 = 100.0;

/// Output of an actuator at rest that rises to `u` for the first time \[µm\]: 0.12 µm/V, and 0.2 µm/V near 100 V.
fn first_rise(u: f64) -> f64 {
    0.12 * u + 0.0004 * u * u
}

/// Returns the operator with `N` plays whose first rise agrees with `curve` at N + 2 equidistant inputs from 0 to `top`.
fn plays<T: Real, const N: usize>(curve: impl Fn(f64) -> f64, top: f64) -> Result<Pi<T, N>, Error> {
    let step = top / (N + 1) as f64;
    let slope = |i: usize| (curve((i + 1) as f64 * step) - curve(i as f64 * step)) / step;
    let (mut thresholds, mut weights) = ([0.0; N], [0.0; N]);
    for i in 0..N {
        // Each play adds its weight to the slope when the input exceeds its threshold.
        thresholds[i] = (i + 1) as f64 * step;
        weights[i] = slope(i + 1) - slope(i);
    }
    Pi::new(slope(0), &thresholds, &weights)
}

/// A controller: returns the drive \[V\] for the next reference value \[µm\].
trait Controller {
    fn drive(&mut self, reference_um: f32) -> f32;
}

/// Divides by a constant gain \[µm/V\].
struct PlainGain(f32);

impl Controller for PlainGain {
    fn drive(&mut self, reference_um: f32) -> f32 {
        reference_um / self.0
    }
}

/// Inverts the model.
struct Inverse<const N: usize> {
    operator: Pi<f32, N>,
    state: <Pi<f32, N> as Stage<f32>>::State,
}

impl<const N: usize> Inverse<N> {
    fn of(model: &Pi<f32, N>) -> Result<Self, Error> {
        let operator = model.invert()?;
        let mut state = operator.state();
        operator.reset(&mut state, &Env::default(), 0.0);
        Ok(Self { operator, state })
    }
}

impl<const N: usize> Controller for Inverse<N> {
    fn drive(&mut self, reference_um: f32) -> f32 {
        self.operator.step(&mut self.state, &Env::default(), reference_um)
    }
}

/// Follows `samples` values of the reference from rest; returns the RMS error \[µm\].
fn follow(actuator: &Pi<f64, 40>, controller: &mut impl Controller, samples: u32) -> f64 {
    let (mut memory, env) = (actuator.state(), Env::default());
    actuator.reset(&mut memory, &env, 0.0);
    let mut sum = 0.0;
    for k in 0..samples {
        let wanted = reference_um(f64::from(k) * PERIOD_S);
        let drive = f64::from(controller.drive(wanted as f32)).clamp(0.0, TOP_V);
        let reached = actuator.step(&mut memory, &env, drive);
        sum += (reached - wanted) * (reached - wanted);
    }
    (sum / f64::from(samples.max(1))).sqrt()
}

/// Reference \[µm\]: 5 Hz triangles from 2 µm, whose peaks rise and fall between 4 and 14 µm. After a peak of 14 µm the
/// actuator reaches 1.6 µm at 0 V, because of its hysteresis.
fn reference_um(time_s: f64) -> f64 {
    let period = time_s * 5.0;
    let triangle = 1.0 - (2.0 * period.fract() - 1.0).abs();
    let peak = 9.0 - 5.0 * (0.4 * core::f64::consts::PI * time_s).cos();
    2.0 + (peak - 2.0) * triangle
}

fn main() -> Result<(), Error> {
    let actuator = plays::<f64, 40>(first_rise, TOP_V)?;
    let model = plays::<f32, 8>(first_rise, TOP_V)?;
    let samples = 5000;
    let mean_gain = first_rise(TOP_V) / TOP_V;
    let plain = follow(&actuator, &mut PlainGain(mean_gain as f32), samples);
    let inverse = follow(&actuator, &mut Inverse::of(&model)?, samples);
    println!("RMS error of a reference between 2 and 14 µm over {:.0} s:", f64::from(samples) * PERIOD_S);
    println!("  plain gain               {plain:.4} µm");
    println!("  inverse with 8 plays     {inverse:.4} µm, {:.1} times smaller", plain / inverse);
    Ok(())
}
