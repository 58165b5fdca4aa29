//! What a fit may be told.

use std::str::FromStr;

use crate::identify::Form;
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
        }
    }
}
