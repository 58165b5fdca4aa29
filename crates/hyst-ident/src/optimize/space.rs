//! The box of a search: variables with names, units and bounds, on linear or logarithmic scales.

/// Scale of a variable over its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Scale {
    /// Linear.
    #[default]
    Linear,
    /// Logarithmic, for a value that is known only to an order of magnitude.
    Log,
}

/// One variable of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name, as in the model file.
    pub name: String,
    /// Unit, as in the model file.
    pub unit: String,
    /// Lowest value.
    pub lower: f64,
    /// Highest value.
    pub upper: f64,
    /// Scale.
    pub scale: Scale,
}

impl Variable {
    /// Returns a variable on a linear scale.
    pub fn linear(name: &str, unit: &str, lower: f64, upper: f64) -> Self {
        Self { name: name.into(), unit: unit.into(), lower, upper, scale: Scale::Linear }
    }

    /// Returns a variable on a logarithmic scale.
    pub fn log(name: &str, unit: &str, lower: f64, upper: f64) -> Self {
        Self { scale: Scale::Log, ..Self::linear(name, unit, lower, upper) }
    }

    fn check(&self) -> Result<(), SpaceError> {
        let Self { name, lower, upper, .. } = self;
        if !lower.is_finite() || !upper.is_finite() {
            return Err(SpaceError::Infinite { name: name.clone(), lower: *lower, upper: *upper });
        }
        if lower >= upper {
            return Err(SpaceError::Reversed { name: name.clone(), lower: *lower, upper: *upper });
        }
        if self.scale == Scale::Log && *lower <= 0.0 {
            return Err(SpaceError::LogOfZero { name: name.clone(), lower: *lower });
        }
        Ok(())
    }

    /// Returns the value at `x` in 0..=1.
    fn value(&self, x: f64) -> f64 {
        let value = match self.scale {
            Scale::Linear => self.lower + (self.upper - self.lower) * x,
            Scale::Log => self.lower * (x * (self.upper / self.lower).ln()).exp(),
        };
        value.clamp(self.lower, self.upper)
    }

    /// Returns the position of a value in 0..=1.
    fn place(&self, value: f64) -> f64 {
        let value = value.clamp(self.lower, self.upper);
        match self.scale {
            Scale::Linear => (value - self.lower) / (self.upper - self.lower),
            Scale::Log => (value / self.lower).ln() / (self.upper / self.lower).ln(),
        }
    }
}

/// Errors of the definition of a box.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpaceError {
    /// There is no variable.
    #[error("a search needs at least one variable")]
    Empty,
    /// The bounds are reversed or equal.
    #[error("bounds of {name}: the lower one ({lower}) must be below the upper one ({upper})")]
    Reversed {
        /// The variable.
        name: String,
        /// Its lower bound.
        lower: f64,
        /// Its upper bound.
        upper: f64,
    },
    /// A bound is not finite.
    #[error("bounds of {name}: {lower} … {upper} must be a finite range")]
    Infinite {
        /// The variable.
        name: String,
        /// Its lower bound.
        lower: f64,
        /// Its upper bound.
        upper: f64,
    },
    /// A logarithmic scale has a lower bound that is not positive.
    #[error("bounds of {name}: on a logarithmic scale the lower one ({lower}) must be positive")]
    LogOfZero {
        /// The variable.
        name: String,
        /// Its lower bound.
        lower: f64,
    },
    /// Two variables have the same name.
    #[error("there are two variables named {name}")]
    Twice {
        /// The name.
        name: String,
    },
}

/// A box of variables.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    variables: Vec<Variable>,
}

impl Space {
    /// Creates the box of these variables.
    ///
    /// # Errors
    /// If there are none, two have the same name, or bounds are not finite, reversed, or not positive on a logarithmic
    /// scale.
    pub fn new(variables: Vec<Variable>) -> Result<Self, SpaceError> {
        if variables.is_empty() {
            return Err(SpaceError::Empty);
        }
        for (i, v) in variables.iter().enumerate() {
            v.check()?;
            if variables[..i].iter().any(|other| other.name == v.name) {
                return Err(SpaceError::Twice { name: v.name.clone() });
            }
        }
        Ok(Self { variables })
    }

    /// Returns the variables in their order.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// Returns the number of variables.
    pub fn dimensions(&self) -> usize {
        self.variables.len()
    }

    /// Returns the values at a point of the unit cube.
    pub fn values(&self, point: &[f64]) -> Vec<f64> {
        let mut values = vec![0.0; self.dimensions()];
        self.values_into(point, &mut values);
        values
    }

    /// Writes [`values`](Self::values) to an existing list.
    pub(crate) fn values_into(&self, point: &[f64], values: &mut [f64]) {
        for ((value, v), x) in values.iter_mut().zip(&self.variables).zip(point) {
            *value = v.value(*x);
        }
    }

    /// Returns the point of the unit cube for these values; values outside their bounds are moved to them.
    pub fn point(&self, values: &[f64]) -> Vec<f64> {
        self.variables.iter().zip(values).map(|(v, x)| v.place(*x)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn invalid_bounds_are_errors_with_the_name() {
        let refused = |v: Variable| Space::new(vec![v]).unwrap_err().to_string();
        assert!(refused(Variable::linear("gamma", "1/V", 2.0, 1.0)).starts_with("bounds of gamma: the lower one (2)"));
        assert!(refused(Variable::linear("gamma", "1/V", 0.0, f64::INFINITY)).contains("gamma"));
        assert!(refused(Variable::log("tau", "s", 0.0, 1.0)).contains("tau"));
        assert_eq!(Space::new(Vec::new()), Err(SpaceError::Empty));
        let twice = vec![Variable::linear("a", "", 0.0, 1.0), Variable::linear("a", "", 0.0, 1.0)];
        assert_eq!(Space::new(twice), Err(SpaceError::Twice { name: "a".into() }));
    }

    proptest! {
        #[test]
        fn values_of_a_point_give_the_point_again(x in 0.0..=1.0f64, y in 0.0..=1.0f64) {
            let variables = vec![Variable::linear("a", "", -3.0, 7.0), Variable::log("b", "", 1e-6, 1e3)];
            let space = Space::new(variables).unwrap();
            let values = space.values(&[x, y]);
            prop_assert!((-3.0..=7.0).contains(&values[0]) && (1e-6..=1e3).contains(&values[1]));
            let point = space.point(&values);
            prop_assert!((point[0] - x).abs() < 1e-12 && (point[1] - y).abs() < 1e-12);
        }
    }
}
