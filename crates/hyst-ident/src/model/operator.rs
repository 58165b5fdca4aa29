//! The hysteresis operators of the host, with their chain and compensator.

use super::activation::{self, HostActivationInverse};
use super::capacity::{CREEP, DELAY, MIRROR, NODES, PLAYS, TAPS};
use hyst_core::{
    Activation, BoucWen, BoucWenOscillator, Build, Chain, Dpm, DpmParams, Env, Error, Everett, EverettInverse,
    Exponentials, Gpi, GpiInverse, Ifm, IfmInverse, Invert, Lfdm, MaxwellSlip, OperatorParams, Pi, Probe, Sampling,
    Search, Stage, TdEm, TdEmInverse, TdPi, TdPiInverse, ViscousPi, ViscousPiInverse,
};

/// The base model, as parameters.
pub type Base = OperatorParams<Vec<f64>>;

/// The chain of the host.
pub type HostChain = Chain<f64, Operator, DELAY, CREEP>;
/// The compensator of the host.
pub type Compensator = hyst_core::Compensator<f64, OperatorInverse, DELAY, CREEP, TAPS>;

/// The dynamic Preisach model with a mirror grid of at most [`MIRROR`]² nodes.
type HostDpm = Dpm<f64, NODES, MIRROR, MIRROR>;

/// Memory of the fractional models of the host: the full history, with a relative error of 3e-7.
type FullMemory = Exponentials<f64, 40>;

/// Temperature if none is stated \[°C\]. The filter of an electromechanical model is made for it; its gain follows the
/// measured temperature.
pub(crate) const DEFAULT_DEGC: f64 = 23.0;

/// Error of the preview of the inverse of an activation-function model, relative to the largest |α u̇|.
const PREVIEW_TOLERANCE: f64 = 1e-10;

const NO_OSCILLATOR_INVERSE: Error = Error::NotInvertible(
    "the inverse of an oscillator needs acceleration and jerk of the reference; track the reference with feedback instead",
);

/// Declares the operators of the host: type, type of the inverse, function that makes the inverse, and preview of the
/// inverse.
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
                    // The state belongs to another operator: replace it.
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

/// Settings of the inverse.
#[derive(Clone, Copy, Debug)]
struct Inversion {
    /// Input range of an inverse by search.
    range: [f64; 2],
    /// Bandwidth of the inverse of a model with dynamics \[Hz\]; `None` selects it automatically.
    bandwidth_hz: Option<f64>,
    /// The reason why a search may not reach the reference, if any.
    searchable: Result<(), Error>,
}
/// The inverse of a hysteresis operator of the host.
#[derive(Clone, Debug)]
pub struct OperatorInverse {
    any: AnyInverse,
}
/// State of an operator of the host.
#[derive(Clone, Debug)]
pub struct OperatorState(AnyState);
/// State of the inverse of an operator of the host.
#[derive(Clone, Debug)]
pub struct InverseState(AnyInverseState);

fn closed_form<O: Invert<f64>>(operator: &O, _: Inversion) -> Result<O::Inverse, Error> {
    operator.invert()
}

/// Tolerance of a search, as a share of the input range.
const TOLERANCE: f64 = 1e-12;

/// Checks that a search finds the inverse of a dynamic Preisach model.
///
/// The output of the model must be continuous in the input.
///
/// # Errors
/// [`Error::NotInvertible`] for `fade` = 0: no input reaches an output inside a jump, and the search would not report
/// this.
pub fn searchable<L>(params: &DpmParams<L>) -> Result<(), Error> {
    if params.fade > 0.0 {
        Ok(())
    } else {
        Err(Error::NotInvertible(
            "with dpm.fade = 0 the output jumps when a loop closes, and no input reaches the outputs within the jump; set fade above 0",
        ))
    }
}

fn searched<O: Probe<f64> + Clone>(operator: &O, how: Inversion) -> Result<Search<f64, O>, Error> {
    how.searchable?;
    let [low, high] = how.range;
    Search::new(operator.clone(), low, high, TOLERANCE * (high - low))
}

/// Returns the input range of a search: the identified range, extended by its width on either side.
pub(crate) fn searched_range([low, high]: [f64; 2]) -> [f64; 2] {
    let reach = (high - low).abs().max(f64::MIN_POSITIVE);
    [low - reach, high + reach]
}

/// Returns the input range to which the inverse of a model identified on `range` is limited, and its tolerance.
///
/// `None` if the inverse is not limited. For outputs that this range does not reach, the inverse returns the nearer
/// end.
pub(super) fn inverse_ends(base: &Base, range: [f64; 2]) -> Option<([f64; 2], f64)> {
    let [low, high] = searched_range(range);
    match base {
        Base::BoucWen(_) | Base::Dpm(_) => Some(([low, high], TOLERANCE * (high - low))),
        _ => None,
    }
}

fn no_lead<I>(_: &I) -> usize {
    0
}

operators! {
    Pi(Pi<f64, PLAYS>) => Pi<f64, PLAYS>, closed_form, no_lead;
    ViscousPi(ViscousPi<f64, PLAYS>) => ViscousPiInverse<f64, PLAYS>, closed_form, no_lead;
    Gpi(Gpi<f64, PLAYS>) => GpiInverse<f64, PLAYS>, closed_form, no_lead;
    TdPi(TdPi<f64, PLAYS>) => TdPiInverse<f64, PLAYS>, closed_form, no_lead;
    TdEm(TdEm<f64, PLAYS>) => TdEmInverse<f64, PLAYS, TAPS>, |o: &TdEm<f64, PLAYS>, how: Inversion| o.band_limited(DEFAULT_DEGC, how.bandwidth_hz),
        TdEmInverse::lead;
    Lfdm(Lfdm<f64, FullMemory>) => Lfdm<f64, FullMemory>, closed_form, no_lead;
    Ifm(Ifm<f64, FullMemory, DELAY>) => IfmInverse<f64, FullMemory, DELAY>, closed_form, no_lead;
    BoucWen(BoucWen<f64>) => Search<f64, BoucWen<f64>>,
        |o: &BoucWen<f64>, Inversion { range: [low, high], .. }| o.inverse(low, high, TOLERANCE * (high - low)), no_lead;
    BoucWenOscillator(BoucWenOscillator<f64>) => Pi<f64, 1>, |_: &_, _| Err(NO_OSCILLATOR_INVERSE), no_lead;
    Dpm(HostDpm) => Search<f64, HostDpm>, searched, no_lead;
    Activation(Activation<f64>) => HostActivationInverse,
        |o: &Activation<f64>, _| activation::inverse(o, PREVIEW_TOLERANCE), activation::lead;
    Preisach(Everett<f64, NODES>) => EverettInverse<f64, NODES>, closed_form, no_lead;
}

impl Operator {
    /// Builds the operator for a sample period.
    ///
    /// `low` and `high` are the input range that the model was identified on.
    ///
    /// # Errors
    /// If a parameter is not finite, out of range or too long. The error names it.
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

    /// Sets the bandwidth of the inverse \[Hz\]. It applies to models with dynamics.
    pub fn with_bandwidth(mut self, bandwidth_hz: Option<f64>) -> Self {
        self.inversion.bandwidth_hz = bandwidth_hz;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Effects, Ends, Model};
    use crate::record::OutputUnit;
    use hyst_core::{CompensatorOptions, MirrorParams, PreisachParams};

    #[test]
    fn a_model_whose_output_jumps_has_no_inverse() {
        let density = (0..8).flat_map(|a| (0..=a).map(move |b| if a == b { 1.2 } else { 0.15 })).collect();
        let preisach = PreisachParams { low: 0.0, high: 80.0, cells: 8, rest: 0.0, density, once: vec![0.0; 8] };
        let weight = |d: i32, p: i32| 0.984 - 0.016 * f64::from(d) - 0.0016 * f64::from((p - 4).pow(2));
        let mirror = MirrorParams::on_printed_grid((0..8).flat_map(|d| (0..9).map(move |p| weight(d, p))).collect());
        let ends = Ends {
            input_column: "voltage_v".into(),
            input: (0.0, 80.0),
            output: OutputUnit::Newton,
            output_range: None,
            rate_hz: 1e4,
        };
        let base = Base::Dpm(DpmParams { preisach, mirror, fade: 20.0 });
        let mut model = Model::from_parameters(base, Effects::default(), &ends).unwrap();
        let inverse = |model: &Model| model.compensator(1e-4, &CompensatorOptions::default()).map(|_| ());
        assert_eq!(inverse(&model), Ok(()));
        let Base::Dpm(params) = &mut model.base else { panic!("{:?}", model.base) };
        params.fade = 0.0;
        model.build(1e-4).unwrap();
        let why = inverse(&model).unwrap_err();
        assert!(matches!(why, Error::NotInvertible(_)) && why.to_string().contains("set fade above 0"), "{why}");
    }
}
