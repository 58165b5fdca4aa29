//! Damaged files are refused with their place; no input makes the reader panic.

use proptest::prelude::*;

use super::*;

#[test]
fn damaged_headers_are_refused() {
    refused("", Need::Input, &["line 1", "empty"]);
    refused("\u{feff}\n\n", Need::Input, &["empty"]);
    refused("time_s,voltage_v\n", Need::Input, &["no rows", "line 2"]);
    refused(
        "time_s,voltage_v,voltage_v\n0,0,0\n",
        Need::Input,
        &["line 1", "\"voltage_v\"", "both could be the input"],
    );
    refused("0,1\n1,2\n", Need::Input, &["the time", "--map time_s=1", "--map voltage_v=2", "\"1\", \"2\""]);
}

#[test]
fn damaged_rows_are_refused_with_their_line() {
    let with = |row: &str| format!("segment,time_s,voltage_v\r\n0,0.0,1\r\n\r\n{row}\r\n0,0.2,1\r\n");
    refused(&with("0,0.1"), Need::Input, &["line 4", "2 fields", "3 columns", "\"voltage_v\""]);
    refused(&with("0,0.1,1,1"), Need::Input, &["line 4", "4 fields"]);
    refused(&with("0,0.1,\"1"), Need::Input, &["line 4", "\"voltage_v\"", "quotation mark"]);
    refused(&with("0,\"0.1,1"), Need::Input, &["line 4", "quotation mark"]);
    refused(&with("0,0.1,1 V"), Need::Input, &["line 4", "\"voltage_v\"", "\"1 V\"", "1.25"]);
    refused(&with("0.5,0.1,1"), Need::Input, &["line 4", "\"segment\"", "0.5", "integer"]);
    refused(&with("1,0.1,1"), Need::Input, &["line 5", "\"segment\"", "segment 0 returns after segment 1"]);
    refused(&with("0,-0.1,1"), Need::Input, &["line 4", "\"time_s\"", "-0.1 s follows 0.0 s", "another run"]);
}

#[test]
fn bytes_of_unknown_format_are_refused() {
    let refused = |bytes: &[u8], parts: &[&str]| {
        let error = Record::parse("run.csv", bytes, &ColumnMap::default(), Need::Input).unwrap_err().to_string();
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    };
    refused(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", &["run.csv", "not recognised", "to_csv"]);
    refused(b"\x1f\x8b\x08\0truncated", &["run.csv", "gzip", "cannot be unpacked"]);
}

#[test]
fn a_missing_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("absent.csv");
    let message = Record::read(&path, &ColumnMap::default(), Need::Input).unwrap_err().to_string();
    assert!(message.starts_with(&path.display().to_string()), "{message}");
}

proptest! {
    #[test]
    fn no_bytes_make_the_parser_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        for need in [Need::InputAndOutput, Need::Input, Need::Output] {
            let _ = Record::parse("fuzz", &bytes, &ColumnMap::default(), need);
        }
    }

    #[test]
    fn no_text_like_a_record_makes_the_parser_panic(
        header in "(segment,|)time_(s|ms|us),(voltage_v|force_in_n)(,displacement_um|,force_n|,\"x|)(\r\n|\n|\r)",
        rows in "([0-9\"eE.,+\\- \r\nnaif]{0,24}[\n,]){0,12}",
    ) {
        for need in [Need::InputAndOutput, Need::Input, Need::Output] {
            let text = format!("{header}{rows}");
            if let Err(error) = Record::parse("fuzz", text.as_bytes(), &ColumnMap::default(), need) {
                prop_assert!(error.to_string().starts_with("fuzz"));
            }
        }
    }

    #[test]
    fn numbers_at_any_place_make_a_record_or_an_error(
        rows in prop::collection::vec((0_i64..3, any::<f64>(), any::<f64>()), 0..8),
    ) {
        let text = rows.iter().fold(String::from("segment,time_s,voltage_v\n"), |text, (s, t, v)| {
            text + &format!("{s},{t:?},{v:?}\n")
        });
        if let Ok(record) = read(&text, Need::Input) {
            prop_assert!(record.sample_period() > 0.0);
            let mut text = Vec::new();
            record.write_csv(&mut text).unwrap();
        }
    }

    #[test]
    fn samples_survive_writing_and_reading(
        rate in prop::sample::select(vec![1.0, 3.0, 200.0, 750.0, 1000.0, 5000.0, 44_100.0, 100_000.0]),
        starts in prop::collection::vec((1_u32..5000, 2_usize..40), 1..4),
        values in prop::collection::vec(-1e6..1e6, 160),
    ) {
        let (mut segment, mut time) = (Vec::new(), Vec::new());
        let mut clock = 0.0;
        for (label, (rest, rows)) in (0..).zip(starts) {
            let start = ((clock + f64::from(rest)) * 1e3_f64).round() / 1e3;
            segment.extend(std::iter::repeat_n(label, rows));
            time.extend((0..rows).map(|k| start + k as f64 / rate));
            clock = start + rows as f64 / rate;
        }
        let rows = time.len();
        let record = Record::from_samples(Columns {
            name: "memory".into(),
            segment: Some(segment),
            time,
            input: Some(values[..rows].to_vec()),
            output: Some((OutputUnit::Nanometre, values[160 - rows..].to_vec())),
            ..Columns::default()
        }).unwrap();
        prop_assert_eq!(record.sample_period(), 1.0 / rate);
        assert_same(&record, &rewritten(&record));
    }
}
