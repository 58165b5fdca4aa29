//! The simulated actuator of the reference firmware. A real board has converters instead.
//!
//! The actuator is a first-order lag, a gain and dry friction by Dahl (1968). No model that follows references here
//! contains this friction. It uses only products and sums of `f32` in a fixed order, so a host computes the same bits.
#![no_std]

use hyst_hw::wire::{Board, Device, Follower, Identity, Shown, Unit};

/// Sample rate \[Hz\]; the board has one rate.
pub const RATE_HZ: f32 = 500.0;
/// Range of the amplifier \[V\].
pub const RANGE_V: [f32; 2] = [0.0, 120.0];
/// Voltage at rest \[V\].
pub const REST_V: f32 = 0.0;
/// Slew limit of the amplifier \[V/s\].
pub const SLEW_V_PER_S: f32 = 20_000.0;

/// Gain without friction \[µm/V\].
const GAIN: f32 = 0.18;
/// Maximum reduction of the displacement by friction \[µm\].
const FRICTION: f32 = 1.8;
/// Change of the drive over which friction builds up \[V\].
const FRICTION_VOLTS: f32 = 14.0;
/// Time constant of the amplifier \[s\].
const LAG: f32 = 0.003;
/// Number of integration steps in a period.
const STEPS: u8 = 16;

/// The device, with its room for drives and samples and for bytes of a model.
pub type Servo = Device<Follower, 512, 4096>;

/// Returns the device of the reference firmware.
pub fn servo() -> Servo {
    let mut name = heapless::Vec::new();
    // The name fits.
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
    /// Output of the converter \[V\].
    volts: f32,
    /// Voltage at the actuator \[V\].
    drive: f32,
    /// Present friction as a share of its maximum, −1 to 1.
    friction: f32,
}

impl Board for OnBoard {
    fn measure(&mut self) -> Shown {
        let step = 1.0 / (RATE_HZ * f32::from(STEPS));
        for _ in 0..STEPS {
            let change = (self.volts - self.drive) * (step / LAG);
            self.drive += change;
            let towards = if change < 0.0 { -1.0 } else { 1.0 };
            self.friction += change / FRICTION_VOLTS * (1.0 - towards * self.friction);
        }
        Shown { output: GAIN * self.drive - FRICTION * self.friction, temperature_degc: 0.0, load_n: 0.0 }
    }

    fn put_out(&mut self, volts: f32) {
        self.volts = volts;
    }
}
