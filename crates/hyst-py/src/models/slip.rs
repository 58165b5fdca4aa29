//! Maxwell-slip elements, and the electromechanical model with them.

use hyst_core::{Error, MaxwellSlipParams, SlipReading, TdEmParams};

use crate::arrays::List;
use crate::errors;
use crate::inversion::{Inverted, closed};
use crate::model_macro::models;
use hyst_ident::model::capacity::{PLAYS, TAPS};

/// Returns the parameters of a bank of elements.
fn bank(elasto_slip: bool, widths: &[f64], gains: &[f64]) -> MaxwellSlipParams<Vec<f64>> {
    let reading = if elasto_slip { SlipReading::ElastoSlip } else { SlipReading::Backlash };
    MaxwellSlipParams { reading, widths: widths.to_vec(), gains: gains.to_vec() }
}

models! {
    /// Bank of Maxwell-slip elements, ``y = Σ gains[i]·element(u, widths[i])``.
    ///
    /// An element is a backlash of that total width. The inverse is exact; its drive jumps at each reversal of the
    /// reference. With ``elasto_slip`` an element is a spring that slips at that deflection: such a bank saturates and
    /// has no inverse.
    class MaxwellSlip {
        /// Widths [u], positive and strictly rising, shape (n,), n ≤ 64.
        widths: List,
        /// Gains [y/u], shape (n,).
        gains: List,
        /// Whether an element is a spring that slips at that deflection; otherwise a backlash of that total width.
        elasto_slip: bool = false,
    }
    params: |p| Ok(bank(p.elasto_slip, &p.widths, &p.gains)),
    stage: hyst_core::MaxwellSlip<f64, PLAYS>,
    inverse: closed,
    needs: [],

    /// Temperature-dependent electromechanical model: the current of a Maxwell-slip bank charges C ∥ R. The voltage
    /// drives a mass on a spring through the coupling ``ψ(T)``. Needs ``temperature`` [°C].
    ///
    /// ``per_metre`` sets the unit of the output, by default µm; ``save`` must state the same unit. The linear part is
    /// exact for a current that is linear between samples. Inverse: band-limited with preview, then exact.
    class TdEm {
        /// Widths of the slip elements [u], shape (n,), n ≤ 64.
        widths: List,
        /// Gains of the slip elements [A/u], shape (n,).
        gains: List,
        /// Capacitance [F].
        capacitance: f64,
        /// Resistance [Ω].
        resistance: f64,
        /// Mass [kg].
        mass: f64,
        /// Stiffness [N/m].
        stiffness: f64,
        /// Damping [N s/m].
        damping: f64,
        /// Coefficients of ``ψ(T) = psi[0] + psi[1]·T + psi[2]·T²`` [N/V, T in °C], shape (3,).
        psi: List,
        /// Sample period [s].
        period: f64,
        /// Whether an element is a spring that slips; otherwise a backlash, which agrees with the numbers of the paper.
        elasto_slip: bool = false,
        /// Output units per metre: 1e6 for µm, 1e9 for nm, 1e3 for mm, 1 for m (not supported by files).
        per_metre: f64 = 1e6,
        /// Temperature for which the filter of the inverse is designed [°C]. Its gain follows the given temperature.
        filter_degc: f64 = 23.0,
    }
    params: |p| {
        let coupling = <[f64; 3]>::try_from(&*p.psi)
            .map_err(|_| Error::OutOfRange { name: "td-em.psi", must: "three coefficients" })?;
        Ok(TdEmParams {
            slip: bank(p.elasto_slip, &p.widths, &p.gains),
            capacitance: p.capacitance,
            resistance: p.resistance,
            mass: p.mass,
            stiffness: p.stiffness,
            damping: p.damping,
            coupling,
            per_metre: p.per_metre,
        })
    },
    stage: hyst_core::TdEm<f64, PLAYS>,
    period: |p| p.period,
    inverse: |built, options| {
        options.only(&["bandwidth_hz"])?;
        let inverse =
            built.stage.band_limited::<TAPS>(built.given.filter_degc, options.bandwidth_hz).map_err(errors::core)?;
        let (lead, band) = (inverse.lead(), (inverse.bandwidth_hz(), inverse.error()));
        Ok(Inverted::in_band(inverse, lead, Some(band)))
    },
    needs: [temperature],
}
