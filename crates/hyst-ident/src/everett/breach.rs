//! Where a measured surface is no Everett surface: not positive, or not monotone, by more than its noise.

use hyst_core::{SurfaceRule, surface_violations};
use serde::Serialize;

use super::surface::Surface;

/// Standard errors by which a node must break a rule before it counts.
const BEYOND: f64 = 3.0;

/// A rule of Everett surfaces (Schirrer et al., section 4.3: strictly positive, strictly monotone).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum BreachRule {
    /// E > 0: an input that falls from α to β makes the output fall.
    Positive,
    /// E rises with α: rising branches rise.
    RisesWithAlpha,
    /// E rises as β falls: falling branches fall.
    FallsWithBeta,
}

/// A cell of the grid, named by its corner (α, β), that breaks a rule.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Breach {
    /// Upper input \[input unit\].
    pub alpha: f64,
    /// Lower input \[input unit\].
    pub beta: f64,
    /// The rule.
    pub rule: BreachRule,
    /// By how much \[output unit\].
    pub by: f64,
    /// The same in standard errors of the quantity that is negative; infinite without noise.
    pub sigmas: f64,
}

impl Surface {
    /// Every place that breaks a rule, by however little.
    fn all_breaches(&self) -> Vec<Breach> {
        let mut found = Vec::new();
        let mut tell = |i: usize, j: usize, rule: BreachRule, by: f64, variance: f64| {
            let sigmas = if variance > 0.0 { by / variance.sqrt() } else { f64::INFINITY };
            found.push(Breach { alpha: self.at(i), beta: self.at(j), rule, by, sigmas });
        };
        let whole = |i: usize, j: usize| {
            let n = self.node(i, j);
            n.top + n.end
        };
        surface_violations(
            self.grid.cells,
            |i, j| self.value(i, j),
            |v| {
                let (i, j) = (v.alpha, v.beta);
                match v.rule {
                    // Beside the diagonal both neighbours are 0: the two rules are one, that E is positive.
                    SurfaceRule::RisesWithAlpha if i == j + 1 => {}
                    SurfaceRule::RisesWithAlpha => {
                        tell(i, j, BreachRule::RisesWithAlpha, v.by, whole(i, j) + whole(i - 1, j));
                    }
                    // The output at the top cancels between nodes of a row.
                    SurfaceRule::FallsWithBeta if i > j + 1 => {
                        tell(i, j, BreachRule::FallsWithBeta, v.by, self.node(i, j).end + self.node(i, j + 1).end);
                    }
                    SurfaceRule::FallsWithBeta | SurfaceRule::Finite => {}
                }
            },
        );
        for i in 1..=self.grid.cells {
            for j in 0..i {
                let e = self.value(i, j);
                if e < 0.0 {
                    tell(i, j, BreachRule::Positive, -e, whole(i, j));
                }
            }
        }
        found
    }

    /// The cells that break a rule by more than 3 standard errors, the clearest first.
    pub fn breaches(&self) -> Vec<Breach> {
        let mut found = self.all_breaches();
        found.retain(|b| b.sigmas > BEYOND);
        found.sort_by(|a, b| b.sigmas.total_cmp(&a.sigmas));
        found
    }

    /// How many places break a rule by however little: an operator can be built of the values as they are if there are
    /// none, and the virgin curve rises.
    pub fn steps_back(&self) -> usize {
        let virgin = (1..=self.grid.cells).filter(|i| self.virgin(*i) < self.virgin(i - 1)).count();
        self.all_breaches().len() + virgin
    }
}
