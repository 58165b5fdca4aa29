//! Models whose parameters come from elsewhere than a fit: a paper, another program, a person.

use std::collections::{BTreeMap, BTreeSet};

use hyst_core::{Env, Error, Stage};

use super::operator::ROOM;
use super::{Base, Channel, Effect, Effects, Model, units};
use crate::BetweenSamples;
use crate::record::{OutputUnit, is_input_column};

/// The two ends of an actuator whose parameters come from elsewhere.
#[derive(Clone, Debug, PartialEq)]
pub struct Ends {
    /// The input's column: `voltage_v`, or `QUANTITY_in_UNIT`.
    pub input_column: String,
    /// Lowest and highest input for which the parameters hold \[input unit\].
    pub input: (f64, f64),
    /// The output's unit.
    pub output: OutputUnit,
    /// Lowest and highest output \[output unit\]; those at rest at the two inputs, if not given.
    pub output_range: Option<(f64, f64)>,
    /// Sample rate to write into the file \[Hz\]; the parameters do not depend on it.
    pub rate_hz: f64,
}

impl Model {
    /// A model of given parameters, fitted on nothing.
    ///
    /// # Errors
    /// Names what is no number, out of order, out of range or in another unit than the output: an end of the actuator, or a
    /// parameter of a stage.
    pub fn from_parameters(base: Base, effects: Effects, ends: &Ends) -> Result<Self, Error> {
        let Ends { input: (low, high), output, .. } = *ends;
        if !is_input_column(&ends.input_column) {
            return Err(Error::OutOfRange { name: "input_column", must: "voltage_v or QUANTITY_in_UNIT" });
        }
        // Numbers that are none are refused as well.
        if !(low.is_finite() && high.is_finite() && low < high) {
            return Err(Error::OutOfRange { name: "input_range", must: "two finite numbers, the lower one first" });
        }
        if !(ends.rate_hz.is_finite() && ends.rate_hz > 0.0) {
            return Err(Error::OutOfRange { name: "rate_hz", must: "positive" });
        }
        let mut model = Self {
            input: Channel {
                column: ends.input_column.clone(),
                unit: crate::fit::unit_of(&ends.input_column),
                low,
                high,
            },
            between_samples: BetweenSamples::Linear,
            output: Channel { column: output.column().into(), unit: output.suffix().into(), low: 0.0, high: 0.0 },
            falls: false,
            zero: 0.0,
            base,
            effects,
            std_errors: BTreeMap::new(),
            undetermined: BTreeSet::new(),
            rmse: None,
            recorded_at_hz: ends.rate_hz,
            fitted_on: Vec::new(),
            seed: 0,
            version: env!("CARGO_PKG_VERSION").into(),
        };
        units::agree(&model.base, &model.output)?;
        let stated = model.stated_degc();
        let (least, most) = match ends.output_range {
            Some(range) => range,
            None => model.at_rest([low, high], [stated, stated])?,
        };
        if !(least.is_finite() && most.is_finite() && least <= most) {
            return Err(Error::OutOfRange { name: "output_range", must: "two finite numbers, the lower one first" });
        }
        (model.output.low, model.output.high) = (least, most);
        Ok(model)
    }

    /// Temperature that the parameters are stated for \[°C\].
    fn stated_degc(&self) -> f64 {
        match (&self.effects.temperature, &self.base) {
            (Some(gain), _) => gain.reference_degc,
            (None, Base::TdPi(p)) => p.reference_degc,
            (None, _) => ROOM,
        }
    }

    /// Lowest and highest output at rest, over these inputs and temperatures \[°C\], without what is in the sensor.
    pub(crate) fn at_rest(&self, inputs: [f64; 2], degc: [f64; 2]) -> Result<(f64, f64), Error> {
        // Settled: the sample period does not matter there.
        let chain = Box::new(self.without_sensor().build(1.0 / self.recorded_at_hz)?);
        let mut state = Box::new(chain.state());
        let mut outputs = Vec::new();
        for temperature in degc {
            let env = Env { temperature, ..Env::default() };
            outputs.extend(inputs.map(|u| chain.reset(&mut state, &env, u)));
        }
        Ok(crate::samples::range(outputs.into_iter()))
    }

    /// The straight line through the ends of the record that it was fitted to: its slope \[output/input\], which falls where the model does, and its
    /// output at the lowest input. What somebody without a model of the hysteresis would use.
    ///
    /// # Errors
    /// If the model cannot be run.
    pub fn straight_line(&self) -> Result<(f64, f64), Error> {
        let chain = Box::new(self.without_sensor().build(1.0 / self.recorded_at_hz)?);
        let mut state = Box::new(chain.state());
        let env = Env { temperature: self.stated_degc(), ..Env::default() };
        let mut at = |u: f64| chain.reset(&mut state, &env, u);
        let rises = at(self.input.low) <= at(self.input.high);
        let (span, stroke) = (self.input.high - self.input.low, self.output.high - self.output.low);
        Ok(if rises { (stroke / span, self.output.low) } else { (-stroke / span, self.output.high) })
    }

    /// The model without what is in the sensor only: a drive does not follow that.
    pub(crate) fn without_sensor(&self) -> Self {
        let effects = self.effects.without(Effect::Drift).without(Effect::Interference);
        Self { effects, ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyst_core::{DriftParams, PiParams};

    fn pi(gain: f64) -> Base {
        Base::Pi(PiParams { gain, thresholds: vec![10.0], weights: vec![0.05] })
    }

    fn ends() -> Ends {
        Ends {
            input_column: "voltage_v".into(),
            input: (-20.0, 120.0),
            output: OutputUnit::Micrometre,
            output_range: None,
            rate_hz: 1000.0,
        }
    }

    #[test]
    fn the_output_range_is_that_of_rest_and_without_the_sensors_drift() {
        let effects =
            Effects { drift: Some(DriftParams { per_second: 3.0, ..DriftParams::default() }), ..Effects::default() };
        let model = Model::from_parameters(pi(0.1), effects, &ends()).unwrap();
        assert_eq!((model.output.low, model.output.high), (-2.0 - 0.5, 12.0 + 5.5));
        assert_eq!((model.input.unit.as_str(), model.output.unit.as_str()), ("V", "um"));
        assert_eq!(Model::parse("text", &model.to_json()).unwrap(), model);
    }

    #[test]
    fn ends_that_are_none_are_named() {
        let refused = |ends: Ends| match Model::from_parameters(pi(0.1), Effects::default(), &ends) {
            Err(Error::OutOfRange { name, .. }) => name,
            other => panic!("{other:?}"),
        };
        assert_eq!(refused(Ends { input_column: "volts".into(), ..ends() }), "input_column");
        assert_eq!(refused(Ends { input_column: "displacement_um".into(), ..ends() }), "input_column");
        for input in [(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
            assert_eq!(refused(Ends { input, ..ends() }), "input_range");
        }
        assert_eq!(refused(Ends { output_range: Some((2.0, 1.0)), ..ends() }), "output_range");
        assert_eq!(refused(Ends { rate_hz: 0.0, ..ends() }), "rate_hz");
        Model::from_parameters(pi(f64::NAN), Effects::default(), &ends()).unwrap_err();
    }
}
