//! Moves an operator that is not linear in its parameters to the effects found.
//!
//! Its linearisation ([`LinearisedBasis`]) holds only near its parameters. So the parameters move in damped
//! Gauss-Newton steps, with a new linearisation after each.

use crate::base::LinearisedBasis;
use crate::criteria::MIN_RMSE_DROP;
use crate::fit::FitError;
use crate::nested::{Fitted, Hypothesis};

/// Maximum number of steps.
const MAX_STEPS: usize = 16;
/// Fractions of a step that are tried, largest first.
const STEP_FRACTIONS: [f64; 4] = [1.0, 0.5, 0.2, 0.05];
/// Relative fall of Σ residual² below which the iteration ends.
const MIN_RELATIVE_FALL: f64 = 1e-3;

/// Returns the linearised operator at its new parameters, and the fit of the operator alone there. The parameters are
/// unchanged if the error would fall only a little. Returns `None` if the equations cannot be solved.
/// `fit` fits on a linearisation, including the parts of the hypothesis that may change; `solve` solves only the linear
/// unknowns.
pub(super) fn followed(
    plane: &LinearisedBasis,
    hypothesis: &Hypothesis,
    fit: impl Fn(&LinearisedBasis, &Hypothesis) -> Result<Option<Fitted>, FitError>,
    solve: impl Fn(&LinearisedBasis, &Hypothesis) -> Result<Option<Fitted>, FitError>,
) -> Result<Option<(LinearisedBasis, Fitted)>, FitError> {
    let Some(as_it_was) = solve(&plane.alone(), hypothesis)? else { return Ok(None) };
    let (own, mut plane, mut best) = (plane, plane.clone(), as_it_was.clone());
    for _ in 0..MAX_STEPS {
        let Some(step) = fit(&plane, &best.hypothesis)? else { break };
        let mut next = None;
        for share in STEP_FRACTIONS {
            let weights: Vec<f64> = step.weights.iter().map(|w| share * w).collect();
            let Some(there) = plane.at(plane.operator(&weights)) else { continue };
            next = solve(&there, &step.hypothesis)?.filter(|held| held.squares < best.squares).map(|f| (there, f));
            if next.is_some() {
                break;
            }
        }
        let Some((there, held)) = next else { break };
        let has_arrived = held.squares > (1.0 - MIN_RELATIVE_FALL) * best.squares;
        (plane, best) = (there.with_slopes_of(&plane), held);
        if has_arrived {
            break;
        }
    }
    // The known parameters are kept unless the error falls by more than another noise realisation would change it.
    let is_worth = best.rmse() <= (1.0 - MIN_RMSE_DROP) * as_it_was.rmse();
    Ok(Some(if is_worth { (plane, best) } else { (own.clone(), as_it_was) }))
}
