//! Each shape has the levels, frequencies and lines that its fields state.

use super::*;

#[test]
fn a_sine_has_the_shape_of_its_formula() {
    let u = only(Shape::Sine(Sine { frequency_hz: 10.0, cycles: 4 }), &LIMITS);
    assert_eq!(u.len(), 401);
    assert_eq!((u[25], u[50], u[100]), (40.0, 100.0, -20.0));
}

#[test]
fn a_decaying_sine_has_decreasing_loops_that_end_at_mid_span() {
    let u = only(Shape::DecayingSine(DecayingSine { frequency_hz: 5.0, duration_s: 4.1 }), &LIMITS);
    let tops: Vec<f64> = u.windows(3).filter(|w| w[0] < w[1] && w[1] >= w[2]).map(|w| w[1]).collect();
    assert!(tops.len() >= 18 && tops[0] > 97.0, "{tops:?}");
    assert!(tops.windows(2).all(|w| w[1] < w[0]), "{tops:?}");
    assert!((u[4000] - 40.0).abs() < 1e-3, "{}", u[4000]);
}

#[test]
fn stairs_hold_levels_from_every_part_of_the_span() {
    let stairs = Stairs { levels: 8, hold_s: 0.2, ramp_s: 0.05, seed: 3 };
    let u = only(Shape::Stairs(stairs), &LIMITS);
    let held = |level: usize| &u[level * 250 + 51..(level + 1) * 250];
    let mut parts: Vec<usize> = (0..8)
        .map(|level| {
            assert!(held(level).iter().all(|u| *u == held(level)[0]), "level {level} is not held");
            ((held(level)[0] - LIMITS.lo_v) / LIMITS.span() * 8.0) as usize
        })
        .collect();
    parts.sort_unstable();
    assert_eq!(parts, (0..8).collect::<Vec<_>>());
    // Half a cosine wave is π/2 times as steep as a straight ramp.
    let steepest = u.windows(2).fold(0.0_f64, |most, w| most.max((w[1] - w[0]).abs())) * 1000.0;
    assert!(steepest <= std::f64::consts::FRAC_PI_2 * LIMITS.span() / 0.05);
}

#[test]
fn a_multisine_has_its_lines_and_no_other() {
    // With very short fades the lines are orthogonal over the duration.
    let limits = Limits { lo_v: -1.0, hi_v: 1.0, ..LIMITS };
    let multisine = Multisine {
        low_hz: 2.0,
        high_hz: 10.0,
        lines: 5,
        periods: 1,
        phases: Phases::Schroeder,
        duration_s: 4.0,
        fade_s: 0.01,
    };
    let u = only(Shape::Multisine(multisine), &limits);
    let amplitude = |hz: f64| {
        let (re, im) = u[..4000].iter().enumerate().fold((0.0, 0.0), |(re, im), (k, u)| {
            let (sin, cos) = (std::f64::consts::TAU * hz * k as f64 * 1e-3).sin_cos();
            (re + u * cos, im + u * sin)
        });
        f64::hypot(re, im) / 2000.0
    };
    for hz in [2.0, 4.0, 6.0, 8.0, 10.0] {
        assert!(amplitude(hz) > 0.2, "{hz} Hz: {}", amplitude(hz));
    }
    for hz in [1.0, 3.0, 5.0, 9.0, 12.0] {
        assert!(amplitude(hz) < 0.02, "{hz} Hz: {}", amplitude(hz));
    }
}

#[test]
fn a_multisine_repeats_and_has_a_low_crest_factor() {
    let limits = Limits { lo_v: -1.0, hi_v: 1.0, ..LIMITS };
    let phases = Phases::LowCrest;
    let multisine =
        Multisine { low_hz: 2.0, high_hz: 62.0, lines: 31, periods: 5, phases, duration_s: 10.0, fade_s: 0.5 };
    let u = only(Shape::Multisine(multisine), &limits);
    let (second, third) = (&u[2000..4000], &u[4000..6000]);
    assert!(second.iter().zip(third).all(|(a, b)| (a - b).abs() < 1e-5));
    assert!(multisine.crest_factor(1000.0).unwrap() < 1.5);
    // In a band with room for uneven lines, multiples of one spacing are used.
    let usual = Multisine { low_hz: 1.0, high_hz: 50.0, lines: 40, periods: 1, duration_s: 5.0, ..multisine };
    assert!(usual.crest_factor(1000.0).unwrap() < 1.5);
    let plain = Multisine { phases: Phases::Schroeder, ..multisine };
    assert!(plain.crest_factor(1000.0).unwrap() > 1.55);
}

#[test]
fn a_modulated_sine_has_all_amplitudes_and_a_tone_only_one() {
    let peaks = |u: &[f64]| u.windows(3).filter(|w| w[0] < w[1] && w[1] >= w[2]).map(|w| w[1]).collect::<Vec<f64>>();
    let limits = Limits { lo_v: -1.0, hi_v: 1.0, ..LIMITS };
    let sine = AmSine { frequency_hz: 20.0, modulation_hz: 1.0, depth: 0.75, cycles: 2 };
    let tops = peaks(&only(Shape::AmSine(sine), &limits));
    let (least, most) = extremes(&tops);
    assert_eq!(tops.len(), 40);
    assert!((least - 0.25).abs() < 0.01 && most > 0.98, "{least} {most}");
    let tone = only(Shape::Tone(Tone { frequency_hz: 20.0, amplitude: 0.1, cycles: 10 }), &limits);
    // Three cycles of fade at each end.
    let (least, most) = extremes(&tone[151..649]);
    assert_eq!(tone.len(), 801);
    assert!((least + 0.1).abs() < 1e-3 && (most - 0.1).abs() < 1e-3, "{least} {most}");
}

#[test]
fn minor_loops_are_at_evenly_spaced_levels() {
    let limits = Limits { lo_v: 0.0, hi_v: 10.0, ..LIMITS };
    let loops = MinorLoops { levels: 5, share: 0.2, frequency_hz: 10.0, cycles: 4 };
    let u = only(Shape::MinorLoops(loops), &limits);
    for level in 0..5 {
        let low = 2.0 * level as f64;
        let (least, most) = extremes(&u[level * 500 + 100..=level * 500 + 500]);
        assert!((least - low).abs() < 1e-4 && (most - low - 2.0).abs() < 1e-4, "{level}: {least} {most}");
    }
}

#[test]
fn a_sweep_reaches_its_last_frequency() {
    let u = only(Shape::Sweep(Sweep { low_hz: 1.0, high_hz: 20.0, duration_s: 10.0 }), &LIMITS);
    let crossings: Vec<usize> =
        u.windows(2).enumerate().filter(|(_, w)| (w[0] < 40.0) != (w[1] < 40.0)).map(|(k, _)| k).collect();
    let period = |at: usize| (crossings[at + 2] - crossings[at]) as f64 * 1e-3;
    assert!((period(0) - 0.9).abs() < 0.1, "{}", period(0));
    assert!((period(crossings.len() - 3) - 0.05).abs() < 0.003);
}

#[test]
fn forc_peaks_reach_evenly_spaced_reversals() {
    for peak in [Peak::HalfSine, Peak::Triangle] {
        let u = only(Shape::Forc(Forc { curves: 4, peak_s: 0.2, rest_s: 0.3, peak }), &LIMITS);
        for (curve, top) in [10.0, 40.0, 70.0, 100.0].into_iter().enumerate() {
            assert_eq!(extremes(&u[curve * 500..(curve + 1) * 500]), (-20.0, top));
            assert!(u[curve * 500 + 201..(curve + 1) * 500].iter().all(|u| *u == -20.0));
        }
    }
}
