//! Fits the mirror function ξ(D, P) of the dynamic Preisach model to records at several rates.
//!
//! For a fixed classical part, drive and fade the output of the model is an affine function of the node values of ξ.
//! Each term of the reversal stack counts `ξ(Dᵢ, Pᵢ) Eᵢ` (Chen et al., eq. 6 and 7), ξ is bilinear between nodes (eq.
//! 20), and a fading step is a difference of such terms. The column of a node is therefore the output with this node
//! raised by one minus the output with ξ ≡ 1. The node values follow by bounded linear least squares.

use hyst_core::{Build, Dpm, DpmParams, Env, MirrorParams, PreisachParams, Sampling, Stage};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::Samples;
use crate::identify::convex::untouched;
use crate::identify::{Noise, TableEstimate, TableOf};
use crate::lsq::{Blocks, Bounds, Gram, solve};
use crate::model::capacity::{MIRROR, NODES};

/// Bounds of ξ: a value outside indicates not rate-dependence, but a record that does not match the classical part.
const BOUNDS: Bounds = Bounds { lower: 0.2, upper: 3.0 };
/// Candidate weights of `(ξₐ − ξ_b)²` between neighbouring nodes, as shares of the mean square of a node's column. The
/// weight with the smallest cross-validated error is used. Nodes with little data follow their neighbours, one of which
/// is the classical model, ξ = 1 at D = 0.
const SMOOTHING_WEIGHTS: [f64; 6] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1];
/// Weight if there is only one segment.
const DEFAULT_SMOOTHING: f64 = 1e-3;
/// Weight of `(ξ(D, P) − ξ(D, −P))²`, relative to that between neighbours. If ξ differs between rising and falling
/// branches, the output of the model drifts while loops are open; only data may cause such a difference.
const SYMMETRY_WEIGHT: f64 = 10.0;
/// Maximum number of rows of a fit.
const MAX_ROWS: usize = 40_000;

/// A mirror function for one fade.
pub(super) struct MirrorFit {
    pub(super) mirror: MirrorParams<Vec<f64>>,
    pub(super) zeros: Vec<f64>,
    /// RMS residual over the fitted rows.
    pub(super) rmse: f64,
    /// The same over segments that were left out in turn, each without its mean; `None` for a single segment.
    pub(super) left_out: Option<f64>,
    /// Nodes that no row depends on.
    pub(super) untouched: Vec<usize>,
    /// Nodes at a bound.
    pub(super) bound: usize,
    /// Determination of each node by the rows.
    pub(super) table: TableEstimate,
}

/// Data of the fit of a mirror function.
pub(super) struct MirrorProblem<'a> {
    pub(super) samples: &'a Samples,
    pub(super) classical: &'a PreisachParams<Vec<f64>>,
    /// The grid; its weights are not used.
    pub(super) grid: &'a MirrorParams<Vec<f64>>,
    /// Column of the zero of each segment.
    pub(super) zero_of_segment: &'a [usize],
}

type Model = Dpm<f64, NODES, MIRROR, MIRROR>;

impl MirrorProblem<'_> {
    fn nodes(&self) -> usize {
        self.grid.rates * self.grid.changes
    }

    /// Returns the output of the model over all segments for these node values.
    pub(super) fn output(&self, weights: Vec<f64>, fade: f64) -> Result<Vec<f64>, hyst_core::Error> {
        let mirror = MirrorParams { weights, ..self.grid.clone() };
        let params = DpmParams { preisach: self.classical.clone(), mirror, fade };
        let model: Box<Model> = Box::new(params.build(&Sampling { period: self.samples.period })?);
        let (mut state, env) = (Box::new(model.state()), Env::default());
        let u = &self.samples.input;
        let mut output = Vec::with_capacity(u.len());
        for rows in &self.samples.segments {
            output.push(model.reset(&mut state, &env, u[rows.start]));
            output.extend(u[rows.start + 1..rows.end].iter().map(|u| model.step(&mut state, &env, *u)));
        }
        Ok(output)
    }

    /// Fits the node values for a fade; `None` if the equations cannot be solved.
    pub(super) fn fit(&self, fade: f64) -> Result<Option<MirrorFit>, hyst_core::Error> {
        let (n, zeros) = (self.nodes(), self.zero_of_segment.iter().max().map_or(0, |m| m + 1));
        let classical = self.output(vec![1.0; n], fade)?;
        // Columns contain only the rows that are used; blocks are in the order of the rows.
        let blocks = Blocks::new(self.samples, 1, MAX_ROWS);
        let used: Vec<usize> = blocks.all_used(self.samples).collect();
        let column = |node: usize| -> Result<Vec<f64>, hyst_core::Error> {
            let mut weights = vec![1.0; n];
            weights[node] = 2.0;
            let raised = self.output(weights, fade)?;
            Ok(used.iter().map(|k| raised[*k] - classical[*k]).collect())
        };
        // Returns the first of several errors, independent of the thread timing.
        let columns: Vec<Result<Vec<f64>, hyst_core::Error>> = (0..n).into_par_iter().map(column).collect();
        let columns: Vec<Vec<f64>> = columns.into_iter().collect::<Result<_, _>>()?;
        let grams = self.grams(&columns, &used, &classical, zeros);
        let total = Gram::sum(n + zeros + 1, grams.iter());
        let level = (0..n).map(|c| total.matrix[(c, c)]).sum::<f64>() / n as f64;
        // The unknowns are ξ − 1.
        let mut bounds = vec![Bounds { lower: BOUNDS.lower - 1.0, upper: BOUNDS.upper - 1.0 }; n];
        bounds.extend(vec![Bounds::FREE; zeros]);
        let solved = |gram: &Gram, weight: f64| solve(gram, Some(&self.penalty(weight * level, n + zeros)), &bounds);
        let mut best = (f64::INFINITY, DEFAULT_SMOOTHING);
        if grams.len() > 1 {
            for weight in SMOOTHING_WEIGHTS {
                let mut squares = 0.0;
                for own in &grams {
                    let others = Gram { matrix: &total.matrix - &own.matrix, rows: total.rows - own.rows };
                    let Some(z) = solved(&others, weight) else { return Ok(None) };
                    squares += left_out_squares(own, &z, n);
                }
                // Of two equal errors, take the smoother solution.
                if squares <= best.0 {
                    best = (squares, weight);
                }
            }
        }
        let Some(z) = solved(&total, best.1) else { return Ok(None) };
        let rmse = (total.error(&z) / total.rows.max(1) as f64).sqrt();
        let weights: Vec<f64> = z.iter().take(n).map(|z| (1.0 + z).clamp(BOUNDS.lower, BOUNDS.upper)).collect();
        let untouched = untouched(&total, n);
        let mean = weights.iter().sum::<f64>() / n as f64;
        let residual = self.residual(&columns, &used, &classical, z.as_slice());
        let noise = Noise::of(&residual, &blocks.used_of_segments(self.samples));
        let table = TableEstimate::of(TableOf::Nodes, &z.as_slice()[..n], mean, &total, &bounds, &noise);
        let at_bound = |w: &&f64| **w < BOUNDS.lower + 1e-6 || **w > BOUNDS.upper - 1e-6;
        Ok(Some(MirrorFit {
            bound: weights.iter().filter(at_bound).count(),
            mirror: MirrorParams { weights, ..self.grid.clone() },
            zeros: z.iter().skip(n).copied().collect(),
            rmse,
            left_out: (grams.len() > 1).then(|| (best.0 / total.rows.max(1) as f64).sqrt()),
            untouched: (0..n).filter(|c| untouched[*c]).collect(),
            table,
        }))
    }

    /// Returns the normal equations of each segment: nodes, zeros, and the residual of the classical model.
    fn grams(&self, columns: &[Vec<f64>], used: &[usize], classical: &[f64], zeros: usize) -> Vec<Gram> {
        let n = columns.len();
        let of_segment = |(rows, zero): (&std::ops::Range<usize>, &usize)| {
            let (first, end) = (used.partition_point(|k| *k < rows.start), used.partition_point(|k| *k < rows.end));
            let x = DMatrix::from_fn(end - first, n + zeros + 1, |r, c| {
                let k = used[first + r];
                if c < n {
                    columns[c][first + r]
                } else if c < n + zeros {
                    f64::from(u8::from(c - n == *zero))
                } else {
                    self.samples.output[k] - classical[k]
                }
            });
            Gram { matrix: x.tr_mul(&x), rows: end - first }
        };
        self.samples.segments.iter().zip(self.zero_of_segment).map(of_segment).collect()
    }

    /// Returns the residual in the fitted rows.
    fn residual(&self, columns: &[Vec<f64>], used: &[usize], classical: &[f64], z: &[f64]) -> Vec<f64> {
        let (nodes, zeros) = z.split_at(columns.len());
        let mut residual: Vec<f64> = used.iter().map(|k| self.samples.output[*k] - classical[*k]).collect();
        for (column, z) in columns.iter().zip(nodes) {
            residual.iter_mut().zip(column).for_each(|(r, x)| *r -= z * x);
        }
        for (rows, zero) in self.samples.segments.iter().zip(self.zero_of_segment) {
            let own = used.partition_point(|k| *k < rows.start)..used.partition_point(|k| *k < rows.end);
            residual[own].iter_mut().for_each(|r| *r -= zeros[*zero]);
        }
        residual
    }

    /// Returns the penalty on differences between neighbours along D, down to ξ = 1 at D = 0, along P, and between ±P.
    fn penalty(&self, weight: f64, unknowns: usize) -> DMatrix<f64> {
        let mut p = DMatrix::zeros(unknowns, unknowns);
        let (rates, changes) = (self.grid.rates, self.grid.changes);
        let mut add = |a: usize, b: usize, weight: f64| {
            p[(a, a)] += weight;
            p[(b, b)] += weight;
            p[(a, b)] -= weight;
            p[(b, a)] -= weight;
        };
        for d in 0..rates {
            for c in 0..changes {
                let node = d * changes + c;
                if d + 1 < rates {
                    add(node, node + changes, weight);
                }
                if c + 1 < changes {
                    add(node, node + 1, weight);
                }
                if 2 * c + 1 < changes {
                    add(node, d * changes + changes - 1 - c, SYMMETRY_WEIGHT * weight);
                }
            }
        }
        for node in 0..changes {
            p[(node, node)] += weight;
        }
        p
    }
}

/// Returns Σ residual² of a segment, without its mean, for node values `z` that were fitted without it.
fn left_out_squares(own: &Gram, z: &DVector<f64>, nodes: usize) -> f64 {
    let mut z = z.clone();
    let rows = own.rows.max(1) as f64;
    // The segment has one zero: the only one whose column in its normal equations is not empty.
    for c in nodes..z.len() {
        z[c] = 0.0;
        if own.matrix[(c, c)] > 0.0 {
            z[c] = own.score(&z)[c] / rows;
        }
    }
    own.error(&z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    /// Sines of several frequencies at 10 kHz that decay around 40 V, with a first range of 0 to 80 V.
    fn samples() -> Samples {
        let mut input = Vec::new();
        let mut segments = Vec::new();
        for hz in [5.0, 25.0, 50.0, 75.0, 100.0] {
            let start = input.len();
            input.extend((0..4000).map(|k| {
                let t = f64::from(k) * 1e-4;
                40.0 - 40.0 * (1.0 - t / 0.4) * (std::f64::consts::TAU * hz * t).cos()
            }));
            segments.push(start..input.len());
        }
        let output = vec![0.0; input.len()];
        Samples { file_of_segment: vec![0; segments.len()], segments, ..Samples::of_columns(1e-4, input, output) }
    }

    fn classical() -> PreisachParams<Vec<f64>> {
        let cells = 8;
        let density = (0..cells).flat_map(|a| (0..=a).map(move |b| if a == b { 1.2 } else { 0.15 })).collect();
        PreisachParams { low: 0.0, high: 80.0, cells, rest: 0.0, density, once: vec![0.0; cells] }
    }

    /// A problem with one zero for each of the five segments.
    fn problem<'a>(
        samples: &'a Samples,
        classical: &'a PreisachParams<Vec<f64>>,
        grid: &'a MirrorParams<Vec<f64>>,
    ) -> MirrorProblem<'a> {
        MirrorProblem { samples, classical, grid, zero_of_segment: &[0, 1, 2, 3, 4] }
    }

    fn random(seed: u64) -> Vec<f64> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        (0..72).map(|_| 0.7 + 0.5 * rng.random::<f64>()).collect()
    }

    #[test]
    fn the_output_is_affine_in_the_node_values() {
        let (samples, classical) = (samples(), classical());
        let grid = MirrorParams::on_printed_grid(Vec::new());
        let problem = problem(&samples, &classical, &grid);
        for fade in [0.0, 15.0] {
            let (a, b) = (random(1), random(2));
            let mixed = a.iter().zip(&b).map(|(a, b)| 0.3 * a + 0.7 * b).collect();
            let (a, b) = (problem.output(a, fade).unwrap(), problem.output(b, fade).unwrap());
            for (k, y) in problem.output(mixed, fade).unwrap().iter().enumerate() {
                assert!((y - 0.3 * a[k] - 0.7 * b[k]).abs() < 1e-9, "{k}");
            }
        }
    }

    #[test]
    fn node_values_that_the_drive_reaches_are_recovered() {
        let (mut samples, classical) = (samples(), classical());
        let grid = MirrorParams::on_printed_grid(Vec::new());
        // A smooth ξ, as the penalty assumes, with a sensor zero for each segment.
        let truth: Vec<f64> = (0..72)
            .map(|k| {
                let (d, p) = (f64::from(k / 9) / 7.0, f64::from(k % 9) / 8.0);
                1.0 - 0.25 * d + 0.1 * d * (2.0 * p - 1.0).powi(2)
            })
            .collect();
        samples.output = problem(&samples, &classical, &grid).output(truth.clone(), 12.0).unwrap();
        for (s, rows) in samples.segments.iter().enumerate() {
            samples.output[rows.clone()].iter_mut().for_each(|y| *y += s as f64 - 1.5);
        }
        let fit = problem(&samples, &classical, &grid).fit(12.0).unwrap().unwrap();
        assert!(fit.rmse < 2e-3, "{}", fit.rmse);
        for (s, zero) in fit.zeros.iter().enumerate() {
            assert!((zero - (s as f64 - 1.5)).abs() < 5e-3, "{zero}");
        }
        // These sines contain no fast motion over 80 V: some nodes are not reached and are reported.
        assert!(!fit.untouched.is_empty() && fit.untouched.len() < 40, "{:?}", fit.untouched);
        let reached = (0..72).filter(|k| !fit.untouched.contains(k));
        let errors: Vec<f64> = reached.map(|k| (fit.mirror.weights[k] - truth[k]).abs()).collect();
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        assert!(rms < 0.03, "{rms} {errors:?}");
        assert_eq!(fit.bound, 0);
    }
}
