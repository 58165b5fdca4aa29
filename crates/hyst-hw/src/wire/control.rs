//! The interface of a controller on the device.

use super::board::Shown;

/// A controller that follows references: an inverse, a feedback, or both.
pub trait Control {
    /// Loads a model, a [block of `hyst-core`](https://docs.rs/hyst-core).
    ///
    /// Returns whether the controller can run it.
    fn load(&mut self, block: &[u8]) -> bool;
    /// Returns whether a model is loaded.
    fn ready(&self) -> bool;
    /// Prepares a run with this period \[s\] that begins at rest; returns whether it can follow references.
    ///
    /// All slow work is done here. With `force`, the external force is estimated in each period; the present force, at
    /// drive `volts`, counts as zero.
    fn prepare(&mut self, period: f32, shown: &Shown, volts: f32, force: bool) -> bool;
    /// Returns the external force \[N\] from the voltage of this period and the readings at its end.
    ///
    /// `None` without an observer.
    fn force(&mut self, volts: f32, shown: &Shown) -> Option<f32>;
    /// Begins at the first reference, from the present readings and voltage.
    fn begin(&mut self, reference: f32, shown: &Shown, volts: f32);
    /// Returns the drive for the reference \[V\], before the limits of the run.
    fn step(&mut self, reference: f32, shown: &Shown) -> f32;
    /// Reports the applied drive, after the limits of the run \[V\].
    fn applied(&mut self, volts: f32);
    /// Returns whether a limit keeps the output away from the reference.
    fn limited(&self) -> bool;
    /// Returns the reference for the next measured output.
    ///
    /// A controller with preview gets references before they are due.
    fn due(&self) -> Option<f32>;
}

/// No controller: the device only plays voltages.
#[derive(Debug, Clone, Copy, Default)]
pub struct Open;

impl Control for Open {
    fn load(&mut self, _: &[u8]) -> bool {
        false
    }
    fn ready(&self) -> bool {
        false
    }
    fn prepare(&mut self, _: f32, _: &Shown, _: f32, _: bool) -> bool {
        false
    }
    fn force(&mut self, _: f32, _: &Shown) -> Option<f32> {
        None
    }
    fn begin(&mut self, _: f32, _: &Shown, _: f32) {}
    fn step(&mut self, reference: f32, _: &Shown) -> f32 {
        reference
    }
    fn applied(&mut self, _: f32) {}
    fn limited(&self) -> bool {
        false
    }
    fn due(&self) -> Option<f32> {
        None
    }
}
