//! Repairs of texts, with their notes.

use crate::record::{ColumnMap, Need, Record};

fn read(text: &str) -> Record {
    Record::parse("run.csv", text.as_bytes(), &ColumnMap::default(), Need::InputAndOutput)
        .unwrap_or_else(|e| panic!("{e}"))
}

fn table(times: &[f64]) -> String {
    times.iter().fold("time_s,voltage_v,displacement_um\n".to_owned(), |text, t| {
        text + &format!("{t:.6},{:.9},{:.9}\n", (6.0 * t).sin(), 1.0 + (6.0 * t).cos())
    })
}

#[test]
fn jitter_is_resampled() {
    let jitter = |k: usize| 1e-3 * k as f64 + 2e-6 * (k as f64 * 1.7).sin();
    let record = read(&table(&(0..500).map(jitter).collect::<Vec<_>>()));
    assert_eq!((record.sample_period(), record.segments().len()), (1e-3, 1));
    assert!(record.notes()[0].contains("jitter by 0.15 %"), "{:?}", record.notes());
    let worst = record.time().iter().zip(record.input()).map(|(t, u)| ((6.0 * t).sin() - u).abs()).fold(0.0, f64::max);
    // The times are printed with a resolution of 1 µs.
    assert!(worst < 1e-5, "{worst}");
}

#[test]
fn an_interruption_begins_a_segment() {
    let times: Vec<f64> = (0..100).map(|k| 1e-3 * f64::from(k) + if k >= 40 { 2.0 } else { 0.0 }).collect();
    let record = read(&table(&times));
    assert_eq!((record.segments(), record.labels()), (&[0..40, 40..100][..], &[0, 1][..]));
    assert!(record.notes()[0].contains("an interruption of 2.001 s before row"), "{:?}", record.notes());
}

#[test]
fn a_clock_that_restarts_begins_a_segment() {
    let run = |rows: i32| (0..rows).map(|k| 1e-3 * f64::from(k));
    let record = read(&table(&run(40).chain(run(60)).collect::<Vec<_>>()));
    assert_eq!((record.segments(), record.labels()), (&[0..40, 40..100][..], &[0, 1][..]));
    assert!(record.notes()[0].contains("restarts in row 41"), "{:?}", record.notes());
    assert!((record.time()[99] - 0.099).abs() < 1e-9);
}

#[test]
fn times_continue_after_a_counter_overflow() {
    let times: Vec<f64> = (0..100).map(|k| (4294.9 + 1e-3 * f64::from(k)) % 4294.967296).collect();
    let record = read(&table(&times));
    assert_eq!((record.rows(), record.segments().len(), record.sample_period()), (100, 1, 1e-3));
    assert!(record.notes()[0].contains("after 4294.967296 s"), "{:?}", record.notes());
}

#[test]
fn many_lost_rows_of_a_clear_grid_are_inserted() {
    let times: Vec<f64> = (0..300).filter(|k| k % 7 != 3).map(|k| 1e-3 * f64::from(k)).collect();
    let record = read(&table(&times));
    assert_eq!((record.rows(), record.segments().len()), (300, 1));
    assert!(record.notes()[0].contains("43 rows missing in the time grid"), "{:?}", record.notes());
}

#[test]
fn repeated_rows_are_joined() {
    let mut times: Vec<f64> = (0..100).map(|k| 1e-3 * f64::from(k)).collect();
    times.insert(41, 0.040);
    let record = read(&table(&times));
    assert_eq!((record.rows(), record.sample_period()), (100, 1e-3));
    assert!(
        record.notes()[0].contains("1 row with the time of the row before (with the same values; the first is row 42)"),
        "{:?}",
        record.notes()
    );
}

#[test]
fn missing_values_are_omitted_and_counted() {
    let mut rows: Vec<String> =
        table(&(0..100).map(|k| 1e-3 * f64::from(k)).collect::<Vec<_>>()).lines().map(str::to_owned).collect();
    rows[11] = "0.010,0.06,NaN".into();
    rows[21] = "0.020,,1.9".into();
    for row in &mut rows[31..51] {
        *row = format!("{},,1.9", row.split(',').next().unwrap());
    }
    let record = read(&rows.join("\n"));
    assert_eq!((record.rows(), record.segments().len()), (80, 2));
    assert_eq!(record.missing().iter().filter(|missing| **missing).count(), 1);
    assert!((record.input()[20] - (0.12_f64).sin()).abs() < 1e-4);
    let notes = record.notes().join("; ");
    for part in [
        "1 row without displacement_um is not fitted",
        "1 row without voltage_v: interpolated",
        "20 rows without voltage_v are left out",
    ] {
        assert!(notes.contains(part), "{notes}");
    }
}
