//! Relaxation with travel: rate-independent memory that no superposition of relays has.
//!
//! A Duhem law `ż = |u̇| f(z, u) + u̇ g(u)` forgets with the distance that its input travels, not with time (Coleman
//! and Hodgdon 1986; also Bouc-Wen). Its linear case is exactly a combination of the input and of `de = du − a |du| e`,
//! with one forgetting rate `a` for each element. A bank of such elements represents all rates, as a bank of play
//! operators represents a smooth density of thresholds. The outputs `e²` and `e·x`, with x the scaled input, represent
//! laws whose forgetting rate depends on the branch; `e³` and `e·x²`, which are odd, those of a symmetric loop.

use std::ops::Range;

/// Travel over which an element forgets to 1/e, in input ranges: from a tenth of a minor loop to two full sweeps.
const MIN_TRAVEL: f64 = 1.0 / 16.0;
const MAX_TRAVEL: f64 = 2.0;
/// Number of elements of the bank, with equal ratios of their rates.
const ELEMENTS: usize = 6;
/// Columns per element: e, e² and e·x, or e, e³ and e·x².
const READ_OUTS: usize = 3;

/// A bank of elements that relax with the travel of the input.
#[derive(Clone, Debug)]
pub(super) struct TravelBank {
    /// Forgetting rates \[1/V\].
    rates: Vec<f64>,
    middle: f64,
    half: f64,
    /// Whether all columns are odd about the middle of the drive.
    is_odd: bool,
}

impl TravelBank {
    /// Builds a bank for a drive between these voltages.
    pub(super) fn new(low: f64, high: f64, is_odd: bool) -> Self {
        let range = (high - low).max(f64::MIN_POSITIVE);
        let ratio = (MAX_TRAVEL / MIN_TRAVEL).powf(1.0 / (ELEMENTS - 1) as f64);
        let rates = (0..ELEMENTS).map(|i| 1.0 / (range * MAX_TRAVEL / ratio.powi(i as i32))).collect();
        Self { rates, middle: 0.5 * (low + high), half: 0.5 * range, is_odd }
    }

    /// Returns a bank without elements, for a record that repeats one loop: travel is then proportional to time.
    pub(super) fn none() -> Self {
        Self { rates: Vec::new(), middle: 0.0, half: 1.0, is_odd: true }
    }

    /// Returns the number of columns.
    pub(super) fn len(&self) -> usize {
        READ_OUTS * self.rates.len()
    }

    /// Returns the columns with the indices `of` \[V\]: the read-outs of each element in turn. Each element starts at 0
    /// V with virgin memory and moves to the first voltage of its segment.
    pub(super) fn columns(&self, of: Range<usize>, drive: &[f64], segments: &[Range<usize>]) -> Vec<Vec<f64>> {
        let mut columns = Vec::with_capacity(of.len());
        let elements = if of.is_empty() { 0..0 } else { of.start / READ_OUTS..of.end.div_ceil(READ_OUTS) };
        for element in elements {
            let rate = self.rates[element];
            let relaxed = relaxed(drive, segments, rate);
            let x = |u: f64| (u - self.middle) / self.half;
            for read_out in (0..READ_OUTS).filter(|read_out| of.contains(&(READ_OUTS * element + read_out))) {
                // The magnitude of an element is at most 1/rate.
                columns.push(match (read_out, self.is_odd) {
                    (0, _) => relaxed.clone(),
                    (1, false) => relaxed.iter().map(|e| rate * e * e).collect(),
                    (1, true) => relaxed.iter().map(|e| (rate * e).powi(2) * e).collect(),
                    (_, false) => relaxed.iter().zip(drive).map(|(e, u)| e * x(*u)).collect(),
                    (_, true) => relaxed.iter().zip(drive).map(|(e, u)| e * x(*u).powi(2)).collect(),
                });
            }
        }
        columns
    }
}

/// Solves `de = du − a |du| e` exactly for a drive that is linear between samples.
fn relaxed(drive: &[f64], segments: &[Range<usize>], rate: f64) -> Vec<f64> {
    let mut column = vec![0.0; drive.len()];
    for rows in segments {
        let (mut e, mut before) = (0.0, 0.0);
        for k in rows.clone() {
            let step = drive[k] - before;
            let kept = (-rate * step.abs()).exp();
            e = e * kept + (1.0 - kept).copysign(step) / rate;
            (column[k], before) = (e, drive[k]);
        }
    }
    column
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The result depends only on the path, not on its speed or sampling.
    #[test]
    fn memory_depends_on_the_path_and_not_on_its_speed() {
        let path = |u: &mut dyn FnMut(f64)| {
            for turn in [0.0, 90.0, 20.0, 60.0, 0.0, 75.0] {
                u(turn);
            }
        };
        let mut coarse = Vec::new();
        path(&mut |u| coarse.push(u));
        let mut fine = Vec::new();
        for pair in coarse.windows(2) {
            fine.extend((0..50).map(|i| pair[0] + (pair[1] - pair[0]) * f64::from(i) / 50.0));
        }
        fine.push(75.0);
        let bank = TravelBank::new(0.0, 90.0, false);
        let all = |drive: &[f64]| bank.columns(0..bank.len(), drive, std::slice::from_ref(&(0..drive.len())));
        for (a, b) in all(&coarse).iter().zip(all(&fine)) {
            let (a, b) = (a[5], b[250]);
            assert!((a - b).abs() < 1e-9 * (1.0 + a.abs()), "{a} {b}");
        }
    }

    /// A Coleman-Hodgdon law with straight curves, integrated in small steps, is a combination of the input and one
    /// element.
    #[test]
    fn a_linear_duhem_law_is_one_element() {
        let (a, b, c) = (0.04, 0.05, 0.03);
        let drive: Vec<f64> =
            (0..400).map(|k| 45.0 * (1.0 - (0.05 * f64::from(k)).cos()) * f64::from(k) / 400.0).collect();
        let (mut z, mut before, mut law) = (0.0, 0.0, Vec::new());
        for u in &drive {
            let steps = 2000;
            let du = (u - before) / f64::from(steps);
            for i in 0..steps {
                let v = before + du * (f64::from(i) + 0.5);
                z += a * du.abs() * (b * v - z) + c * du;
            }
            law.push(z);
            before = *u;
        }
        // z = b u + (c − b) e
        let e = relaxed(&drive, std::slice::from_ref(&(0..drive.len())), a);
        for ((u, e), z) in drive.iter().zip(&e).zip(&law) {
            assert!((b * u + (c - b) * e - z).abs() < 1e-3, "{z} {}", b * u + (c - b) * e);
        }
    }
}
