//! Every model of the core over the same samples: on the host and in firmware, in `f32` and `f64`.
//!
//! What a [`Case`] computes is arithmetic alone (no clock, no file, no random device), so two machines that disagree in
//! one bit of one sample disagree in how they compute. [`run`] gives the bits, [`Fingerprint`] their fingerprint.
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
    /// Never, if the case is a sound one: the tests build all of them.
    fn build<T: Real>() -> Result<Self::Model<T>, Error>;
}

/// The history of case `C` in precision `T`.
pub type State<C, T> = <<C as Case>::Model<T> as Stage<T>>::State;

/// What is done with every case in every precision.
pub trait Visit {
    /// Called once for each case and precision, always in the same order.
    fn visit<C: Case, T: Precision>(&mut self);
}

/// Visits every case, in `f32` and then in `f64`.
pub fn each(visitor: &mut impl Visit) {
    list::each(visitor);
}

/// A number type with a name and bits.
pub trait Precision: Real {
    /// `f32` or `f64`.
    const NAME: &'static str;
    /// The bits of the number, in the low end for `f32`.
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

/// 64-bit FNV-1a over the bits of numbers, low byte first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint(pub u64);

impl Default for Fingerprint {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fingerprint {
    /// Takes in one more number.
    pub fn add<T: Precision>(&mut self, x: T) {
        for byte in x.bits().to_le_bytes().iter().take(size_of::<T>()) {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    /// The fingerprint of a run.
    pub fn of<T: Precision>(numbers: &[T]) -> Self {
        let mut hash = Self::default();
        numbers.iter().for_each(|x| hash.add(*x));
        hash
    }
}

/// Input and surroundings of case `C`: the same samples for all cases, scaled to the range of the input.
pub fn inputs<C: Case, T: Real>(u: &mut [T; SAMPLES], env: &mut [Env<T>; SAMPLES]) {
    let [low, high] = C::INPUT;
    for ((u, env), s) in u.iter_mut().zip(env).zip(samples()) {
        *u = T::from_f64(low + (high - low) * s.drive);
        *env = Env { time: T::from_f64(s.time), temperature: T::from_f64(s.temperature), load: T::from_f64(s.load) };
    }
}

/// All outputs of case `C`: at rest at the first sample, then step by step.
///
/// # Errors
/// As [`Case::build`].
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

/// A value that the optimiser must not look into: parameters come from outside, on a device as here.
pub fn given<X>(value: X) -> X {
    black_box(value)
}
