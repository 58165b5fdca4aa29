//! Records of several files.

use super::*;

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
