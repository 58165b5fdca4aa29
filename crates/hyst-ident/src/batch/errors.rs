//! RMS errors of many candidates as the cost of a search.

use pulp::{Arch, Simd, WithSimd};

use super::{Kernel, LANES, Lanes, Rows};
use crate::optimize::Cost;

/// Number of rows between two checks of the limits.
const STRIDE: usize = 256;

/// Maximum number of parameters of a kernel.
const MAX_PARAMETERS: usize = 64;

/// Reason why a kernel cannot run over rows.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ErrorsError {
    /// A kernel without parameters, or with too many.
    #[error("the kernel has {parameters} parameters; expected 1 to {MAX_PARAMETERS}")]
    Parameters {
        /// Number of parameters.
        parameters: usize,
    },
    /// Columns of different length.
    #[error("{rows} rows, {output} outputs and {counts} flags of rows that count; expected equal numbers")]
    Lengths {
        /// Rows of the drive.
        rows: usize,
        /// Measured outputs.
        output: usize,
        /// Flags of rows that count.
        counts: usize,
    },
    /// A segment outside of the rows.
    #[error("segment {start}..{end} is outside of the {rows} rows")]
    Segment {
        /// Its first row.
        start: usize,
        /// The row after its last one.
        end: usize,
        /// Number of rows.
        rows: usize,
    },
}

/// RMS error of a kernel's candidates over the rows that count \[y\].
#[derive(Debug)]
pub struct Errors<'a, K> {
    kernel: K,
    data: Rows<'a>,
    count: f64,
    arch: Arch,
}

impl<'a, K: Kernel> Errors<'a, K> {
    /// Prepares a kernel for these rows.
    ///
    /// # Errors
    /// If the kernel has no parameters or more than 64, columns differ in length, or a segment is outside of the rows.
    pub fn new(kernel: K, data: Rows<'a>) -> Result<Self, ErrorsError> {
        let parameters = kernel.parameters();
        if !(1..=MAX_PARAMETERS).contains(&parameters) {
            return Err(ErrorsError::Parameters { parameters });
        }
        let [rows, output, counts] = [data.rows.len(), data.output.len(), data.counts.len()];
        if output != rows || counts != rows {
            return Err(ErrorsError::Lengths { rows, output, counts });
        }
        if let Some(s) = data.segments.iter().find(|s| s.start > s.end || s.end > rows) {
            return Err(ErrorsError::Segment { start: s.start, end: s.end, rows });
        }
        let count = data.counts.iter().filter(|c| **c).count().max(1) as f64;
        Ok(Self { kernel, data, count, arch: Arch::new() })
    }

    /// Returns the sums of squared errors; infinite if all candidates exceed their `limits`.
    #[inline(always)]
    fn pass(&self, parameters: &[Lanes], limits: Lanes) -> Lanes {
        let c = self.kernel.coefficients(parameters);
        let mut sum = Lanes::ZERO;
        for segment in self.data.segments {
            let mut s = self.kernel.state();
            let columns = (&self.data.rows[segment.clone()], &self.data.output[segment.clone()]);
            let counts = &self.data.counts[segment.clone()];
            let strides = columns.0.chunks(STRIDE).zip(columns.1.chunks(STRIDE)).zip(counts.chunks(STRIDE));
            for ((rows, output), counts) in strides {
                for ((row, y), counts) in rows.iter().zip(output).zip(counts) {
                    let error = self.kernel.step(&c, &mut s, row) - Lanes::all(*y);
                    sum += error * error * f64::from(u8::from(*counts));
                }
                if sum.0.iter().zip(limits.0).all(|(s, limit)| *s > limit) {
                    return Lanes::all(f64::INFINITY);
                }
            }
        }
        sum
    }

    /// Returns the outputs of the first candidates (at most eight) over all rows, one list each.
    pub fn outputs(&self, points: &[f64]) -> Vec<Vec<f64>> {
        let parameters = self.kernel.parameters();
        let used = (points.len() / parameters).min(LANES);
        let c = self.kernel.coefficients(&transposed(points, parameters));
        let mut out = vec![Vec::with_capacity(self.data.rows.len()); used];
        for segment in self.data.segments {
            let mut s = self.kernel.state();
            for row in &self.data.rows[segment.clone()] {
                let y = self.kernel.step(&c, &mut s, row);
                for (out, y) in out.iter_mut().zip(y.0) {
                    out.push(y);
                }
            }
        }
        out
    }
}

/// One pass over the rows, compiled for each set of vector instructions.
struct Pass<'a, 'b, K> {
    errors: &'b Errors<'a, K>,
    parameters: &'b [Lanes],
    limits: Lanes,
}

impl<K: Kernel> WithSimd for Pass<'_, '_, K> {
    type Output = Lanes;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Lanes {
        self.errors.pass(self.parameters, self.limits)
    }
}

/// Rearranges consecutive candidates into lanes; lanes without a candidate repeat the first one.
fn transposed(points: &[f64], parameters: usize) -> [Lanes; MAX_PARAMETERS] {
    let mut out = [Lanes::ZERO; MAX_PARAMETERS];
    for (p, lanes) in out.iter_mut().enumerate().take(parameters) {
        for (l, x) in lanes.0.iter_mut().enumerate() {
            *x = points.get(l * parameters + p).or_else(|| points.get(p)).copied().unwrap_or(0.0);
        }
    }
    out
}

impl<K: Kernel> Cost for Errors<'_, K> {
    fn width(&self) -> usize {
        LANES
    }

    fn costs(&self, points: &[f64], hopeless: &[f64], costs: &mut [f64]) {
        let parameters = self.kernel.parameters();
        for ((costs, points), hopeless) in
            costs.chunks_mut(LANES).zip(points.chunks(LANES * parameters)).zip(hopeless.chunks(LANES))
        {
            let lanes = transposed(points, parameters);
            let mut limits = Lanes::all(f64::NEG_INFINITY);
            for (limit, h) in limits.0.iter_mut().zip(hopeless) {
                // A margin above the limit, for sums that round to it.
                *limit = h * h * self.count * (1.0 + 1e-9);
            }
            let sums = self.arch.dispatch(Pass { errors: self, parameters: &lanes[..parameters], limits });
            for (cost, sum) in costs.iter_mut().zip(sums.0) {
                *cost = (sum / self.count).sqrt();
            }
        }
    }
}
