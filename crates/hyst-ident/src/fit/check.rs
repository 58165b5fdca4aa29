//! Checks whether a record can be fitted.

use crate::error::FitError;
use crate::model::Kind;
use crate::record::Record;
use crate::samples::Samples;
use crate::statistics::range;

/// Checks whether a record can be fitted; `wrong_sign` means that its output has the opposite sign to the model's.
pub(crate) fn check(record: &Record, samples: &Samples, wrong_sign: bool) -> Result<(), FitError> {
    let name = record.name();
    let Some(unit) = record.output_unit() else {
        return Err(FitError::Missing {
            record: name,
            column: "displacement_um".into(),
            advice: "a fit needs the measured output".into(),
        });
    };
    if record.input().is_empty() {
        return Err(FitError::Missing {
            record: name,
            column: "voltage_v".into(),
            advice: "a fit needs the drive".into(),
        });
    }
    let (low, high) = samples.input_range();
    if high - low <= 1e-9 * high.abs().max(low.abs()).max(f64::MIN_POSITIVE) {
        return Err(FitError::ConstantInput { record: name, column: record.input_column().into(), value: low });
    }
    let (least, most) = range(samples.output.iter().copied());
    if most - least <= 1e-12 * most.abs().max(least.abs()).max(f64::MIN_POSITIVE) {
        return Err(FitError::ConstantOutput { record: name, column: unit.column().into(), value: least });
    }
    if wrong_sign {
        return Err(FitError::Falling { record: name, column: unit.column() });
    }
    Ok(())
}

/// Returns whether the sign of the output is a property of the model.
pub(crate) fn sign_matters(kind: Kind) -> bool {
    // The phase of an oscillator lags by up to 180°.
    kind != Kind::BoucWenOscillator
}
