//! Hysteresis laws as relays, play operators and differential equations in small steps.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// A hysteresis law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// Play operators with random widths and weights.
    Plays,
    /// Relays with random switching points.
    Relays,
    /// Relays with ramps as edges (Krasnosel'skii and Pokrovskii).
    Ramps,
    /// Differential equation of Coleman and Hodgdon.
    ColemanHodgdon,
    /// Differential equation of Bouc and Wen.
    BoucWen,
    /// Differential equation of Jiles and Atherton.
    JilesAtherton,
    /// Sum of Dahl friction elements.
    Dahl,
}

impl Law {
    /// All laws.
    pub const ALL: [Self; 7] =
        [Self::Plays, Self::Relays, Self::Ramps, Self::ColemanHodgdon, Self::BoucWen, Self::JilesAtherton, Self::Dahl];

    /// Returns the output of the memory for a drive between −1 and 1 that starts at −1.
    pub(super) fn follow(self, x: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
        let mut memory = self.memory(rng);
        x.iter().map(|x| memory(*x)).collect()
    }

    /// Returns the memory: a function from the next drive value (between −1 and 1, from −1 on) to the output.
    pub fn memory(self, rng: &mut ChaCha8Rng) -> Box<dyn FnMut(f64) -> f64 + Send> {
        let mut draw = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        match self {
            Self::Plays => {
                let elements: Vec<(f64, f64)> = (0..14).map(|_| (draw(0.01, 0.8), draw(0.0, 1.0) / 7.0)).collect();
                let mut at = vec![-1.0_f64; elements.len()];
                Box::new(move |x| {
                    let moved = at.iter_mut().zip(&elements).map(|(p, (r, w))| {
                        *p = f64::clamp(*p, x - r, x + r);
                        w * *p
                    });
                    moved.sum()
                })
            }
            Self::Relays | Self::Ramps => {
                let width = if self == Self::Ramps { draw(0.1, 0.3) } else { 0.0 };
                let count = if self == Self::Ramps { 400 } else { 3000 };
                let relays: Vec<(f64, f64)> = (0..count)
                    .map(|_| {
                        let (middle, half) = (draw(-1.0, 1.0) * draw(0.5, 1.0), draw(0.0, 0.5) * draw(0.2, 1.0));
                        (middle - half, middle + half)
                    })
                    .collect();
                let mut at = vec![-1.0; relays.len()];
                let ramp = move |x: f64| match width > 0.0 {
                    true => (2.0 * x / width).clamp(-1.0, 1.0),
                    false => 1f64.copysign(x),
                };
                Box::new(move |x| {
                    let moved = at.iter_mut().zip(&relays).map(|(s, (down, up))| {
                        *s = f64::max(*s, ramp(x - up)).min(f64::max(ramp(x - up), ramp(x - down)));
                        *s
                    });
                    moved.sum::<f64>() / count as f64
                })
            }
            Self::ColemanHodgdon => {
                let (a, b, c) = (draw(1.0, 4.0), draw(0.8, 1.2), draw(0.2, 0.5));
                small_steps(move |x, z, dx| a * dx.abs() * (b * x - z) + c * dx, -b)
            }
            Self::BoucWen => {
                let (n, closing, scale) = (draw(1.0, 2.0), draw(0.1, 0.6), draw(0.15, 0.5));
                // The output of a piezo follows its input, so the force of the law is subtracted.
                let law = move |_: f64, z: f64, dx: f64| {
                    let share = if dx * z > 0.0 { 1.0 } else { closing };
                    dx * (1.0 - share * (z.abs() / scale).powf(n))
                };
                let mut force = small_steps(law, 0.0);
                Box::new(move |x| x - force(x))
            }
            Self::JilesAtherton => {
                let (k, a, c) = (draw(0.1, 0.3), draw(0.2, 0.5), draw(0.05, 0.3));
                let langevin = move |x: f64| {
                    if x.abs() < 1e-4 { x / (3.0 * a) } else { (a / x).mul_add(-1.0, 1.0 / (x / a).tanh()) }
                };
                let law = move |x: f64, m: f64, dx: f64| {
                    let gap = langevin(x) - m;
                    let slope = if gap * dx > 0.0 { gap / k * dx.signum() } else { 0.0 };
                    let reversible = c * (langevin(x + 1e-5) - langevin(x - 1e-5)) / 2e-5;
                    ((1.0 - c) * slope + reversible) * dx
                };
                small_steps(law, -0.5)
            }
            Self::Dahl => {
                // This output is also subtracted, from a line that is at least as steep everywhere.
                let (mut elements, mut steepest) = (Vec::new(), 0.0);
                for _ in 0..3 {
                    let (reach, n, weight) = (draw(0.2, 0.9), draw(0.6, 1.4), draw(0.1, 0.4));
                    let law = move |_: f64, f: f64, dx: f64| {
                        let margin = 1.0 - f * dx.signum();
                        dx / reach * margin.abs().powf(n).copysign(margin)
                    };
                    elements.push((weight, small_steps(law, -1.0)));
                    steepest += weight * 2_f64.powf(n) / reach;
                }
                Box::new(move |x| {
                    let total = elements.iter_mut().fold(0.0, |sum, (weight, f)| sum + *weight * f(x).clamp(-1.5, 1.5));
                    x - total / steepest
                })
            }
        }
    }
}

/// Returns a law dz = rate(x, z, dx) that is integrated from x = −1 and z = `start`. The steps are small enough for
/// jumps of the drive too: a law is stiff where its loop is narrow.
fn small_steps(rate: impl Fn(f64, f64, f64) -> f64 + Send + 'static, start: f64) -> Box<dyn FnMut(f64) -> f64 + Send> {
    const MIN_STEPS: f64 = 12.0;
    const MAX_STEP: f64 = 0.002;
    let (mut z, mut from) = (start, -1.0_f64);
    Box::new(move |to| {
        let steps = ((to - from).abs() / MAX_STEP).ceil().max(MIN_STEPS);
        let step = (to - from) / steps;
        for i in 0..steps as u32 {
            z += rate(from + step * (f64::from(i) + 0.5), z, step);
        }
        from = to;
        z
    })
}
