//! What a fit may be told.

use std::str::FromStr;

use super::FitError;
use crate::identify::Form;
use crate::model::Kind;
use crate::model::capacity::PLAYS;
use crate::optimize::{Method, MethodError};

/// How a fit goes about it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Optimizer {
    /// What suits the model: convex where it is linear in its weights, else adaptive differential evolution over what it is not
    /// linear in.
    #[default]
    Auto,
    /// One convex problem.
    Convex,
    /// A search, by its [`name`](Method::named).
    Search(String),
}

impl Optimizer {
    /// Names of all.
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

/// Kinds whose fit is one convex problem, unless a search is asked for.
const CONVEX: [Kind; 3] = [Kind::Pi, Kind::Preisach, Kind::Dpm];

/// Bounds of one searched variable, instead of those that the record suggests.
#[derive(Clone, Debug, PartialEq)]
pub struct VariableBounds {
    /// The variable.
    pub name: String,
    /// Its lowest value.
    pub lower: f64,
    /// Its highest value.
    pub upper: f64,
}

/// What a fit may be told.
#[derive(Clone, Debug)]
pub struct FitOptions {
    /// Seed of what is drawn at random; kept with the model.
    pub seed: u64,
    /// One sensor zero for each file instead of one for all.
    pub zero_per_record: bool,
    /// How to go about it.
    pub optimizer: Optimizer,
    /// How often a search is repeated, with other draws; the best is taken.
    pub trials: usize,
    /// Most evaluations of a trial; `None` for 1500 a variable, 200 with a Bouc-Wen oscillator.
    pub evaluations: Option<u64>,
    /// Members, particles or wolves; `None` for the search's own.
    pub population: Option<usize>,
    /// Bounds instead of those that the record suggests.
    pub bounds: Vec<VariableBounds>,
    /// Form of a model that has more than one.
    pub form: Form,
    /// Most thresholds of the convex fit of `pi`, chosen by the record; `None` for even ones, unless some that are no more predict parts
    /// of the record clearly better.
    pub thresholds: Option<usize>,
}

impl FitOptions {
    /// Whether weights are to be solved for without a search, where that is possible.
    pub fn convex(&self) -> bool {
        matches!(self.optimizer, Optimizer::Auto | Optimizer::Convex)
    }

    /// Whether a model of this kind can be fitted with these options.
    ///
    /// # Errors
    /// [`FitError::Thresholds`] if there are no thresholds to choose, [`FitError::UnknownBounds`] if there are bounds where nothing is
    /// searched, [`FitError::Elements`] if a model cannot have that many.
    pub fn suits(&self, kind: Kind) -> Result<(), FitError> {
        if let Some(elements) = self.form.elements.filter(|n| !(1..=PLAYS).contains(n)) {
            return Err(FitError::Elements { elements, most: PLAYS });
        }
        if let (true, Some(bound)) = (self.convex() && CONVEX.contains(&kind), self.bounds.first()) {
            let (name, names) = (bound.name.clone(), "nothing".into());
            return Err(FitError::UnknownBounds { name, kind: kind.name(), names });
        }
        let advice = match self.thresholds {
            None => return Ok(()),
            Some(1..=PLAYS) if kind == Kind::Pi && self.convex() => return Ok(()),
            Some(_) if kind == Kind::Pi && self.convex() => "give 1 to 64",
            Some(_) => "other models, and a search, take a number of elements",
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
