//! The traits of a stage and of its parameters.

use crate::{Error, Real};

/// Returns the last finite value: `x` if it is finite, else the held value. One non-finite sample (sensor dropout) must
/// not stay in a history.
#[inline]
pub(crate) fn hold<T: Real>(held: &mut T, x: T) -> T {
    if x.is_finite() {
        *held = x;
    }
    *held
}

/// Returns the input of the rest state: `x`, or zero if `x` is not finite. Also holds it.
#[inline]
pub(crate) fn rest<T: Real>(held: &mut T, x: T) -> T {
    *held = finite_or(x, T::ZERO);
    *held
}

/// Returns `x`, or the value before it if `x` is not finite.
#[inline]
pub(crate) fn finite_or<T: Real>(x: T, before: T) -> T {
    if x.is_finite() { x } else { before }
}

/// Measured environment at one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Env<T> {
    /// Time \[s\].
    pub time: T,
    /// Temperature \[°C\].
    pub temperature: T,
    /// External load \[N\].
    pub load: T,
}

/// One block of a signal chain: coefficients that map an input sample and a history to an output.
///
/// The input is linear between two samples (first-order hold). A stage that is a differential equation is solved
/// exactly for such a drive, at any sample period.
///
/// `step` never allocates, never panics and does bounded work.
pub trait Stage<T: Real> {
    /// The history.
    type State: Clone;

    /// Returns a history. Pass it to [`reset`](Self::reset) before the first step.
    fn state(&self) -> Self::State;

    /// Sets the history to rest at the input `u0` and returns the output there.
    ///
    /// Linear stages are settled at `u0`. Memory operators start from virgin memory and then get `u0`. A non-finite
    /// input counts as zero.
    fn reset(&self, state: &mut Self::State, env: &Env<T>, u0: T) -> T;

    /// Returns the output one sample period later, at input `u`. A stage with a history replaces a non-finite input by
    /// the last finite one. A stage without a history returns the result of its equation.
    fn step(&self, state: &mut Self::State, env: &Env<T>, u: T) -> T;

    /// Calls [`step`](Self::step) for each sample of the slices. Stops at the end of the shortest.
    fn block(&self, state: &mut Self::State, env: &[Env<T>], u: &[T], y: &mut [T]) {
        for ((y, u), e) in y.iter_mut().zip(u).zip(env) {
            *y = self.step(state, e, *u);
        }
    }
}

/// A stage whose inverse is a stage.
///
/// Memory operators have causal inverses, most of them in closed form. Models with their own dynamics (a circuit, a
/// derivative) have inverses that need the reference of the next [`lead`](Self::lead) samples. The dynamic stages of a
/// chain (lag, delay, resonance) do not implement this trait; [`Preview`](crate::Preview) inverts them in a band.
pub trait Invert<T: Real>: Stage<T> {
    /// The inverse operator.
    type Inverse: Stage<T>;
    /// Builds the inverse: `self ∘ inverse` is the identity on every input that the inverse accepts, exactly or within
    /// the stated error.
    ///
    /// # Errors
    /// [`Error::NotInvertible`] if there is no inverse.
    fn invert(&self) -> Result<Self::Inverse, Error>;

    /// Returns the number of preview samples that an inverse needs: its `step` takes the reference (and environment) of
    /// time k + lead and returns the drive of time k.
    fn lead(_inverse: &Self::Inverse) -> usize {
        0
    }

    /// Returns the band in which an inverse is valid \[Hz\], and its largest relative error there; `None` if it is
    /// valid at all frequencies.
    fn band(_inverse: &Self::Inverse) -> Option<(f64, f64)> {
        None
    }
}

/// A stage that can compute its next output for a trial input without a change of its history.
/// [`Search`](crate::Search) uses this to invert a stage that has no closed-form inverse.
pub trait Probe<T: Real>: Stage<T> {
    /// Returns the output that [`step`](Stage::step) would return.
    fn probe(&self, state: &Self::State, env: &Env<T>, u: T) -> T;
}

/// The sample period for which coefficients are built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Sample period \[s\].
    pub period: f64,
}

impl Sampling {
    /// Returns the period if it is positive.
    pub(crate) fn checked(&self) -> Result<f64, Error> {
        crate::error::within("sample period", self.period, self.period > 0.0, "positive")
    }
}

/// Parameters from which coefficients `C` are built. There is no other constructor, so existing coefficients are valid.
///
/// All arithmetic is `f64`, even for `f32` coefficients: it runs once, and `f32` cannot resolve a slow pole.
pub trait Build<C> {
    /// Further data on which the coefficients depend.
    type Context;
    /// Checks every parameter and computes the coefficients.
    ///
    /// # Errors
    /// Names the first parameter that is not finite, out of range, or a list that is too long.
    fn build(&self, context: &Self::Context) -> Result<C, Error>;
}

/// Description of one parameter for an optimiser, a report or a form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meta {
    /// Path within its stage, as in the files: `gain`, `slip.widths`. All elements of a list have the path of the list.
    pub name: &'static str,
    /// Unit: `u` is the unit of the input, `y` that of the output, the empty string a ratio: `y/u`, `u s`, `1/K`.
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
