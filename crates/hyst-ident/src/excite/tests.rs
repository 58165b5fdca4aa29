//! Tests of drives: limits, rest, seeds, errors, files.

use super::*;
use crate::record::{ColumnMap, Need};
use proptest::prelude::*;

const LIMITS: Limits = Limits { rate_hz: 1000.0, lo_v: -20.0, hi_v: 100.0, slew_v_per_s: None };

fn shapes() -> Vec<Shape> {
    let multisine = Multisine {
        low_hz: 1.0,
        high_hz: 40.0,
        lines: 30,
        periods: 1,
        phases: Phases::Schroeder,
        duration_s: 2.0,
        fade_s: 0.3,
    };
    vec![
        Shape::Sine(Sine { frequency_hz: 7.0, cycles: 3 }),
        Shape::DecayingSine(DecayingSine { frequency_hz: 5.0, duration_s: 3.0 }),
        Shape::Triangle(Triangle { frequency_hz: 3.0, cycles: 2 }),
        Shape::Stairs(Stairs { levels: 6, hold_s: 0.3, ramp_s: 0.08, seed: 5 }),
        Shape::Multisine(multisine),
        Shape::Multisine(Multisine { phases: Phases::Random(9), ..multisine }),
        Shape::Multisine(Multisine { phases: Phases::LowCrest, ..multisine }),
        Shape::AmSine(AmSine { frequency_hz: 7.0, modulation_hz: 0.5, depth: 0.8, cycles: 2 }),
        Shape::Tone(Tone { frequency_hz: 9.0, amplitude: 0.8, cycles: 6 }),
        Shape::MinorLoops(MinorLoops { levels: 4, share: 0.3, frequency_hz: 5.0, cycles: 3 }),
        Shape::Raster(Raster { frequency_hz: 4.0, cycles: 3, turning: 0.2 }),
        Shape::Spiral(Spiral { frequency_hz: 5.0, cycles: 8, phase_deg: 90.0 }),
        Shape::Sweep(Sweep { low_hz: 1.0, high_hz: 50.0, duration_s: 2.0 }),
        Shape::Forc(Forc { curves: 5, peak_s: 0.2, rest_s: 0.1, peak: Peak::HalfSine }),
        Shape::Forc(Forc { curves: 5, peak_s: 0.2, rest_s: 0.1, peak: Peak::Triangle }),
    ]
}

fn only(shape: Shape, limits: &Limits) -> Vec<f64> {
    Drive::new(&[shape], limits, 0.0).unwrap().voltage().to_vec()
}

fn extremes(u: &[f64]) -> (f64, f64) {
    u.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), u| (low.min(*u), high.max(*u)))
}

#[test]
fn every_segment_starts_and_ends_at_rest_and_stays_in_the_span() {
    let drive = Drive::new(&shapes(), &LIMITS, 1.0).unwrap();
    assert_eq!(drive.segments().len(), shapes().len());
    for (rows, name) in drive.segments().iter().zip(drive.shapes()) {
        let u = &drive.voltage()[rows.clone()];
        assert_eq!((u[0], u[u.len() - 1]), (LIMITS.lo_v, LIMITS.lo_v), "{name}");
        let (low, high) = extremes(u);
        assert!(low >= LIMITS.lo_v && high <= LIMITS.hi_v, "{name}: {low} … {high}");
        assert!(high > LIMITS.hi_v - 0.25 * LIMITS.span(), "{name} does not use the span: {high}");
    }
}

#[test]
fn smooth_shapes_start_without_a_kink() {
    // A signal that starts with slope zero has a first step of second order in the sample period.
    for shape in shapes() {
        if matches!(shape, Shape::Triangle(_) | Shape::Forc(_)) {
            continue;
        }
        let u = only(shape, &LIMITS);
        let steepest = u.windows(2).fold(0.0_f64, |most, w| most.max((w[1] - w[0]).abs()));
        assert!((u[1] - u[0]).abs() <= 0.05 * steepest, "{}", shape.name());
        assert!((u[u.len() - 1] - u[u.len() - 2]).abs() <= 0.3 * steepest, "{}", shape.name());
    }
}

#[test]
fn time_continues_over_rests_of_the_requested_length() {
    let sine = Shape::Sine(Sine { frequency_hz: 1.0, cycles: 2 });
    let drive = Drive::new(&[sine, sine], &Limits { rate_hz: 750.0, ..LIMITS }, 1.0).unwrap();
    let (first, second) = (drive.segments()[0].clone(), drive.segments()[1].clone());
    assert_eq!(first, 0..1501);
    assert_eq!(drive.time()[1], 1.0 / 750.0);
    // The last row lasts one period, then the rest follows.
    assert_eq!(drive.time()[second.start], 3.001_333);
}

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

#[test]
fn equal_seeds_give_equal_drives() {
    let drive = |seed| Identification::at_rate(1000.0, seed).drive(&LIMITS).unwrap();
    assert_eq!(drive(1), drive(1));
    assert_ne!(drive(1), drive(2));
    // The first numbers of ChaCha8: other versions of the generator must not change existing drives.
    let stairs = Stairs { levels: 4, hold_s: 0.1, ramp_s: 0.05, seed: 1 };
    let u = only(Shape::Stairs(stairs), &LIMITS);
    assert_eq!([u[100], u[250], u[400], u[550]], [-7.9254, 57.8968, 76.5797, 12.4115]);
}

#[test]
fn a_test_drive_differs_in_every_segment() {
    for (rate_hz, slew_v_per_s) in
        [(20.0, None), (1000.0, None), (20_000.0, None), (1000.0, Some(3000.0)), (1000.0, Some(400.0))]
    {
        let limits = Limits { rate_hz, slew_v_per_s, ..LIMITS };
        let long = Identification { duration_s: 80.0, ..Identification::at_rate(rate_hz, 1) };
        let long = long.within_slew(&limits, &|_| true);
        let test = long.for_test_within_slew(&limits, &|_| true);
        let [train, test] = [long, test].map(|spec| spec.drive(&limits).unwrap());
        assert_eq!(train.shapes(), test.shapes());
        for (a, b) in train.segments().iter().zip(test.segments()) {
            let (a, b) = (&train.voltage()[a.clone()], &test.voltage()[b.clone()]);
            let squares: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
            let rms = (squares / a.len().min(b.len()) as f64).sqrt();
            assert!(rms > 0.1 * (LIMITS.hi_v - LIMITS.lo_v), "{rms} V at {rate_hz} Hz");
        }
    }
    // A specification that is valid for training is valid for the test.
    for (slow_hz, fast_hz, band_hz) in [(4.0, 40.0, 5.0), (1.0, 1.01, 50.0)] {
        let narrow = Identification { slow_hz, fast_hz, band_hz, ..Identification::at_rate(1000.0, 1) };
        narrow.drive(&LIMITS).unwrap();
        narrow.for_test().drive(&LIMITS).unwrap();
    }
    let wrong = Identification { slow_hz: -1.0, ..Identification::at_rate(1000.0, 1) };
    assert!(wrong.for_test().drive(&LIMITS).unwrap_err().to_string().contains("slow_hz = -1"));
}

#[test]
fn the_steepest_slope_is_that_of_the_drive() {
    let sine = Drive::new(&[Shape::Sine(Sine { frequency_hz: 2.0, cycles: 3 })], &LIMITS, 0.0).unwrap();
    let (low, high) = (LIMITS.lo_v, LIMITS.hi_v);
    let exact = std::f64::consts::PI * 2.0 * (high - low);
    assert!((sine.steepest() / exact - 1.0).abs() < 1e-3, "{} {exact}", sine.steepest());
    let limits = Limits { slew_v_per_s: Some(sine.steepest()), ..LIMITS };
    Drive::new(&[Shape::Sine(Sine { frequency_hz: 2.0, cycles: 3 })], &limits, 0.0).unwrap();
}

#[test]
fn the_identification_has_its_duration_and_all_segments() {
    for rate_hz in [100.0, 750.0, 1000.0, 20_000.0] {
        let limits = Limits { rate_hz, ..LIMITS };
        let drive = Identification::at_rate(rate_hz, 4).drive(&limits).unwrap();
        let end = drive.time()[drive.time().len() - 1];
        assert!((30.0..40.0).contains(&end), "{end} s at {rate_hz} Hz");
        assert_eq!(drive.shapes(), ["decaying-sine", "sine", "sine", "triangle", "stairs", "multisine"]);
    }
}

#[test]
fn a_written_drive_is_read_without_change() {
    for (rate_hz, hi_v) in [(750.0, 150.0), (1000.0, 1.0 / 3.0), (8192.0, 30.0)] {
        let limits = Limits { rate_hz, lo_v: 0.1, hi_v, slew_v_per_s: None };
        let drive = Identification::at_rate(rate_hz, 4).drive(&limits).unwrap();
        let mut text = Vec::new();
        drive.write_csv(&mut text).unwrap();
        let record = Record::parse("drive.csv", &text, &ColumnMap::default(), Need::Input).unwrap();
        assert_eq!(record.segments(), drive.segments());
        assert_eq!(record.input(), drive.voltage());
        assert_eq!(record.sample_period(), 1.0 / rate_hz);
        assert!(record.time().iter().zip(drive.time()).all(|(a, b)| (a - b).abs() < 1e-9));
        let text = String::from_utf8(text).unwrap();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("segment,time_s,voltage_v"));
        let decimals = if hi_v > 100.0 {
            4
        } else if hi_v > 10.0 {
            5
        } else {
            6
        };
        assert!(lines.all(|line| line.rsplit('.').next().unwrap().len() == decimals));
    }
}

#[test]
fn a_drive_above_the_slew_limit_is_an_error() {
    let slow = Limits { slew_v_per_s: Some(1000.0), ..LIMITS };
    let sine = |frequency_hz| Drive::new(&[Shape::Sine(Sine { frequency_hz, cycles: 1 })], &slow, 0.0);
    // π · 120 V · f
    assert!(sine(2.6).is_ok());
    let message = sine(2.7).unwrap_err().to_string();
    for part in ["sine", "slew_v_per_s = 1000", "frequency_hz"] {
        assert!(message.contains(part), "{message}");
    }
    let message = Identification::at_rate(1000.0, 0).drive(&slow).unwrap_err().to_string();
    assert!(message.contains("fast_hz") && message.contains("slow_hz"), "{message}");
}

#[test]
fn an_identification_is_slowed_down_in_free_fields_only() {
    let usual = Identification { duration_s: 90.0, ..Identification::at_rate(1000.0, 3) };
    assert_eq!(usual.within_slew(&LIMITS, &|_| true), usual);
    for (v_per_s, test) in [(8000.0, false), (1000.0, true), (400.0, false)] {
        let limits = Limits { slew_v_per_s: Some(v_per_s), ..LIMITS };
        let spec = if test { usual.for_test() } else { usual };
        assert!(spec.drive(&limits).is_err());
        let slower = spec.within_slew(&limits, &|_| true);
        let drive = slower.drive(&limits).unwrap();
        assert!(drive.steepest() > 0.9 * v_per_s, "{v_per_s}: {}", drive.steepest());
        // A segment below the limit is not changed.
        assert_eq!(slower.slow_hz == spec.slow_hz, v_per_s > 5000.0, "{v_per_s}: {slower:?}");
        // A fixed field is not changed and causes an error.
        let fixed = spec.within_slew(&limits, &|field| field != "band_hz");
        assert_eq!(fixed.band_hz, spec.band_hz);
        assert!(fixed.drive(&limits).unwrap_err().to_string().contains("band_hz"));
    }
}

#[test]
fn fields_out_of_range_are_named() {
    let shape = |shape: Shape| Drive::new(&[shape], &LIMITS, 1.0).unwrap_err().to_string();
    let limits = |limits: Limits| Drive::new(&shapes(), &limits, 1.0).unwrap_err().to_string();
    let spec = |spec: Identification| spec.drive(&LIMITS).unwrap_err().to_string();
    let usual = Identification::at_rate(1000.0, 0);
    let stairs = Stairs { levels: 6, hold_s: 0.3, ramp_s: 0.08, seed: 5 };
    let multisine = Multisine {
        low_hz: 1.0,
        high_hz: 9.0,
        lines: 9,
        periods: 1,
        phases: Phases::Schroeder,
        duration_s: 2.0,
        fade_s: 0.3,
    };
    for (message, field) in [
        (limits(Limits { rate_hz: 0.0, ..LIMITS }), "rate_hz = 0"),
        (limits(Limits { lo_v: f64::NAN, ..LIMITS }), "lo_v = NaN"),
        (limits(Limits { hi_v: -20.0, ..LIMITS }), "hi_v = -20"),
        (limits(Limits { lo_v: 0.0, hi_v: 1e-6, ..LIMITS }), "hi_v = 0.000001"),
        (limits(Limits { slew_v_per_s: Some(-1.0), ..LIMITS }), "slew_v_per_s = -1"),
        (Drive::new(&shapes(), &LIMITS, -1.0).unwrap_err().to_string(), "rest_s = -1"),
        (Drive::new(&[], &LIMITS, 1.0).unwrap_err().to_string(), "segment"),
        (shape(Shape::Sine(Sine { frequency_hz: 300.0, cycles: 1 })), "frequency_hz = 300"),
        (shape(Shape::Sine(Sine { frequency_hz: 1.0, cycles: 0 })), "cycles = 0"),
        (
            shape(Shape::Sine(Sine { frequency_hz: 1e-9, cycles: 9 })),
            "cycles = 9: it has to be such that the segment has 2 to 5e7 rows",
        ),
        (shape(Shape::DecayingSine(DecayingSine { frequency_hz: 1.0, duration_s: 2.0 })), "duration_s = 2"),
        (shape(Shape::Triangle(Triangle { frequency_hz: f64::NAN, cycles: 1 })), "frequency_hz = NaN"),
        (shape(Shape::Stairs(Stairs { levels: 0, ..stairs })), "levels = 0"),
        (shape(Shape::Stairs(Stairs { levels: u32::MAX, ..stairs })), "levels = 4294967295"),
        (shape(Shape::Stairs(Stairs { hold_s: f64::INFINITY, ..stairs })), "hold_s = inf"),
        (shape(Shape::Stairs(Stairs { ramp_s: 0.0, ..stairs })), "ramp_s = 0"),
        (shape(Shape::Multisine(Multisine { high_hz: 0.5, ..multisine })), "high_hz = 0.5"),
        (shape(Shape::Multisine(Multisine { lines: 18, ..multisine })), "lines = 18"),
        (shape(Shape::Multisine(Multisine { fade_s: 1.1, ..multisine })), "fade_s = 1.1"),
        (shape(Shape::Multisine(Multisine { duration_s: 1e12, lines: 1, ..multisine })), "duration_s = 1000000000000"),
        (shape(Shape::Sweep(Sweep { low_hz: 5.0, high_hz: 5.0, duration_s: 1.0 })), "high_hz = 5"),
        (shape(Shape::Forc(Forc { curves: 5, peak_s: 0.001, rest_s: 0.1, peak: Peak::HalfSine })), "peak_s = 0.001"),
        (shape(Shape::Multisine(Multisine { periods: 0, ..multisine })), "periods = 0"),
        (
            shape(Shape::AmSine(AmSine { frequency_hz: 5.0, modulation_hz: 2.0, depth: 0.5, cycles: 1 })),
            "modulation_hz = 2",
        ),
        (shape(Shape::AmSine(AmSine { frequency_hz: 5.0, modulation_hz: 1.0, depth: 1.5, cycles: 1 })), "depth = 1.5"),
        (shape(Shape::Tone(Tone { frequency_hz: 5.0, amplitude: 0.0, cycles: 1 })), "amplitude = 0"),
        (shape(Shape::MinorLoops(MinorLoops { levels: 2, share: -1.0, frequency_hz: 1.0, cycles: 1 })), "share = -1"),
        (spec(Identification { duration_s: 9.0, ..usual }), "duration_s = 9"),
        (spec(Identification { fast_hz: 0.5, ..usual }), "fast_hz = 0.5"),
        (spec(Identification { band_hz: 400.0, ..usual }), "band_hz = 400"),
        (spec(Identification { slow_hz: 0.0, ..usual }), "slow_hz = 0"),
        (spec(Identification { ramp_s: 1e-9, ..usual }), "ramp_s = 0.000000001"),
    ] {
        assert!(message.contains(field), "\"{field}\" is missing in: {message}");
    }
}

proptest! {
    #[test]
    fn drives_stay_within_any_limits(
        rate_hz in 200.0..5e3,
        lo_v in -1e3..1e3,
        span in 1e-3..1e3,
        slew in 1.0..1e6,
    ) {
        let limits = Limits { rate_hz, lo_v, hi_v: lo_v + span, slew_v_per_s: Some(slew) };
        for shape in shapes() {
            match Drive::new(&[shape], &limits, 0.0) {
                Ok(drive) => {
                    let u = drive.voltage();
                    prop_assert!(u.iter().all(|u| (limits.lo_v..=limits.hi_v).contains(u)));
                    prop_assert!(u.windows(2).all(|w| (w[1] - w[0]).abs() * rate_hz <= slew * (1.0 + 1e-6)));
                    prop_assert!((u[0] - lo_v).abs() <= 1e-4 && u[0] == u[u.len() - 1]);
                }
                Err(error) => prop_assert!(matches!(error, ExciteError::Slew { .. }), "{error}"),
            }
        }
    }
}
