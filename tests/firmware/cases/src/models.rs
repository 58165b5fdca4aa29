//! Parameters of the cases, and functions that build coefficients in more than one call.

use crate::{PERIOD, given};
use core::array::from_fn;
use hyst_core::*;

pub(crate) const DELAY: DelayParams = DelayParams { seconds: 2.3e-3 };
pub(crate) const LAG: LagParams = LagParams { seconds: 2e-3 };
pub(crate) const CREEP: CreepParams<[f64; 4]> =
    CreepParams { seconds: [0.02, 0.2, 2.0, 20.0], shares: [0.02, 0.015, 0.01, 0.02] };
pub(crate) const MODE: ResonanceParams = ResonanceParams { hz: 90.0, damping: 0.03, gain: 0.9 };
pub(crate) const TEMPERATURE: TemperatureParams =
    TemperatureParams { per_kelvin: 0.005, reference_degc: 22.0, expansion: 0.02, direct: 0.0004, seconds: 3.0 };
pub(crate) const BOUC_WEN: BoucWenParams = BoucWenParams { k0: 0.15, alpha: -0.05, beta: 0.06, gamma: 0.02, n: 1.0 };
/// Xie et al., tanh at 50 Hz, with a smaller γ so that the curve bends in this range.
pub(crate) const XIE: ActivationParams = ActivationParams { k0: 0.1447, alpha: -9e-5, beta: 0.4017, gamma: 0.05 };
pub(crate) const LFDM: LfdmParams = LfdmParams::PRINTED;
pub(crate) const IFM: IfmParams = IfmParams::PRINTED;
pub(crate) const ASYMMETRY: AsymmetryParams<[f64; 3]> = AsymmetryParams::behind([4.0, 10.0, -3.0], [0.1, -0.05, 0.2]);
pub(crate) const COMPLIANCE: LoadParams = LoadParams { per_newton: -0.02, gain_per_newton: 0.002 };
pub(crate) const SATURATION: SaturationParams = SaturationParams::behind(-2.0, 20.0, 0.2);
pub(crate) const GAINS: PidParams = PidParams {
    proportional: 0.5,
    integral: 200.0,
    derivative: 1e-4,
    derivative_hz: 200.0,
    proportional_weight: 1.0,
    derivative_weight: 0.0,
    anti_windup_seconds: 0.01,
    low: 0.0,
    high: 120.0,
};
pub(crate) const DRIFT: DriftParams = DriftParams { per_second: 0.01, settling: 0.2, seconds: 2.0, since_s: 0.5 };
pub(crate) const OVERDRIVE: RateParams =
    RateParams { volts: 0.8, exponent: 0.4, reference_rate: 120.0, law: RateLaw::Relaxes };
pub(crate) const WIDENING: WideningParams<[f64; 6]> = WideningParams {
    growth: 0.3,
    exponent: 0.35,
    reference_rate: 120.0,
    seconds: 0.004,
    thresholds: [8.0, 16.0, 24.0, 32.0, 40.0, 48.0],
    weights: [0.02, 0.015, 0.01, 0.01, 0.005, 0.005],
};
pub(crate) const INTERFERENCE: InterferenceParams = InterferenceParams {
    hz: 50.0,
    amplitude: 0.05,
    phase: 0.3,
    harmonics: [0.0, 0.0, 0.015, -0.005, 0.0, 0.0, 0.004, 0.0],
};
pub(crate) const OPTIONS: CompensatorOptions = CompensatorOptions { bandwidth_hz: None };

pub(crate) fn pi<T: Real, const N: usize>() -> Result<Pi<T, N>, Error> {
    let thresholds: [f64; N] = from_fn(|i| 50.0 * (i + 1) as f64 / N as f64);
    given(PiParams { gain: 0.1, thresholds, weights: [1.0 / (10 * N) as f64; N] }).build(&())
}

const PI_10: PiParams<[f64; 10]> = PiParams {
    gain: 0.1,
    thresholds: [5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0],
    weights: [0.01; 10],
};

/// Builds a viscous operator with λ = 2 ms.
pub(crate) fn viscous<T: Real>() -> Result<ViscousPi<T, 10>, Error> {
    given(ViscousPiParams { pi: PI_10, seconds: 2e-3, volt_seconds: 0.0 }).build(&PERIOD)
}

/// Builds a root-viscous operator with J = 5 mV s.
pub(crate) fn root_viscous<T: Real>() -> Result<ViscousPi<T, 10>, Error> {
    given(ViscousPiParams { pi: PI_10, seconds: 0.0, volt_seconds: 5e-3 }).build(&PERIOD)
}

pub(crate) fn gpi<T: Real>() -> Result<Gpi<T, 10>, Error> {
    let PiParams { gain, thresholds, weights } = PI_10;
    let left = Curve::Linear { slope: 0.95, offset: -0.5 };
    let right = Curve::Tanh { height: 400.0, rate: 2.6e-3, shift: 0.0, offset: 1.0 };
    given(GpiParams { left, right, gain, thresholds, weights }).build(&())
}

pub(crate) fn everett<T: Real, const N: usize>() -> Result<Everett<T, N>, Error> {
    let grid = given(Grid { low: 0.0, high: 120.0, cells: N - 1 });
    let density = |a: usize, b: usize| given(if a == b { 0.3 } else { 0.03 / (1 + a - b) as f64 });
    Everett::new(grid, 0.0, density, |_| given(0.05))
}

pub(crate) fn chain<T: Real>() -> Result<Chain<T, Pi<T, 10>, 16, 4>, Error> {
    Chain::new(pi()?)
        .with_zero(given(-1.5))
        .with_delay(&given(DELAY), &PERIOD)?
        .with_lag(&given(LAG), &PERIOD)?
        .with_temperature(&given(TEMPERATURE), &PERIOD)?
        .with_creep(&given(CREEP), &PERIOD)?
        .with_resonance(&given(MODE), &PERIOD)?
        .with_drift(&given(DRIFT))?
        .with_interference(&given(INTERFERENCE))
}

pub(crate) fn dpm<T: Real>() -> Result<Dpm<T, 25, 8, 9>, Error> {
    let grid = MirrorParams::on_printed_grid(());
    let mirror = Mirror::from_fn(&grid, |d, p| given(1.0 - 8e-6 * d - 2e-6 * p * p))?;
    Dpm::new(everett::<T, 25>()?, mirror, given(20.0), &PERIOD)
}

/// A stage at the constant temperature 23 °C.
#[derive(Clone, Debug)]
pub struct Steady<S>(pub(crate) S);

impl<T: Real, S: Stage<T>> Stage<T> for Steady<S> {
    type State = S::State;
    fn state(&self) -> S::State {
        self.0.state()
    }
    fn reset(&self, s: &mut S::State, e: &Env<T>, u0: T) -> T {
        self.0.reset(s, &Env { temperature: T::from_f64(23.0), ..*e }, u0)
    }
    fn step(&self, s: &mut S::State, e: &Env<T>, u: T) -> T {
        self.0.step(s, &Env { temperature: T::from_f64(23.0), ..*e }, u)
    }
}

/// A closed loop of a PID and a first-order plant, as a stage from reference to drive.
#[derive(Clone, Debug)]
pub struct Loop<T>(Pid<T>);

pub(crate) fn pid_loop<T: Real>() -> Result<Loop<T>, Error> {
    Ok(Loop(given(GAINS).build(&PERIOD)?))
}

impl<T: Real> Stage<T> for Loop<T> {
    type State = (PidState<T>, T);
    fn state(&self) -> Self::State {
        (self.0.state(), T::ZERO)
    }
    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        *s = self.state();
        self.step(s, e, u0)
    }
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let drive = self.0.step(&mut s.0, u, s.1, T::ZERO);
        s.1 += (drive * T::from_f64(0.15) - s.1) * T::from_f64(0.2);
        drive
    }
}

/// A force observer as a stage; its measured displacement is the sample's load.
#[derive(Clone, Debug)]
pub struct Observer<T>(ForceObserver<T, Pi<T, 10>>);

pub(crate) fn observer<T: Real>() -> Result<Observer<T>, Error> {
    Ok(Observer(given(ForceParams { stiffness: 1.08, kappa: 1.02, chi: -0.3 }).observer(pi::<T, 10>()?)?))
}

impl<T: Real> Stage<T> for Observer<T> {
    type State = PiState<T, 10>;
    fn state(&self) -> Self::State {
        PiState::virgin()
    }
    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        self.0.reset(s, e, u0, e.load)
    }
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        self.0.step(s, e, u, e.load)
    }
}

/// The adaptation as a stage from reference to corrected reference. The measured output is 5 % smaller than the
/// predicted one and has another zero.
#[derive(Clone, Debug)]
pub struct Adaptive<T>(Adaptation<T, 4, 6>);

pub(crate) fn adaptive<T: Real>() -> Result<Adaptive<T>, Error> {
    Ok(Adaptive(Adaptation::new((0.0, 20.0), &AdaptationOptions::default())?))
}

impl<T: Real> Stage<T> for Adaptive<T> {
    type State = Adapted<T, 4, 6>;
    fn state(&self) -> Self::State {
        self.0.begin()
    }
    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        *s = self.state();
        self.step(s, e, u0)
    }
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let aimed = self.0.aim(s, u);
        self.0.learn(s, aimed, aimed * T::from_f64(0.95) + T::from_f64(0.1), true);
        aimed
    }
}

/// Voltage and slew limits as a stage.
#[derive(Clone, Debug)]
pub struct Limiter<T>(Limits<T>);

pub(crate) fn limiter<T: Real>() -> Result<Limiter<T>, Error> {
    Ok(Limiter(Limits::new(given(0.0), given(120.0), given(9e3), &PERIOD)?))
}

impl<T: Real> Stage<T> for Limiter<T> {
    type State = T;
    fn state(&self) -> T {
        T::ZERO
    }
    fn reset(&self, last: &mut T, _: &Env<T>, u0: T) -> T {
        *last = self.0.apply(u0, u0).drive;
        *last
    }
    fn step(&self, last: &mut T, _: &Env<T>, u: T) -> T {
        *last = self.0.apply(*last, u).drive;
        *last
    }
}
