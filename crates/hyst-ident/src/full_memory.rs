//! Fractional models with full memory, over a whole record at once.
//!
//! Offline the Grünwald-Letnikov sums need not be truncated. LFDM and IFM are linear, so their outputs are convolutions
//! with an impulse response, which is a quotient of two power series. Both cost O(N log N) by FFT; the sums cost O(N²).
//! This is the reference for the memories of [`hyst_core::Memory`], which run sample by sample.

use hyst_core::{Build, Error, Exponentials, GlWeights, Ifm, IfmParams, Lfdm, LfdmParams, Sampling};
use realfft::RealFftPlanner;

/// Returns one side of Eq. 15 as a power series in z⁻¹: `gain + weight · Σ ωₖ z⁻ᵏ`, divided by `by`.
fn side(gain: f64, weight: f64, weights: GlWeights, by: f64, n: usize) -> Vec<f64> {
    let mut series: Vec<f64> = weights.take(n).map(|w| weight * w / by).collect();
    if let Some(first) = series.first_mut() {
        *first += gain / by;
    }
    series
}

/// Returns the first `n` terms of the product of two power series.
fn product(planner: &mut RealFftPlanner<f64>, a: &[f64], b: &[f64], n: usize) -> Vec<f64> {
    let (a, b) = (&a[..a.len().min(n)], &b[..b.len().min(n)]);
    if a.is_empty() || b.is_empty() {
        return vec![0.0; n];
    }
    let length = (a.len() + b.len()).next_power_of_two();
    let (forward, backward) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
    let spectrum = |x: &[f64]| {
        let mut padded = forward.make_input_vec();
        padded[..x.len()].copy_from_slice(x);
        let mut spectrum = forward.make_output_vec();
        // Cannot fail: the lengths come from the planner.
        let _ = forward.process(&mut padded, &mut spectrum);
        spectrum
    };
    let (mut x, y) = (spectrum(a), spectrum(b));
    let scale = 1.0 / length as f64;
    x.iter_mut().zip(&y).for_each(|(x, y)| *x = *x * y * scale);
    let mut out = backward.make_output_vec();
    let _ = backward.process(&mut x, &mut out);
    out.resize(n, 0.0);
    out
}

/// Returns the first `n` terms of 1/b, with b₀ = 1, by Newton's iteration `r ← r − r (b r − 1)`, which doubles the
/// number of correct terms.
fn reciprocal(planner: &mut RealFftPlanner<f64>, b: &[f64], n: usize) -> Vec<f64> {
    let mut r = vec![1.0];
    while r.len() < n {
        let next = (2 * r.len()).min(n);
        let mut excess = product(planner, b, &r, next);
        // These terms are already correct; the excess is rounding.
        excess[..r.len()].fill(0.0);
        let correction = product(planner, &r, &excess, next);
        r.resize(next, 0.0);
        r.iter_mut().zip(&correction).for_each(|(r, c)| *r -= c);
    }
    r.truncate(n);
    r
}

/// Returns the first `n` samples of the LFDM's impulse response from rest \[y/u\].
/// They are the quotient of the two sides of Eq. 15.
///
/// # Errors
/// Those of the model's [`build`](hyst_core::Build::build).
pub fn impulse_response(params: &LfdmParams, sampling: &Sampling, n: usize) -> Result<Vec<f64>, Error> {
    let _checked: Lfdm<f64, Exponentials<f64, 8>> = params.build(sampling)?;
    let LfdmParams { a, b, c, alpha, beta, order } = *params;
    let (wa, wb) = (GlWeights::new(alpha, order), GlWeights::new(beta, order));
    let (b, c) = (b * sampling.period.powf(-alpha), c * sampling.period.powf(-beta));
    let first = 1.0 + c * { wb }.next().unwrap_or_default();
    let mut planner = RealFftPlanner::new();
    let inverse = reciprocal(&mut planner, &side(1.0, c, wb, first, n), n);
    Ok(product(&mut planner, &side(a, b, wa, first, n), &inverse, n))
}

/// Replaces values that are not finite by the last finite value, as the models do.
fn held(u: &[f64]) -> Vec<f64> {
    let mut last = 0.0;
    u.iter()
        .map(|u| {
            last = if u.is_finite() { *u } else { last };
            last
        })
        .collect()
}

/// Returns the output \[y\] of the LFDM with full memory for the input `u` \[u\].
/// The model is settled at the first value.
///
/// Zhu et al. 2018, eq. 6, 15.
///
/// # Errors
/// Those of the model's [`build`](hyst_core::Build::build).
///
/// ```
/// use hyst_core::{LfdmParams, Sampling};
/// let printed = LfdmParams::PRINTED;
/// let step: Vec<f64> = (0..100_000).map(|k| if k == 0 { 0.0 } else { 1.0 }).collect();
/// let x = hyst_ident::full_memory::lfdm(&printed, &Sampling { period: 1e-4 }, &step)?;
/// assert!(x[99_999] > 0.9 * printed.a);
/// # Ok::<(), hyst_core::Error>(())
/// ```
pub fn lfdm(params: &LfdmParams, sampling: &Sampling, u: &[f64]) -> Result<Vec<f64>, Error> {
    let response = impulse_response(params, sampling, u.len())?;
    let mut u = held(u);
    let rest = u.first().copied().unwrap_or_default();
    u.iter_mut().for_each(|u| *u -= rest);
    let mut x = product(&mut RealFftPlanner::new(), &response, &u, u.len());
    x.iter_mut().for_each(|x| *x += params.a * rest);
    Ok(x)
}

/// Returns the output \[y\] of the IFM with full memory for the input `u` \[u\].
/// The model is settled at the first value.
///
/// Zhu et al. 2018, eq. 10, 11, 15.
///
/// # Errors
/// Those of the model's [`build`](hyst_core::Build::build); the delay is not limited.
pub fn ifm(params: &IfmParams, sampling: &Sampling, u: &[f64]) -> Result<Vec<f64>, Error> {
    // The delay is applied to the record here, so the limit of the model's ring buffer does not apply.
    let tau = if params.tau.is_finite() && params.tau > 0.0 { 0.0 } else { params.tau };
    let _checked: Ifm<f64, Exponentials<f64, 8>, 2> = IfmParams { tau, ..*params }.build(sampling)?;
    let u = held(u);
    let late = delayed(&u, params.tau / sampling.period);
    let difference: Vec<f64> = late.iter().zip(&u).map(|(late, u)| late - u).collect();
    let IfmParams { a, b, c, alpha, beta, delta, order, .. } = *params;
    let mut x = lfdm(&LfdmParams { a, b, c, alpha, beta, order }, sampling, &difference)?;
    x.iter_mut().zip(&u).for_each(|(x, u)| *x += delta * u);
    Ok(x)
}

/// Delays `u` by a number of samples, linear between them; before the first sample, the first sample.
fn delayed(u: &[f64], samples: f64) -> Vec<f64> {
    // As hyst_core::Delay: integers up to rounding are integers.
    let nearest = samples.round();
    let samples = if (samples - nearest).abs() <= 1e-9 * nearest { nearest } else { samples };
    let (whole, fraction) = (samples.floor() as usize, samples.fract());
    let at = |k: usize, back: usize| u[k.saturating_sub(back)];
    (0..u.len()).map(|k| at(k, whole) + fraction * (at(k, whole.saturating_add(1)) - at(k, whole))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyst_core::{Env, GlOrder, Ifm, Memory, ShortMemory, Stage};

    const LFDM: LfdmParams = LfdmParams::PRINTED;
    const IFM: IfmParams = IfmParams::PRINTED;
    const TEN_KHZ: Sampling = Sampling { period: 1e-4 };
    const BOTH: [GlOrder; 2] = [GlOrder::First, GlOrder::Second];

    /// The paper's five sines with an offset that is reached within a second.
    fn drive(n: usize, h: f64) -> Vec<f64> {
        (0..n)
            .map(|k| {
                let t = h * k as f64;
                let waves = [5.0, 10.0, 15.0, 20.0, 30.0];
                let sum: f64 = waves.iter().map(|hz| (std::f64::consts::TAU * hz * t + hz).sin() - hz.sin()).sum();
                7.0 + 20.0 * (1.0 - (-3.0 * t).exp()) + 5.0 * sum
            })
            .collect()
    }

    fn run(stage: &impl Stage<f64>, u: &[f64]) -> Vec<f64> {
        let (mut s, e) = (stage.state(), Env::default());
        let first = stage.reset(&mut s, &e, u[0]);
        std::iter::once(first).chain(u[1..].iter().map(|u| stage.step(&mut s, &e, *u))).collect()
    }

    /// Returns the maximum distance, relative to the span of `exact`.
    fn apart(x: &[f64], exact: &[f64]) -> f64 {
        let (low, high) = crate::statistics::range(exact.iter().copied());
        let distance = x.iter().zip(exact).fold(0.0, |d: f64, (x, y)| d.max((x - y).abs()));
        assert_eq!(x.len(), exact.len());
        distance / (high - low)
    }

    /// Eq. 15 as printed: O(N²).
    fn recursion(p: &LfdmParams, h: f64, u: &[f64]) -> Vec<f64> {
        let weights = |mu| GlWeights::new(mu, p.order).take(u.len()).collect::<Vec<f64>>();
        let (wa, wb) = (weights(p.alpha), weights(p.beta));
        let (b, c) = (p.b * h.powf(-p.alpha), p.c * h.powf(-p.beta));
        let mut x: Vec<f64> = Vec::new();
        for n in 0..u.len() {
            let driven: f64 = (0..=n).map(|k| wa[k] * (u[n - k] - u[0])).sum();
            let past: f64 = (1..=n).map(|k| wb[k] * x[n - k]).sum();
            x.push((p.a * (u[n] - u[0]) + b * driven - c * past) / (1.0 + c * wb[0]));
        }
        x.iter().map(|x| x + p.a * u[0]).collect()
    }

    #[test]
    fn the_convolution_equals_the_recursion() {
        for order in BOTH {
            for h in [1e-4, 1e-2] {
                for n in [1, 2, 3, 1000, 2047, 2048] {
                    let (u, cx) = (drive(n.max(2), h), Sampling { period: h });
                    let params = LfdmParams { order, ..LFDM };
                    let exact = recursion(&params, h, &u);
                    assert!(apart(&lfdm(&params, &cx, &u).unwrap(), &exact) < 1e-12, "{order:?} {h} {n}");
                    for tau in [0.0, 1.5e-3, 0.3e-2] {
                        let params = IfmParams { order, tau, ..IFM };
                        let (whole, fraction) = ((tau / h + 1e-9) as usize, (tau / h).fract());
                        let fraction = if fraction > 1.0 - 1e-9 { 0.0 } else { fraction };
                        let at = |k: usize| u[k.saturating_sub(whole)];
                        let late = |k: usize| at(k) * (1.0 - fraction) + at(k.saturating_sub(1)) * fraction;
                        let ud: Vec<f64> = (0..u.len()).map(|k| late(k) - u[k]).collect();
                        let exact: Vec<f64> = recursion(&params_of(&params), h, &ud)
                            .iter()
                            .zip(&u)
                            .map(|(h, u)| h + params.delta * u)
                            .collect();
                        assert!(apart(&ifm(&params, &cx, &u).unwrap(), &exact) < 1e-11, "{order:?} {h} {n} {tau}");
                    }
                }
            }
        }
        assert!(lfdm(&LFDM, &TEN_KHZ, &[]).unwrap().is_empty() && ifm(&IFM, &TEN_KHZ, &[]).unwrap().is_empty());
    }

    fn params_of(p: &IfmParams) -> LfdmParams {
        LfdmParams { a: p.a, b: p.b, c: p.c, alpha: p.alpha, beta: p.beta, order: p.order }
    }

    /// Returns the errors of a memory over 1e5 samples at 10 kHz, relative to the output's span: LFDM, IFM.
    fn errors<W: Memory<f64>>(order: GlOrder) -> (f64, f64) {
        let u = drive(100_000, 1e-4);
        let (l, i) = (LfdmParams { order, ..LFDM }, IfmParams { order, ..IFM });
        let one: Box<Lfdm<f64, W>> = Box::new(l.build(&TEN_KHZ).unwrap());
        let two: Box<Ifm<f64, W, 32>> = Box::new(i.build(&TEN_KHZ).unwrap());
        (
            apart(&run(&*one, &u), &lfdm(&l, &TEN_KHZ, &u).unwrap()),
            apart(&run(&*two, &u), &ifm(&i, &TEN_KHZ, &u).unwrap()),
        )
    }

    /// Checks the errors stated in the documentation of the memories.
    #[test]
    fn errors_of_the_memories_against_full_memory() {
        for order in BOTH {
            let below =
                |(l, i): (f64, f64), limit: (f64, f64)| assert!(l < limit.0 && i < limit.1, "{order:?} {l} {i}");
            below(errors::<Exponentials<f64, 24>>(order), (1e-6, 3e-7));
            below(errors::<Exponentials<f64, 32>>(order), (2.5e-8, 8e-9));
            below(errors::<Exponentials<f64, 40>>(order), (1e-9, 3e-10));
            let about = |(l, i): (f64, f64), stated: (f64, f64)| {
                assert!((l / stated.0 - 1.0).abs() < 0.03 && (i / stated.1 - 1.0).abs() < 0.03, "{order:?} {l} {i}");
            };
            about(errors::<ShortMemory<f64, 100>>(order), (0.225, 0.0125));
            about(errors::<ShortMemory<f64, 1000>>(order), (0.0725, 1.89e-3));
            about(errors::<ShortMemory<f64, 5000>>(order), (0.0214, 4.24e-4));
        }
    }

    #[test]
    fn invalid_inputs_are_held_and_invalid_parameters_are_refused() {
        let mut u = drive(500, 1e-4);
        let model: Ifm<f64, Exponentials<f64, 40>, 32> = IFM.build(&TEN_KHZ).unwrap();
        (u[70], u[200]) = (f64::NAN, f64::INFINITY);
        assert!(apart(&run(&model, &u), &ifm(&IFM, &TEN_KHZ, &u).unwrap()) < 1e-9);
        for tau in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(ifm(&IfmParams { tau, ..IFM }, &TEN_KHZ, &u).is_err());
        }
        assert!(lfdm(&LfdmParams { alpha: 2.0, ..LFDM }, &TEN_KHZ, &u).is_err());
        // A delay of any length.
        let late = ifm(&IfmParams { tau: 1e9, ..IFM }, &TEN_KHZ, &u).unwrap();
        assert!(late.iter().all(|x| x.is_finite()));
    }
}
