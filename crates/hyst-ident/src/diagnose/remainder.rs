//! What is left when every effect that was found has been added.

use hyst_core::Error;

use super::findings::{Remainder, RemainderKind};
use super::search::Search;
use crate::base::PreisachBasis;
use crate::lsq::Blocks;
use crate::nested::{Problem, cross_validate, folds_interleaved};
use crate::samples::Samples;
use crate::simulate::Simulation;

/// An RMSE of this many noise floors counts as the floor.
const AT_FLOOR: f64 = 1.3;
/// A richer base that lowers the variance above the floor by this share shows a lack of capacity.
const RICHER: f64 = 0.3;
/// Cells of the richer base.
const CELLS: usize = 24;
/// Rows that the comparison uses.
const ROWS: usize = 8_000;

/// Whether the rest is noise, lack of capacity of the base, or unexplained.
pub(super) fn judge(
    problem: &Problem<'_>,
    found: &Search,
    after: &Simulation,
    samples: &Samples,
    per_record: bool,
) -> Result<Remainder, Error> {
    let noise2 = found.noise * found.noise;
    let rmse = after.errors.as_ref().map_or(0.0, |e| e.rmse);
    let span = samples.output_span();
    let settled = || samples.output.iter().zip(&samples.settling).filter(|(_, s)| !**s).map(|(y, _)| *y);
    let n = settled().count().max(1) as f64;
    let mean = settled().sum::<f64>() / n;
    let variance = settled().map(|y| (y - mean) * (y - mean)).sum::<f64>() / n;
    let share = rmse * rmse / variance.max(f64::MIN_POSITIVE);
    let left = |kind, description: String| Remainder { kind, variance_share: share, description };
    let percent = |x: f64| 100.0 * x / span.max(f64::MIN_POSITIVE);
    if rmse <= AT_FLOOR * found.noise {
        return Ok(left(
            RemainderKind::None,
            format!("what is left is noise: {rmse:.3e} against a floor of {:.3e}", found.noise),
        ));
    }
    // The search ran on a richer, rate-independent base: what that one takes is the base's.
    let richest = {
        let screening = found.best.cv_rmse();
        if screening <= AT_FLOOR * found.noise {
            screening
        } else {
            let blocks = Blocks::new(samples, problem.blocks.rows.len(), ROWS);
            let basis = PreisachBasis::for_samples(samples, CELLS);
            let preisach = Problem::new(samples, &basis, &blocks, per_record);
            let cv = preisach.fit_linear(&found.best.fit.effects)?.and_then(|f| {
                let squares: f64 = cross_validate(&f, &folds_interleaved(&blocks, 4))?.iter().sum();
                Some((squares / f.rows.max(1) as f64).sqrt())
            });
            cv.map_or(screening, |cv| cv.min(screening))
        }
    };
    let above = (rmse * rmse - noise2).max(f64::MIN_POSITIVE);
    let taken = 1.0 - (richest * richest - noise2).max(0.0) / above;
    Ok(if taken >= RICHER {
        left(
            RemainderKind::BaseCapacity,
            format!(
                "{:.2} % of span; a richer rate-independent base would leave {:.2} %, so most of it is a map of the input's history that this base is too coarse for",
                percent(rmse),
                percent(richest)
            ),
        )
    } else {
        left(
            RemainderKind::Unexplained,
            format!(
                "{:.2} % of span stands above the noise floor of {:.2} %, and no effect of the list explains it",
                percent(rmse),
                percent(found.noise)
            ),
        )
    })
}
