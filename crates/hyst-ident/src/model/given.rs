//! Models with given parameters, for example from a paper or another program.

use std::collections::{BTreeMap, BTreeSet};

use hyst_core::{Env, Error, Stage};

use super::operator::DEFAULT_DEGC;
use super::{Base, Channel, Effect, Effects, Model, unit_of, units};
use crate::BetweenSamples;
use crate::record::{OutputUnit, is_input_column};

/// Input and output of an actuator with given parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Ends {
    /// The column of the input: `voltage_v` or `QUANTITY_in_UNIT`.
    pub input_column: String,
    /// Minimum and maximum input for which the parameters are valid \[input unit\].
    pub input: (f64, f64),
    /// The unit of the output.
    pub output: OutputUnit,
    /// Minimum and maximum output \[output unit\]. Default: the outputs at rest at the two inputs.
    pub output_range: Option<(f64, f64)>,
    /// Sample rate for the file \[Hz\]. The parameters do not depend on it.
    pub rate_hz: f64,
}

impl Model {
    /// Makes a model of given parameters, without a fit.
    ///
    /// # Errors
    /// If a range or a parameter is not a finite number, not in order, out of range, or has another unit than the
    /// output. The error names it.
    pub fn from_parameters(base: Base, effects: Effects, ends: &Ends) -> Result<Self, Error> {
        let Ends { input: (low, high), output, .. } = *ends;
        if !is_input_column(&ends.input_column) {
            return Err(Error::OutOfRange { name: "input_column", must: "voltage_v or QUANTITY_in_UNIT" });
        }
        // The comparison also refuses NaN.
        if !(low.is_finite() && high.is_finite() && low < high) {
            return Err(Error::OutOfRange { name: "input_range", must: "two finite numbers, the smaller one first" });
        }
        if !(ends.rate_hz.is_finite() && ends.rate_hz > 0.0) {
            return Err(Error::OutOfRange { name: "rate_hz", must: "positive" });
        }
        let mut model = Self {
            input: Channel { column: ends.input_column.clone(), unit: unit_of(&ends.input_column), low, high },
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
            return Err(Error::OutOfRange { name: "output_range", must: "two finite numbers, the smaller one first" });
        }
        (model.output.low, model.output.high) = (least, most);
        Ok(model)
    }

    /// Returns the reference temperature of the parameters \[°C\].
    fn stated_degc(&self) -> f64 {
        match (&self.effects.temperature, &self.base) {
            (Some(gain), _) => gain.reference_degc,
            (None, Base::TdPi(p)) => p.reference_degc,
            (None, _) => DEFAULT_DEGC,
        }
    }

    /// Returns the minimum and maximum output at rest at these inputs and temperatures \[°C\], without effects of the
    /// sensor.
    pub(crate) fn at_rest(&self, inputs: [f64; 2], degc: [f64; 2]) -> Result<(f64, f64), Error> {
        // The output at rest does not depend on the sample period.
        let chain = Box::new(self.without_sensor().build(1.0 / self.recorded_at_hz)?);
        let mut state = Box::new(chain.state());
        let mut outputs = Vec::new();
        for temperature in degc {
            let env = Env { temperature, ..Env::default() };
            outputs.extend(inputs.map(|u| chain.reset(&mut state, &env, u)));
        }
        Ok(crate::statistics::range(outputs.into_iter()))
    }

    /// Returns the straight line through the ends of the fitted range.
    ///
    /// The line is given by its slope \[output/input\] and its output at the minimum input. It is the compensation
    /// without a model of the hysteresis. The slope is negative if the output of the model falls.
    ///
    /// # Errors
    /// If the chain cannot be built.
    pub fn straight_line(&self) -> Result<(f64, f64), Error> {
        let chain = Box::new(self.without_sensor().build(1.0 / self.recorded_at_hz)?);
        let mut state = Box::new(chain.state());
        let env = Env { temperature: self.stated_degc(), ..Env::default() };
        let mut at = |u: f64| chain.reset(&mut state, &env, u);
        let rises = at(self.input.low) <= at(self.input.high);
        let (span, stroke) = (self.input.high - self.input.low, self.output.high - self.output.low);
        Ok(if rises { (stroke / span, self.output.low) } else { (-stroke / span, self.output.high) })
    }

    /// Returns the model without effects of the sensor, which a drive does not compensate.
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
    fn the_default_output_range_is_at_rest_and_without_sensor_drift() {
        let effects =
            Effects { drift: Some(DriftParams { per_second: 3.0, ..DriftParams::default() }), ..Effects::default() };
        let model = Model::from_parameters(pi(0.1), effects, &ends()).unwrap();
        assert_eq!((model.output.low, model.output.high), (-2.0 - 0.5, 12.0 + 5.5));
        assert_eq!((model.input.unit.as_str(), model.output.unit.as_str()), ("V", "um"));
        assert_eq!(Model::parse("text", &model.to_json()).unwrap(), model);
    }

    #[test]
    fn invalid_ranges_are_refused_by_name() {
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
