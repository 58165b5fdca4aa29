//! The standard drive of an identification.

use super::error::{positive, require};
use super::{DecayingSine, Drive, ExciteError, Limits, Multisine, Phases, Shape, Sine, Stairs, Triangle};

/// Offset of the seed of a test drive.
const TEST_SEED_OFFSET: u64 = 1 << 32;
/// Slew limit of a test drive, as a share of the slew limit.
const TEST_SLEW_SHARE: f64 = 0.8;
/// Target slope of a drive that is slowed down, as a share of the slew limit.
const TARGET_SLEW_SHARE: f64 = 0.98;
/// Maximum number of rounds in which the drive is slowed down, one field per round.
const ROUNDS: usize = 12;

/// A drive that excites every effect of a diagnosis: nested loops (decaying sine), slow and fast full loops (lag,
/// resonance, rate), triangles, long holds (creep, drift) and a broad band (multisine).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Identification {
    /// Duration with rests \[s\]; the drive matches it within a few seconds.
    pub duration_s: f64,
    /// Rest between segments \[s\].
    pub rest_s: f64,
    /// Frequency of the slow loops \[Hz\].
    pub slow_hz: f64,
    /// Frequency of the fast loops \[Hz\].
    pub fast_hz: f64,
    /// Highest frequency of the multisine \[Hz\]; its lowest is `slow_hz`.
    pub band_hz: f64,
    /// Hold time of each level of the stairs \[s\].
    pub hold_s: f64,
    /// Duration of the ramps between them \[s\].
    pub ramp_s: f64,
    /// Seed of levels and phases.
    pub seed: u64,
}

impl Identification {
    /// Returns the usual drive: 36 s, 1 to 20 Hz and a band up to 50 Hz; lower frequencies if `rate_hz` is low.
    pub fn at_rate(rate_hz: f64, seed: u64) -> Self {
        Self {
            duration_s: 36.0,
            rest_s: 1.0,
            slow_hz: f64::min(1.0, rate_hz / 100.0),
            fast_hz: f64::min(20.0, rate_hz / 10.0),
            band_hz: f64::min(50.0, rate_hz / 8.0),
            hold_s: 2.0,
            ramp_s: f64::max(0.08, 4.0 / rate_hz),
            seed,
        }
    }

    /// Returns a short drive for a first record of an unknown actuator: the same segments in a fifth of the time.
    pub fn short(rate_hz: f64, seed: u64) -> Self {
        let usual = Self::at_rate(rate_hz, seed);
        let slow_hz = f64::min(1.5, rate_hz / 100.0);
        // Long enough for five stairs and for the periods of the decaying sine.
        let (hold_s, rest_s) = (0.9, 0.3);
        let active_s = f64::max(8.1 / slow_hz, 5.1 * (hold_s + usual.ramp_s));
        Self { duration_s: active_s + 5.0 * rest_s, rest_s, slow_hz, hold_s, ..usual }
    }

    /// Returns the drive for a test record, of about the same duration, voltages and highest frequency. Levels and
    /// phases are different random numbers. The frequencies of the periodic waves are moved inwards by a tenth of the
    /// range on a logarithmic scale, for example from 1 and 20 Hz to 1.35 and 14.8 Hz. If `slow_hz` and `fast_hz` are
    /// nearly equal, the frequencies of both drives are too.
    #[must_use]
    pub fn for_test(self) -> Self {
        let other = Self { seed: self.seed.wrapping_add(TEST_SEED_OFFSET), ..self };
        let factor = (self.fast_hz.min(self.band_hz) / self.slow_hz).powf(0.1);
        // Invalid fields are not changed, so the error reports the given value.
        let valid = self.slow_hz > 0.0 && factor.is_finite() && factor > 1.0;
        if valid { Self { slow_hz: self.slow_hz * factor, fast_hz: self.fast_hz / factor, ..other } } else { other }
    }

    /// Slows down the segments that exceed the slew limit. `free` returns whether the field `slow_hz`, `fast_hz`,
    /// `band_hz` or `ramp_s` may change, and for `duration_s` whether the same number of loops may take longer.
    #[must_use]
    pub fn within_slew(mut self, limits: &Limits, free: &dyn Fn(&str) -> bool) -> Self {
        for _ in 0..ROUNDS {
            let Err(ExciteError::Slew { shape, needed, limit, .. }) = self.drive(limits) else { break };
            let field = match shape {
                // The slow sine is not steeper than the decaying sine.
                "sine" => "fast_hz",
                "stairs" => "ramp_s",
                "multisine" => "band_hz",
                _ => "slow_hz",
            };
            if !free(field) {
                break;
            }
            let factor = TARGET_SLEW_SHARE * limit / needed;
            match field {
                "fast_hz" => self.fast_hz *= factor,
                "band_hz" => self.band_hz *= factor,
                "ramp_s" => self.ramp_s /= factor,
                _ => {
                    self.slow_hz *= factor;
                    self.duration_s /= if free("duration_s") { factor } else { 1.0 };
                }
            }
        }
        self
    }

    /// Returns [`for_test`](Self::for_test) with 80 % of the slew limit, so that it also differs if the limit sets the
    /// speed.
    #[must_use]
    pub fn for_test_within_slew(self, limits: &Limits, free: &dyn Fn(&str) -> bool) -> Self {
        let reduced = Limits { slew_v_per_s: limits.slew_v_per_s.map(|v_per_s| TEST_SLEW_SHARE * v_per_s), ..*limits };
        self.for_test().within_slew(&reduced, free)
    }

    /// Returns the segments. The stairs take two fifths and the decaying sine one fifth of the time without rests.
    ///
    /// # Errors
    /// If a field is out of its range.
    pub fn shapes(&self) -> Result<Vec<Shape>, ExciteError> {
        require("rest_s", self.rest_s, (0.0..=1e6).contains(&self.rest_s), "between 0 and 1e6")?;
        positive("slow_hz", self.slow_hz)?;
        for (field, hz) in [("fast_hz", self.fast_hz), ("band_hz", self.band_hz)] {
            require(field, hz, hz.is_finite() && hz > self.slow_hz, "above slow_hz")?;
        }
        require("hold_s", self.hold_s, self.hold_s.is_finite() && self.hold_s >= 0.0, "a number from 0 up")?;
        positive("ramp_s", self.ramp_s)?;
        let active = self.duration_s - 5.0 * self.rest_s;
        // The decaying sine needs three of its periods, at twice the slow frequency.
        let least = f64::max(8.0 / self.slow_hz, 5.0 * (self.hold_s + self.ramp_s));
        let must =
            format!("finite and at least {} (5 rests and {least} s for the segments)", least + 5.0 * self.rest_s);
        require("duration_s", self.duration_s, self.duration_s.is_finite() && active >= least, &must)?;
        let cycles = |share: f64, frequency: f64| (share * active * frequency).round().clamp(1.0, 1e6) as u32;
        let multisine_s = 0.15 * active;
        let room = (self.band_hz - self.slow_hz) * multisine_s;
        Ok(vec![
            Shape::DecayingSine(DecayingSine { frequency_hz: 2.0 * self.slow_hz, duration_s: 0.2 * active }),
            Shape::Sine(Sine { frequency_hz: self.slow_hz, cycles: cycles(0.1, self.slow_hz) }),
            Shape::Sine(Sine { frequency_hz: self.fast_hz, cycles: cycles(0.05, self.fast_hz) }),
            Shape::Triangle(Triangle { frequency_hz: self.slow_hz, cycles: cycles(0.1, self.slow_hz) }),
            Shape::Stairs(Stairs {
                levels: cycles(0.4, 1.0 / (self.hold_s + self.ramp_s)),
                hold_s: self.hold_s,
                ramp_s: self.ramp_s,
                seed: self.seed,
            }),
            Shape::Multisine(Multisine {
                low_hz: self.slow_hz,
                high_hz: self.band_hz,
                lines: room.floor().clamp(1.0, 40.0) as u32,
                periods: 1,
                phases: Phases::Random(self.seed),
                duration_s: multisine_s,
                fade_s: 0.1 * multisine_s,
            }),
        ])
    }

    /// Computes the drive.
    ///
    /// # Errors
    /// As [`Drive::new`]; messages name the fields of this specification.
    pub fn drive(&self, limits: &Limits) -> Result<Drive, ExciteError> {
        limits.check()?;
        for (field, hz) in [("fast_hz", self.fast_hz), ("band_hz", self.band_hz)] {
            require(field, hz, hz <= 0.25 * limits.rate_hz, "at most a quarter of rate_hz")?;
        }
        Drive::new(&self.shapes()?, limits, self.rest_s).map_err(|error| match error {
            ExciteError::Slew { shape, needed, limit, .. } => {
                let remedy = match shape {
                    "sine" => "lower fast_hz (and slow_hz, if that is not enough)",
                    "stairs" => "lengthen ramp_s",
                    "multisine" => "lower band_hz",
                    _ => "lower slow_hz",
                };
                ExciteError::Slew { shape, needed, limit, remedy }
            }
            other => other,
        })
    }
}
