//! The hysteresis of a model as the host runs it, and the host's chain and compensator around it.

use super::activation::{self, HostActivationInverse};
use super::capacity::{CREEP, DELAY, MIRROR, NODES, PLAYS, TAPS};
use hyst_core::{
    Activation, BoucWen, BoucWenOscillator, Build, Chain, Dpm, DpmParams, Env, Error, Everett, EverettInverse,
    Exponentials, Gpi, GpiInverse, Ifm, IfmInverse, Invert, Lfdm, MaxwellSlip, OperatorParams, Pi, Probe, Sampling,
    Search, Stage, TdEm, TdEmInverse, TdPi, TdPiInverse, ViscousPi, ViscousPiInverse,
};

/// The hysteresis of a model, as parameters.
pub type Base = OperatorParams<Vec<f64>>;

/// The chain as the host runs it.
pub type HostChain = Chain<f64, Operator, DELAY, CREEP>;
/// The compensator as the host runs it.
pub type Compensator = hyst_core::Compensator<f64, OperatorInverse, DELAY, CREEP, TAPS>;

/// The dynamic Preisach model with a mirror of at most [`MIRROR`]² nodes.
type HostDpm = Dpm<f64, NODES, MIRROR, MIRROR>;

/// Memory of the host's fractional models: all of it, to 3e-7.
type FullMemory = Exponentials<f64, 40>;

/// Temperature where none is stated \[°C\]. The filter of an electromechanical model is made for it; its gain follows the measured one.
pub(crate) const ROOM: f64 = 23.0;

/// What the preview of an activation-function model's inverse may miss, of the largest |α u̇|.
const PREVIEW_TOLERANCE: f64 = 1e-10;

const NO_OSCILLATOR_INVERSE: Error = Error::NotInvertible(
    "the drive of an oscillator takes the reference's acceleration and jerk; track it with feedback instead",
);

/// Declares the operators of the host: type, type of the inverse, how it is made, and its preview.
macro_rules! operators {
    ($($name:ident($operator:ty) => $inverse:ty, $invert:expr, $lead:expr;)+) => {
        #[derive(Clone, Debug)]
        enum Any {
            $($name(Box<$operator>),)+
        }

        #[derive(Clone, Debug)]
        enum AnyInverse {
            $($name(Box<$inverse>),)+
        }

        #[derive(Clone, Debug)]
        enum AnyState {
            $($name(Box<<$operator as Stage<f64>>::State>),)+
        }

        #[derive(Clone, Debug)]
        enum AnyInverseState {
            $($name(Box<<$inverse as Stage<f64>>::State>),)+
        }

        operators!(@stage Operator, any, Any, OperatorState, AnyState, $($name)+);
        operators!(@stage OperatorInverse, any, AnyInverse, InverseState, AnyInverseState, $($name)+);

        impl Invert<f64> for Operator {
            type Inverse = OperatorInverse;
            fn invert(&self) -> Result<OperatorInverse, Error> {
                let any = match &self.any {
                    $(Any::$name(o) => AnyInverse::$name(Box::new($invert(&**o, self.inversion)?)),)+
                };
                Ok(OperatorInverse { any })
            }
            fn lead(inverse: &OperatorInverse) -> usize {
                match &inverse.any {
                    $(AnyInverse::$name(i) => $lead(&**i),)+
                }
            }
            fn band(inverse: &OperatorInverse) -> Option<(f64, f64)> {
                match &inverse.any {
                    AnyInverse::TdEm(i) => Some((i.bandwidth_hz(), i.error())),
                    _ => None,
                }
            }
        }
    };
    (@stage $outer:ident, $field:ident, $any:ident, $outer_state:ident, $any_state:ident, $($name:ident)+) => {
        impl Stage<f64> for $outer {
            type State = $outer_state;
            fn state(&self) -> $outer_state {
                $outer_state(match &self.$field {
                    $($any::$name(o) => $any_state::$name(Box::new(o.state())),)+
                })
            }
            fn reset(&self, s: &mut $outer_state, e: &Env<f64>, u0: f64) -> f64 {
                match (&self.$field, &mut s.0) {
                    $(($any::$name(o), $any_state::$name(s)) => o.reset(s, e, u0),)+
                    // A state of another operator: begin one of this one.
                    (_, other) => {
                        *other = self.state().0;
                        self.reset(s, e, u0)
                    }
                }
            }
            fn step(&self, s: &mut $outer_state, e: &Env<f64>, u: f64) -> f64 {
                match (&self.$field, &mut s.0) {
                    $(($any::$name(o), $any_state::$name(s)) => o.step(s, e, u),)+
                    (_, _) => self.reset(s, e, u),
                }
            }
        }
    };
}

/// A hysteresis operator of the host.
#[derive(Clone, Debug)]
pub struct Operator {
    any: Any,
    inversion: Inversion,
}

/// What inverses take besides the operator.
#[derive(Clone, Copy, Debug)]
struct Inversion {
    /// Inputs among which one may have to search.
    range: [f64; 2],
    /// Band of one with dynamics of its own \[Hz\]; chosen if not given.
    bandwidth_hz: Option<f64>,
    /// Why a search could end at an output that is not the reference, if it could.
    searchable: Result<(), Error>,
}
/// The inverse of a hysteresis operator of the host.
#[derive(Clone, Debug)]
pub struct OperatorInverse {
    any: AnyInverse,
}
/// History of an operator of the host.
#[derive(Clone, Debug)]
pub struct OperatorState(AnyState);
/// History of the inverse of an operator of the host.
#[derive(Clone, Debug)]
pub struct InverseState(AnyInverseState);

fn closed<O: Invert<f64>>(operator: &O, _: Inversion) -> Result<O::Inverse, Error> {
    operator.invert()
}

/// Share of the range to which a search finds the input.
const TOLERANCE: f64 = 1e-12;

/// Whether a search finds the inverse of a dynamic Preisach model: only where its output is continuous in the input.
///
/// # Errors
/// [`Error::NotInvertible`] for `fade` = 0: no input reaches what lies inside a step, and a search ends beside it without a word.
pub fn searchable<L>(params: &DpmParams<L>) -> Result<(), Error> {
    if params.fade > 0.0 {
        Ok(())
    } else {
        Err(Error::NotInvertible(
            "with dpm.fade = 0 the output steps where loops close, and no input reaches what lies inside a step; set fade above 0",
        ))
    }
}

fn searched<O: Probe<f64> + Clone>(operator: &O, how: Inversion) -> Result<Search<f64, O>, Error> {
    how.searchable?;
    let [low, high] = how.range;
    Search::new(operator.clone(), low, high, TOLERANCE * (high - low))
}

/// What was never driven may have to be reached by an inverse: as much again on either side.
pub(crate) fn searched_range([low, high]: [f64; 2]) -> [f64; 2] {
    let reach = (high - low).abs().max(f64::MIN_POSITIVE);
    [low - reach, high + reach]
}

/// Inputs that the inverse of a model identified on `range` does not leave, if there are such, and how near it comes to the exact
/// one: for outputs beyond what they reach it takes the nearer end.
pub(super) fn inverse_ends(base: &Base, range: [f64; 2]) -> Option<([f64; 2], f64)> {
    let [low, high] = searched_range(range);
    match base {
        Base::BoucWen(_) | Base::Dpm(_) => Some(([low, high], TOLERANCE * (high - low))),
        _ => None,
    }
}

fn at_once<I>(_: &I) -> usize {
    0
}

operators! {
    Pi(Pi<f64, PLAYS>) => Pi<f64, PLAYS>, closed, at_once;
    ViscousPi(ViscousPi<f64, PLAYS>) => ViscousPiInverse<f64, PLAYS>, closed, at_once;
    Gpi(Gpi<f64, PLAYS>) => GpiInverse<f64, PLAYS>, closed, at_once;
    TdPi(TdPi<f64, PLAYS>) => TdPiInverse<f64, PLAYS>, closed, at_once;
    TdEm(TdEm<f64, PLAYS>) => TdEmInverse<f64, PLAYS, TAPS>, |o: &TdEm<f64, PLAYS>, how: Inversion| o.band_limited(ROOM, how.bandwidth_hz),
        TdEmInverse::lead;
    Lfdm(Lfdm<f64, FullMemory>) => Lfdm<f64, FullMemory>, closed, at_once;
    Ifm(Ifm<f64, FullMemory, DELAY>) => IfmInverse<f64, FullMemory, DELAY>, closed, at_once;
    BoucWen(BoucWen<f64>) => Search<f64, BoucWen<f64>>,
        |o: &BoucWen<f64>, Inversion { range: [low, high], .. }| o.inverse(low, high, TOLERANCE * (high - low)), at_once;
    BoucWenOscillator(BoucWenOscillator<f64>) => Pi<f64, 1>, |_: &_, _| Err(NO_OSCILLATOR_INVERSE), at_once;
    Dpm(HostDpm) => Search<f64, HostDpm>, searched, at_once;
    Activation(Activation<f64>) => HostActivationInverse,
        |o: &Activation<f64>, _| activation::inverse(o, PREVIEW_TOLERANCE), activation::lead;
    Preisach(Everett<f64, NODES>) => EverettInverse<f64, NODES>, closed, at_once;
}

impl Operator {
    /// The operator with these parameters at a sample period; `low` and `high` are the inputs that it was identified on.
    ///
    /// # Errors
    /// Names the parameter that is not finite, out of range or too long.
    pub fn new(base: &Base, [low, high]: [f64; 2], cx: &Sampling) -> Result<Self, Error> {
        let any = match base {
            Base::Pi(p) => Any::Pi(Box::new(p.build(&())?)),
            Base::ViscousPi(p) => Any::ViscousPi(Box::new(p.build(cx)?)),
            Base::Gpi(p) => Any::Gpi(Box::new(p.build(&())?)),
            Base::TdPi(p) => Any::TdPi(Box::new(p.build(&())?)),
            Base::MaxwellSlip(p) => {
                let bank: MaxwellSlip<f64, PLAYS> = p.build(&())?;
                Any::Gpi(Box::new(bank))
            }
            Base::TdEm(p) => Any::TdEm(Box::new(p.build(cx)?)),
            Base::Preisach(p) => Any::Preisach(Box::new(p.build(&())?)),
            Base::BoucWen(p) => Any::BoucWen(Box::new(p.build(&())?)),
            Base::BoucWenOscillator(p) => Any::BoucWenOscillator(Box::new(p.build(cx)?)),
            Base::Atan(_) | Base::Sigmoid(_) | Base::Softplus(_) | Base::Softsign(_) | Base::Tanh(_) => {
                let params = base.activation().ok_or(Error::NotInvertible("no activation function"))?;
                Any::Activation(Box::new(params.build(cx)?))
            }
            Base::Dpm(p) => Any::Dpm(Box::new(p.build(cx)?)),
            Base::Lfdm(p) => Any::Lfdm(Box::new(p.build(cx)?)),
            Base::Ifm(p) => Any::Ifm(Box::new(p.build(cx)?)),
        };
        let searchable = match base {
            Base::Dpm(p) => searchable(p),
            _ => Ok(()),
        };
        Ok(Self { any, inversion: Inversion { range: searched_range([low, high]), bandwidth_hz: None, searchable } })
    }

    /// The same, whose inverse holds in this band if it has dynamics of its own \[Hz\].
    pub fn with_bandwidth(mut self, bandwidth_hz: Option<f64>) -> Self {
        self.inversion.bandwidth_hz = bandwidth_hz;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use hyst_core::CompensatorOptions;

    #[test]
    fn a_model_whose_output_steps_has_no_inverse() {
        let mut model = Model::parse("dpm", include_str!("../../../../docs/models/dpm.json")).unwrap();
        let inverse = |model: &Model| model.compensator(1e-4, &CompensatorOptions::default()).map(|_| ());
        assert_eq!(inverse(&model), Ok(()));
        let Base::Dpm(params) = &mut model.base else { panic!("{:?}", model.base) };
        params.fade = 0.0;
        model.build(1e-4).unwrap();
        let why = inverse(&model).unwrap_err();
        assert!(matches!(why, Error::NotInvertible(_)) && why.to_string().contains("set fade above 0"), "{why}");
    }
}
