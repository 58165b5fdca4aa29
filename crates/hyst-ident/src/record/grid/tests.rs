//! Periods of rounded, accumulated, uneven and incomplete times.

use super::*;

fn printed(texts: &[String]) -> (Vec<f64>, Printed) {
    let mut figures = Printed::default();
    texts.iter().for_each(|text| figures.take(text.as_bytes()));
    (texts.iter().map(|text| text.parse().unwrap()).collect(), figures)
}

fn one(rows: usize) -> Vec<Range<usize>> {
    std::iter::once(0..rows).collect()
}

fn period_of(texts: &[String]) -> Result<Period, Fault> {
    let (time, figures) = printed(texts);
    fit(&time, &one(time.len()), figures).map(|periods| periods[0])
}

fn fixed(rate: f64, rows: usize, decimals: usize) -> Vec<String> {
    (0..rows).map(|k| format!("{:.decimals$}", k as f64 / rate)).collect()
}

#[test]
fn decimals_and_digits_of_printed_numbers_are_counted() {
    let of = |text: &str| {
        let mut p = Printed::default();
        p.take(text.as_bytes());
        (p.decimals, p.digits)
    };
    assert_eq!(of("10.9200"), (4, 6));
    assert_eq!(of("0.001333"), (6, 4));
    assert_eq!(of("-1.25e-3"), (5, 3));
    assert_eq!(of("4.000e+01"), (2, 4));
    assert_eq!(of("12"), (0, 2));
    assert_eq!(of("1e999999999999"), (0, 1));
}

#[test]
fn whole_rates_are_found_from_rounded_times() {
    for (rate, decimals) in
        [(750.0, 6), (750.0, 4), (750.0, 3), (1000.0, 3), (200.0, 6), (44_100.0, 7), (51_200.0, 6), (30.0, 2), (3.0, 1)]
    {
        let period = period_of(&fixed(rate, 2000, decimals)).unwrap();
        assert_eq!(period.value, 1.0 / rate, "{rate} Hz with {decimals} decimals");
    }
}

#[test]
fn a_period_that_is_printed_exactly_is_not_changed() {
    for (h, decimals) in [(0.0012, 4), (0.0012, 17), (0.0015, 4), (2.5, 1), (60.0, 0)] {
        let texts: Vec<_> = (0..3).map(|k| format!("{:.decimals$}", k as f64 * h)).collect();
        assert_eq!(period_of(&texts).unwrap().value, h, "{h} with {decimals} decimals");
    }
}

#[test]
fn times_with_a_fixed_number_of_digits_are_even() {
    // "%g" and "%.5e" print such times: the resolution decreases with time.
    let g = |k: usize| {
        let t = k as f64 / 750.0;
        let decimals = if k == 0 { 0 } else { (5 - t.log10().floor() as i32) as usize };
        format!("{t:.decimals$}")
    };
    assert_eq!(period_of(&(0..9000).map(g).collect::<Vec<_>>()).unwrap().value, 1.0 / 750.0);
    let e: Vec<_> = (0..9000).map(|k| format!("{:.5e}", k as f64 / 750.0)).collect();
    assert_eq!(period_of(&e).unwrap().value, 1.0 / 750.0);
}

#[test]
fn accumulated_times_are_even() {
    let mut t = 0.0;
    let texts: Vec<_> = (0..100_000)
        .map(|_| {
            t += 0.001;
            format!("{t:?}")
        })
        .collect();
    assert_eq!(period_of(&texts).unwrap().value, 0.001);
}

#[test]
fn a_missing_row_is_found_at_its_place() {
    let mut texts = fixed(1000.0, 100, 6);
    texts.remove(12);
    let fault = period_of(&texts).unwrap_err();
    let Fault::Uneven { row, expected } = fault else { panic!("{fault:?}") };
    assert_eq!(row, 12);
    assert!((expected - 0.012).abs() < 1e-12);
}

#[test]
fn a_missing_row_is_found_if_the_period_is_one_printed_unit() {
    for (rate, decimals, missing) in [(1000.0, 3, 400), (1000.0, 3, 1), (1000.0, 3, 998), (500.0, 3, 400)] {
        let mut texts = fixed(rate, 1000, decimals);
        assert_eq!(period_of(&texts).unwrap().value, 1.0 / rate);
        texts.remove(missing);
        let fault = period_of(&texts).unwrap_err();
        assert!(matches!(fault, Fault::Uneven { row, .. } if row == missing), "{missing} at {rate} Hz: {fault:?}");
    }
    let few: Vec<_> = ["0.0", "0.1", "0.3"].map(str::to_owned).into();
    assert_eq!(period_of(&few), Err(Fault::Uneven { row: 2, expected: 0.2 }));
}

#[test]
fn a_deviation_of_two_units_is_uneven_and_of_one_is_not() {
    let mut texts = fixed(1000.0, 100, 6);
    texts[50] = "0.050001".to_owned();
    assert_eq!(period_of(&texts).unwrap().value, 0.001);
    texts[50] = "0.050002".to_owned();
    assert!(matches!(period_of(&texts), Err(Fault::Uneven { row: 50, .. })));
}

#[test]
fn a_drifting_rate_is_uneven() {
    let texts: Vec<_> = (0..1000).map(|k| format!("{:.6}", k as f64 * 1e-3 + (k * k) as f64 * 1e-9)).collect();
    assert!(matches!(period_of(&texts), Err(Fault::Uneven { .. })));
}

#[test]
fn segments_of_two_rates_keep_their_own_periods() {
    let (mut time, figures) = printed(&fixed(1000.0, 100, 6));
    time.extend((0..100).map(|k| 1.0 + f64::from(k) * 2e-3));
    time.extend((0..50).map(|k| 2.0 + f64::from(k) * 1e-3));
    time.push(3.0);
    let periods = fit(&time, &[0..100, 100..200, 200..250, 250..251], figures).unwrap();
    assert_eq!(periods.iter().map(|p| p.value).collect::<Vec<_>>(), [1e-3, 2e-3, 1e-3, 1e-3]);
    time[150] += 5e-4;
    let fault = fit(&time, &[0..100, 100..200, 200..250, 250..251], figures);
    assert!(matches!(fault, Err(Fault::Uneven { row: 150, .. })), "{fault:?}");
}

#[test]
fn extreme_times_do_not_panic() {
    for time in [[-1.7e308, 0.0, 1.7e308], [0.0, 5e-324, 1e-323], [1e15, 2e15, 3e15]] {
        let _ = fit(&time, &one(3), Printed::EXACT);
        let _ = fit(&time, &one(3), Printed::default());
    }
    assert_eq!(fit(&[1.0], &one(1), Printed::EXACT), Err(Fault::TooShort));
}
