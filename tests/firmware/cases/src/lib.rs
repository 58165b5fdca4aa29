//! All models of the core on the same samples: on the host and in firmware, in `f32` and `f64`.
//!
//! A [`Case`] is pure arithmetic, without clock, file or random device. So a difference in one bit between two machines
//! is a difference in their arithmetic. [`run`] computes the outputs, [`Fingerprint`] a hash of their bits.
#![no_std]
#![forbid(unsafe_code)]

pub mod list;
mod models;
mod samples;

use core::hint::black_box;
use hyst_core::{Env, Error, Real, Stage};
pub use models::{Limiter, Steady};
pub use samples::{PERIOD, SAMPLES, Sample, samples};

/// A model with its parameters and the range of its input.
pub trait Case {
    /// Name of the model: `pi_10`, `pi_10_inverse`, …
    const NAME: &'static str;
    /// Lowest and highest input.
    const INPUT: [f64; 2];
    /// The coefficients in precision `T`.
    type Model<T: Real>: Stage<T>;

    /// Builds the coefficients.
    ///
    /// # Errors
    /// If the parameters are invalid. The tests build all cases.
    fn build<T: Real>() -> Result<Self::Model<T>, Error>;
}

/// The history of case `C` in precision `T`.
pub type State<C, T> = <<C as Case>::Model<T> as Stage<T>>::State;

/// A visitor of all cases in all precisions.
pub trait Visit {
    /// Called once for each case and precision, always in the same order.
    fn visit<C: Case, T: Precision>(&mut self);
}

/// Visits all cases, each in `f32` and then in `f64`.
pub fn each(visitor: &mut impl Visit) {
    list::each(visitor);
}

/// A number type with a name and access to its bits.
pub trait Precision: Real {
    /// `f32` or `f64`.
    const NAME: &'static str;
    /// Returns the bits of the number; the lower 32 bits for `f32`.
    fn bits(self) -> u64;
}

impl Precision for f32 {
    const NAME: &'static str = "f32";
    fn bits(self) -> u64 {
        u64::from(self.to_bits())
    }
}

impl Precision for f64 {
    const NAME: &'static str = "f64";
    fn bits(self) -> u64 {
        self.to_bits()
    }
}

/// 64-bit FNV-1a hash of the bits of numbers, low byte first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint(pub u64);

impl Default for Fingerprint {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fingerprint {
    /// Adds a number.
    pub fn add<T: Precision>(&mut self, x: T) {
        for byte in x.bits().to_le_bytes().iter().take(size_of::<T>()) {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    /// Returns the fingerprint of a run.
    pub fn of<T: Precision>(numbers: &[T]) -> Self {
        let mut hash = Self::default();
        numbers.iter().for_each(|x| hash.add(*x));
        hash
    }
}

/// Computes input and environment of case `C`.
///
/// The samples are the same for all cases, scaled to the range of the input.
pub fn inputs<C: Case, T: Real>(u: &mut [T; SAMPLES], env: &mut [Env<T>; SAMPLES]) {
    let [low, high] = C::INPUT;
    for ((u, env), s) in u.iter_mut().zip(env).zip(samples()) {
        *u = T::from_f64(low + (high - low) * s.drive);
        *env = Env { time: T::from_f64(s.time), temperature: T::from_f64(s.temperature), load: T::from_f64(s.load) };
    }
}

/// Computes all outputs of case `C`: a reset at the first sample, then one step per sample.
///
/// # Errors
/// The errors of [`Case::build`].
pub fn run<C: Case, T: Real>() -> Result<[T; SAMPLES], Error> {
    let (mut u, mut env, mut y) = ([T::ZERO; SAMPLES], [Env::default(); SAMPLES], [T::ZERO; SAMPLES]);
    inputs::<C, T>(&mut u, &mut env);
    let model = C::build::<T>()?;
    let mut state = model.state();
    let mut rows = y.iter_mut().zip(&u).zip(&env);
    if let Some(((y, u), e)) = rows.next() {
        *y = model.reset(&mut state, e, *u);
    }
    for ((y, u), e) in rows {
        *y = model.step(&mut state, e, *u);
    }
    Ok(y)
}

/// Hides a value from the optimiser, because on a device parameters also come from outside.
pub fn given<X>(value: X) -> X {
    black_box(value)
}
