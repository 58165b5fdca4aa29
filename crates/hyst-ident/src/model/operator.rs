//! The hysteresis of a model, and the host's chain and compensator around it.

use std::fmt;
use std::str::FromStr;

use hyst_core::{Chain, Env, Error, Everett, EverettInverse, Grid, Invert, Pi, PiState, PreisachState, Stage};
use serde::{Deserialize, Serialize};

/// Plays that the host's Prandtl-Ishlinskii operator holds.
const PLAYS: usize = 64;
/// Nodes along one edge of the host's Preisach triangle.
pub const NODES: usize = 65;
/// Samples that the host's delay holds.
const DELAY: usize = 8192;
/// Creep elements that the host's chain holds.
pub(crate) const CREEP: usize = 32;
/// Taps that one of the host's preview filters holds.
pub(crate) const TAPS: usize = 4095;

/// The chain as the host runs it.
pub type HostChain = Chain<f64, Operator, DELAY, CREEP>;
/// The compensator as the host runs it.
pub type Compensator = hyst_core::Compensator<f64, OperatorInverse, DELAY, CREEP, TAPS>;

/// Base models that can be fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Prandtl-Ishlinskii.
    Pi,
    /// Classical Preisach as an Everett map.
    Preisach,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 2] = [Self::Pi, Self::Preisach];

    /// The name that commands and files use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pi => "pi",
            Self::Preisach => "preisach",
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Kind {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|k| k.name() == s)
            .ok_or_else(|| format!("no model is called {s:?}; there are pi and preisach"))
    }
}

/// Densities of a Preisach operator on its triangle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PreisachSpec {
    /// Lowest input of the grid \[V\].
    pub low: f64,
    /// Highest input of the grid \[V\].
    pub high: f64,
    /// Cells along one edge.
    pub cells: usize,
    /// Input at rest \[V\].
    pub rest: f64,
    /// Output gained by each cell, α interval by α interval, β ≤ α \[output unit\].
    pub density: Vec<f64>,
    /// Output gained once per α interval by relays that never switch back \[output unit\].
    pub once: Vec<f64>,
}

/// Place of the cell with α interval `a` and β interval `b ≤ a` in a list of the triangle's cells.
pub(crate) fn cell_index(a: usize, b: usize) -> usize {
    a * (a + 1) / 2 + b
}

/// The hysteresis of a model, as parameters.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "stage", rename_all = "kebab-case")]
pub enum Base {
    /// `y = gain u + Σ weights_i play_{thresholds_i}(u)`.
    Pi {
        /// Gain of the identity \[output unit/V\].
        gain: f64,
        /// Half-widths of the plays \[V\].
        thresholds: Vec<f64>,
        /// Weights of the plays \[output unit/V\].
        weights: Vec<f64>,
    },
    /// Relays on a triangle.
    Preisach(PreisachSpec),
}

impl Base {
    /// Which kind of model it is.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Pi { .. } => Kind::Pi,
            Self::Preisach(_) => Kind::Preisach,
        }
    }

    /// The operator.
    ///
    /// # Errors
    /// Names the parameter that is not finite, out of range or too long.
    pub fn build(&self) -> Result<Operator, Error> {
        Ok(match self {
            Self::Pi { gain, thresholds, weights } => Operator::Pi(Pi::new(*gain, thresholds, weights)?),
            Self::Preisach(p) => {
                let needed = p.cells.saturating_mul(p.cells.saturating_add(1)) / 2;
                if p.density.len() != needed || p.once.len() != p.cells {
                    return Err(Error::Lengths(
                        "preisach.density and preisach.once, and what preisach.cells asks for,",
                    ));
                }
                let grid = Grid { low: p.low, high: p.high, cells: p.cells };
                Operator::Preisach(Box::new(Everett::new(
                    grid,
                    p.rest,
                    |a, b| p.density[cell_index(a, b)],
                    |a| p.once[a],
                )?))
            }
        })
    }
}

/// A hysteresis operator of the host, or the inverse of one.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "one per chain; the common case goes without indirection")]
pub enum AnyOperator<P, E> {
    /// Prandtl-Ishlinskii.
    Pi(P),
    /// Preisach.
    Preisach(Box<E>),
}

/// A hysteresis operator of the host.
pub type Operator = AnyOperator<Pi<f64, PLAYS>, Everett<f64, NODES>>;
/// The inverse of a hysteresis operator of the host.
pub type OperatorInverse = AnyOperator<Pi<f64, PLAYS>, EverettInverse<f64, NODES>>;

/// Memory of an operator of the host; an operator uses the half that is its own.
#[derive(Clone, Debug)]
pub struct OperatorState {
    pi: PiState<f64, PLAYS>,
    preisach: PreisachState<f64, NODES>,
}

impl OperatorState {
    fn new() -> Self {
        Self { pi: PiState::virgin(), preisach: PreisachState::empty() }
    }
}

impl<P, E> Stage<f64> for AnyOperator<P, E>
where
    P: Stage<f64, State = PiState<f64, PLAYS>>,
    E: Stage<f64, State = PreisachState<f64, NODES>>,
{
    type State = OperatorState;
    fn state(&self) -> OperatorState {
        OperatorState::new()
    }
    fn reset(&self, s: &mut OperatorState, e: &Env<f64>, u0: f64) -> f64 {
        match self {
            Self::Pi(o) => o.reset(&mut s.pi, e, u0),
            Self::Preisach(o) => o.reset(&mut s.preisach, e, u0),
        }
    }
    fn step(&self, s: &mut OperatorState, e: &Env<f64>, u: f64) -> f64 {
        match self {
            Self::Pi(o) => o.step(&mut s.pi, e, u),
            Self::Preisach(o) => o.step(&mut s.preisach, e, u),
        }
    }
}

impl Invert<f64> for Operator {
    type Inverse = OperatorInverse;
    fn invert(&self) -> Result<OperatorInverse, Error> {
        Ok(match self {
            Self::Pi(o) => OperatorInverse::Pi(o.invert()?),
            Self::Preisach(o) => OperatorInverse::Preisach(Box::new(o.invert()?)),
        })
    }
}
