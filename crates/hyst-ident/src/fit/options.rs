//! Options of a fit.

use std::str::FromStr;

use crate::error::FitError;
use crate::identify::Form;
use crate::model::Kind;
use crate::model::capacity::PLAYS;
use crate::optimize::{Method, MethodError};

/// Optimizer of a fit.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Optimizer {
    /// Chosen by the model.
    /// Convex if it is linear in its weights, otherwise adaptive differential evolution over the nonlinear parameters.
    #[default]
    Auto,
    /// A single convex problem.
    Convex,
    /// A search, by [`name`](Method::named).
    Search(String),
}

impl Optimizer {
    /// Returns the names of all optimizers.
    pub fn names() -> Vec<&'static str> {
        ["auto", "convex"].into_iter().chain(Method::NAMES).collect()
    }
}

impl FromStr for Optimizer {
    type Err = MethodError;

    fn from_str(name: &str) -> Result<Self, MethodError> {
        Ok(match name {
            "auto" => Self::Auto,
            "convex" => Self::Convex,
            _ => {
                Method::named(name, 1)?;
                Self::Search(name.into())
            }
        })
    }
}

/// Kinds whose fit is a single convex problem unless a search is requested.
const CONVEX: [Kind; 3] = [Kind::Pi, Kind::Preisach, Kind::Dpm];

/// Bounds of one searched variable, instead of those suggested by the record.
#[derive(Clone, Debug, PartialEq)]
pub struct VariableBounds {
    /// The variable.
    pub name: String,
    /// Its lowest value.
    pub lower: f64,
    /// Its highest value.
    pub upper: f64,
}

/// Options of a fit.
#[derive(Clone, Debug)]
pub struct FitOptions {
    /// Seed of the random numbers; stored with the model.
    pub seed: u64,
    /// One sensor zero for each file instead of one for all.
    pub zero_per_record: bool,
    /// Optimizer.
    pub optimizer: Optimizer,
    /// Number of repetitions of a search with other random numbers; the best result is used.
    pub trials: usize,
    /// Maximum number of evaluations of a trial.
    /// `None` for 1500 per variable (200 for a Bouc-Wen oscillator).
    pub evaluations: Option<u64>,
    /// Population size (members, particles or wolves); `None` for the default of the search.
    pub population: Option<usize>,
    /// Bounds instead of those suggested by the record.
    pub bounds: Vec<VariableBounds>,
    /// Form of a model that has more than one.
    pub form: Form,
    /// Maximum number of thresholds of the convex fit of `pi`, chosen by the record.
    /// `None` for evenly spaced thresholds, unless at most as many chosen thresholds predict left-out parts of the
    /// record clearly better.
    pub thresholds: Option<usize>,
}

impl FitOptions {
    /// Returns whether weights are solved for without a search, if the model allows that.
    pub fn convex(&self) -> bool {
        matches!(self.optimizer, Optimizer::Auto | Optimizer::Convex)
    }

    /// Checks whether a model of this kind can be fitted with these options.
    ///
    /// # Errors
    /// [`FitError::Thresholds`] if the model has no selectable thresholds, [`FitError::NoElements`] if it has no
    /// selectable number of elements, [`FitError::UnknownBounds`] if there are bounds but nothing is searched,
    /// [`FitError::Elements`] if the number of elements is out of range.
    pub fn suits(&self, kind: Kind) -> Result<(), FitError> {
        if let Some(elements) = self.form.elements.filter(|n| !(1..=PLAYS).contains(n)) {
            return Err(FitError::Elements { elements, most: PLAYS });
        }
        let has_elements = match kind {
            Kind::Gpi | Kind::TdPi | Kind::TdEm | Kind::MaxwellSlip => true,
            Kind::Pi => !self.convex(),
            _ => false,
        };
        if self.form.elements.is_some() && !has_elements {
            let advice = match kind {
                Kind::Pi => "for the convex fit of pi, give a number of thresholds",
                _ => "leave it out",
            };
            return Err(FitError::NoElements { kind: kind.name(), advice });
        }
        if let (true, Some(bound)) = (self.convex() && CONVEX.contains(&kind), self.bounds.first()) {
            let (name, names) = (bound.name.clone(), "nothing".into());
            return Err(FitError::UnknownBounds { name, kind: kind.name(), names });
        }
        let advice = match self.thresholds {
            None => return Ok(()),
            Some(1..=PLAYS) if kind == Kind::Pi && self.convex() => return Ok(()),
            Some(_) if kind == Kind::Pi && self.convex() => "give 1 to 64",
            Some(_) => "for other models and for a search, give a number of elements",
        };
        Err(FitError::Thresholds { kind: kind.name(), advice })
    }
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            seed: 0,
            zero_per_record: false,
            optimizer: Optimizer::Auto,
            trials: 1,
            evaluations: None,
            population: None,
            bounds: Vec::new(),
            form: Form::default(),
            thresholds: None,
        }
    }
}
