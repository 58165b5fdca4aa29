//! PID and force observer.

use std::sync::{Mutex, PoisonError};

use hyst_core::{AffineFit, Build, ForceObservation, ForceParams, PidParams, PidState, Sampling};
use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{Signal, array};
use crate::errors;

/// Estimates an external force without a force sensor: ``k_out·(x − (kappa·free + chi))``.
///
/// ``free`` is the output of a model of the unloaded actuator at the same drive.
#[pyclass(frozen, module = "hyst")]
pub(crate) struct ForceObserver {
    parameters: ForceParams,
    observation: ForceObservation<f64>,
}

/// Reads two signals of equal length.
fn two<'py>(
    (name, x): (&str, &Bound<'py, PyAny>),
    (other, y): (&str, &Bound<'py, PyAny>),
) -> PyResult<(Signal<'py>, Signal<'py>)> {
    let (a, b) = (Signal::new(name, x)?, Signal::new(other, y)?);
    let (n, m) = (a.values()?.len(), b.values()?.len());
    if n == m { Ok((a, b)) } else { Err(PyValueError::new_err(format!("{name} has {n} samples, {other} has {m}"))) }
}

#[pymethods]
impl ForceObserver {
    /// ``k_out`` is the output stiffness [N/y], ``kappa`` and ``chi`` correct slow changes of gain and zero.
    #[new]
    #[pyo3(signature = (*, k_out, kappa = 1.0, chi = 0.0))]
    fn new(k_out: f64, kappa: f64, chi: f64) -> PyResult<Self> {
        let parameters = ForceParams { stiffness: k_out, kappa, chi };
        Ok(Self { parameters, observation: parameters.build(&()).map_err(errors::core)? })
    }

    /// Returns an observer with the kappa and chi for which ``kappa·free + chi`` is the least-squares fit of ``x``,
    /// both measured without a force, shape (n,) [y].
    #[staticmethod]
    #[pyo3(signature = (x, free, *, k_out))]
    fn calibrated(py: Python<'_>, x: &Bound<'_, PyAny>, free: &Bound<'_, PyAny>, k_out: f64) -> PyResult<Self> {
        let (x, free) = two(("x", x), ("free", free))?;
        let (x, free) = (x.values()?, free.values()?);
        let fitted = py.detach(|| {
            let mut fit = AffineFit::default();
            free.iter().zip(x).for_each(|(free, x)| fit.add(*free, *x));
            fit.solve()
        });
        let Some((kappa, chi)) = fitted else {
            return Err(PyValueError::new_err("free does not move: kappa and chi cannot be determined"));
        };
        Self::new(k_out, kappa, chi)
    }

    /// Returns the estimated force [N] from the measured displacement ``x`` and the modelled free one, shape (n,) [y].
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        free: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (x, free) = two(("x", x), ("free", free))?;
        let (x, free) = (x.values()?, free.values()?);
        let force = py.detach(|| x.iter().zip(free).map(|(x, free)| self.observation.force(*x, *free)).collect());
        Ok(array(py, force))
    }

    /// Output stiffness [N/y].
    #[getter]
    fn k_out(&self) -> f64 {
        self.parameters.stiffness
    }

    /// Gain of the modelled free displacement.
    #[getter]
    fn kappa(&self) -> f64 {
        self.parameters.kappa
    }

    /// Zero of the modelled free displacement [y].
    #[getter]
    fn chi(&self) -> f64 {
        self.parameters.chi
    }

    fn __repr__(&self) -> String {
        let ForceParams { stiffness, kappa, chi } = self.parameters;
        format!("ForceObserver(k_out={stiffness:?}, kappa={kappa:?}, chi={chi:?})")
    }
}

/// PID with a filtered derivative and anti-windup:
/// ``u = feedforward + kp·(b·r − y) + ki·∫(r − y) dt + kd·d/dt (c·r − y)``, limited to ``low`` … ``high``.
#[pyclass(frozen, module = "hyst")]
pub(crate) struct Pid {
    pid: hyst_core::Pid<f64>,
    state: Mutex<PidState<f64>>,
}

impl Pid {
    /// Calls `f` with the history.
    fn with<R>(&self, f: impl FnOnce(&mut PidState<f64>) -> R) -> R {
        f(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[pymethods]
impl Pid {
    /// Gains [u/y, u/(y s), u s/y], sample period [s], limits [u], corner frequency of the derivative filter [Hz],
    /// weights of the reference in the proportional and the derivative part, tracking time constant of the anti-windup
    /// [s].
    #[new]
    #[pyo3(signature = (*, kp, ki, kd = 0.0, period, low, high, derivative_hz = 100.0, b = 1.0, c = 0.0, anti_windup = 0.01))]
    #[allow(clippy::too_many_arguments, reason = "keywords of one call")]
    fn new(
        kp: f64,
        ki: f64,
        kd: f64,
        period: f64,
        low: f64,
        high: f64,
        derivative_hz: f64,
        b: f64,
        c: f64,
        anti_windup: f64,
    ) -> PyResult<Self> {
        let params = PidParams {
            proportional: kp,
            integral: ki,
            derivative: kd,
            derivative_hz,
            proportional_weight: b,
            derivative_weight: c,
            anti_windup_seconds: anti_windup,
            low,
            high,
        };
        let pid: hyst_core::Pid<f64> = params.build(&Sampling { period }).map_err(errors::core)?;
        Ok(Self { state: Mutex::new(pid.state()), pid })
    }

    /// Returns the drive [u] for a reference and a measured output [y], added to a feedforward [u].
    #[pyo3(signature = (reference, measured, feedforward = 0.0))]
    fn step(&self, reference: f64, measured: f64, feedforward: f64) -> f64 {
        self.with(|s| self.pid.step(s, reference, measured, feedforward))
    }

    /// Bumpless transfer: the next drive at reference = measured = ``measured`` is ``drive``.
    #[pyo3(signature = (drive, measured, feedforward = 0.0))]
    fn take_over(&self, drive: f64, measured: f64, feedforward: f64) {
        self.with(|s| self.pid.take_over(s, drive, measured, feedforward));
    }

    /// Resets the history.
    fn reset(&self) {
        self.with(|s| *s = self.pid.state());
    }

    /// Whether a limit acted on the last drive.
    #[getter]
    fn limited(&self) -> bool {
        self.with(|s| s.limited())
    }
}
