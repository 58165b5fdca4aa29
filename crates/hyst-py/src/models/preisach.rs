//! Classical and dynamic Preisach.

use hyst_core::{Build, DpmParams, Error, Everett, MirrorParams, PreisachParams, Sampling};
use hyst_ident::model::capacity::{MIRROR, NODES};
use hyst_ident::model::searchable;

use crate::arrays::List;
use crate::errors;
use crate::inversion::{closed, search};
use crate::keep::{Keep, Kept};
use crate::model_macro::models;

/// The dynamic Preisach model with a mirror of at most [`MIRROR`]² nodes.
type HostDpm = hyst_core::Dpm<f64, NODES, MIRROR, MIRROR>;

/// Preisach parameters from lists of the caller's.
fn triangle(
    low: f64,
    high: f64,
    density: &[f64],
    once: Option<&[f64]>,
    rest: Option<f64>,
) -> Result<PreisachParams<Vec<f64>>, Error> {
    let cells = (0..NODES).find(|n| n * (n + 1) / 2 >= density.len()).unwrap_or(NODES);
    if density.len() != cells * (cells + 1) / 2 {
        return Err(Error::OutOfRange { name: "preisach.density", must: "n (n + 1) / 2 values, n at most 64" });
    }
    let once = once.map_or_else(|| vec![0.0; cells], <[f64]>::to_vec);
    if once.len() != cells {
        return Err(Error::Lengths("preisach.once and the cells along one edge of preisach.density"));
    }
    Ok(PreisachParams { low, high, cells, rest: rest.unwrap_or(low), density: density.to_vec(), once })
}

/// The dynamic model in the stack form or as the recursion of eq. 17.
struct EitherForm {
    params: DpmParams<Vec<f64>>,
    drifting: bool,
}

impl Build<HostDpm> for EitherForm {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<HostDpm, Error> {
        let model: HostDpm = self.params.build(cx)?;
        Ok(if self.drifting { model.drifting() } else { model })
    }
}

impl EitherForm {
    /// Whether a search finds the inverse.
    fn searchable(&self) -> Result<(), Error> {
        if self.drifting {
            return Err(Error::NotInvertible(
                "the drifting recursion jumps where the input turns; leave drifting= out and set fade above 0",
            ));
        }
        searchable(&self.params)
    }
}

impl Keep for EitherForm {
    fn keep(&self) -> Result<Kept, &'static str> {
        if self.drifting {
            Err("the drifting recursion is there to be compared with; files hold the stack form")
        } else {
            self.params.keep()
        }
    }
}

models! {
    /// Classical Preisach operator: relays of constant density in the cells of a triangle.
    ///
    /// Cell (a, b), b ≤ a, holds the relays that switch up in grid interval a and down in interval b. On the diagonal the
    /// relays have no width: the reversible part. The output is zero at rest. Closed-form inverse, if every cell on the
    /// diagonal has a density.
    class Preisach {
        /// Lowest input of the grid [u].
        low: f64,
        /// Highest input of the grid [u].
        high: f64,
        /// Output gained by each cell when all its relays switch up [y], shape (cells·(cells + 1)/2,), cells ≤ 64, in the
        /// order of ``numpy.tril_indices(cells)``: (0, 0), (1, 0), (1, 1), (2, 0), …
        density: List,
        /// Output gained once per grid interval by relays that switch up there and never down [y], shape (cells,); zeros
        /// if not given.
        once: Option<List> = None,
        /// Input at which the virgin memory rests [u]; the lowest if not given.
        rest: Option<f64> = None,
    }
    params: |p| triangle(p.low, p.high, &p.density, p.once.as_deref(), p.rest),
    stage: Everett<f64, NODES>,
    inverse: closed,
    needs: [],

    /// Dynamic Preisach model: a classical one whose branches are weighted by a mirror function ξ(D, P) of their average rate D
    /// and change P, bilinear on a uniform grid, 1 at D = 0 and clamped beyond the other edges.
    ///
    /// With ``fade = 0`` the stack form as printed, which steps where loops close; with ``fade > 0`` the steps fade with that travel
    /// of the input, and the output is continuous. ``drifting`` is the recursion of eq. 17, which drifts. Inverse by search: give
    /// ``low`` and ``high``. Only with ``fade > 0`` and without ``drifting``: inside a step there is nothing to find.
    class Dpm {
        /// Lowest input of the Preisach grid [u].
        low: f64,
        /// Highest input of the Preisach grid [u].
        high: f64,
        /// Output gained by each cell, as in ``Preisach`` [y].
        density: List,
        /// Lowest rate of the mirror's grid [u/s].
        rate_low: f64,
        /// Highest rate of the mirror's grid [u/s].
        rate_high: f64,
        /// Nodes along the rate, at most 32.
        rates: usize,
        /// Lowest change of the mirror's grid [u].
        change_low: f64,
        /// Highest change of the mirror's grid [u].
        change_high: f64,
        /// Nodes along the change, at most 32.
        changes: usize,
        /// ξ at the nodes, positive, shape (rates·changes,): node (d, p) at d·changes + p.
        mirror: List,
        /// Sample period [s].
        period: f64,
        /// Output gained once per grid interval by relays that never switch back [y]; zeros if not given.
        once: Option<List> = None,
        /// Input at which the virgin memory rests [u]; the lowest if not given.
        rest: Option<f64> = None,
        /// Travel over which the step at a closing loop fades to 1/e [u].
        fade: f64 = 0.0,
        /// The recursion of eq. 17 instead.
        drifting: bool = false,
    }
    params: |p| {
        let preisach = triangle(p.low, p.high, &p.density, p.once.as_deref(), p.rest)?;
        let mirror = MirrorParams {
            rate_low: p.rate_low,
            rate_high: p.rate_high,
            rates: p.rates,
            change_low: p.change_low,
            change_high: p.change_high,
            changes: p.changes,
            weights: p.mirror.to_vec(),
        };
        Ok(EitherForm { params: DpmParams { preisach, mirror, fade: p.fade }, drifting: p.drifting })
    },
    stage: HostDpm,
    period: |p| p.period,
    inverse: |built, options| {
        built.params.searchable().map_err(errors::core)?;
        search(built, options)
    },
    needs: [],
}
