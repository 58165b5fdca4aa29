//! Tests of reading, joining and writing, through the public interface.

use super::*;
use proptest::prelude::*;

fn read(text: &str, need: Need) -> Result<Record, RecordError> {
    Record::parse("run.csv", text.as_bytes(), &ColumnMap::default(), need)
}

fn read_mapped(text: &str, map: &[&str], need: Need) -> Result<Record, RecordError> {
    Record::parse("run.csv", text.as_bytes(), &ColumnMap::parse(map).unwrap(), need)
}

/// Asserts that `text` is refused with a message that contains all of `parts`.
#[track_caller]
fn refused(text: &str, need: Need, parts: &[&str]) {
    refused_mapped(text, &[], need, parts);
}

#[track_caller]
fn refused_mapped(text: &str, map: &[&str], need: Need, parts: &[&str]) {
    let message = read_mapped(text, map, need).expect_err("a sound record").to_string();
    for part in ["run.csv"].iter().chain(parts) {
        assert!(message.contains(part), "\"{part}\" is missing in: {message}");
    }
    assert!(!message.contains('\n'), "more than one line: {message}");
}

const TRAIN: &str = "segment,time_s,voltage_v,displacement_um,temperature_degc,load_n\n\
    0,0.000,0.0,0.001,25.0,1.5\n\
    0,0.001,1.5,0.250,25.1,1.5\n\
    0,0.002,3.0,0.500,25.1,1.5\n\
    7,1.500,0.0,-0.002,25.2,1.0\n\
    7,1.501,1e1,2.5e-1,25.2,1.0\n";

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
fn the_required_columns_depend_on_the_need() {
    let drive = "time_s,voltage_v\n0,0\n1,1\n";
    assert_eq!(read(drive, Need::Input).unwrap().output(), None);
    refused(
        drive,
        Need::InputAndOutput,
        &["line 1", "the output", "displacement_um|displacement_nm", "also needs: output"],
    );
    let reference = "time_s,force_n\n0,0\n1,1\n";
    let record = read(reference, Need::Output).unwrap();
    assert!(record.input().is_empty());
    assert_eq!(record.output_unit(), Some(OutputUnit::Newton));
    refused(reference, Need::Input, &["line 1", "the input", "voltage_v", "columns found: \"time_s\", \"force_n\""]);
    // A drive in the file is copied without being read, with any unit.
    assert!(read("time_s,force_n,voltage_mv\n0,0,x\n1,1,x\n", Need::Output).is_ok());
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
fn further_columns_are_copied_unchanged() {
    let text = "note,time_s,voltage_v,predicted_um,gain\n\"a, b\",0.00,0.10,9,x\n,0.50,1.0e0,9,\n";
    let record = read(text, Need::Input).unwrap();
    let mut out = Vec::new();
    let extra = [Extra::numbers("predicted_um", &[0.1, -2.0]), Extra::flags("settling", &[true, false])];
    record.write_with(&mut out, &extra).unwrap();
    assert_eq!(
        String::from_utf8(out).unwrap(),
        "note,time_s,voltage_v,gain,predicted_um,settling\n\
         \"a, b\",0.00,0.10,x,0.1,1\n,0.50,1.0e0,,-2,0\n"
    );
}

#[test]
fn extra_columns_are_checked() {
    let record = read(TRAIN, Need::Input).unwrap();
    let write = |extra: Extra<'_>| record.write_with(Vec::new(), &[extra]).unwrap_err().to_string();
    assert!(write(Extra::numbers("predicted_um", &[1.0])).contains("\"predicted_um\" has 1 values"));
    let message = write(Extra::rounded("voltage_v", &[0.0, 1.0, f64::NAN, 0.0, 0.0], 4));
    assert!(message.contains("\"voltage_v\", row 2: NaN"), "{message}");
}

#[test]
fn a_column_can_be_mapped() {
    let text = "t,Vin,voltage_v,x\n0,1,9,3\n1,2,9,4\n";
    let map = ["time_s=t", "voltage_v=Vin", "displacement_nm = x"];
    let record = read_mapped(text, &map, Need::InputAndOutput).unwrap();
    assert_eq!((record.input_column(), record.input()), ("voltage_v", &[1.0, 2.0][..]));
    assert_eq!(record.output_unit(), Some(OutputUnit::Nanometre));
    refused_mapped(
        text,
        &["time_s=t", "voltage_v=Uin"],
        Need::Input,
        &["line 1", "--map voltage_v=Uin", "columns found: \"t\", \"Vin\""],
    );
    // Messages about values use the column name of the file.
    refused_mapped("t,Vin\n0,1\n1,x\n", &["time_s=t", "voltage_v=Vin"], Need::Input, &["line 3", "\"Vin\"", "\"x\""]);
    refused_mapped("t,Vin\n0,1\n0,2\n", &["time_s=t", "voltage_v=Vin"], Need::Input, &["line 3", "\"t\"", "increase"]);
}

#[test]
fn map_arguments_are_checked() {
    let message = |arguments: &[&str]| ColumnMap::parse(arguments).unwrap_err().to_string();
    for malformed in ["voltage_v", "=Vin", "voltage_v=", ""] {
        assert!(message(&[malformed]).contains("NAME=COLUMN"), "{malformed}");
    }
    let unknown = message(&["volts=Vin"]);
    assert!(unknown.contains("\"volts\"") && unknown.contains("voltage_v") && unknown.contains("load_n"), "{unknown}");
    assert!(message(&["voltage_v=a", "force_in_n=b"]).contains("both name the input"));
    assert!(message(&["voltage_v=a", "load_n=a"]).contains("same column"));
    assert_eq!(ColumnMap::parse([""; 0]), Ok(ColumnMap::default()));
}

#[test]
fn two_candidates_for_a_role_are_refused() {
    let both = "time_s,voltage_v,displacement_um,force_n\n0,0,0,0\n1,1,1,1\n";
    for need in [Need::InputAndOutput, Need::Input, Need::Output] {
        refused(
            both,
            need,
            &["line 1", "\"displacement_um\"", "\"force_n\"", "--map displacement_um=", "--map load_n="],
        );
    }
    let record = read_mapped(both, &["force_n=force_n"], Need::InputAndOutput).unwrap();
    assert_eq!(record.output_unit(), Some(OutputUnit::Newton));
    refused("time_s,time_ms,voltage_v\n0,0,0\n", Need::Input, &["\"time_s\"", "\"time_ms\""]);
    refused("time_s,force_in_n,current_in_a\n0,0,0\n", Need::Input, &["\"force_in_n\"", "\"current_in_a\""]);
    // A voltage takes precedence over other inputs.
    let record = read("time_s,force_in_n,voltage_v\n0,5,6\n1,5,6\n", Need::Input).unwrap();
    assert_eq!((record.input_column(), record.input()), ("voltage_v", &[6.0, 6.0][..]));
}

#[test]
fn other_units_are_converted_and_noted() {
    let record = read("Time (ms),Drive [mV],Position_m\n0,0,0\n1,1500,2.5e-6\n", Need::InputAndOutput).unwrap();
    assert_eq!((record.time(), record.input()), (&[0.0, 0.001][..], &[0.0, 1.5][..]));
    assert_eq!((record.output_unit(), record.output()), (Some(OutputUnit::Micrometre), Some(&[0.0, 2.5][..])));
    let notes = record.notes().join("; ");
    assert!(notes.contains("from mV to V") && notes.contains("from m to µm"), "{notes}");
    let record = read("time_s,voltage_v,temperature_k\n0,0,293.15\n1,1,293.15\n", Need::Input).unwrap();
    assert_eq!(record.temperature(), Some(&[20.0, 20.0][..]));
}

#[test]
fn units_that_are_not_stated_or_not_known_are_refused() {
    refused("time,voltage_v\n0,0\n1,1\n", Need::Input, &["\"time\"", "unit is not stated", "--map time_s=time"]);
    for output in ["displacement", "position [counts]", "sensor"] {
        refused(
            &format!("time_s,voltage_v,{output}\n0,0,0\n1,1,1\n"),
            Need::InputAndOutput,
            &[&format!("\"{output}\""), "--map", "displacement_um="],
        );
    }
    // An optional column with an unknown unit is refused, …
    refused("time_s,voltage_v,load_kg\n0,0,0\n1,1,1\n", Need::Input, &["\"load_kg\"", "load_n"]);
    // … but a column that only shares a word with it is copied unchanged.
    assert!(read("time_s,voltage_v,load_cell_v,temperature_sensor_id\n0,0,0,x\n1,1,0,x\n", Need::Input).is_ok());
}

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
fn a_missing_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("absent.csv");
    let message = Record::read(&path, &ColumnMap::default(), Need::Input).unwrap_err().to_string();
    assert!(message.starts_with(&path.display().to_string()), "{message}");
}

#[test]
fn joined_records_keep_the_file_of_each_segment() {
    let one = read(TRAIN, Need::InputAndOutput).unwrap();
    let two = Record::parse("two.csv", TRAIN.as_bytes(), &ColumnMap::default(), Need::InputAndOutput).unwrap();
    let joined = Record::join(vec![one, two]).unwrap();
    assert_eq!(joined.segments(), [0..3, 3..5, 5..8, 8..10]);
    assert_eq!(joined.file_of_segment(), [0, 0, 1, 1]);
    assert_eq!(joined.rows_of_files(), [0..5, 5..10]);
    assert_eq!(joined.labels(), [0, 7, 0, 7]);
    assert_eq!(joined.output().unwrap().len(), 10);
    assert_eq!(joined.load().unwrap().len(), 10);
    assert_eq!(joined.name(), "run.csv + two.csv");
    assert!(matches!(joined.write_csv(Vec::new()), Err(WriteError::Joined { .. })));
    assert!(matches!(Record::join(vec![]), Err(RecordError::Nothing)));
}

#[test]
fn records_with_different_columns_are_not_joined() {
    let base = "time_s,voltage_v,displacement_um\n0.0,0,0\n0.1,0,0\n";
    for (other, part) in [
        ("time_s,force_in_n,displacement_um\n0.0,0,0\n0.1,0,0\n", "the input column is \"force_in_n\""),
        ("time_s,voltage_v,displacement_nm\n0.0,0,0\n0.1,0,0\n", "the output column is \"displacement_nm\""),
        ("time_s,voltage_v,displacement_um,load_n\n0.0,0,0,0\n0.1,0,0,0\n", "\"load_n\" is measured"),
    ] {
        let records = [("one.csv", base), ("two.csv", other)].map(|(name, text)| {
            Record::parse(name, text.as_bytes(), &ColumnMap::default(), Need::InputAndOutput).unwrap()
        });
        let message = Record::join(records.into()).unwrap_err().to_string();
        assert!(
            message.contains("two.csv, line 1") && message.contains("one.csv") && message.contains(part),
            "{message}"
        );
    }
}

#[test]
fn a_single_row_has_no_sample_period() {
    refused("time_s,voltage_v\n0,0\n", Need::Input, &["line 2", "\"time_s\"", "two rows"]);
}

#[test]
fn segments_and_files_keep_their_own_sample_periods() {
    let two = "segment,time_s,voltage_v,displacement_um\n0,0.0,0,0\n0,0.1,1,1\n0,0.2,0,0\n1,5.0,0,0\n1,5.001,1,1\n1,5.002,0,0\n";
    let one = "time_s,voltage_v,displacement_um\n0.0,0,0\n0.5,0,0\n";
    let records = [("two.csv", two), ("one.csv", one)]
        .map(|(name, text)| Record::parse(name, text.as_bytes(), &ColumnMap::default(), Need::InputAndOutput).unwrap());
    assert_eq!(records[0].sample_periods(), [0.1, 0.001]);
    assert_eq!(records[0].time(), [0.0, 0.1, 0.2, 5.0, 5.001, 5.002]);
    let mut written = Vec::new();
    records[0].write_csv(&mut written).unwrap();
    assert_eq!(
        Record::parse("two.csv", &written, &ColumnMap::default(), Need::InputAndOutput).unwrap().sample_periods(),
        [0.1, 0.001]
    );
    let joined = Record::join(records.into()).unwrap();
    assert_eq!((joined.sample_periods(), joined.sample_period()), (vec![0.1, 0.001, 0.5], 0.001));
    let message = joined.need_one_sample_period("a reference").unwrap_err().to_string();
    assert!(message.contains("segment 1 has 0.001000000 s and segment 0 0.100000000 s"), "{message}");
}

#[test]
fn a_short_file_joins_a_long_one_of_the_same_rate() {
    // Two rows allow rates from 749.6 to 750.8 Hz; the longer file is more accurate.
    let text = |rows: u32| {
        (0..rows).fold(String::from("time_s,voltage_v\n"), |text, k| text + &format!("{:.6},0\n", f64::from(k) / 750.0))
    };
    let [short, long] = [2, 900].map(|rows| read(&text(rows), Need::Input).unwrap());
    assert_eq!(short.sample_period(), 0.001333);
    assert_eq!(Record::join(vec![short, long]).unwrap().sample_period(), 1.0 / 750.0);
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

fn assert_same(a: &Record, b: &Record) {
    assert_eq!(a.sample_period(), b.sample_period());
    assert_eq!((a.segments(), a.labels(), a.time()), (b.segments(), b.labels(), b.time()));
    assert_eq!((a.input_column(), a.input()), (b.input_column(), b.input()));
    assert_eq!((a.output_unit(), a.output()), (b.output_unit(), b.output()));
    assert_eq!((a.temperature(), a.load()), (b.temperature(), b.load()));
}

fn rewritten(record: &Record) -> Record {
    let mut text = Vec::new();
    record.write_csv(&mut text).unwrap();
    Record::parse(&record.name(), &text, &ColumnMap::default(), Need::InputAndOutput).unwrap()
}

#[test]
fn writing_and_reading_again_is_exact() {
    let record = read(TRAIN, Need::InputAndOutput).unwrap();
    assert_same(&record, &rewritten(&record));
    let mut text = String::from("time_ms,force_in_n,displacement_mm\n");
    for k in 0..500 {
        text += &format!("{:.3},{},{}\n", 12.5 + f64::from(k) / 0.75, (f64::from(k)).sin(), 1.0 / (1.0 + f64::from(k)));
    }
    let record = read(&text, Need::InputAndOutput).unwrap();
    assert_eq!(record.sample_period(), 1.0 / 750.0);
    assert_same(&record, &rewritten(&record));
}

#[test]
fn times_are_written_with_the_fewest_sufficient_decimals() {
    for (h, second) in
        [(0.001, "0.001"), (1.0 / 750.0, "0.001333"), (0.000_25, "0.00025"), (1.0 / 44_100.0, "0.00002268")]
    {
        let time = (0..4000).map(|k| f64::from(k) * h).collect();
        let record =
            Record::from_samples(Columns { time, input: Some(vec![0.0; 4000]), ..Columns::default() }).unwrap();
        let mut text = Vec::new();
        record.write_csv(&mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert_eq!(text.lines().nth(2), Some(format!("{second},0").as_str()));
    }
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

#[test]
fn columns_of_a_text_in_another_encoding_are_copied_unchanged() {
    let text = "time_s,voltage_v,displacement_um,gain_x\n0,0,0,7\n1,1,1,8\n2,2,2,9\n";
    let orders: [fn(u16) -> [u8; 2]; 2] = [u16::to_le_bytes, u16::to_be_bytes];
    for order in orders {
        let bytes: Vec<u8> = format!("\u{feff}{text}").encode_utf16().flat_map(order).collect();
        let record = Record::parse("run.csv", &bytes, &ColumnMap::default(), Need::InputAndOutput).unwrap();
        let mut written = Vec::new();
        record.write_with(&mut written, &[]).unwrap();
        assert_eq!(String::from_utf8(written).unwrap(), text);
    }
    let marked = format!("\u{feff}{text}");
    let record = Record::parse("run.csv", marked.as_bytes(), &ColumnMap::default(), Need::InputAndOutput).unwrap();
    let mut written = Vec::new();
    record.write_with(&mut written, &[]).unwrap();
    assert_eq!(String::from_utf8(written).unwrap(), text);
}
