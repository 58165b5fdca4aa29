//! Classical and dynamic Preisach models.

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

/// Returns Preisach parameters from the lists of the caller.
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

/// The dynamic model, in the stack form or as the recursion of eq. 17.
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
    /// Returns an error if a search cannot find the inverse.
    fn searchable(&self) -> Result<(), Error> {
        if self.drifting {
            return Err(Error::NotInvertible(
                "the drifting recursion jumps at reversals of the input; leave drifting= out and set fade above 0",
            ));
        }
        searchable(&self.params)
    }
}

impl Keep for EitherForm {
    fn keep(&self) -> Result<Kept, &'static str> {
        if self.drifting {
            Err("the drifting recursion is only for comparison; model files support only the stack form")
        } else {
            self.params.keep()
        }
    }
}

models! {
    /// Classical Preisach operator: relays of constant density in the cells of a triangle.
    ///
    /// Cell (a, b), b ≤ a, contains the relays that switch up in grid interval a and down in interval b. The relays on
    /// the diagonal have no width: the reversible part. The output is zero at rest. Closed-form inverse, if every cell
    /// on the diagonal has a positive density.
    class Preisach {
        /// Minimum input of the grid [u].
        low: f64,
        /// Maximum input of the grid [u].
        high: f64,
        /// Output increase of each cell when all its relays switch up [y], shape (cells·(cells + 1)/2,), cells ≤ 64, in
        /// the order of ``numpy.tril_indices(cells)``: (0, 0), (1, 0), (1, 1), (2, 0), …
        density: List,
        /// Output increase per grid interval of relays that switch up there and never down [y], shape (cells,); default
        /// zeros.
        once: Option<List> = None,
        /// Input of the virgin memory at rest [u]; default ``low``.
        rest: Option<f64> = None,
    }
    params: |p| triangle(p.low, p.high, &p.density, p.once.as_deref(), p.rest),
    stage: Everett<f64, NODES>,
    inverse: closed,
    needs: [],

    /// Dynamic Preisach model: the classical model with branches that are weighted by a mirror function ξ(D, P) of
    /// their average rate D and change P. ξ is bilinear on a uniform grid, 1 at D = 0 and constant beyond the other
    /// edges.
    ///
    /// With ``fade = 0`` it is the printed stack form, whose output has a step at each closing loop. With ``fade > 0``
    /// the steps decay with that travel of the input, and the output is continuous. ``drifting`` selects the recursion
    /// of eq. 17, which drifts. Inverse by search, only with ``fade > 0`` and without ``drifting``, because a step has
    /// no inverse: give ``low`` and ``high``.
    class Dpm {
        /// Minimum input of the Preisach grid [u].
        low: f64,
        /// Maximum input of the Preisach grid [u].
        high: f64,
        /// Output increase of each cell, as in ``Preisach`` [y].
        density: List,
        /// Minimum rate of the grid of the mirror function [u/s].
        rate_low: f64,
        /// Maximum rate of the grid of the mirror function [u/s].
        rate_high: f64,
        /// Number of nodes along the rate, at most 32.
        rates: usize,
        /// Minimum change of the grid of the mirror function [u].
        change_low: f64,
        /// Maximum change of the grid of the mirror function [u].
        change_high: f64,
        /// Number of nodes along the change, at most 32.
        changes: usize,
        /// ξ at the nodes, positive, shape (rates·changes,): node (d, p) at d·changes + p.
        mirror: List,
        /// Sample period [s].
        period: f64,
        /// Output increase per grid interval of relays that never switch back [y]; default zeros.
        once: Option<List> = None,
        /// Input of the virgin memory at rest [u]; default ``low``.
        rest: Option<f64> = None,
        /// Travel after which the step at a closing loop has decayed to 1/e [u].
        fade: f64 = 0.0,
        /// Whether the model is the recursion of eq. 17.
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
