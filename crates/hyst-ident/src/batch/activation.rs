//! Activation-function candidates, processed together.

use hyst_core::ActivationKind;

use super::{Kernel, Lanes, Row};

/// Kernel of `z = k₀ u + α u̇ + β f(γ u)`; parameters k₀, α, β, γ, as [`hyst_core::Activation`].
#[derive(Clone, Copy, Debug)]
pub struct ActivationKernel {
    /// The activation function f.
    pub kind: ActivationKind,
}

impl Kernel for ActivationKernel {
    type Coefficients = [Lanes; 4];
    type State = ();

    fn parameters(&self) -> usize {
        4
    }

    #[inline(always)]
    fn coefficients(&self, p: &[Lanes]) -> [Lanes; 4] {
        [p[0], p[1], p[2], p[3]]
    }

    #[inline(always)]
    fn state(&self) {}

    #[inline(always)]
    fn step(&self, [k0, alpha, beta, gamma]: &[Lanes; 4], (): &mut (), row: &Row) -> Lanes {
        let bent = (*gamma * row.input).map(|x| self.kind.value(x));
        *k0 * row.input + *beta * bent + *alpha * row.rate
    }
}
