//! Linearisation of a record around the operator of a fit.

use hyst_core::{CurveSide, Error};

use super::assembly::times;
use super::{Fitted, Problem, SignalPath};
use crate::Samples;

/// A record as seen by the operator of a fit, with everything around the operator held. To first order,
/// [`through`](Self::through) maps a change of the operator's output to a change of the measured output.
pub(crate) struct Tangent<'a> {
    /// The record with the drive of the operator as input, and with the operator's contribution plus the residual as
    /// output.
    pub(crate) samples: Samples,
    path: SignalPath<'a>,
    /// Slope of the curve behind the operator in each row, if there is one.
    curve: Option<Vec<f64>>,
    /// Slope of the output over the motion in each row, if there is a saturation or a gain wander.
    gain: Option<Vec<f64>>,
}

impl Tangent<'_> {
    /// Replaces changes of the operator's output by the changes of the measured output that they cause.
    pub(crate) fn through(&self, changes: &mut [Vec<f64>]) {
        times(changes, self.curve.as_deref());
        self.path.output_side_of(changes);
        times(changes, self.gain.as_deref());
    }
}

impl<'a> Problem<'a> {
    /// Returns the record as seen by the operator of a fit.
    ///
    /// # Errors
    /// If a stage cannot be built.
    pub(crate) fn tangent(&self, fit: &Fitted) -> Result<Tangent<'a>, Error> {
        let h = &fit.hypothesis;
        let path = SignalPath::new(self.samples, h)?;
        let point = self.point_at(h, &path, &fit.solution);
        let (layout, z) = (self.layout(h), fit.solution.as_slice());
        let curve = self.bend(h, &point);
        let gain = (h.effects.limits(CurveSide::Output).is_some() || h.gain_wanders).then(|| {
            let wandered = |k| self.wandering(&z[layout.gain_hats.clone()], k);
            point.motion.iter().enumerate().map(|(k, m)| path.saturated(*m).1 + wandered(k)).collect()
        });
        let input = path.input_side().to_vec();
        let mut tangent = Tangent { samples: Samples { input, ..self.samples.clone() }, path, curve, gain };
        // The widening is added to the operator's output; it is removed here.
        let mut operator = point.operator;
        let without: Vec<f64> = z[layout.widening.clone()].iter().map(|w| -w).collect();
        tangent.path.widen(&mut operator, &without);
        let mut output = [operator];
        tangent.through(&mut output);
        [tangent.samples.output] = output;
        tangent.samples.output.iter_mut().zip(self.residual(fit)?).for_each(|(y, left)| *y += left);
        Ok(tangent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{DragParams, PiBasis, ScreeningBasis};
    use crate::lsq::Blocks;
    use crate::model::Effects;
    use crate::nested::Hypothesis;
    use crate::nested::bounds::stepped;
    use crate::statistics::range;
    use hyst_core::{
        AsymmetryParams, CreepParams, DelayParams, LagParams, ResonanceParams, SaturationParams, TemperatureParams,
    };

    /// A drive with a growing amplitude and a nonlinear output.
    fn samples() -> Samples {
        let rows = 3000;
        let time: Vec<f64> = (0..rows).map(|k| f64::from(k) * 1e-3).collect();
        let input: Vec<f64> = time.iter().map(|t| 10.0 * t * (1.0 - (15.0 * t).cos())).collect();
        let output = input.iter().map(|u| 0.1 * u - 0.4 * (0.1 * u).sin()).collect();
        Samples {
            temperature: Some(time.iter().map(|t| 23.0 + t).collect()),
            ..Samples::of_columns(1e-3, input, output)
        }
    }

    /// Columns that a parameter does not change need not be recomputed.
    #[test]
    fn the_jacobian_matches_differences_of_the_output() {
        for limits in [SaturationParams::behind(0.3, 4.5, 0.05), SaturationParams::before(2.0, 40.0, 0.05)] {
            jacobian_matches_differences(limits);
        }
    }

    fn jacobian_matches_differences(limits: SaturationParams) {
        let samples = samples();
        let effects = Effects {
            delay: Some(DelayParams { seconds: 0.0023 }),
            lag: Some(LagParams { seconds: 0.01 }),
            creep: Some(CreepParams { seconds: vec![0.3, 2.0], shares: vec![0.05, 0.03] }),
            temperature: Some(TemperatureParams {
                per_kelvin: 0.01,
                reference_degc: 23.0,
                seconds: 0.4,
                ..Default::default()
            }),
            resonances: vec![ResonanceParams { hz: 60.0, damping: 0.05, gain: 0.8 }],
            saturation: Some(limits),
            asymmetry: Some(AsymmetryParams::before(vec![10.0, 30.0], vec![0.3, -0.2])),
            ..Effects::default()
        };
        let drag = Some(DragParams { seconds: 2e-3, volt_seconds: 1e-3 });
        let h = Hypothesis { drag, ..Hypothesis::of(effects) };
        let basis = ScreeningBasis::for_samples(&samples, true, None);
        let blocks = Blocks::new(&samples, 20, 1000);
        let problem = Problem::new(&samples, &basis, &blocks, false);
        let fit = problem.fit_linear(&h).unwrap().unwrap();
        let jacobian = problem.jacobian(&h, &fit.solution).unwrap();
        let mut parameters = 0;
        h.clone().visit_nonlinear(&mut |_| parameters += 1);
        assert_eq!(jacobian.len(), parameters);
        let motion = |h: &Hypothesis| problem.motion(h, &fit.solution).unwrap();
        let here = motion(&h);
        for (at, column) in jacobian.iter().enumerate() {
            let (moved, step, _) = stepped(&h, at, &samples, range(here.iter().copied())).unwrap();
            let there = motion(&moved);
            let slopes = problem.at_used_rows(|k| (there[k] - here[k]) / step);
            let largest = slopes.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            assert!(largest > 0.0, "parameter {at}");
            for (said, seen) in column.iter().zip(&slopes) {
                assert!((said - seen).abs() < 1e-4 * largest, "parameter {at}: {said} {seen}");
            }
        }
    }

    #[test]
    fn the_tangent_maps_a_small_change_of_the_operator() {
        // In some rows a saturation hides the change; a wandering gain shows it there too.
        let hidden = arrives_as_its_tangent_says(false);
        assert!(hidden > 20, "{hidden}");
        arrives_as_its_tangent_says(true);
    }

    /// Returns the number of rows with a high drive in which the change is hidden.
    fn arrives_as_its_tangent_says(gain_wanders: bool) -> usize {
        let samples = samples();
        let effects = Effects {
            lag: Some(LagParams { seconds: 0.01 }),
            creep: Some(CreepParams { seconds: vec![0.3], shares: vec![0.05] }),
            temperature: Some(TemperatureParams {
                per_kelvin: 0.01,
                reference_degc: 23.0,
                seconds: 0.4,
                ..Default::default()
            }),
            resonances: vec![ResonanceParams { hz: 60.0, damping: 0.05, gain: 0.8 }],
            asymmetry: Some(AsymmetryParams::behind(vec![1.0, 2.5, -0.1], vec![0.1, 0.2, 0.1])),
            saturation: Some(SaturationParams::behind(-9.0, 4.5, 0.05)),
            ..Effects::default()
        };
        let h = Hypothesis { gain_wanders, ..Hypothesis::of(effects) };
        let basis = PiBasis::for_samples(&samples);
        let blocks = Blocks::new(&samples, 20, 3000);
        let problem = Problem::new(&samples, &basis, &blocks, false);
        let fit = problem.fit_linear(&h).unwrap().unwrap();
        let tangent = problem.tangent(&fit).unwrap();
        // The drive lags. The output is the operator's contribution plus the residual.
        assert_ne!(tangent.samples.input, samples.input);
        let through = |change: Vec<f64>| {
            let mut changes = [change];
            tangent.through(&mut changes);
            let [arrived] = changes;
            arrived
        };
        let arrives = through(problem.operator_output(&fit).unwrap());
        let left = problem.residual(&fit).unwrap();
        for ((seen, arrives), left) in tangent.samples.output.iter().zip(&arrives).zip(&left) {
            assert_eq!(*seen, arrives + left);
        }

        let mut other = fit.clone();
        other.solution.rows_mut(0, fit.weights.len()).scale_mut(1.0 + 1e-6);
        let difference = |a: Vec<f64>, b: Vec<f64>| a.iter().zip(&b).map(|(a, b)| a - b).collect::<Vec<f64>>();
        let change = difference(problem.operator_output(&other).unwrap(), problem.operator_output(&fit).unwrap());
        let seen = difference(problem.residual(&fit).unwrap(), problem.residual(&other).unwrap());
        let largest = seen.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let mut hidden = 0;
        for (k, (said, seen)) in through(change).iter().zip(&seen).enumerate() {
            assert!((said - seen).abs() < 1e-3 * largest, "row {k}: {said} said, {seen} seen");
            hidden += usize::from(seen.abs() < 0.1 * largest && samples.input[k] > 40.0);
        }
        assert!(largest > 1e-6, "{largest}");
        hidden
    }
}
