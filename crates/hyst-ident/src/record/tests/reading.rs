//! Records of texts and of columns in memory.

use super::*;

#[test]
fn a_full_record_is_read() {
    let record = read(TRAIN, Need::InputAndOutput).unwrap();
    assert_eq!(record.rows(), 5);
    assert_eq!(record.segments(), [0..3, 3..5]);
    assert_eq!(record.labels(), [0, 7]);
    assert_eq!(record.file_of_segment(), [0, 0]);
    assert_eq!(record.rows_of_files().first(), Some(&(0..5)));
    assert_eq!(record.sample_period(), 0.001);
    assert_eq!(record.time(), [0.0, 0.001, 0.002, 1.5, 1.501]);
    assert_eq!((record.input_column(), record.input()), ("voltage_v", &[0.0, 1.5, 3.0, 0.0, 10.0][..]));
    assert_eq!(record.output_unit(), Some(OutputUnit::Micrometre));
    assert_eq!(record.output().unwrap(), [0.001, 0.25, 0.5, -0.002, 0.25]);
    assert_eq!(record.temperature().unwrap(), [25.0, 25.1, 25.1, 25.2, 25.2]);
    assert_eq!(record.load().unwrap(), [1.5, 1.5, 1.5, 1.0, 1.0]);
    assert_eq!(record.name(), "run.csv");
}

#[test]
fn sha256_is_that_of_the_files_bytes() {
    let bytes = b"time_s,voltage_v\n0,0\n1,1\n";
    let record = Record::parse("run.csv", bytes, &ColumnMap::default(), Need::Input).unwrap();
    assert_eq!(
        record.sources()[0].sha256.as_deref(),
        // From `sha256sum`.
        Some("da13669eb0b2121099e2d3345cd7eddb46d314afd0f27f762675d8d698d5faad")
    );
}

#[test]
fn time_may_be_in_three_units() {
    for (text, period) in [
        ("time_ms,voltage_v\n1.5,0\n3.0,1\n4.5,1\n", 0.0015),
        ("time_us,voltage_v\n0,0\n20,1\n40,1\n", 2e-5),
        ("time_s,voltage_v\n0.25,0\n0.5,1\n", 0.25),
    ] {
        assert_eq!(read(text, Need::Input).unwrap().sample_period(), period, "{text}");
    }
    let record = read("time_ms,voltage_v\n1.5,0\n3.0,1\n4.5,1\n", Need::Input).unwrap();
    assert_eq!(record.time(), [0.0015, 0.003, 0.0015 + 2.0 * 0.0015]);
}

#[test]
fn rounding_jitter_of_times_is_removed() {
    let mut text = String::from("time_s,force_in_n,displacement_mm\n");
    for k in 0..3000 {
        text += &format!("{:.6},{k},0\n", f64::from(k) / 750.0);
    }
    let record = read(&text, Need::InputAndOutput).unwrap();
    assert_eq!(record.sample_period(), 1.0 / 750.0);
    assert_eq!(record.time()[1], 1.0 / 750.0);
    assert_eq!(record.time()[2999], 2999.0 * (1.0 / 750.0));
    assert_eq!(record.input_column(), "force_in_n");
    assert_eq!(record.output_unit(), Some(OutputUnit::Millimetre));
}

#[test]
fn byte_order_mark_line_ends_quotes_and_blanks_are_accepted() {
    for text in [
        "\u{feff}time_s,voltage_v\n0,0\n1,2.5\n",
        "time_s,voltage_v\r\n0,0\r\n1,2.5\r\n",
        "time_s,voltage_v\r0,0\r1,2.5",
        "\n\ntime_s,voltage_v\n0,0\n\n1,2.5\n\n",
        "\"time_s\",\"voltage_v\"\n\"0\",\"0\"\n1,\"2.5\"\n",
        "time_s, voltage_v\n 0, 0\n 1 , 2.5 \n",
    ] {
        let record = read(text, Need::Input).unwrap_or_else(|error| panic!("{text:?}: {error}"));
        assert_eq!(record.input(), [0.0, 2.5], "{text:?}");
    }
}

#[test]
fn a_lost_row_is_interpolated_and_not_fitted() {
    let rows = |times: &[f64]| {
        times
            .iter()
            .fold(String::from("time_s,voltage_v,displacement_um\n"), |text, t| text + &format!("{t:.6},{t},{t}\n"))
    };
    let times: Vec<f64> = (0..60).filter(|k| *k != 12).map(|k| f64::from(k) * 1e-3).collect();
    let record = read(&rows(&times), Need::InputAndOutput).unwrap();
    assert_eq!((record.rows(), record.segments().len(), record.missing()[12]), (60, 1, true));
    assert!((record.input()[12] - 0.012).abs() < 1e-12);
    // Time must increase across segments.
    refused(
        "segment,time_s,voltage_v\n0,0.0,0\n0,0.1,0\n1,0.0,0\n1,0.1,0\n",
        Need::Input,
        &["line 4", "\"time_s\"", "0.0 s follows 0.1 s", "across segments"],
    );
}

#[test]
fn a_single_row_has_no_sample_period() {
    refused("time_s,voltage_v\n0,0\n", Need::Input, &["line 2", "\"time_s\"", "two rows"]);
}

#[test]
fn columns_in_memory_are_checked() {
    let samples = || Columns {
        name: "demo".into(),
        time: vec![0.0, 0.1, 0.2],
        input: Some(vec![0.0; 3]),
        output: Some((OutputUnit::Micrometre, vec![0.0; 3])),
        ..Columns::default()
    };
    let sound = Record::from_samples(samples()).unwrap();
    assert_eq!((sound.input_column(), sound.sample_period()), ("voltage_v", 0.1));
    assert_eq!(sound.sources()[0].sha256, None);
    let refused = |samples: Columns, parts: &[&str]| {
        let message = Record::from_samples(samples).unwrap_err().to_string();
        assert!(message.starts_with("demo") && parts.iter().all(|part| message.contains(part)), "{message}");
    };
    refused(Columns { load: Some(vec![0.0]), ..samples() }, &["\"load_n\"", "1 values", "has 3"]);
    refused(Columns { segment: Some(vec![0]), ..samples() }, &["\"segment\"", "1 values"]);
    refused(Columns { input: Some(vec![0.0, f64::NAN, 0.0]), ..samples() }, &["row 1", "\"voltage_v\"", "NaN"]);
    refused(Columns { time: vec![0.0, 0.1, 0.3], ..samples() }, &["row 2", "uneven"]);
    refused(Columns { time: vec![0.0, 0.1, 0.1], ..samples() }, &["row 2", "increase"]);
    refused(Columns { segment: Some(vec![0, 1, 0]), ..samples() }, &["row 2", "returns"]);
    refused(Columns { name: "demo".into(), ..Columns::default() }, &["no rows"]);
}

#[test]
fn a_missing_column_is_named_with_the_reason() {
    let record = read("time_s,voltage_v\n0,0\n1,1\n", Need::Input).unwrap();
    let message = record.need_temperature("the model has a temperature stage").unwrap_err().to_string();
    assert!(message.contains("run.csv") && message.contains("\"temperature_degc\""), "{message}");
    assert!(message.contains("the model has a temperature stage"), "{message}");
    assert!(record.need_load("").is_err() && record.need_output(OutputUnit::Newton, "").is_err());
    let full = read(TRAIN, Need::InputAndOutput).unwrap();
    assert!(full.need_temperature("").is_ok() && full.need_load("").is_ok());
    assert!(full.need_output(OutputUnit::Micrometre, "").is_ok() && full.need_output(OutputUnit::Newton, "").is_err());
}
