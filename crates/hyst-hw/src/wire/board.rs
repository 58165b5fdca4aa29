//! The amplifier and the sensors of a device.

/// Sensor readings.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Shown {
    /// The output, in the device's unit.
    pub output: f32,
    /// Temperature \[°C\]; 0 without a sensor.
    pub temperature_degc: f32,
    /// Load \[N\]; 0 without a sensor.
    pub load_n: f32,
}

/// The amplifier and the sensors.
pub trait Board {
    /// Reads the sensors.
    fn measure(&mut self) -> Shown;
    /// Sets the output voltage \[V\].
    fn put_out(&mut self, volts: f32);
}
