//! Convex fits: weights of play operators or of Preisach cells.

use super::basis::{BasisOf, ROWS_PER_UNKNOWN, basis_for};
use super::check::check;
use super::model::{to_model, with_errors};
use super::options::FitOptions;
use super::result::Fit;
use super::settled::{fit_settled, solved};
use crate::base::{Drag, PlaysWithSlopes};
use crate::error::FitError;
use crate::identify::{Estimate, Noise, TableEstimate, TableOf, convex, parameters_of};
use crate::lsq::{BLOCKS, Blocks, Gram, ROWS, Share};
use crate::model::{Base, Kind, Model, ZERO};
use crate::nested::Fitted;
use crate::record::Record;
use crate::samples::Samples;

/// Minimum number of rows for any model.
const MIN_ROWS: usize = 45;
/// Description of the fit.
const DESCRIPTION: &str = "convex: non-negative weights, one optimum";

/// Fits non-negative weights of play operators or cells.
pub(super) fn fit(record: &Record, kind: Kind, options: &FitOptions) -> Result<Fit, FitError> {
    let mut samples = Samples::from_record(record);
    let name = || record.name();
    let enough = |rows: usize, unknowns: usize| match ROWS_PER_UNKNOWN * unknowns {
        needed if rows < needed => Err(FitError::TooShort { record: name(), rows, unknowns, needed }),
        _ => Ok(()),
    };
    enough(samples.len(), MIN_ROWS / ROWS_PER_UNKNOWN)?;
    check(record, &samples, false)?;
    let basis = basis_for(kind, &samples)?;
    enough(samples.len(), basis.len())?;
    let (fitted, left) = fit_settled(&mut samples, basis.as_ref(), options, &name)?;
    let settled = samples.settling.iter().filter(|s| !**s).count();
    enough(settled, basis.len())?;
    let BasisOf::Pi(even) = &basis else {
        let model = to_model(record, &samples, &basis, &fitted, options.seed);
        return Ok(Fit { tables: vec![cells(&fitted, &samples, &left)], ..Fit::at_once(model, DESCRIPTION) });
    };
    let Some(chosen) = even.chosen(&samples, &Drag::NONE, &|_| {}, options.thresholds) else {
        if options.thresholds.is_some() {
            return Err(FitError::Unsolvable { record: name() });
        }
        let model = to_model(record, &samples, &basis, &fitted, options.seed);
        let estimate = plays(&model.base, &fitted, &fitted, &samples, &left);
        return Ok(with_estimate(model, estimate, DESCRIPTION));
    };
    let count = chosen.thresholds.len();
    enough(settled, 2 * (1 + count))?;
    let (fitted, left) = solved(&samples, &chosen, options.zero_per_record, &name)?;
    let sliding = PlaysWithSlopes { plays: &chosen, weights: &fitted.weights };
    let slopes = solved(&samples, &sliding, options.zero_per_record, &name)?.0;
    let model = to_model(record, &samples, &BasisOf::Pi(chosen.clone()), &fitted, options.seed);
    let estimate = plays(&model.base, &fitted, &slopes, &samples, &left);
    let why = match options.thresholds {
        Some(most) => format!("{most} at most"),
        None => "clearly better than even ones on left-out parts".into(),
    };
    Ok(with_estimate(model, estimate, &format!("{DESCRIPTION}; {count} thresholds chosen by the record ({why})")))
}

fn with_estimate(model: Model, estimate: Estimate, how: &str) -> Fit {
    let model = with_errors(model, &estimate);
    Fit { estimate: Some(estimate), ..Fit::at_once(model, how) }
}

/// Returns the standard errors of the weights of a Prandtl-Ishlinskii operator and of the sensor's zeros. Includes the
/// thresholds if `columns`, at the same optimum, has their derivatives.
fn plays(base: &Base, fitted: &Fitted, columns: &Fitted, samples: &Samples, left: &[f64]) -> Estimate {
    let (thresholds, mut parameters): (Vec<_>, Vec<_>) =
        parameters_of(base).into_iter().partition(|(name, _)| name.starts_with("thresholds"));
    let (low, high) = samples.input_range();
    // Weights are parts of one curve, so their scale is the sum; the scale of thresholds is half of their spacing.
    let whole = parameters.iter().map(|(_, weight)| weight).sum();
    let mut scales = vec![whole; parameters.len()];
    if columns.weights.len() > parameters.len() {
        scales.extend(vec![0.5 * (high - low) / thresholds.len() as f64; thresholds.len()]);
        parameters.extend(thresholds);
    }
    let name = |i: usize| if fitted.zeros.len() == 1 { ZERO.into() } else { format!("{ZERO}[{i}]") };
    parameters.extend(fitted.zeros.iter().enumerate().map(|(i, zero)| (name(i), *zero)));
    scales.resize(parameters.len(), samples.output_span());
    let (total, values): (_, Vec<f64>) = (total(columns), parameters.iter().map(|(_, value)| *value).collect());
    let free = convex::free(&values, &total, &columns.bounds);
    convex::estimate(parameters, &scales, &total, &free, &noise(samples, left))
}

/// Returns how well the record determines each cell of a Preisach triangle.
pub(crate) fn cells(fitted: &Fitted, samples: &Samples, left: &[f64]) -> TableEstimate {
    let weights = &fitted.weights;
    let mean = weights.iter().sum::<f64>() / weights.len().max(1) as f64;
    TableEstimate::of(TableOf::Cells, weights, mean, &total(fitted), &fitted.bounds, &noise(samples, left))
}

/// Returns the noise estimated from the residual in the rows that a fit used.
fn noise(samples: &Samples, left: &[f64]) -> Noise {
    Noise::of(left, &Blocks::new(samples, BLOCKS, ROWS).used_of_segments(samples))
}

fn total(fitted: &Fitted) -> Gram {
    Share::sum(fitted.shares.first().map_or(1, Share::columns), fitted.shares.iter())
}

#[cfg(test)]
mod tests {
    use hyst_core::PiParams;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::base::play_column;
    use crate::record::{Columns, OutputUnit};

    /// A sine with an amplitude that rises from 0 and falls again, ± 50 V.
    fn drive() -> Vec<f64> {
        (0..3000).map(|k| f64::from(k) / 3000.0).map(|x| 50.0 * (3.0 * x).sin() * (88.0 * x).sin()).collect()
    }

    /// A record of play operators with the sensor's zero at 2.5 µm and autoregressive noise of standard deviation
    /// `sigma`, with the coefficient `remembered`.
    fn record(plays: &PiParams<Vec<f64>>, u: Vec<f64>, sigma: f64, remembered: f64, seed: u64) -> Record {
        let rows = u.len();
        let mut y: Vec<f64> = u.iter().map(|u| 2.5 + plays.gain * u).collect();
        for (r, w) in plays.thresholds.iter().zip(&plays.weights) {
            y.iter_mut().zip(play_column(&u, std::slice::from_ref(&(0..rows)), *r)).for_each(|(y, p)| *y += w * p);
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let mut noise = normal();
        for y in &mut y {
            noise = remembered * noise + (1.0 - remembered * remembered).sqrt() * normal();
            *y += sigma * noise;
        }
        Record::from_samples(Columns {
            name: "record".into(),
            time: (0..rows).map(|k| k as f64 * 1e-3).collect(),
            input: Some(u),
            output: Some((OutputUnit::Micrometre, y)),
            ..Columns::default()
        })
        .unwrap()
    }

    /// Play operators with the thresholds of the fit.
    fn plays() -> PiParams<Vec<f64>> {
        let thresholds = (1..=15).map(|i| 50.0 * f64::from(i) / 16.0).collect();
        PiParams { gain: 0.1, thresholds, weights: (0..15).map(|i| 0.02 - 0.001 * f64::from(i)).collect() }
    }

    fn fitted(record: &Record) -> Fit {
        fit(record, Kind::Pi, &FitOptions::default()).unwrap()
    }

    #[test]
    fn standard_errors_equal_the_scatter_over_repeated_records() {
        let truth = plays();
        let expected: Vec<f64> = [&[truth.gain], &truth.weights[..], &[2.5]].concat();
        for remembered in [0.0, 0.5] {
            let (mut squares, mut stated) = (vec![0.0; expected.len()], vec![0.0; expected.len()]);
            for seed in 0..30 {
                let found = fitted(&record(&truth, drive(), 0.02, remembered, seed));
                let estimate = found.estimate.unwrap();
                assert!(estimate.held.is_empty(), "{:?}", estimate.held);
                for (i, p) in estimate.parameters.iter().enumerate() {
                    squares[i] += (p.value - expected[i]).powi(2) / 30.0;
                    stated[i] += p.std_error / 30.0;
                }
                assert_eq!(found.model.std_errors["zero"], estimate.parameter("zero").unwrap().std_error);
            }
            for (i, (scatter, stated)) in squares.iter().map(|s| s.sqrt()).zip(stated).enumerate() {
                assert!((1.0 / 1.5..1.5).contains(&(scatter / stated)), "{remembered} {i}: {scatter} {stated}");
            }
        }
    }

    #[test]
    fn standard_errors_of_chosen_thresholds_equal_their_scatter() {
        let truth = PiParams { gain: 0.1, thresholds: vec![3.3, 11.7, 37.2], weights: vec![0.03, 0.05, 0.02] };
        let expected: Vec<f64> = [&[truth.gain], &truth.weights[..], &truth.thresholds[..], &[2.5]].concat();
        let (mut squares, mut stated) = (vec![0.0; expected.len()], vec![0.0; expected.len()]);
        for seed in 0..30 {
            let options = FitOptions { thresholds: Some(8), ..FitOptions::default() };
            let estimate =
                fit(&record(&truth, drive(), 0.02, 0.0, seed), Kind::Pi, &options).unwrap().estimate.unwrap();
            assert_eq!(estimate.parameters.len(), expected.len(), "{:?}", estimate.parameters);
            for (i, p) in estimate.parameters.iter().enumerate() {
                squares[i] += (p.value - expected[i]).powi(2) / 30.0;
                stated[i] += p.std_error / 30.0;
            }
        }
        for (i, (scatter, stated)) in squares.iter().map(|s| s.sqrt()).zip(stated).enumerate() {
            assert!((1.0 / 1.5..1.5).contains(&(scatter / stated)), "{i}: {scatter} {stated}");
        }
    }

    #[test]
    fn a_number_of_thresholds_is_refused_except_for_the_convex_fit_of_pi() {
        let record = record(&plays(), drive(), 0.02, 0.0, 1);
        let refused = |kind, thresholds, optimizer: &str| {
            let optimizer = optimizer.parse().unwrap();
            let options = FitOptions { thresholds: Some(thresholds), optimizer, ..FitOptions::default() };
            crate::fit::fit(&record, kind, &options).unwrap_err().to_string()
        };
        assert!(refused(Kind::Preisach, 4, "auto").starts_with("preisach: a number of thresholds"));
        assert!(refused(Kind::MaxwellSlip, 4, "auto").contains("elements"));
        assert!(refused(Kind::Pi, 4, "de").contains("elements"));
        assert!(refused(Kind::Pi, 0, "auto").contains("1 to 64") && refused(Kind::Pi, 65, "auto").contains("1 to 64"));
    }

    #[test]
    fn weights_at_a_bound_are_held_and_have_no_error() {
        // Every second play operator is missing: noise moves its weight to either side of zero, but negative weights
        // are not allowed.
        let mut sparse = plays();
        sparse.weights.iter_mut().skip(1).step_by(2).for_each(|w| *w = 0.0);
        let found = fitted(&record(&sparse, drive(), 0.02, 0.0, 1));
        let estimate = found.estimate.unwrap();
        assert!((1..=7).contains(&estimate.held.len()), "{:?}", estimate.held);
        for name in &estimate.held {
            assert!(estimate.parameter(name).is_none() && !found.model.std_errors.contains_key(&format!("pi.{name}")));
        }
        assert_eq!(estimate.parameters.len() + estimate.held.len(), 17);
        assert!(found.model.undetermined.is_empty());
    }

    #[test]
    fn undetermined_parameters_of_a_noisy_loop_are_named() {
        let one_loop = (0..200).map(|k| 50.0 * (0.1 * f64::from(k)).sin()).collect();
        let found = fitted(&record(&plays(), one_loop, 4.0, 0.0, 1));
        let undetermined = found.estimate.unwrap().undetermined().len();
        assert!(undetermined > 0 && undetermined == found.model.undetermined.len(), "{:?}", found.model.undetermined);
    }

    #[test]
    fn cells_are_counted_by_how_well_they_are_determined() {
        let record = record(&plays(), drive(), 0.02, 0.0, 1);
        let found = fit(&record, Kind::Preisach, &FitOptions::default()).unwrap();
        assert!(found.estimate.is_none());
        let [table] = &found.tables[..] else { panic!("{:?}", found.tables) };
        assert_eq!((table.of, table.elements, table.std_errors.len()), (TableOf::Cells, 300, 300));
        let errors: Vec<f64> = table.std_errors.iter().flatten().copied().collect();
        assert_eq!(errors.len() + table.held + table.untouched, 300);
        assert_eq!(errors.iter().filter(|e| **e < 0.5 * table.mean).count(), table.determined);
        // 3000 rows determine some of the 300 cells, but not all.
        assert!(table.determined > 10 && table.vague() > 10, "{table:?}");
    }
}
