//! The actuator that the reference firmware simulates on its board: instead of it, a real board has a converter out and converters in.
//!
//! Dry friction as Dahl described it (1968), which none of the models that follow references here is, behind a gain; then a lag.
//! Products and sums of `f32` only, in one order: a host gets the same bits.
#![no_std]

use hyst_hw::wire::{Board, Device, Follower, Identity, Shown, Unit};

/// Periods of the clock in a second \[Hz\]: the board has one rate.
pub const RATE_HZ: f32 = 500.0;
/// Range of the amplifier \[V\].
pub const RANGE_V: [f32; 2] = [0.0, 120.0];
/// Voltage at rest \[V\].
pub const REST_V: f32 = 0.0;
/// Steepest slope of the amplifier \[V/s\].
pub const SLEW_V_PER_S: f32 = 20_000.0;

/// Motion without friction \[µm/V\].
const GAIN: f32 = 0.18;
/// Most that friction takes of it \[µm\].
const FRICTION: f32 = 1.8;
/// Way in which friction builds up \[V\].
const WAY: f32 = 14.0;
/// Lag of the amplifier \[s\].
const LAG: f32 = 0.003;
/// Steps of the integration in a period.
const STEPS: u8 = 16;

/// Room of the device: drives and samples, bytes of a model.
pub type Servo = Device<Follower, 512, 4096>;

/// The device of the reference firmware.
pub fn servo() -> Servo {
    let mut name = heapless::Vec::new();
    // As long as it has room.
    let _ = name.extend_from_slice(b"hyst servo, simulated actuator");
    let identity = Identity {
        name,
        min_v: RANGE_V[0],
        max_v: RANGE_V[1],
        rest_v: REST_V,
        max_slew_v_per_s: SLEW_V_PER_S,
        min_rate_hz: RATE_HZ,
        max_rate_hz: RATE_HZ,
        output: Unit::Micrometre,
        temperature: false,
        load: false,
        follows: true,
        queue: 0,
        model: 0,
    };
    Device::new(identity, Follower::new())
}

/// Amplifier, actuator and sensor.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OnBoard {
    /// Put out by the converter \[V\].
    volts: f32,
    /// At the actuator \[V\].
    drive: f32,
    /// Share of the friction that acts, −1 to 1.
    friction: f32,
}

impl Board for OnBoard {
    fn measure(&mut self) -> Shown {
        let step = 1.0 / (RATE_HZ * f32::from(STEPS));
        for _ in 0..STEPS {
            let change = (self.volts - self.drive) * (step / LAG);
            self.drive += change;
            let towards = if change < 0.0 { -1.0 } else { 1.0 };
            self.friction += change / WAY * (1.0 - towards * self.friction);
        }
        Shown { output: GAIN * self.drive - FRICTION * self.friction, temperature_degc: 0.0, load_n: 0.0 }
    }

    fn put_out(&mut self, volts: f32) {
        self.volts = volts;
    }
}
