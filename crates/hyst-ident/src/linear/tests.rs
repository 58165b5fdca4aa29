//! Tests of responses, gain maps and corrected loops, against closed forms.

use std::f64::consts::TAU;

use hyst_core::{Build, Env, Lag, LagParams, Pi, Resonance, ResonanceParams, Sampling, Stage};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::Samples;

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

fn output_of<S: Stage<f64>>(stage: &S, u: &[f64]) -> Vec<f64> {
    let (mut s, e) = (stage.state(), Env::default());
    u.iter()
        .enumerate()
        .map(|(k, u)| if k == 0 { stage.reset(&mut s, &e, *u) } else { stage.step(&mut s, &e, *u) })
        .collect()
}

const PERIOD: f64 = 1e-3;

fn lag() -> Lag<f64> {
    LagParams { seconds: 0.004 }.build(&Sampling { period: PERIOD }).unwrap()
}

#[test]
fn response_and_coherence_of_noise_through_a_lag() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let u: Vec<f64> = (0..200_000).map(|_| normal(&mut rng)).collect();
    // Sensor noise of known power: coherence |H|² / (|H|² + 0.09).
    let y: Vec<f64> = output_of(&lag(), &u).iter().map(|y| y + 0.3 * normal(&mut rng)).collect();
    let found = response(&Samples::of_columns(PERIOD, u, y), &WelchOptions { window_s: Some(0.5) }).unwrap();
    let Method::Welch { averages, effective_averages, .. } = found.method else { panic!("{:?}", found.method) };
    assert_eq!(averages, 799);
    let (mut outside, mut beyond) = (0, 0);
    for line in &found.lines {
        let h = lag().response(hyst_core::Complex::polar(1.0, -TAU * line.hz * PERIOD));
        let power = h.abs() * h.abs();
        assert!((line.coherence - power / (power + 0.09)).abs() < 0.12, "{line:?}");
        let (low, high) = line.gain_band();
        outside += usize::from(!(low..=high).contains(&h.abs()));
        beyond += usize::from((line.phase - h.arg()).abs() > 1.96 * line.phase_std_error);
    }
    // One in twenty may be outside, with a random factor of two in both directions.
    for (count, what) in [(outside, "gain"), (beyond, "phase")] {
        let share = count as f64 / found.lines.len() as f64;
        assert!((0.02..0.1).contains(&share), "{what}: {share}");
    }
    assert!(effective_averages < 799.0 && effective_averages > 740.0);
}

#[test]
fn a_multisine_gives_its_lines_with_their_scatter() {
    let (length, periods) = (1000, 12);
    let lines = [3, 7, 20, 51];
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let u: Vec<f64> = (0..length * periods)
        .map(|k| lines.iter().map(|l| (TAU * (*l * k) as f64 / length as f64).sin()).sum::<f64>())
        .collect();
    let y: Vec<f64> = output_of(&lag(), &u).iter().map(|y| y + 0.1 * normal(&mut rng)).collect();
    let found = periodic_response(&Samples::of_columns(PERIOD, u.clone(), y.clone()), 1.0).unwrap();
    assert!(matches!(found.method, Method::Periodic { periods: 11, unexcited_share, .. } if unexcited_share < 0.6));
    assert_eq!(found.lines.len(), lines.len());
    for (line, k) in found.lines.iter().zip(lines) {
        assert!((line.hz - k as f64).abs() < 1e-9);
        let h = lag().response(hyst_core::Complex::polar(1.0, -TAU * line.hz * PERIOD));
        assert!((line.gain - h.abs()).abs() < 4.0 * line.gain_std_error, "{line:?} {}", h.abs());
        assert!((line.phase - h.arg()).abs() < 4.0 * line.phase_std_error, "{line:?} {}", h.arg());
        // Noise 0.1 over 1000 rows and 11 periods on an amplitude of 1.
        let expected = 0.1 * (2.0 / 11_000.0_f64).sqrt();
        assert!((0.4..2.0).contains(&(line.gain_std_error / expected)), "{line:?} {expected}");
        assert!(line.coherence > 0.98);
    }
    assert!(matches!(
        periodic_response(&Samples::of_columns(PERIOD, u.clone(), y.clone()), 0.7),
        Err(LinearError::NotPeriodic { .. })
    ));
    assert!(matches!(
        periodic_response(&Samples::of_columns(PERIOD, u, y), 0.000_7),
        Err(LinearError::NotPeriodic { .. })
    ));
}

#[test]
fn gain_over_amplitude_is_that_of_the_play_operator() {
    // Describing function of `u + w play_r(u)`, with x = 1 − 2r/A.
    let (r, w) = (10.0, 0.8);
    let describing = |a: f64| {
        let x: f64 = 1.0 - 2.0 * r / a;
        let re = 0.5 + (x.asin() + x * (1.0 - x * x).sqrt()) / std::f64::consts::PI;
        let im = -(1.0 - x * x) / std::f64::consts::PI;
        (1.0 + w * re, w * im)
    };
    let pi = Pi::<f64, 1>::new(1.0, &[r], &[w]).unwrap();
    let mut u = Vec::new();
    let mut segments = Vec::new();
    for (amplitude, hz) in [(20.0, 2.0), (40.0, 2.0), (40.0, 7.3), (80.0, 7.3)] {
        let first = u.len();
        u.extend((0..4000).map(|k| {
            let t = k as f64 * PERIOD;
            // Faded in over half a second.
            amplitude * (2.0 * t).min(1.0) * (TAU * hz * t).sin()
        }));
        segments.push(first..u.len());
    }
    let mut y = Vec::new();
    segments.iter().for_each(|s: &std::ops::Range<usize>| y.extend(output_of(&pi, &u[s.clone()])));
    let record = Samples { segments, file_of_segment: vec![0; 4], ..Samples::of_columns(PERIOD, u, y) };
    let points = gain_map(&record, None).unwrap();
    assert_eq!(points.len(), 4, "{points:?}");
    for (point, (amplitude, hz)) in points.iter().zip([(20.0, 2.0), (40.0, 2.0), (40.0, 7.3), (80.0, 7.3)]) {
        assert!((point.hz / hz - 1.0).abs() < 2e-3 && (point.amplitude / amplitude - 1.0).abs() < 2e-3, "{point:?}");
        let (re, im) = describing(amplitude);
        assert!((point.gain / re.hypot(im) - 1.0).abs() < 2e-3, "{point:?} {}", re.hypot(im));
        assert!((point.phase - im.atan2(re)).abs() < 5e-3, "{point:?} {}", im.atan2(re));
        assert!(point.gain_std_error.unwrap() < 1e-3 && point.harmonics > 0.01);
    }
    // A small sine far from rest: the motion to it and back is larger.
    let small: Vec<f64> = (0..6000)
        .map(|k| {
            let t = k as f64 * PERIOD;
            t.min(6.0 - t).min(1.0) * (50.0 + 4.0 * (TAU * 5.0 * t).sin())
        })
        .collect();
    let y = output_of(&pi, &small);
    let points = gain_map(&Samples::of_columns(PERIOD, small, y), None).unwrap();
    let steady = points.iter().max_by_key(|p| p.cycles).unwrap();
    assert!((steady.hz / 5.0 - 1.0).abs() < 2e-3 && (steady.amplitude - 4.0).abs() < 0.01, "{points:?}");
    assert!((steady.bias - 50.0).abs() < 0.05 && (steady.gain - 1.0).abs() < 1e-3, "{steady:?}");
    // A decaying sine gives one point per cycle.
    let decaying: Vec<f64> =
        (0..4000).map(|k| 80.0 * (1.0 - k as f64 / 4000.0) * (TAU * 5.0 * k as f64 * PERIOD).sin()).collect();
    let y = output_of(&pi, &decaying);
    let points = gain_map(&Samples::of_columns(PERIOD, decaying, y), None).unwrap();
    assert!(points.len() > 15 && points.iter().all(|p| p.cycles == 1), "{}", points.len());
    assert!(points.windows(2).filter(|p| p[1].gain < p[0].gain).count() > 14, "{points:?}");
    assert!(matches!(
        gain_map(&Samples::of_columns(PERIOD, vec![0.0; 50], vec![0.0; 50]), None),
        Err(LinearError::NoSine { .. })
    ));
}

#[test]
fn the_phase_of_the_structure_is_removed_from_the_loop() {
    // A loop of known width, then a mode of known phase at 10 Hz.
    let period = 1e-4;
    let hz = 10.0;
    let mode: Resonance<f64> =
        ResonanceParams { hz: 40.0, damping: 0.3, gain: 1.0 }.build(&Sampling { period }).unwrap();
    let u: Vec<f64> = (0..20_000).map(|k| 50.0 * (TAU * hz * k as f64 * period).sin()).collect();
    let pi = Pi::<f64, 1>::new(1.0, &[5.0], &[0.3]).unwrap();
    let alone = output_of(&pi, &u);
    let mounted = output_of(&mode, &alone);
    let s = (hz / 40.0, 0.6 * hz / 40.0);
    let phase = -(s.1).atan2(1.0 - s.0 * s.0);
    let bare = corrected_loop(period, &u, &alone, None, 0.0).unwrap();
    let with = corrected_loop(period, &u, &mounted, None, phase).unwrap();
    // The width of the play operator is 2 r w, of a span of 2 (A + w (A − r)).
    let width = 100.0 * 2.0 * 5.0 * 0.3 / (2.0 * (50.0 + 0.3 * 45.0));
    assert!((bare.raw.width_percent - width).abs() < 0.01, "{bare:?}", bare = bare.raw);
    assert!(with.raw.width_percent > 3.0 * width, "{:?}", with.raw);
    // The mode also changes the harmonics of the loop, which are not corrected.
    assert!((with.corrected.width_percent / width - 1.0).abs() < 0.15, "{:?} {width}", with.corrected);
    assert!((with.gain / bare.gain * ((1.0 - s.0 * s.0).powi(2) + s.1 * s.1).sqrt() - 1.0).abs() < 0.01);
    assert!((with.hz - hz).abs() < 0.01, "{}", with.hz);
    assert!(matches!(corrected_loop(period, &u[..900], &alone, None, 0.0), Err(LinearError::NoSine { .. })));
    assert!(matches!(corrected_loop(period, &u, &alone, None, 9.0), Err(LinearError::Field { field: "phase", .. })));
}

#[test]
fn a_structure_is_identified_from_a_record_with_a_high_sample_rate() {
    // One mode driven by a multisine up to 60 Hz, at 4 kHz.
    let period = 2.5e-4;
    let mode: Resonance<f64> =
        ResonanceParams { hz: 35.0, damping: 0.03, gain: 0.8 }.build(&Sampling { period }).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let lines: Vec<(f64, f64)> = (1..120).map(|k| (0.5 * f64::from(k), TAU * rng.random::<f64>())).collect();
    let u: Vec<f64> = (0..64_000)
        .map(|k| lines.iter().map(|(hz, phase)| (TAU * hz * k as f64 * period + phase).sin()).sum::<f64>())
        .collect();
    let y: Vec<f64> = output_of(&mode, &u).iter().map(|y| y + 0.2 * normal(&mut rng)).collect();
    let found = identify_structure(&Samples::of_columns(period, u, y), &StructureOptions::default()).unwrap();
    assert!((55.0..70.0).contains(&found.band_hz) && found.factor > 15, "{} {}", found.band_hz, found.factor);
    let near = found.modes.iter().min_by(|a, b| (a.hz - 35.0).abs().total_cmp(&(b.hz - 35.0).abs())).unwrap();
    assert!((near.hz / 35.0 - 1.0).abs() < 0.01 && (near.damping / 0.03 - 1.0).abs() < 0.1, "{near:?}");
    assert!(!found.orders.is_empty() && found.simulation_share < 0.05, "{}", found.simulation_share);
}
