//! Maxwell-slip banks and the electromechanical model: linear in the gains of their elements.

use hyst_core::{Build, Error, MaxwellSlip, MaxwellSlipParams, SlipReading, TdEm, TdEmParams};
use nalgebra::DMatrix;

use crate::Samples;
use crate::base::choice::{self, Bank, CANDIDATES};
use crate::identify::family::{largest_input, run, run_into};
use crate::identify::{Family, Linear, OtherParameter};
use crate::lsq;
use crate::model::Base;
use crate::model::capacity::PLAYS;
use crate::optimize::Variable;

fn gains(count: usize) -> Vec<Linear> {
    (0..count).map(|i| Linear::not_negative(&format!("gains[{i}]"))).collect()
}

/// A bank with widths chosen by the record.
pub(super) struct SlipFamily<'a> {
    samples: &'a Samples,
    widths: Vec<f64>,
    /// Whether the record chose the widths.
    chosen: bool,
    reading: SlipReading,
}

impl<'a> SlipFamily<'a> {
    /// Builds a bank with at most this many elements. If the record chooses none, the widths are even over the input
    /// range.
    pub(super) fn new(samples: &'a Samples, elements: usize, reading: SlipReading) -> Self {
        let elements = elements.clamp(1, PLAYS);
        let element = |width: &f64| {
            let mut y = vec![0.0; samples.len()];
            let params = MaxwellSlipParams { reading, widths: [*width], gains: [1.0] };
            // An element of width zero has no output.
            let _ = run(samples, |_| Build::<MaxwellSlip<f64, 1>>::build(&params, &()), &mut y);
            y
        };
        let slipping = |widths: &[f64]| widths.iter().map(element).collect();
        let bank = |rows| Bank::new(samples, Vec::new(), even(samples, CANDIDATES, reading), &slipping, rows);
        let chosen = bank(choice::ROWS).at_most(elements).and_then(|widths| bank(lsq::ROWS).from(widths));
        let chosen = chosen.filter(|w| !w.is_empty());
        let is_chosen = chosen.is_some();
        let widths = chosen.unwrap_or_else(|| even(samples, elements, reading));
        Self { samples, widths, chosen: is_chosen, reading }
    }
}

/// Returns even widths over the input range. The first backlash has nearly no width and represents the part without
/// hysteresis; the first spring has a full width.
fn even(samples: &Samples, count: usize, reading: SlipReading) -> Vec<f64> {
    let (low, high) = samples.input_range();
    let first = if reading == SlipReading::Backlash { 1e-3 } else { 1.0 };
    (0..count).map(|i| (high - low) * (first + i as f64) / count as f64).collect()
}

impl Family for SlipFamily<'_> {
    fn variables(&self) -> Vec<Variable> {
        Vec::new()
    }

    fn linear(&self) -> Vec<Linear> {
        gains(self.widths.len())
    }

    fn columns(&self, _: &[f64], columns: &mut DMatrix<f64>) -> Result<(), Error> {
        for (i, d) in self.widths.iter().enumerate() {
            let params = MaxwellSlipParams { reading: self.reading, widths: [*d], gains: [1.0] };
            run_into(self.samples, |_| Build::<MaxwellSlip<f64, 1>>::build(&params, &()), columns, i)?;
        }
        Ok(())
    }

    fn base(&self, _: &[f64], linear: &[f64]) -> Base {
        Base::MaxwellSlip(MaxwellSlipParams {
            reading: self.reading,
            widths: self.widths.clone(),
            gains: linear.to_vec(),
        })
    }

    fn other_parameter(&self, name: &str) -> OtherParameter {
        if self.chosen && name.starts_with("widths") { OtherParameter::Chosen } else { OtherParameter::Given }
    }

    /// Gains are parts of one curve; the scale of widths is their spacing.
    fn scale(&self, base: &Base, name: &str) -> Option<f64> {
        let (low, high) = self.samples.input_range();
        match base {
            Base::MaxwellSlip(p) if name.starts_with("gains") => Some(p.gains.iter().sum()),
            Base::MaxwellSlip(p) => Some((high - low) / p.widths.len() as f64),
            _ => None,
        }
    }
}

/// The electromechanical model. The first width d₁ (the others are its multiples, as published) and the temperature
/// dependence of ψ are searched, the gains are solved for. C, R, m, k, b and ψ at the reference temperature are those
/// of the published tube: a displacement record determines only the products ψ R gᵢ.
pub(super) struct TdEmFamily<'a> {
    samples: &'a Samples,
    elements: usize,
    reference_degc: f64,
}

impl<'a> TdEmFamily<'a> {
    pub(super) fn new(samples: &'a Samples, elements: usize) -> Self {
        let reference_degc =
            samples.temperature.as_ref().map_or(23.0, |t| t.iter().sum::<f64>() / t.len().max(1) as f64);
        Self { samples, elements: elements.clamp(1, PLAYS), reference_degc }
    }

    fn varies(&self) -> bool {
        self.samples.temperature.as_ref().is_some_and(|t| {
            let (low, high) = crate::statistics::range(t.iter().copied());
            high - low > 0.5
        })
    }

    fn params(&self, values: &[f64], gains: Vec<f64>) -> TdEmParams<Vec<f64>> {
        let printed = TdEmParams::PRINTED;
        let [c0, c1, c2] = printed.coupling;
        let t0 = self.reference_degc;
        let psi = c0 + t0 * (c1 + t0 * c2);
        // ψ(T) = ψ(T₀) (1 + p (T − T₀) + q (T − T₀)²), as a polynomial in T.
        let (p, q) = (values.get(1).copied().unwrap_or(0.0), values.get(2).copied().unwrap_or(0.0));
        let coupling = [psi * (1.0 - p * t0 + q * t0 * t0), psi * (p - 2.0 * q * t0), psi * q];
        TdEmParams {
            slip: MaxwellSlipParams {
                reading: SlipReading::Backlash,
                widths: (1..=gains.len()).map(|i| values[0] * i as f64).collect(),
                gains,
            },
            capacitance: printed.capacitance,
            resistance: printed.resistance,
            mass: printed.mass,
            stiffness: printed.stiffness,
            damping: printed.damping,
            coupling,
            per_metre: printed.per_metre,
        }
    }
}

impl Family for TdEmFamily<'_> {
    fn variables(&self) -> Vec<Variable> {
        let u = largest_input(self.samples);
        let n = self.elements as f64;
        let mut list = vec![Variable::log("slip.widths[0]", "u", 0.02 * u / n, 2.0 * u / n)];
        if self.varies() {
            list.push(Variable::linear("relative slope of the coupling", "1/K", -0.05, 0.05));
            list.push(Variable::linear("relative bend of the coupling", "1/K^2", -0.005, 0.005));
        }
        list
    }

    fn linear(&self) -> Vec<Linear> {
        gains(self.elements)
    }

    fn columns(&self, values: &[f64], columns: &mut DMatrix<f64>) -> Result<(), Error> {
        for i in 0..self.elements {
            let mut p = self.params(values, Vec::new());
            p.slip.widths = vec![values[0] * (i as f64 + 1.0)];
            p.slip.gains = vec![1.0];
            run_into(self.samples, |sampling| Build::<TdEm<f64, 1>>::build(&p, sampling), columns, i)?;
        }
        Ok(())
    }

    fn base(&self, values: &[f64], linear: &[f64]) -> Base {
        Base::TdEm(self.params(values, linear.to_vec()))
    }

    /// The products ψ R gᵢ are known, but neither ψ nor a gain alone.
    fn other_parameter(&self, name: &str) -> OtherParameter {
        if name == "coupling[0]" { OtherParameter::Convention } else { OtherParameter::Given }
    }

    fn given(&self) -> Option<String> {
        let degc = self.reference_degc;
        Some(format!(
            "capacitance, resistance, mass, stiffness, damping and the coupling at {degc:.1} °C are those of the published tube"
        ))
    }

    fn scale(&self, base: &Base, name: &str) -> Option<f64> {
        match base {
            Base::TdEm(p) if name.starts_with("slip.gains") => Some(p.slip.gains.iter().sum()),
            _ => None,
        }
    }
}
