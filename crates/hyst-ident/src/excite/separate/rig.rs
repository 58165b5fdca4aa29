//! Simulates a typical actuator on one drive, with and without an effect, and removes what a fit of its loop would
//! explain.

use hyst_core::{Build, EffectParams, Env, PiParams, Sampling, Stage, ViscousPi, ViscousPiParams, play};
use nalgebra::{DMatrix, DVector};

use super::drives::Candidate;
use super::result::SeparateOptions;
use crate::excite::{ExciteError, Limits};

/// Number of play operators of the loop.
const PLAYS: usize = 8;
/// Maximum delay \[samples\].
const DELAY: usize = 256;
/// Maximum number of creep elements.
const CREEP: usize = 8;
/// Maximum number of rows: more rows take longer and do not change the result.
const MAX_ROWS: f64 = 60_000.0;
/// Maximum sample rate \[Hz\]: no typical effect is faster.
const MAX_RATE_HZ: f64 = 1000.0;

/// The simulated actuator. Input and output are shares of span, from 0 to about 1.
pub(super) struct Rig {
    pub(super) period: f64,
    pub(super) times: Vec<f64>,
    input: Vec<f64>,
    /// The first row of each segment.
    starts: Vec<bool>,
    env: Vec<Env<f64>>,
    pub(super) thermometer: bool,
    pub(super) load_cell: bool,
    pi: PiParams<Vec<f64>>,
    /// Output without any effect.
    pub(super) base_output: Vec<f64>,
    /// Orthonormal basis of the outputs for free weights, gain and zero of the loop.
    fitted: DMatrix<f64>,
}

impl Rig {
    pub(super) fn new(candidate: &Candidate, limits: &Limits, options: &SeparateOptions) -> Result<Self, ExciteError> {
        let rate_hz = limits.rate_hz.min(MAX_RATE_HZ).min(MAX_ROWS / options.duration_s);
        let drive = candidate.drive(&Limits { rate_hz, slew_v_per_s: None, ..*limits })?;
        let span = limits.hi_v - limits.lo_v;
        let times = drive.time().to_vec();
        let input: Vec<f64> = drive.voltage().iter().map(|u| (u - limits.lo_v) / span).collect();
        let mut starts = vec![false; times.len()];
        drive.segments().iter().for_each(|s| starts[s.start] = true);
        let turn = std::f64::consts::TAU / options.duration_s;
        // A varying room temperature, and a load that is applied and removed: neither in step with the drive.
        let surroundings = |t: &f64| Env {
            time: *t,
            temperature: 1.2 * (0.8 * turn * t + 0.6).sin() + 0.5 * (1.7 * turn * t).cos(),
            load: f64::from(u8::from((2.3 * turn * t + 0.4).sin() > 0.2)),
        };
        let env = times.iter().map(surroundings).collect();
        let thresholds: Vec<f64> = (1..=PLAYS).map(|i| 0.5 * (i as f64 / PLAYS as f64).powf(1.5)).collect();
        let weights = vec![0.06; PLAYS];
        let pi = PiParams { gain: 0.65, thresholds, weights };
        let mut rig = Self {
            period: 1.0 / rate_hz,
            times,
            input,
            starts,
            env,
            thermometer: options.thermometer,
            load_cell: options.load_cell,
            pi,
            base_output: Vec::new(),
            fitted: DMatrix::zeros(0, 0),
        };
        rig.base_output = rig.output(0.0, &EffectParams::default()).unwrap_or_default();
        rig.fitted = rig.loop_columns().qr().q();
        Ok(rig)
    }

    pub(super) fn rows(&self) -> usize {
        self.times.len()
    }

    /// Returns the temperature difference from T₀ in each row \[K\].
    pub(super) fn temperature(&self) -> Vec<f64> {
        self.env.iter().map(|e| e.temperature).collect()
    }

    /// Returns the load in each row, as a share of the applied load.
    pub(super) fn load(&self) -> Vec<f64> {
        self.env.iter().map(|e| e.load).collect()
    }

    /// Returns the output with effects and the drag λ \[s\] of the loop; `None` if the chain cannot be built.
    pub(super) fn output(&self, drag: f64, effects: &EffectParams<Vec<f64>>) -> Option<Vec<f64>> {
        let cx = Sampling { period: self.period };
        let plays = ViscousPiParams { pi: self.pi.clone(), seconds: drag, volt_seconds: 0.0 };
        let plays: ViscousPi<f64, PLAYS> = plays.build(&cx).ok()?;
        let chain = Box::new(effects.around::<f64, _, DELAY, CREEP>(plays, &cx).ok()?);
        let mut state = Box::new(chain.state());
        let rows = self.starts.iter().zip(&self.env).zip(&self.input);
        Some(
            rows.map(
                |((start, e), u)| {
                    if *start { chain.reset(&mut state, e, *u) } else { chain.step(&mut state, e, *u) }
                },
            )
            .collect(),
        )
    }

    /// Returns the contribution of the effects to the output after a fit of the loop.
    pub(super) fn added(&self, drag: f64, effects: &EffectParams<Vec<f64>>) -> Option<DVector<f64>> {
        let output = self.output(drag, effects)?;
        Some(self.loop_residual(output.iter().zip(&self.base_output).map(|(y, p)| y - p).collect()))
    }

    /// Returns the residual of a column after a fit of the loop.
    pub(super) fn loop_residual(&self, column: Vec<f64>) -> DVector<f64> {
        let mut residual = DVector::from_vec(column);
        // The second pass removes the rounding error of the first one.
        for _ in 0..2 {
            let coefficients = self.fitted.tr_mul(&residual);
            residual.gemv(-1.0, &self.fitted, &coefficients, 1.0);
        }
        residual
    }

    fn loop_columns(&self) -> DMatrix<f64> {
        let mut columns = DMatrix::zeros(self.rows(), PLAYS + 2);
        let mut plays = [0.0; PLAYS];
        for (t, (u, start)) in self.input.iter().zip(&self.starts).enumerate() {
            if *start {
                plays = [0.0; PLAYS];
            }
            for (i, (p, r)) in plays.iter_mut().zip(&self.pi.thresholds).enumerate() {
                *p = play(*p, *u, *r);
                columns[(t, i)] = *p;
            }
            columns[(t, PLAYS)] = *u;
            columns[(t, PLAYS + 1)] = 1.0;
        }
        columns
    }
}
