//! A fit and the start-up rows that it leaves out. A second fit to all rows decides whether they are start-up rows.

use crate::Samples;
use crate::criteria::RMSE_TOLERANCE;
use crate::nested::Fitted;

/// RMSE below which the residual is rounding, as a share of the output's span.
const ROUNDING_SHARE: f64 = 1e-6;

/// Fits without the marked rows, and returns the fit and its start-up rows; `None` if it cannot be solved.
pub(super) type Fits<'a, E> = dyn FnMut(&[bool]) -> Result<Option<(Fitted, Vec<bool>)>, E> + 'a;

/// A fit, and the rows that it left out.
pub(super) struct Settled {
    pub(super) fit: Fitted,
    pub(super) settling: Vec<bool>,
}

impl Settled {
    /// Fits without these rows, and again without the resulting start-up rows if they differ.
    pub(super) fn from<E>(settling: Vec<bool>, fit: &mut Fits<'_, E>) -> Result<Option<Self>, E> {
        let Some((first, starting)) = fit(&settling)? else { return Ok(None) };
        if starting == settling {
            return Ok(Some(Self { fit: first, settling }));
        }
        Ok(fit(&starting)?.map(|(fit, _)| Self { fit, settling: starting }))
    }
}

/// Returns a fit that starts with all rows, or the `known` one. The new fit is used if at most half of the known
/// start-up rows are start-up then and its error is not larger. A model without an effect that acts at the start
/// mistakes it for a transient.
pub(super) fn unless_followed<E>(samples: &Samples, known: Settled, fit: &mut Fits<'_, E>) -> Result<Settled, E> {
    let blind = &samples.blind;
    let start_up = |rows: &[bool]| rows.iter().zip(blind).filter(|(starts, blind)| **starts && !**blind).count();
    if start_up(&known.settling) == 0 {
        return Ok(known);
    }
    let floor = ROUNDING_SHARE * samples.output_span();
    let errs_no_more = |all: &Settled| all.fit.rmse() <= RMSE_TOLERANCE * known.fit.rmse().max(floor);
    let Some(all) = Settled::from(blind.clone(), fit)? else { return Ok(known) };
    let followed = 2 * start_up(&all.settling) <= start_up(&known.settling);
    Ok(if followed && errs_no_more(&all) { all } else { known })
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::nested::Hypothesis;
    use crate::record::{Columns, OutputUnit, Record};

    /// A hundred rows of a rising line, without clipping.
    fn samples() -> Samples {
        let rows = || (0..100).map(f64::from);
        let record = Record::from_samples(Columns {
            time: rows().map(|k| k * 1e-3).collect(),
            input: Some(rows().collect()),
            output: Some((OutputUnit::Micrometre, rows().collect())),
            ..Columns::default()
        });
        Samples::from_record(&record.unwrap())
    }

    /// Flags the first rows of a hundred.
    fn first(rows: usize) -> Vec<bool> {
        (0..100).map(|k| k < rows).collect()
    }

    fn fitted(rmse: f64) -> Fitted {
        Fitted {
            hypothesis: Hypothesis::default(),
            weights: Vec::new(),
            zeros: Vec::new(),
            squares: 100.0 * rmse * rmse,
            rows: 100,
            shares: [].into(),
            solution: DVector::zeros(0),
            bounds: Vec::new(),
            penalty: DMatrix::zeros(0, 0),
        }
    }

    fn count(settling: &[bool]) -> usize {
        settling.iter().filter(|s| **s).count()
    }

    /// Runs `unless_followed` with 40 known start-up rows and an RMSE of 1, and a fit to all rows with this RMSE and
    /// `starting` start-up rows. Returns the number of start-up rows, and the number of rows that each fit left out.
    fn followed(rmse: f64, starting: usize) -> (usize, Vec<usize>) {
        let asked = RefCell::new(Vec::new());
        let known = Settled { fit: fitted(1.0), settling: first(40) };
        let settled = unless_followed(&samples(), known, &mut |settling: &[bool]| {
            asked.borrow_mut().push(count(settling));
            Ok::<_, ()>(Some((fitted(rmse), first(starting))))
        });
        (count(&settled.unwrap().settling), asked.into_inner())
    }

    #[test]
    fn rows_that_a_fit_to_all_rows_follows_are_not_start_up_rows() {
        assert_eq!(followed(1.0, 0), (0, vec![0]));
        // Some of them may still be start-up rows; a second fit leaves them out.
        assert_eq!(followed(1.0, 20), (20, vec![0, 20]));
    }

    #[test]
    fn rows_that_it_does_not_follow_stay_start_up_rows() {
        assert_eq!(followed(1.0, 21).0, 40, "most of them are a start-up for it too");
        assert_eq!(followed(1.06, 0).0, 40, "its error is larger");
        assert_eq!(followed(1.04, 0).0, 0, "its error is equal within the tolerance");
    }

    #[test]
    fn without_start_up_rows_or_a_solution_nothing_changes() {
        let none = Settled { fit: fitted(1.0), settling: first(0) };
        let kept = unless_followed(&samples(), none, &mut |_: &[bool]| Err("nothing is to be fitted"));
        assert_eq!(count(&kept.unwrap().settling), 0);
        let known = || Settled { fit: fitted(1.0), settling: first(40) };
        let kept = unless_followed(&samples(), known(), &mut |_: &[bool]| Ok::<_, ()>(None));
        assert_eq!(count(&kept.unwrap().settling), 40);
        assert!(unless_followed(&samples(), known(), &mut |_: &[bool]| Err(())).is_err());
    }

    /// If the known fit is exact, a fit with a rounding error is not worse.
    #[test]
    fn a_rounding_error_counts_as_no_error() {
        let known = Settled { fit: fitted(0.0), settling: first(40) };
        let rounding = ROUNDING_SHARE * 99.0;
        let all = |rmse| move |_: &[bool]| Ok::<_, ()>(Some((fitted(rmse), first(0))));
        let kept = unless_followed(&samples(), known, &mut all(rounding)).unwrap();
        assert_eq!(count(&kept.settling), 0);
        let known = Settled { fit: fitted(0.0), settling: first(40) };
        let kept = unless_followed(&samples(), known, &mut all(2.0 * rounding)).unwrap();
        assert_eq!(count(&kept.settling), 40);
    }
}
