//! The traits of a stage, and how parameters become coefficients.

use crate::{Error, Real};

/// The last finite value: `x` if it is finite, else what was held. One sample that is no number (a sensor that
/// drops out) must not stay in a history for ever.
#[inline]
pub(crate) fn hold<T: Real>(held: &mut T, x: T) -> T {
    if x.is_finite() {
        *held = x;
    }
    *held
}

/// The input to rest at: `x`, or zero if `x` is no finite number.
#[inline]
pub(crate) fn rest<T: Real>(held: &mut T, x: T) -> T {
    *held = finite_or(x, T::ZERO);
    *held
}

/// `x`, or what came before it if `x` is no finite number.
#[inline]
pub(crate) fn finite_or<T: Real>(x: T, before: T) -> T {
    if x.is_finite() { x } else { before }
}

/// Measured surroundings at one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Env<T> {
    /// The lab's clock \[s\].
    pub time: T,
    /// Temperature \[°C\].
    pub temperature: T,
    /// External load \[N\].
    pub load: T,
}

/// One block of a signal chain: coefficients that map an input sample and a history to an output.
///
/// Between two samples the input is taken as linear (first-order hold), so a stage that is a
/// differential equation is solved exactly for such a drive, whatever the sample period.
///
/// `step` never allocates, never panics and does bounded work.
pub trait Stage<T: Real> {
    /// The history.
    type State: Clone;

    /// A history to be given to [`reset`](Self::reset) before the first step.
    fn state(&self) -> Self::State;

    /// Sets the history to rest at the input `u0` and returns the output there.
    ///
    /// Linear stages are settled at `u0`. Memory operators start from virgin memory and then see
    /// `u0`. An input that is no finite number counts as zero.
    fn reset(&self, state: &mut Self::State, env: &Env<T>, u0: T) -> T;

    /// The output one sample period later, at input `u`. A stage with a history takes an input that is no finite number
    /// for the last one again; one without returns what its equation gives.
    fn step(&self, state: &mut Self::State, env: &Env<T>, u: T) -> T;

    /// [`step`](Self::step) over slices; stops at the shortest of the three.
    fn block(&self, state: &mut Self::State, env: &[Env<T>], u: &[T], y: &mut [T]) {
        for ((y, u), e) in y.iter_mut().zip(u).zip(env) {
            *y = self.step(state, e, *u);
        }
    }
}

/// A stage whose inverse is a stage.
///
/// Memory operators have causal inverses, most of them in closed form. Models with dynamics of their own (a circuit, a derivative) have inverses that
/// need the reference of the next [`lead`](Self::lead) samples. The dynamic stages of a chain (lag, delay, resonance) do not implement
/// this; [`Preview`](crate::Preview) inverts them in a band.
pub trait Invert<T: Real>: Stage<T> {
    /// The inverse operator.
    type Inverse: Stage<T>;
    /// Builds the inverse: `self ∘ inverse` is the identity on every input the inverse accepts, exactly or within what the
    /// inverse states.
    ///
    /// # Errors
    /// [`Error::NotInvertible`] if there is none.
    fn invert(&self) -> Result<Self::Inverse, Error>;

    /// Samples of preview that an inverse needs: its `step` takes the reference (and surroundings) of time k + lead and returns
    /// the drive of time k.
    fn lead(_inverse: &Self::Inverse) -> usize {
        0
    }

    /// Band in which an inverse holds \[Hz\], and its largest relative error there; `None` if it holds at all frequencies.
    fn band(_inverse: &Self::Inverse) -> Option<(f64, f64)> {
        None
    }
}

/// A stage that can tell its next output for a trial input without moving its history. What has no closed-form inverse
/// is inverted through this ([`Search`](crate::Search)).
pub trait Probe<T: Real>: Stage<T> {
    /// What [`step`](Stage::step) would return.
    fn probe(&self, state: &Self::State, env: &Env<T>, u: T) -> T;
}

/// The sample period that coefficients are built for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Sample period \[s\].
    pub period: f64,
}

impl Sampling {
    /// The period, if it is a positive number.
    pub(crate) fn checked(&self) -> Result<f64, Error> {
        crate::error::within("sample period", self.period, self.period > 0.0, "positive")
    }
}

/// Parameters that become coefficients `C`. The only way to coefficients, so what exists is valid.
///
/// All arithmetic is `f64` even for `f32` coefficients: it runs once, and a slow pole is lost in
/// `f32`.
pub trait Build<C> {
    /// What the coefficients depend on besides the parameters.
    type Context;
    /// Checks every parameter and computes the coefficients.
    ///
    /// # Errors
    /// Names the first parameter that is not finite, out of range or too many.
    fn build(&self, context: &Self::Context) -> Result<C, Error>;
}

/// What an optimiser, a report or a form has to know of one parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meta {
    /// Path within its stage, as the files have it: `gain`, `slip.widths`. All elements of a list have the list's.
    pub name: &'static str,
    /// Unit; `u` stands for the input's unit, `y` for the output's, the empty string for a ratio: `y/u`, `u s`, `1/K`.
    pub unit: &'static str,
    /// Smallest physically sensible value.
    pub lower: f64,
    /// Largest physically sensible value.
    pub upper: f64,
}

/// Parameters as a flat list with names, units and bounds.
pub trait Params {
    /// Calls `f` for every parameter, always in the same order.
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64));
}
