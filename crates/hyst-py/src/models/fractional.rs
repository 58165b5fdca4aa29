//! Fractional-order models, with full or short memory.

use hyst_core::{Build, Error, Exponentials, GlOrder, IfmParams, LfdmParams, Sampling, ShortMemory};

use crate::inversion::closed;
use crate::keep::{Keep, Kept};
use crate::model_macro::models;
use hyst_core::Either;
use hyst_ident::model::capacity::DELAY;

/// Full memory of a fractional model, with an error of 3e-7.
type Full = Exponentials<f64, 40>;
/// Capacity of a short memory \[samples\].
const MAX_MEMORY: usize = 4096;
type Short = ShortMemory<f64, MAX_MEMORY>;

/// Parameters of a fractional model, and the length of its short memory; `None` for the full memory.
struct WithMemory<P> {
    params: P,
    samples: Option<usize>,
}

/// A model with a short memory that can be shortened.
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

impl<P, A, B: Cut> Build<Either<A, B>> for WithMemory<P>
where
    P: Build<A, Context = Sampling> + Build<B, Context = Sampling>,
{
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<Either<A, B>, Error> {
        let short = |samples| Ok(Either::Second(Build::<B>::build(&self.params, cx)?.cut_to(samples)));
        match self.samples {
            None => Ok(Either::First(self.params.build(cx)?)),
            Some(samples @ 1..=MAX_MEMORY) => short(samples),
            Some(_) => {
                Err(Error::OutOfRange { name: "memory", must: "from 1 to 4096 samples, or None for the full memory" })
            }
        }
    }
}

impl<P: Keep> Keep for WithMemory<P> {
    fn keep(&self) -> Result<Kept, &'static str> {
        match self.samples {
            None => self.params.keep(),
            Some(_) => Err("model files only support the full memory; leave out memory="),
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
    /// Linear fractional-order differential model ``(1 + c·s^beta) X = (a + b·s^alpha) U``, with full memory (error
    /// 3e-7) or short memory.
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
        /// Length of the short memory of the paper [samples], at most 4096. By default full memory, as 40 exponentials.
        memory: Option<usize> = None,
    }
    params: |p| Ok(WithMemory {
        params: LfdmParams { a: p.a, b: p.b, c: p.c, alpha: p.alpha, beta: p.beta, order: order_of(p.order)? },
        samples: p.memory,
    }),
    stage: Either<hyst_core::Lfdm<f64, Full>, hyst_core::Lfdm<f64, Short>>,
    period: |p| p.period,
    inverse: closed,
    needs: [],

    /// Improved fractional-order model ``X = delta·U + (a + b·s^alpha)/(1 + c·s^beta)·(e^(−tau·s) − 1)·U``, with full
    /// memory (error 3e-7) or short memory.
    ///
    /// The inverse solves the recursion. It exists if the sampled model has no zero outside the unit circle.
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
        /// Length of the short memory of the paper [samples], at most 4096. By default full memory, as 40 exponentials.
        memory: Option<usize> = None,
    }
    params: |p| Ok(WithMemory {
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
