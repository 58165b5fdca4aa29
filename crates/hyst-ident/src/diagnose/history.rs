//! Estimates the share of a remainder that is a function of the input's history, for any hysteresis law.
//!
//! Two rows with equal input and equal states of play operators of all widths have the same rate-independent memory. If
//! their remainders differ, the difference is no function of that memory: `δ = ½ mean (rᵢ − rⱼ)²`, with j the nearest
//! neighbour of i, estimates the variance of this part (the delta test; Pi and Peterson, Neural Computation 6, 1994).
//! The test needs no base model.

use rayon::prelude::*;

use crate::base::play_column;
use crate::samples::Samples;

/// Half widths of the play operators, as shares of half the drive's range.
const WIDTHS: [f64; 6] = [0.0, 0.08, 0.2, 0.4, 0.6, 0.8];
/// Maximum number of rows; each is compared with each other.
const ROWS: usize = 4000;
/// Share of the rows on either side of a row that are excluded as neighbours: they have the same memory, but also the
/// same time.
const EXCLUDED_SHARE: f64 = 0.005;
/// Minimum number of excluded rows.
const MIN_EXCLUDED_ROWS: usize = 3;

/// Returns the variance of the part of `residual` that the input's history does not determine, over the rows that count
/// \[residual²\]; `None` if there are too few rows.
pub(super) fn undetermined_variance(samples: &Samples, residual: &[f64], counts: &[bool]) -> Option<f64> {
    let rows: Vec<usize> = (0..samples.len()).filter(|k| counts[*k]).collect();
    let step = rows.len().div_ceil(ROWS).max(1);
    let rows: Vec<usize> = rows.into_iter().step_by(step).collect();
    let excluded = ((EXCLUDED_SHARE * rows.len() as f64) as usize).max(MIN_EXCLUDED_ROWS);
    if rows.len() <= 4 * excluded {
        return None;
    }
    let (low, high) = samples.input_range();
    let plays = WIDTHS.map(|r| play_column(&samples.input, &samples.segments, 0.5 * r * (high - low)));
    // The input itself is the play operator of width 0.
    let states: Vec<[f64; WIDTHS.len()]> = rows.iter().map(|k| plays.each_ref().map(|p| p[*k])).collect();
    let differences: Vec<f64> = (0..rows.len())
        .into_par_iter()
        .map(|i| {
            let others = (0..(i + 1).saturating_sub(excluded)).chain(i + excluded..rows.len());
            let mut nearest = (f64::INFINITY, i);
            for j in others {
                let distance = states[i].iter().zip(&states[j]).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
                if distance < nearest.0 {
                    nearest = (distance, j);
                }
            }
            residual[rows[i]] - residual[rows[nearest.1]]
        })
        .collect();
    Some(0.5 * differences.iter().map(|d| d * d).sum::<f64>() / differences.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyst_core::play;

    #[test]
    fn a_function_of_the_memory_is_separated_from_a_function_of_time() {
        let rows = 6000;
        let input: Vec<f64> =
            (0..rows).map(|k| 0.01 * f64::from(k)).map(|t| 30.0 * (t.sin() + (0.31 * t).sin())).collect();
        let mut p = 0.0;
        let map: Vec<f64> = input
            .iter()
            .map(|u| {
                p = play(p, *u, 13.0);
                (0.07 * p).sin() + 0.3 * (0.2 * u).cos()
            })
            .collect();
        let samples = Samples::of_columns(1e-3, input.clone(), input);
        let counts = vec![true; samples.len()];
        let variance = |x: &[f64]| {
            let mean = x.iter().sum::<f64>() / x.len() as f64;
            x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len() as f64
        };
        let left = undetermined_variance(&samples, &map, &counts).unwrap();
        assert!(left < 0.1 * variance(&map), "{left} of {}", variance(&map));
        let tone: Vec<f64> = (0..rows).map(|k| (0.0371 * f64::from(k)).sin()).collect();
        let left = undetermined_variance(&samples, &tone, &counts).unwrap();
        assert!(left > 0.8 * variance(&tone), "{left} of {}", variance(&tone));
        assert_eq!(undetermined_variance(&samples, &map, &vec![false; samples.len()]), None);
    }
}
