//! The standard drive of an identification.

use super::{
    DecayingSine, Drive, ExciteError, Limits, Multisine, Phases, Shape, Sine, Stairs, Triangle, positive, require,
};

/// Added to the seed of a test record's drive.
const TEST_SEED: u64 = 1 << 32;
/// Slope of a test record's drive over that of the other one where that is limited.
const TEST_SLEW: f64 = 0.8;
/// Share of a slope limit that is aimed at.
const AIM: f64 = 0.98;
/// Rounds in which the drive is slowed down: each field has its own in the end.
const ROUNDS: usize = 12;

/// A drive that shows every effect that a diagnosis can name: nested loops (decaying sine), slow and fast full loops
/// (lag, resonance, rate), triangles, long holds (creep, drift) and a broad band (multisine).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Identification {
    /// Duration, rests included \[s\]; the drive comes within a few seconds of it.
    pub duration_s: f64,
    /// Rest between segments \[s\].
    pub rest_s: f64,
    /// Frequency of the slow loops \[Hz\].
    pub slow_hz: f64,
    /// Frequency of the fast loops \[Hz\].
    pub fast_hz: f64,
    /// Highest frequency of the multisine \[Hz\]; its lowest is `slow_hz`.
    pub band_hz: f64,
    /// How long the levels of the stairs are held \[s\].
    pub hold_s: f64,
    /// How long the ramps between them take \[s\].
    pub ramp_s: f64,
    /// Seed of levels and phases.
    pub seed: u64,
}

impl Identification {
    /// The usual drive: 36 s, 1 to 20 Hz and a band up to 50 Hz, less where `rate_hz` is low.
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

    /// A first look at an actuator, of which nothing is known: the same segments in a fifth of the time.
    pub fn short(rate_hz: f64, seed: u64) -> Self {
        let usual = Self::at_rate(rate_hz, seed);
        let slow_hz = f64::min(1.5, rate_hz / 100.0);
        // Five stairs, and what the decaying sine needs of its periods.
        let (hold_s, rest_s) = (0.9, 0.3);
        let active_s = f64::max(8.1 / slow_hz, 5.1 * (hold_s + usual.ramp_s));
        Self { duration_s: active_s + 5.0 * rest_s, rest_s, slow_hz, hold_s, ..usual }
    }

    /// The drive for a test record: about as long, over the same voltages and up to the same frequency. Levels and phases are drawn
    /// anew; periodic waves have frequencies a tenth of the way, on a logarithmic scale, further inside: with the usual 1 and
    /// 20 Hz these are 1.35 and 14.8 Hz. Where `slow_hz` and `fast_hz` are nearly the same, so are those of both drives.
    #[must_use]
    pub fn for_test(self) -> Self {
        let other = Self { seed: self.seed.wrapping_add(TEST_SEED), ..self };
        let inwards = (self.fast_hz.min(self.band_hz) / self.slow_hz).powf(0.1);
        // What is out of its range is told as it was given.
        let legal = self.slow_hz > 0.0 && inwards.is_finite() && inwards > 1.0;
        if legal { Self { slow_hz: self.slow_hz * inwards, fast_hz: self.fast_hz / inwards, ..other } } else { other }
    }

    /// The same, no steeper than the limits allow: what is too steep is slowed down, where `free` says of `slow_hz`, `fast_hz`, `band_hz` or
    /// `ramp_s` that nobody has fixed it. Of `duration_s` it says whether as many loops may take longer.
    #[must_use]
    pub fn within_slew(mut self, limits: &Limits, free: &dyn Fn(&str) -> bool) -> Self {
        for _ in 0..ROUNDS {
            let Err(ExciteError::Slew { shape, needed, limit, .. }) = self.drive(limits) else { break };
            let field = match shape {
                // The slow one is no steeper than the decaying sine.
                "sine" => "fast_hz",
                "stairs" => "ramp_s",
                "multisine" => "band_hz",
                _ => "slow_hz",
            };
            if !free(field) {
                break;
            }
            let slower = AIM * limit / needed;
            match field {
                "fast_hz" => self.fast_hz *= slower,
                "band_hz" => self.band_hz *= slower,
                "ramp_s" => self.ramp_s /= slower,
                _ => {
                    self.slow_hz *= slower;
                    self.duration_s /= if free("duration_s") { slower } else { 1.0 };
                }
            }
        }
        self
    }

    /// [`for_test`](Self::for_test) within the slope of the limits, and slower also where it is the slope that says how fast the drive is.
    #[must_use]
    pub fn for_test_within_slew(self, limits: &Limits, free: &dyn Fn(&str) -> bool) -> Self {
        let gentler = Limits { slew_v_per_s: limits.slew_v_per_s.map(|v_per_s| TEST_SLEW * v_per_s), ..*limits };
        self.for_test().within_slew(&gentler, free)
    }

    /// The segments. Of the time without rests the stairs take two fifths and the decaying sine a fifth.
    ///
    /// # Errors
    /// When a field is out of its range.
    pub fn shapes(&self) -> Result<Vec<Shape>, ExciteError> {
        require("rest_s", self.rest_s, (0.0..=1e6).contains(&self.rest_s), "between 0 and 1e6")?;
        positive("slow_hz", self.slow_hz)?;
        for (field, hz) in [("fast_hz", self.fast_hz), ("band_hz", self.band_hz)] {
            require(field, hz, hz.is_finite() && hz > self.slow_hz, "above slow_hz")?;
        }
        require("hold_s", self.hold_s, self.hold_s.is_finite() && self.hold_s >= 0.0, "a number from 0 up")?;
        positive("ramp_s", self.ramp_s)?;
        let active = self.duration_s - 5.0 * self.rest_s;
        // The decaying sine needs three of its periods, of which it takes two a slow one.
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

    /// Makes the drive.
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
