//! Fractional-order models, with all of their memory or a short one.

use hyst_core::{Build, Error, Exponentials, GlOrder, IfmParams, LfdmParams, Sampling, ShortMemory};

use crate::inversion::closed;
use crate::keep::{Keep, Kept};
use crate::model_macro::models;
use hyst_core::Either;
use hyst_ident::model::capacity::DELAY;

/// All of a fractional model's memory, to 3e-7.
type Full = Exponentials<f64, 40>;
/// Samples that a short memory holds.
const MEMORY: usize = 4096;
type Short = ShortMemory<f64, MEMORY>;

/// Parameters of a fractional model, and how many samples of its memory are kept; all of them if none is said.
struct Remembered<P> {
    params: P,
    samples: Option<usize>,
}

/// A model whose short memory can be cut to a length.
trait Cut {
    fn cut_to(self, samples: usize) -> Self;
}

impl Cut for hyst_core::Lfdm<f64, Short> {
    fn cut_to(self, samples: usize) -> Self {
        self.cut(samples)
    }
}

impl Cut for hyst_core::Ifm<f64, Short, DELAY> {
    fn cut_to(self, samples: usize) -> Self {
        self.cut(samples)
    }
}

impl<P, A, B: Cut> Build<Either<A, B>> for Remembered<P>
where
    P: Build<A, Context = Sampling> + Build<B, Context = Sampling>,
{
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<Either<A, B>, Error> {
        let short = |samples| Ok(Either::Second(Build::<B>::build(&self.params, cx)?.cut_to(samples)));
        match self.samples {
            None => Ok(Either::First(self.params.build(cx)?)),
            Some(samples @ 1..=MEMORY) => short(samples),
            Some(_) => Err(Error::OutOfRange { name: "memory", must: "from 1 to 4096 samples, or None for all of it" }),
        }
    }
}

impl<P: Keep> Keep for Remembered<P> {
    fn keep(&self) -> Result<Kept, &'static str> {
        match self.samples {
            None => self.params.keep(),
            Some(_) => Err("files hold models with all of their memory; leave memory= out"),
        }
    }
}

fn order_of(order: usize) -> Result<GlOrder, Error> {
    match order {
        1 => Ok(GlOrder::First),
        2 => Ok(GlOrder::Second),
        _ => Err(Error::OutOfRange { name: "order", must: "1 or 2" }),
    }
}

models! {
    /// Linear fractional-order differential model ``(1 + c·s^beta) X = (a + b·s^alpha) U``, all of its memory (to 3e-7) or a short
    /// one.
    ///
    /// Closed-form inverse.
    class Lfdm {
        /// Gain at rest [y/u].
        a: f64,
        /// Weight of the input's derivative.
        b: f64,
        /// Weight of the output's derivative.
        c: f64,
        /// Order of the input's derivative, 0 to 1.
        alpha: f64,
        /// Order of the output's derivative, 0 to 1.
        beta: f64,
        /// Sample period [s].
        period: f64,
        /// Order of accuracy of the sampled derivatives: 1 (the paper's) or 2.
        order: usize = 1,
        /// Samples of memory, at most 4096: the paper's short memory. All of it, as 40 exponentials, if not given.
        memory: Option<usize> = None,
    }
    params: |p| Ok(Remembered {
        params: LfdmParams { a: p.a, b: p.b, c: p.c, alpha: p.alpha, beta: p.beta, order: order_of(p.order)? },
        samples: p.memory,
    }),
    stage: Either<hyst_core::Lfdm<f64, Full>, hyst_core::Lfdm<f64, Short>>,
    period: |p| p.period,
    inverse: closed,
    needs: [],

    /// Improved fractional-order model ``X = delta·U + (a + b·s^alpha)/(1 + c·s^beta)·(e^(−tau·s) − 1)·U``, all of its memory
    /// (to 3e-7) or a short one.
    ///
    /// The inverse solves the recursion; it exists where the sampled model has no zero outside the unit circle.
    class Ifm {
        /// Gain of the hysteresis at rest [y/u].
        a: f64,
        /// Weight of the input's derivative.
        b: f64,
        /// Weight of the hysteresis' derivative.
        c: f64,
        /// Order of the input's derivative, 0 to 1.
        alpha: f64,
        /// Order of the hysteresis' derivative, 0 to 1.
        beta: f64,
        /// Time delay [s], at most 8190 periods.
        tau: f64,
        /// Gain of the linear part [y/u].
        delta: f64,
        /// Sample period [s].
        period: f64,
        /// Order of accuracy of the sampled derivatives: 1 (the paper's) or 2.
        order: usize = 1,
        /// Samples of memory, at most 4096: the paper's short memory. All of it, as 40 exponentials, if not given.
        memory: Option<usize> = None,
    }
    params: |p| Ok(Remembered {
        params: IfmParams {
            a: p.a,
            b: p.b,
            c: p.c,
            alpha: p.alpha,
            beta: p.beta,
            tau: p.tau,
            delta: p.delta,
            order: order_of(p.order)?,
        },
        samples: p.memory,
    }),
    stage: Either<hyst_core::Ifm<f64, Full, DELAY>, hyst_core::Ifm<f64, Short, DELAY>>,
    period: |p| p.period,
    inverse: closed,
    needs: [],
}
