//! Converts the parameters of a class to those of a model file.

use hyst_core::{
    ActivationKind, ActivationParams, AsymmetryParams, BoucWenClassicParams, BoucWenOscillatorParams, BoucWenParams,
    CreepParams, DelayParams, DpmParams, DriftParams, GpiParams, IfmParams, InterferenceParams, LagParams, LfdmParams,
    LoadParams, MaxwellSlipParams, PiParams, PreisachParams, RateParams, ResonanceParams, SaturationParams, TdEmParams,
    TdPiParams, TemperatureParams, ViscousPiParams,
};
use hyst_ident::model::{Base, Effects};

/// Base model and effects of a model file.
pub(crate) struct Kept {
    pub(crate) base: Base,
    pub(crate) effects: Effects,
}

/// Parameters that a model file can contain.
pub(crate) trait Keep {
    /// Returns the parameters for a file, or the reason why a file cannot contain them.
    fn keep(&self) -> Result<Kept, &'static str>;
}

impl Kept {
    /// Returns a base model without effects.
    fn hysteresis(base: Base) -> Self {
        Self { base, effects: Effects::default() }
    }

    /// Returns effects around the identity.
    fn around_identity(effects: Effects) -> Self {
        Self { base: Base::Pi(PiParams { gain: 1.0, thresholds: Vec::new(), weights: Vec::new() }), effects }
    }
}

macro_rules! hystereses {
    ($($params:ty => $kind:ident,)*) => { $(
        impl Keep for $params {
            fn keep(&self) -> Result<Kept, &'static str> {
                Ok(Kept::hysteresis(Base::$kind(self.clone())))
            }
        }
    )* };
}
hystereses! {
    PiParams<Vec<f64>> => Pi,
    ViscousPiParams<Vec<f64>> => ViscousPi,
    GpiParams<Vec<f64>> => Gpi,
    TdPiParams => TdPi,
    MaxwellSlipParams<Vec<f64>> => MaxwellSlip,
    TdEmParams<Vec<f64>> => TdEm,
    PreisachParams<Vec<f64>> => Preisach,
    DpmParams<Vec<f64>> => Dpm,
    LfdmParams => Lfdm,
    IfmParams => Ifm,
    BoucWenParams => BoucWen,
    BoucWenOscillatorParams => BoucWenOscillator,
}

impl Keep for BoucWenClassicParams {
    fn keep(&self) -> Result<Kept, &'static str> {
        self.general().keep()
    }
}

impl Keep for (ActivationKind, ActivationParams) {
    fn keep(&self) -> Result<Kept, &'static str> {
        let kind = match self.0 {
            ActivationKind::Atan => Base::Atan,
            ActivationKind::Sigmoid => Base::Sigmoid,
            ActivationKind::Softplus => Base::Softplus,
            ActivationKind::Softsign => Base::Softsign,
            ActivationKind::Tanh => Base::Tanh,
        };
        Ok(Kept::hysteresis(kind(self.1)))
    }
}

macro_rules! stages {
    ($($params:ty => $field:ident: $present:expr,)*) => { $(
        impl Keep for $params {
            fn keep(&self) -> Result<Kept, &'static str> {
                Ok(Kept::around_identity(Effects { $field: $present(self.clone()), ..Effects::default() }))
            }
        }
    )* };
}
stages! {
    DelayParams => delay: Some,
    LagParams => lag: Some,
    RateParams => rate: Some,
    AsymmetryParams<Vec<f64>> => asymmetry: Some,
    TemperatureParams => temperature: Some,
    CreepParams<Vec<f64>> => creep: Some,
    LoadParams => load: Some,
    ResonanceParams => resonances: |mode| vec![mode],
    SaturationParams => saturation: Some,
    DriftParams => drift: Some,
    InterferenceParams => interference: Some,
}
