//! Finds where a measured surface is not an Everett surface: not positive, or not monotone, by more than its noise.

use hyst_core::{SurfaceRule, surface_violations};
use serde::Serialize;

use super::surface::Surface;

/// Minimum size of a breach that counts, in standard errors.
const MIN_SIGMAS: f64 = 3.0;

/// A rule of Everett surfaces (Schirrer et al., section 4.3: strictly positive, strictly monotone).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum BreachRule {
    /// E > 0: an input that falls from α to β makes the output fall.
    Positive,
    /// E rises with α: rising branches rise.
    RisesWithAlpha,
    /// E rises with falling β: falling branches fall.
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
    /// Size of the breach \[output unit\].
    pub by: f64,
    /// The same in standard errors of the negative quantity; infinite without noise.
    pub sigmas: f64,
}

impl Surface {
    /// Returns all breaches, however small.
    fn all_breaches(&self) -> Vec<Breach> {
        let mut found = Vec::new();
        let mut add = |i: usize, j: usize, rule: BreachRule, by: f64, variance: f64| {
            let sigmas = if variance > 0.0 { by / variance.sqrt() } else { f64::INFINITY };
            found.push(Breach { alpha: self.at(i), beta: self.at(j), rule, by, sigmas });
        };
        let variance_of = |i: usize, j: usize| {
            let n = self.node(i, j);
            n.top + n.end
        };
        surface_violations(
            self.grid.cells,
            |i, j| self.value(i, j),
            |v| {
                let (i, j) = (v.alpha, v.beta);
                match v.rule {
                    // Next to the diagonal both neighbours are 0: both rules then require a positive E.
                    SurfaceRule::RisesWithAlpha if i == j + 1 => {}
                    SurfaceRule::RisesWithAlpha => {
                        add(i, j, BreachRule::RisesWithAlpha, v.by, variance_of(i, j) + variance_of(i - 1, j));
                    }
                    // The error of the output at the top cancels between nodes of a row.
                    SurfaceRule::FallsWithBeta if i > j + 1 => {
                        add(i, j, BreachRule::FallsWithBeta, v.by, self.node(i, j).end + self.node(i, j + 1).end);
                    }
                    SurfaceRule::FallsWithBeta | SurfaceRule::Finite => {}
                }
            },
        );
        for i in 1..=self.grid.cells {
            for j in 0..i {
                let e = self.value(i, j);
                if e < 0.0 {
                    add(i, j, BreachRule::Positive, -e, variance_of(i, j));
                }
            }
        }
        found
    }

    /// Returns the breaches of more than 3 standard errors, the largest first.
    pub fn breaches(&self) -> Vec<Breach> {
        let mut found = self.all_breaches();
        found.retain(|b| b.sigmas > MIN_SIGMAS);
        found.sort_by(|a, b| b.sigmas.total_cmp(&a.sigmas));
        found
    }

    /// Returns the number of breaches, however small, and of cells in which the virgin curve falls. If it is 0, an
    /// operator can be built from the measured values.
    pub fn steps_back(&self) -> usize {
        let virgin = (1..=self.grid.cells).filter(|i| self.virgin(*i) < self.virgin(i - 1)).count();
        self.all_breaches().len() + virgin
    }
}
