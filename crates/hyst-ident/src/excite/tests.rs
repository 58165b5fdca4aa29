//! Tests of drives: limits, rest, seeds, errors, files.

use super::*;
use crate::record::{ColumnMap, Need, Record};
use proptest::prelude::*;

mod shapes;

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
