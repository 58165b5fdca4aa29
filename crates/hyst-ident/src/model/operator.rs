//! The hysteresis of a model as the host runs it, and the host's chain and compensator around it.

use hyst_core::{
    Build, Chain, Env, Error, Everett, EverettInverse, Exponentials, Gpi, GpiInverse, Ifm, IfmInverse, Invert, Lfdm,
    MaxwellSlip, OperatorParams, Pi, Sampling, Stage, TdEm, TdEmInverse, TdPi, TdPiInverse, ViscousPi,
    ViscousPiInverse,
};

/// Plays and elements that the host's operators hold.
const PLAYS: usize = 64;
/// Nodes along one edge of the host's Preisach triangle.
pub const NODES: usize = 65;
/// Samples that the host's delay holds.
const DELAY: usize = 8192;
/// Creep elements that the host's chain holds.
pub(crate) const CREEP: usize = 32;
/// Taps that one of the host's preview filters holds.
pub(crate) const TAPS: usize = 4095;

/// The hysteresis of a model, as parameters.
pub type Base = OperatorParams<Vec<f64>>;

/// The chain as the host runs it.
pub type HostChain = Chain<f64, Operator, DELAY, CREEP>;
/// The compensator as the host runs it.
pub type Compensator = hyst_core::Compensator<f64, OperatorInverse, DELAY, CREEP, TAPS>;

/// Memory of the host's fractional models: all of it, to 3e-7.
type FullMemory = Exponentials<f64, 40>;

/// Temperature for which the filter of an electromechanical model is made \[°C\]; its gain follows the measured one.
const ROOM: f64 = 23.0;

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

        operators!(@stage Operator, Any, OperatorState, AnyState, $($name)+);
        operators!(@stage OperatorInverse, AnyInverse, InverseState, AnyInverseState, $($name)+);

        impl Invert<f64> for Operator {
            type Inverse = OperatorInverse;
            fn invert(&self) -> Result<OperatorInverse, Error> {
                Ok(OperatorInverse(match &self.0 {
                    $(Any::$name(o) => AnyInverse::$name(Box::new($invert(&**o)?)),)+
                }))
            }
            fn lead(inverse: &OperatorInverse) -> usize {
                match &inverse.0 {
                    $(AnyInverse::$name(i) => $lead(&**i),)+
                }
            }
        }
    };
    (@stage $outer:ident, $any:ident, $outer_state:ident, $any_state:ident, $($name:ident)+) => {
        impl Stage<f64> for $outer {
            type State = $outer_state;
            fn state(&self) -> $outer_state {
                $outer_state(match &self.0 {
                    $($any::$name(o) => $any_state::$name(Box::new(o.state())),)+
                })
            }
            fn reset(&self, s: &mut $outer_state, e: &Env<f64>, u0: f64) -> f64 {
                match (&self.0, &mut s.0) {
                    $(($any::$name(o), $any_state::$name(s)) => o.reset(s, e, u0),)+
                    // A state of another operator: begin one of this one.
                    (_, other) => {
                        *other = self.state().0;
                        self.reset(s, e, u0)
                    }
                }
            }
            fn step(&self, s: &mut $outer_state, e: &Env<f64>, u: f64) -> f64 {
                match (&self.0, &mut s.0) {
                    $(($any::$name(o), $any_state::$name(s)) => o.step(s, e, u),)+
                    (_, _) => self.reset(s, e, u),
                }
            }
        }
    };
}

/// A hysteresis operator of the host.
#[derive(Clone, Debug)]
pub struct Operator(Any);
/// The inverse of a hysteresis operator of the host.
#[derive(Clone, Debug)]
pub struct OperatorInverse(AnyInverse);
/// History of an operator of the host.
#[derive(Clone, Debug)]
pub struct OperatorState(AnyState);
/// History of the inverse of an operator of the host.
#[derive(Clone, Debug)]
pub struct InverseState(AnyInverseState);

fn at_once<I>(_: &I) -> usize {
    0
}

operators! {
    Pi(Pi<f64, PLAYS>) => Pi<f64, PLAYS>, Invert::invert, at_once;
    ViscousPi(ViscousPi<f64, PLAYS>) => ViscousPiInverse<f64, PLAYS>, Invert::invert, at_once;
    Gpi(Gpi<f64, PLAYS>) => GpiInverse<f64, PLAYS>, Invert::invert, at_once;
    TdPi(TdPi<f64, PLAYS>) => TdPiInverse<f64, PLAYS>, Invert::invert, at_once;
    TdEm(TdEm<f64, PLAYS>) => TdEmInverse<f64, PLAYS, TAPS>, |o: &TdEm<f64, PLAYS>| o.band_limited(ROOM, None),
        TdEmInverse::lead;
    Lfdm(Lfdm<f64, FullMemory>) => Lfdm<f64, FullMemory>, Invert::invert, at_once;
    Ifm(Ifm<f64, FullMemory, DELAY>) => IfmInverse<f64, FullMemory, DELAY>, Invert::invert, at_once;
    Preisach(Everett<f64, NODES>) => EverettInverse<f64, NODES>, |o: &Everett<f64, NODES>| o.invert(), at_once;
}

impl Operator {
    /// The operator with these parameters at a sample period.
    ///
    /// # Errors
    /// Names the parameter that is not finite, out of range or too long.
    pub fn new(base: &Base, cx: &Sampling) -> Result<Self, Error> {
        Ok(Self(match base {
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
            Base::Lfdm(p) => Any::Lfdm(Box::new(p.build(cx)?)),
            Base::Ifm(p) => Any::Ifm(Box::new(p.build(cx)?)),
        }))
    }
}
