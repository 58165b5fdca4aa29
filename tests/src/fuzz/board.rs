//! A board that checks the limits of its drive.

use hyst_hw::wire::{Board, Identity, Shown, Unit};

/// Limits of the devices in these tests.
pub(super) const RANGE_V: [f32; 2] = [-10.0, 100.0];
pub(super) const SLEW_V_PER_S: f32 = 50_000.0;
pub(super) const RATES_HZ: [f32; 2] = [1.0, 10_000.0];

/// Its output is a fifth of its drive. Panics if a drive is outside the range or changes too fast.
#[derive(Debug)]
pub(super) struct CheckedBoard {
    pub(super) volts: f32,
    pub(super) low: f32,
    pub(super) high: f32,
    /// Largest permitted change of the drive in one period \[V\].
    pub(super) step: f32,
}

impl CheckedBoard {
    pub(super) fn new() -> Self {
        let [low, high] = RANGE_V;
        Self { volts: 0.0, low, high, step: 0.0 }
    }
}

impl Board for CheckedBoard {
    fn measure(&mut self) -> Shown {
        Shown { output: 0.2 * self.volts, temperature_degc: 20.0, load_n: 0.0 }
    }

    fn put_out(&mut self, volts: f32) {
        assert!((self.low..=self.high).contains(&volts), "{volts} V is outside {} to {} V", self.low, self.high);
        let change = (volts - self.volts).abs();
        assert!(change <= self.step * 1.0001 + 1e-4, "step of {change} V, at most {} V are permitted", self.step);
        self.volts = volts;
    }
}

pub(super) fn identity(follows: bool) -> Identity {
    Identity {
        name: b"watched".iter().copied().collect(),
        min_v: RANGE_V[0],
        max_v: RANGE_V[1],
        rest_v: 0.0,
        max_slew_v_per_s: SLEW_V_PER_S,
        min_rate_hz: RATES_HZ[0],
        max_rate_hz: RATES_HZ[1],
        output: Unit::Micrometre,
        temperature: true,
        load: false,
        follows,
        queue: 0,
        model: 0,
    }
}
