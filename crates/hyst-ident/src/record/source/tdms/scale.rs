//! NI scales: properties for the conversion of raw values to physical values.

use super::objects::{Object, Values};

/// The input source that means the raw data.
const RAW: f64 = u32::MAX as f64;
/// Largest number of scales of a channel, and of steps between them. Files have one to four.
const MAX_STEPS: usize = 64;
/// Largest number of coefficients of a polynomial, and of rows of a table.
const MAX_COEFFICIENTS: f64 = 4096.0;
/// Number of coefficients of a polynomial that does not state it.
const DEFAULT_COEFFICIENTS: f64 = 4.0;

/// Converts the values of a channel to physical values.
///
/// `stated` are the objects that may state its scales: the channel, its group and the file.
pub(crate) fn apply<'a>(values: Values, mut stated: impl Iterator<Item = &'a Object>) -> Result<Vec<f64>, String> {
    let scaled = stated.find_map(|object| Some((object, count(object)?)));
    if let Some((object, count)) = scaled.filter(|(object, _)| object.text("NI_Scaling_Status") != Some("scaled")) {
        let mut scales = Scales { object, raw: &values, steps: 0 };
        return scales.scale(count - 1);
    }
    match values {
        Values::Numbers(values) => Ok(values),
        Values::Scalers(mut scalers) if scalers.len() == 1 => Ok(scalers.swap_remove(0).1),
        _ => Err("it has several DAQmx scalers and no scale that selects one of them".into()),
    }
}

/// Returns the number of scales that an object states.
fn count(object: &Object) -> Option<usize> {
    let stated = object.number("NI_Number_Of_Scales").map(|count| count as usize);
    let found = || {
        (0..MAX_STEPS).rev().find(|at| object.text(&format!("NI_Scale[{at}]_Scale_Type")).is_some()).map(|at| at + 1)
    };
    stated.or_else(found).filter(|count| *count > 0)
}

struct Scales<'a> {
    object: &'a Object,
    raw: &'a Values,
    /// Number of scales computed so far. Sums refer to two other scales, and a damaged file may refer in circles.
    steps: usize,
}

impl Scales<'_> {
    fn scale(&mut self, at: usize) -> Result<Vec<f64>, String> {
        self.steps += 1;
        if at >= MAX_STEPS || self.steps > MAX_STEPS {
            return Err("its scales refer to one another in a circle".into());
        }
        let Some(kind) = self.object.text(&format!("NI_Scale[{at}]_Scale_Type")) else {
            return self.scaler(at);
        };
        let prefix = format!("NI_Scale[{at}]_{kind}_");
        match kind {
            "Linear" => {
                let slope = self.number(&format!("{prefix}Slope"))?;
                let intercept = self.number(&format!("{prefix}Y_Intercept"))?;
                self.mapped(&prefix, |x| x * slope + intercept)
            }
            "Polynomial" => {
                let count = self.object.number(&format!("{prefix}Coefficients_Size")).unwrap_or(DEFAULT_COEFFICIENTS);
                let coefficients = self.numbers(&format!("{prefix}Coefficients"), count)?;
                self.mapped(&prefix, |x| coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c))
            }
            "Table" => {
                let inputs = self.numbers(&format!("{prefix}Pre_Scaled_Values"), f64::NAN)?;
                let outputs = self.numbers(&format!("{prefix}Scaled_Values"), f64::NAN)?;
                let table = table(inputs, outputs)?;
                self.mapped(&prefix, |x| interpolated(&table, x))
            }
            "Add" => self.both(&prefix, |left, right| left + right),
            // The right operand is the minuend, as in the programs of NI.
            "Subtract" => self.both(&prefix, |left, right| right - left),
            "AdvancedAPI" => self.mapped(&prefix, |x| x),
            other => Err(format!("its scale \"{other}\" is not supported")),
        }
    }

    fn number(&self, property: &str) -> Result<f64, String> {
        self.object.number(property).ok_or_else(|| format!("its scale has no \"{property}\""))
    }

    /// Returns the properties `name[0]`, `name[1]` …. Their number is `count`, or the property `name_Size` if `count`
    /// is NaN.
    fn numbers(&self, name: &str, count: f64) -> Result<Vec<f64>, String> {
        let count = if count.is_nan() { self.number(&format!("{name}_Size"))? } else { count };
        if !(0.0..=MAX_COEFFICIENTS).contains(&count) {
            return Err(format!("its scale states {count} values \"{name}\", which is impossible"));
        }
        (0..count as usize).map(|at| self.number(&format!("{name}[{at}]"))).collect()
    }

    fn mapped(&mut self, prefix: &str, map: impl Fn(f64) -> f64) -> Result<Vec<f64>, String> {
        let mut values = self.source(&format!("{prefix}Input_Source"))?;
        values.iter_mut().for_each(|value| *value = map(*value));
        Ok(values)
    }

    fn both(&mut self, prefix: &str, of: impl Fn(f64, f64) -> f64) -> Result<Vec<f64>, String> {
        let mut left = self.source(&format!("{prefix}Left_Operand_Input_Source"))?;
        let right = self.source(&format!("{prefix}Right_Operand_Input_Source"))?;
        left.iter_mut().zip(right).for_each(|(left, right)| *left = of(*left, right));
        Ok(left)
    }

    /// Returns the values that a scale is applied to.
    fn source(&mut self, property: &str) -> Result<Vec<f64>, String> {
        match (self.object.number(property).unwrap_or(RAW), self.raw) {
            (source, Values::Numbers(values)) if source >= RAW => Ok(values.clone()),
            (source, Values::Scalers(scalers)) if source >= RAW && scalers.len() == 1 => Ok(scalers[0].1.clone()),
            (source, _) => self.scale(source.clamp(0.0, RAW) as usize),
        }
    }

    /// Returns the values of a DAQmx scaler that has the number of a scale.
    fn scaler(&self, at: usize) -> Result<Vec<f64>, String> {
        let found = match self.raw {
            Values::Scalers(scalers) => scalers.iter().find(|(id, _)| *id as usize == at),
            _ => None,
        };
        found.map(|(_, values)| values.clone()).ok_or_else(|| format!("its scale {at} is missing"))
    }
}

/// Returns the pairs of a table in the order of increasing inputs.
fn table(inputs: Vec<f64>, outputs: Vec<f64>) -> Result<Vec<(f64, f64)>, String> {
    let mut pairs: Vec<(f64, f64)> = inputs.iter().copied().zip(outputs.iter().copied()).collect();
    if pairs.first().zip(pairs.last()).is_some_and(|(first, last)| first.0 > last.0) {
        pairs.reverse();
    }
    let is_rising = pairs.windows(2).all(|pair| pair[0].0 < pair[1].0);
    if pairs.is_empty() || !is_rising || inputs.len() != outputs.len() {
        return Err("the inputs of its scale table do not increase".into());
    }
    Ok(pairs)
}

/// Interpolates a table linearly at `x`; constant outside.
fn interpolated(table: &[(f64, f64)], x: f64) -> f64 {
    let above = table.partition_point(|pair| pair.0 <= x);
    match (above.checked_sub(1).and_then(|below| table.get(below)), table.get(above)) {
        _ if x.is_nan() => x,
        (Some(below), Some(above)) => below.1 + (above.1 - below.1) / (above.0 - below.0) * (x - below.0),
        (Some(only), None) | (None, Some(only)) => only.1,
        (None, None) => f64::NAN,
    }
}
