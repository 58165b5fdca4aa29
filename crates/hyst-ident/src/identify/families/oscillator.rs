//! The Bouc-Wen oscillator: linear only in a scale of the output; its static response sets the scales.

use hyst_core::{BoucWenOscillator, BoucWenOscillatorParams, Build, Error};
use nalgebra::DMatrix;

use crate::drive::{Drive, Passes};
use crate::identify::family::rows_of;
use crate::identify::{Family, Linear};
use crate::model::Base;
use crate::optimize::Variable;
use crate::{BetweenSamples, Samples};

/// With y = Y ỹ the equation keeps its form for any Y. Y is the one linear parameter, so mass, damping and stiffness
/// are searched relative to the static stiffness. The output depends only on the products of β with γ and δ; β is
/// chosen so that γ and δ are of order one if the hysteretic force is as large as the largest input.
pub(super) struct OscillatorFamily<'a> {
    samples: &'a Samples,
    drive: Drive<'a>,
    between: BetweenSamples,
    /// Largest input \[u\].
    size: f64,
}

impl<'a> OscillatorFamily<'a> {
    pub(super) fn new(samples: &'a Samples, between: BetweenSamples, size: f64) -> Self {
        Self { samples, drive: Drive::new(samples, between, Passes::Once), between, size }
    }

    /// Builds the parameters from the frequency of small motions, the damping ratio, the share of the spring without
    /// memory, the two bending terms of the other spring, and ν.
    fn params(&self, values: &[f64], y: f64) -> BoucWenOscillatorParams {
        let [hz, zeta, share, out, back, nu] = [0, 1, 2, 3, 4, 5].map(|i| values.get(i).copied().unwrap_or(1.0));
        let omega = std::f64::consts::TAU * hz;
        // In units in which k + α = 1.
        let (stiffness, alpha) = (share, 1.0 - share);
        // dz/dy = α (1 − out |z/size|^ν) away from zero, α (1 + back |z/size|^ν) back to zero.
        let (gamma, delta) = (0.5 * (out + back), 0.5 * (out - back));
        BoucWenOscillatorParams {
            mass: 1.0 / (omega * omega) / y,
            damping: 2.0 * zeta / omega / y,
            stiffness: stiffness / y,
            alpha: alpha / y,
            beta: self.size.powf(-nu) * alpha / y,
            gamma,
            delta,
            nu,
        }
    }
}

impl Family for OscillatorFamily<'_> {
    fn variables(&self) -> Vec<Variable> {
        let nyquist = 0.5 / self.samples.period;
        let slowest = 2.0 / self.samples.longest_segment();
        vec![
            Variable::log("hz", "Hz", slowest.max(1e-3 * nyquist).min(0.1 * nyquist), 0.5 * nyquist),
            Variable::log("zeta", "", 1e-3, 1.0),
            Variable::linear("stiffness share", "", 0.05, 0.999),
            Variable::linear("bend out", "", -20.0, 20.0),
            Variable::linear("bend back", "", 0.0, 40.0),
            Variable::linear("nu", "", 1.0, 3.0),
        ]
    }

    fn linear(&self) -> Vec<Linear> {
        vec![Linear::not_negative("compliance")]
    }

    fn columns(&self, values: &[f64], columns: &mut DMatrix<f64>) -> Result<(), Error> {
        let params = self.params(values, 1.0);
        let model = self.drive.stages(|sampling| Build::<BoucWenOscillator<f64>>::build(&params, sampling))?;
        self.drive.run(&model, rows_of(columns, 0));
        Ok(())
    }

    fn base(&self, values: &[f64], linear: &[f64]) -> Base {
        Base::BoucWenOscillator(self.params(values, linear[0].max(f64::MIN_POSITIVE)))
    }

    fn between_samples(&self) -> BetweenSamples {
        self.between
    }

    /// β is a convention.
    fn identified(&self, name: &str) -> bool {
        name != "beta"
    }

    fn scale(&self, base: &Base, name: &str) -> Option<f64> {
        match (base, name) {
            (Base::BoucWenOscillator(p), "gamma" | "delta") => Some(p.gamma.abs() + p.delta.abs()),
            _ => None,
        }
    }
}
