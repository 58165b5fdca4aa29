//! How an operator that is not linear in its parameters follows what was found.
//!
//! Its plane ([`LinearisedBasis`]) holds near its parameters only. So it goes there in Gauss-Newton steps, each as far as it lowers the error, with a new
//! plane after each.

use crate::base::LinearisedBasis;
use crate::criteria::MIN_RMSE_DROP;
use crate::fit::FitError;
use crate::nested::{Fitted, Hypothesis};

/// Steps at most.
const STEPS: usize = 16;
/// Shares of a step that are tried, the whole one first.
const SHARES: [f64; 4] = [1.0, 0.5, 0.2, 0.05];
/// Relative fall of the squares at which it has arrived.
const LEAST_FALL: f64 = 1e-3;

/// The plane where fits beside a hypothesis lead, and the fit of the operator alone there; where it was, if it errs hardly less there; none if that cannot be
/// solved. `fit` fits on a plane, as much of the hypothesis as shall follow too; `solve` solves what is linear in the unknowns.
pub(super) fn followed(
    plane: &LinearisedBasis,
    hypothesis: &Hypothesis,
    fit: impl Fn(&LinearisedBasis, &Hypothesis) -> Result<Option<Fitted>, FitError>,
    solve: impl Fn(&LinearisedBasis, &Hypothesis) -> Result<Option<Fitted>, FitError>,
) -> Result<Option<(LinearisedBasis, Fitted)>, FitError> {
    let Some(as_it_was) = solve(&plane.alone(), hypothesis)? else { return Ok(None) };
    let (own, mut plane, mut best) = (plane, plane.clone(), as_it_was.clone());
    for _ in 0..STEPS {
        let Some(step) = fit(&plane, &best.hypothesis)? else { break };
        let mut next = None;
        for share in SHARES {
            let weights: Vec<f64> = step.weights.iter().map(|w| share * w).collect();
            let Some(there) = plane.at(plane.operator(&weights)) else { continue };
            next = solve(&there, &step.hypothesis)?.filter(|held| held.squares < best.squares).map(|f| (there, f));
            if next.is_some() {
                break;
            }
        }
        let Some((there, held)) = next else { break };
        let has_arrived = held.squares > (1.0 - LEAST_FALL) * best.squares;
        (plane, best) = (there.with_slopes_of(&plane), held);
        if has_arrived {
            break;
        }
    }
    // What is known of its parameters is not given up for what another draw of the noise would change as well.
    let is_worth = best.rmse() <= (1.0 - MIN_RMSE_DROP) * as_it_was.rmse();
    Ok(Some(if is_worth { (plane, best) } else { (own.clone(), as_it_was) }))
}
