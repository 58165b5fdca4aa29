//! The samples: integer arithmetic and one exact division, so that all machines compute the same bits.

use hyst_core::Sampling;

/// Number of samples, including the one at rest.
pub const SAMPLES: usize = 1000;

/// The sample period.
pub const PERIOD: Sampling = Sampling { period: 1e-3 };

/// Drive and environment at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time \[s\].
    pub time: f64,
    /// Drive as a share of the input range, 0 to 1.
    pub drive: f64,
    /// Temperature \[°C\], 20 to 26.
    pub temperature: f64,
    /// Load \[N\], −5 to 5.
    pub load: f64,
}

/// 1 in the fixed-point numbers below.
const UNIT: i64 = 1 << 20;

/// Returns the samples.
///
/// The drive is the sum of a slow triangle with decreasing amplitude (nested loops), two approximate sines with other
/// periods (minor loops) and some noise (reversals at nearly every sample). In one part it is constant.
pub fn samples() -> impl Iterator<Item = Sample> {
    let mut seed: u32 = 1;
    let mut held = 0;
    (0..SAMPLES as i64).map(move |k| {
        // Generator of Numerical Recipes; its high bits are better.
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = i64::from(seed >> 12);
        let slow = UNIT - (UNIT - triangle(k, 410)) * (1400 - k) / 1400;
        let drive = 60 * slow + 25 * (UNIT + sine(k, 97)) / 2 + 13 * (UNIT - sine(k, 13)) / 2 + 2 * noise;
        if !(640..680).contains(&k) {
            held = if k == 0 { 0 } else { drive / 100 };
        }
        Sample {
            time: k as f64 * PERIOD.period,
            drive: fraction(held),
            temperature: 20.0 + 6.0 * fraction(triangle(k, 733)),
            load: 5.0 * fraction(sine(k, 171)),
        }
    })
}

fn fraction(x: i64) -> f64 {
    x as f64 / UNIT as f64
}

/// Returns a triangle: 0 at k = 0, 1 at half a period.
fn triangle(k: i64, period: i64) -> i64 {
    let phase = k.rem_euclid(period) * 2 * UNIT / period;
    if phase < UNIT { phase } else { 2 * UNIT - phase }
}

/// Returns an approximate sine of two parabolas, −1 to 1.
fn sine(k: i64, period: i64) -> i64 {
    let phase = k.rem_euclid(period) * 2 * UNIT / period - UNIT;
    -(4 * phase * (UNIT - phase.abs())) / UNIT
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_drive_covers_its_range_with_many_reversals() {
        let (mut low, mut high, mut turns, mut still) = (1.0f64, 0.0f64, 0, 0);
        let (mut last, mut rise) = (0.0, 0.0);
        for s in samples() {
            assert!((0.0..=1.0).contains(&s.drive) && (20.0..=26.0).contains(&s.temperature) && s.load.abs() <= 5.0);
            (low, high) = (low.min(s.drive), high.max(s.drive));
            let step = s.drive - last;
            turns += usize::from(step * rise < 0.0);
            still += usize::from(step == 0.0);
            rise = if step == 0.0 { rise } else { step };
            last = s.drive;
        }
        assert_eq!(low, 0.0);
        assert!(high > 0.95 && turns > 100 && still >= 40, "{high} {turns} {still}");
    }
}
