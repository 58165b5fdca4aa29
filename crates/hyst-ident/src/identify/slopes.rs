//! Derivatives of a model's output with respect to the unknowns of its fit, and the errors of the parameters in its
//! file.
//!
//! The unknowns are the searched variables and the linear parameters. A parameter of the file is a function of them: it
//! may be one of them, a product of several, or one of many that follow from the same unknown. So derivatives are taken
//! with respect to the unknowns, and errors are propagated to the file by the derivatives of that function (the delta
//! method).

use hyst_core::Params;
use nalgebra::DMatrix;
use rayon::prelude::*;

use super::convex;
use super::family::{Family, OtherParameter};
use super::profile::{Interval, end};
use super::projection::{Projected, Projection};
use super::uncertainty::{Estimate, Evidence, MAX_RELATIVE_ERROR, Noise};
use crate::Samples;
use crate::drive::{Drive, Passes};
use crate::metrics::rms;
use crate::model::{Base, Operator};
use crate::optimize::{Scale, Space, Variable};

/// Step of the difference quotients of outputs, as a share of an unknown's scale.
const STEP: f64 = 1e-5;
/// Step of the difference quotients of the file's parameters, which have no noise.
const PARAMETER_STEP: f64 = 1e-6;
/// Distance from a side of the box, as a share of it, within which a variable is on the side: values are rounded.
const SIDE_TOLERANCE: f64 = 1e-12;
/// Distance beyond a side of the box, as a share of it, at which the existence of a model is tested.
const BEYOND: f64 = 1e-3;

/// Returns names and values of a model's parameters in the order of a visit.
pub(crate) fn parameters_of(base: &Base) -> Vec<(String, f64)> {
    let mut list: Vec<(String, f64)> = Vec::new();
    base.clone().visit(&mut |meta, x| list.push((meta.name.to_owned(), *x)));
    let name = |i: usize| {
        let same = |j: &usize| list[*j].0 == list[i].0;
        if (0..list.len()).filter(same).count() > 1 {
            format!("{}[{}]", list[i].0, (0..i).filter(same).count())
        } else {
            list[i].0.clone()
        }
    };
    (0..list.len()).map(|i| (name(i), list[i].1)).collect()
}

fn values_of(base: &Base) -> Vec<f64> {
    let mut list = Vec::new();
    base.clone().visit(&mut |_, x| list.push(*x));
    list
}

/// Returns the model with its `which`-th parameter changed.
fn changed(base: &Base, which: usize, to: f64) -> Base {
    let (mut other, mut i) = (base.clone(), 0);
    other.visit(&mut |_, x| {
        if i == which {
            *x = to;
        }
        i += 1;
    });
    other
}

/// A searched variable that ended on a side of its box and is held there.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Ended {
    pub(crate) name: String,
    /// The side.
    pub(crate) bound: f64,
    /// Whether there are models beyond the side.
    pub(crate) beyond: bool,
}

/// Kind of an unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    /// A searched variable, by its index.
    Searched(usize),
    /// A linear parameter.
    Solved(usize),
    /// A parameter of the file that is neither searched nor solved for, but unknown.
    OtherParameter(OtherParameter, usize),
}

/// An unknown of the fit.
struct Unknown {
    place: Place,
    /// A large change of it. Searched variable: half of the box, at most a factor of e for a logarithmic one. Linear
    /// parameter: its own value, or the value that alone makes an output as large as the measured one.
    scale: f64,
    /// Change of the output per scale over the rows that count, without the sensor's zeros.
    slope: Vec<f64>,
    /// Whether it is held at a bound.
    held: bool,
}

/// Result of an identification.
pub(super) struct Optimum<'a> {
    pub(super) family: &'a dyn Family,
    pub(super) samples: &'a Samples,
    pub(super) projection: &'a Projection<'a>,
    /// `None` without a search.
    pub(super) space: Option<&'a Space>,
    pub(super) values: &'a [f64],
    pub(super) projected: &'a Projected,
}

impl Optimum<'_> {
    /// Returns the standard errors of the model's parameters, and the variables that ended on a side of their box.
    ///
    /// The covariance of the unknowns is `σ² κ (JᵀJ)⁻¹`, with J the derivatives of the output, σ² the mean square of
    /// the residual and κ the number of rows per independent row. The covariance of the parameters is `G C Gᵀ`, with G
    /// their derivatives with respect to the unknowns.
    pub(super) fn estimate(&self) -> (Estimate, Vec<Ended>) {
        let base = self.family.base(self.values, &self.projected.linear);
        let all = parameters_of(&base);
        let (noise, columns) = rayon::join(
            || Noise::of(self.projected.residual.as_slice(), &self.projection.lengths),
            || self.projection.columns(self.values),
        );
        let unknowns = columns.map_or_else(Vec::new, |columns| self.unknowns(&base, &all, &noise, &columns));
        let free: Vec<usize> = (0..unknowns.len()).filter(|u| !unknowns[*u].held).collect();
        let chosen = |u: &&Unknown| !matches!(u.place, Place::OtherParameter(OtherParameter::Convention, _));
        let fitted = unknowns.iter().filter(chosen).count();
        let held = unknowns.iter().filter(|u| u.held).count();

        // Change of each parameter of the file with each unknown, per scale.
        let changes: Vec<Vec<f64>> = unknowns.iter().map(|u| self.changes(u, all.len())).collect();
        let reported = |i: &usize| self.family.identified(&all[*i].0);
        let moves = |i: usize, u: usize| changes[u][i] != 0.0;
        let which: Vec<usize> =
            (0..all.len()).filter(reported).filter(|i| free.iter().any(|u| moves(*i, *u))).collect();
        let at_bound = |i: &usize| !which.contains(i) && (0..unknowns.len()).any(|u| moves(*i, u));
        // The family's scale of a parameter, or its change when the unknowns change by their scales; and the size that
        // its error is compared with.
        let scale = |i: &usize| match self.family.scale(&base, &all[*i].0) {
            Some(own) => (positive(own), positive(own)),
            None => (positive(changes.iter().map(|c| c[*i] * c[*i]).sum::<f64>().sqrt()), all[*i].1.abs()),
        };
        let (scales, sizes): (Vec<f64>, Vec<f64>) = which.iter().map(scale).unzip();
        let slopes: Vec<&[f64]> = free.iter().map(|u| &unknowns[*u].slope[..]).collect();
        let normal = DMatrix::from_fn(free.len(), free.len(), |i, j| product(slopes[i], slopes[j]));
        let freedom = fitted - held + self.projection.groups;
        let rise = 4.0 * noise.variance(freedom);
        let estimate = Estimate::of(Evidence {
            parameters: which.iter().map(|i| all[*i].clone()).collect(),
            map: DMatrix::from_fn(which.len(), free.len(), |i, u| changes[free[u]][which[i]] / scales[i]),
            scales,
            sizes,
            normal,
            noise: &noise,
            unknowns: freedom,
            fitted,
            at_least: self.sections(&free.iter().map(|u| &unknowns[*u]).collect::<Vec<_>>(), rise),
            held: (0..all.len()).filter(reported).filter(at_bound).map(|i| all[i].0.clone()).collect(),
        });
        let ended = unknowns.iter().filter(|u| u.held).filter_map(|u| self.ended(u)).collect();
        (estimate, ended)
    }

    /// Returns the unknowns with the derivatives of the output.
    fn unknowns(&self, base: &Base, all: &[(String, f64)], noise: &Noise, columns: &DMatrix<f64>) -> Vec<Unknown> {
        let searched = (0..self.values.len()).map(Place::Searched);
        let solved = (0..self.projected.linear.len()).map(Place::Solved);
        let other_parameter = (0..all.len()).filter_map(|i| match self.family.other_parameter(&all[i].0) {
            OtherParameter::Given => None,
            what => Some(Place::OtherParameter(what, i)),
        });
        let places: Vec<Place> = searched.chain(solved).chain(other_parameter).collect();
        let held = self.held_linear(columns);
        let measured: Vec<f64> = self.projection.rows.iter().map(|k| self.samples.output[*k]).collect();
        let size = rms(&self.centred(measured));
        let unknown = |place: &Place| match *place {
            Place::Searched(d) => {
                let scale = self.variable(d).map_or(1.0, largest);
                let slope =
                    self.quotient(scale, |step| self.projection.output(&self.moved(d, step), &self.projected.linear));
                let alone = (noise.variance(0) / product(&slope, &slope).max(f64::MIN_POSITIVE)).sqrt();
                // A variable without an effect may end anywhere; it is not held.
                Unknown { place: *place, scale, slope, held: alone <= MAX_RELATIVE_ERROR && self.side(d).is_some() }
            }
            Place::Solved(j) => {
                let mut slope = self.centred(self.projection.rows.iter().map(|k| columns[(*k, j)]).collect());
                let scale = positive((size / rms(&slope)).max(self.projected.linear[j].abs()));
                slope.iter_mut().for_each(|s| *s *= scale);
                Unknown { place: *place, scale, slope, held: held[j] }
            }
            Place::OtherParameter(_, i) => {
                let (name, value) = &all[i];
                let scale = positive(self.family.scale(base, name).unwrap_or(value.abs()));
                let slope = self.quotient(scale, |step| self.simulated(&changed(base, i, value + step)));
                Unknown { place: *place, scale, slope, held: false }
            }
        };
        places.par_iter().with_max_len(1).map(unknown).collect()
    }

    /// Returns which linear parameters are held at their bounds.
    fn held_linear(&self, columns: &DMatrix<f64>) -> Vec<bool> {
        let all = [&self.projected.linear[..], &self.projected.zeros].concat();
        let free = convex::free(&all, &self.projection.gram(columns), &self.projection.bounds);
        (0..self.projected.linear.len()).map(|j| !free.contains(&j)).collect()
    }

    fn variable(&self, d: usize) -> Option<&Variable> {
        self.space.and_then(|space| space.variables().get(d))
    }

    /// Returns the values with one of them moved; a logarithmic one is moved in its logarithm.
    fn moved(&self, d: usize, step: f64) -> Vec<f64> {
        let mut to = self.values.to_vec();
        match self.variable(d).map(|v| v.scale) {
            Some(Scale::Log) => to[d] *= step.exp(),
            _ => to[d] += step,
        }
        to
    }

    /// Returns the side of the box that a variable is on.
    fn side(&self, d: usize) -> Option<f64> {
        let (v, place) = (self.variable(d)?, self.space?.point(self.values)[d]);
        [(v.lower, place), (v.upper, 1.0 - place)]
            .into_iter()
            .find(|(_, off)| *off < SIDE_TOLERANCE)
            .map(|(side, _)| side)
    }

    fn ended(&self, unknown: &Unknown) -> Option<Ended> {
        let Place::Searched(d) = unknown.place else { return None };
        let (v, bound) = (self.variable(d)?, self.side(d)?);
        let step = BEYOND * extent(v) * if bound == v.lower { -1.0 } else { 1.0 };
        let beyond = self.projection.at(&self.moved(d, step)).is_some();
        Some(Ended { name: v.name.clone(), bound, beyond })
    }

    /// Returns the minimum standard errors of the unknowns, per scale, from sections of the likelihood. The linear
    /// parameters are solved again and the other searched variables held. It is 0 for an unknown that was not searched.
    fn sections(&self, unknowns: &[&Unknown], rise: f64) -> Vec<f64> {
        let Some(space) = self.space else { return vec![0.0; unknowns.len()] };
        let (point, least) = (space.point(self.values), self.projected.squares());
        let searched = |u: &&Unknown| if let Place::Searched(d) = u.place { Some(d) } else { None };
        let of: Vec<usize> = unknowns.iter().filter_map(searched).collect();
        // From a common queue, one by one: their durations are not known in advance.
        let ends: Vec<f64> = (0..2 * of.len())
            .into_par_iter()
            .with_max_len(1)
            .map(|i| {
                let d = of[i / 2];
                let squares = |place: f64| {
                    let mut to = point.clone();
                    to[d] = place;
                    self.projection.squares(&space.values(&to))
                };
                end(squares, point[d], (i % 2) as f64, (least, rise))
            })
            .collect();
        let mut intervals = ends.chunks(2).map(|ends| Interval { low: ends[0], high: ends[1] });
        let error = |u: &&Unknown| {
            let v = searched(u).and_then(|d| self.variable(d))?;
            Some(intervals.next()?.std_error() * extent(v) / u.scale)
        };
        unknowns.iter().map(error).map(|e| e.unwrap_or(0.0)).collect()
    }

    /// Returns the change of each parameter of the file with an unknown, per scale.
    fn changes(&self, unknown: &Unknown, count: usize) -> Vec<f64> {
        let (values, linear) = (self.values, &self.projected.linear);
        let side = |step: f64| match unknown.place {
            Place::Searched(d) => values_of(&self.family.base(&self.moved(d, step), linear)),
            Place::Solved(j) => {
                let mut to = linear.clone();
                to[j] += step;
                values_of(&self.family.base(values, &to))
            }
            Place::OtherParameter(_, i) => (0..count).map(|k| if k == i { step } else { 0.0 }).collect(),
        };
        let step = PARAMETER_STEP * unknown.scale;
        side(step).iter().zip(side(-step)).map(|(a, b)| 0.5 * (a - b) / PARAMETER_STEP).collect()
    }

    /// Returns the output of any model over the rows that count; `None` if there is no such model.
    fn simulated(&self, base: &Base) -> Option<Vec<f64>> {
        let (low, high) = self.samples.input_range();
        let drive = Drive::new(self.samples, self.family.between_samples(), Passes::Once);
        let operator = drive.stages(|sampling| Operator::new(base, [low, high], sampling)).ok()?;
        let mut y = vec![0.0; self.samples.len()];
        drive.run(&operator, &mut y);
        Some(self.projection.rows.iter().map(|k| y[*k]).collect())
    }

    /// Returns the difference quotient of an output per `scale`, without the sensor's zeros; zeros if there is no model
    /// on either side.
    fn quotient(&self, scale: f64, output: impl Fn(f64) -> Option<Vec<f64>> + Sync) -> Vec<f64> {
        let of = |a: &[f64], b: &[f64], width: f64| a.iter().zip(b).map(|(a, b)| (a - b) / width).collect();
        let slope: Vec<f64> = match rayon::join(|| output(STEP * scale), || output(-STEP * scale)) {
            (Some(a), Some(b)) => of(&a, &b, 2.0 * STEP),
            // At a bound of the model there is one side only.
            (Some(a), None) => output(0.0).map_or_else(Vec::new, |y| of(&a, &y, STEP)),
            (None, Some(b)) => output(0.0).map_or_else(Vec::new, |y| of(&y, &b, STEP)),
            (None, None) => Vec::new(),
        };
        if slope.is_empty() { vec![0.0; self.projection.rows.len()] } else { self.centred(slope) }
    }

    /// Subtracts the mean of each file, or of all: the zeros are fitted too.
    fn centred(&self, mut rows: Vec<f64>) -> Vec<f64> {
        let (mut sums, mut counts) = (vec![0.0; self.projection.groups], vec![0usize; self.projection.groups]);
        for (x, group) in rows.iter().zip(&self.projection.group) {
            sums[*group] += x;
            counts[*group] += 1;
        }
        for (x, group) in rows.iter_mut().zip(&self.projection.group) {
            *x -= sums[*group] / counts[*group] as f64;
        }
        rows
    }
}

/// Returns the length of a variable's box; for a logarithmic one in logarithms.
fn extent(v: &Variable) -> f64 {
    match v.scale {
        Scale::Linear => v.upper - v.lower,
        Scale::Log => (v.upper / v.lower).ln(),
    }
}

/// Returns a large change of a variable.
fn largest(v: &Variable) -> f64 {
    let half = 0.5 * extent(v);
    if v.scale == Scale::Log { half.min(1.0) } else { half }
}

/// Returns the scale, or 1 if it is not positive.
fn positive(scale: f64) -> f64 {
    if scale > 0.0 && scale.is_finite() { scale } else { 1.0 }
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
