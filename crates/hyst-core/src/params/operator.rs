//! The parameters of any operator.

use super::Kind;
use crate::{
    ActivationKind, ActivationParams, BoucWenOscillatorParams, BoucWenParams, DpmParams, GpiParams, IfmParams,
    LfdmParams, MaxwellSlipParams, Meta, Params, PiParams, PreisachParams, TdEmParams, TdPiParams, ViscousPiParams,
};

/// The parameters of one operator. `L` is any list of numbers: a vector on a host, an array or a fixed-capacity list in
/// firmware.
///
/// The order of the variants is part of the block format: add new variants at the end.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum OperatorParams<L> {
    /// Prandtl-Ishlinskii.
    Pi(PiParams<L>),
    /// Prandtl-Ishlinskii with viscous plays.
    ViscousPi(ViscousPiParams<L>),
    /// Generalised Prandtl-Ishlinskii.
    Gpi(GpiParams<L>),
    /// Temperature-dependent Prandtl-Ishlinskii.
    TdPi(TdPiParams),
    /// Maxwell-slip elements.
    MaxwellSlip(MaxwellSlipParams<L>),
    /// Temperature-dependent electromechanical model.
    TdEm(TdEmParams<L>),
    /// Classical Preisach.
    Preisach(PreisachParams<L>),
    /// Linear fractional-order differential model.
    Lfdm(LfdmParams),
    /// Improved fractional-order model.
    Ifm(IfmParams),
    /// Dynamic Preisach.
    Dpm(DpmParams<L>),
    /// Bouc-Wen, static. The forms of both papers are converted to this one.
    BoucWen(BoucWenParams),
    /// An oscillator with a Bouc-Wen element.
    BoucWenOscillator(BoucWenOscillatorParams),
    /// Activation function atan.
    Atan(ActivationParams),
    /// Activation function sigmoid.
    Sigmoid(ActivationParams),
    /// Activation function softplus.
    Softplus(ActivationParams),
    /// Activation function softsign.
    Softsign(ActivationParams),
    /// Activation function tanh.
    Tanh(ActivationParams),
}

impl<L> OperatorParams<L> {
    /// Returns the kind of the model.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Pi(_) | Self::ViscousPi(_) => Kind::Pi,
            Self::Gpi(_) => Kind::Gpi,
            Self::TdPi(_) => Kind::TdPi,
            Self::MaxwellSlip(_) => Kind::MaxwellSlip,
            Self::TdEm(_) => Kind::TdEm,
            Self::Preisach(_) => Kind::Preisach,
            Self::Lfdm(_) => Kind::Lfdm,
            Self::Ifm(_) => Kind::Ifm,
            Self::Dpm(_) => Kind::Dpm,
            Self::BoucWen(_) => Kind::BoucWen,
            Self::BoucWenOscillator(_) => Kind::BoucWenOscillator,
            Self::Atan(_) => Kind::Atan,
            Self::Sigmoid(_) => Kind::Sigmoid,
            Self::Softplus(_) => Kind::Softplus,
            Self::Softsign(_) => Kind::Softsign,
            Self::Tanh(_) => Kind::Tanh,
        }
    }
}

impl<L> OperatorParams<L> {
    /// Returns the parameters of an activation-function model; `None` for other models.
    pub fn activation(&self) -> Option<(ActivationKind, ActivationParams)> {
        match self {
            Self::Atan(p) => Some((ActivationKind::Atan, *p)),
            Self::Sigmoid(p) => Some((ActivationKind::Sigmoid, *p)),
            Self::Softplus(p) => Some((ActivationKind::Softplus, *p)),
            Self::Softsign(p) => Some((ActivationKind::Softsign, *p)),
            Self::Tanh(p) => Some((ActivationKind::Tanh, *p)),
            _ => None,
        }
    }
}

impl<L: AsMut<[f64]>> Params for OperatorParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        match self {
            Self::Pi(p) => p.visit(f),
            Self::ViscousPi(p) => p.visit(f),
            Self::Gpi(p) => p.visit(f),
            Self::TdPi(p) => p.visit(f),
            Self::MaxwellSlip(p) => p.visit(f),
            Self::TdEm(p) => p.visit(f),
            Self::Preisach(p) => p.visit(f),
            Self::Lfdm(p) => p.visit(f),
            Self::Ifm(p) => p.visit(f),
            Self::Dpm(p) => p.visit(f),
            Self::BoucWen(p) => p.visit(f),
            Self::BoucWenOscillator(p) => p.visit(f),
            Self::Atan(p) | Self::Sigmoid(p) | Self::Softplus(p) | Self::Softsign(p) | Self::Tanh(p) => p.visit(f),
        }
    }
}
