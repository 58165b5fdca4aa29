//! Tests of reading, joining and writing, through the public interface.

mod damaged;
mod joined;
mod reading;
mod roles;
mod written;

use super::*;

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
