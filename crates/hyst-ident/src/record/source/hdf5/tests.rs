//! HDF5 files, built byte by byte.

mod writer;

use super::*;
use crate::record::source::Axis;
use writer::{Attribute, File, Node, checksummed};

#[track_caller]
fn table(bytes: &[u8]) -> Table {
    assert!(is(bytes));
    read("x.h5", bytes).unwrap_or_else(|error| panic!("{error}"))
}

fn names(table: &Table) -> Vec<&str> {
    table.heads.iter().map(|head| head.name.as_str()).collect()
}

fn units(table: &Table) -> Vec<&str> {
    table.heads.iter().map(|head| head.unit.as_deref().unwrap_or("")).collect()
}

#[test]
fn vectors_and_tables_are_columns() {
    let file = File::new(vec![
        ("t", Node::vector(&[0.0, 0.5, 1.0]).with("units", Attribute::text("s"))),
        ("g", Node::group(vec![("data", Node::table(&[3, 2], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]))])),
        ("gain", Node::table(&[1, 1], &[2.0])),
        ("wide", Node::table(&[2, 3], &[0.0; 6])),
    ]);
    let found = table(&file.bytes());
    assert_eq!(found.format, "HDF5");
    assert_eq!((names(&found), units(&found)), (vec!["/t", "/g/data[1]", "/g/data[2]"], vec!["s", "", ""]));
    assert_eq!(found.values[2], [2.0, 4.0, 6.0]);
    assert!(found.notes[0].contains("/wide"), "{:?}", found.notes);
}

#[test]
fn attributes_give_names_units_rates_and_scales() {
    let data = Node::table(&[2, 2], &[0.0, 1.0, 2.0, 3.0])
        .with("columns", Attribute::texts(&["time", "sensor"]))
        .with("unit", Attribute::texts(&["s", "um"]));
    let codes = Node::vector(&[1.0, 2.0, -9.0])
        .with("scale_factor", Attribute::number(0.5))
        .with("add_offset", Attribute::number(10.0))
        .with("_FillValue", Attribute::number(-9.0))
        .with("sample_rate", Attribute::number(100.0));
    let found = table(&File::new(vec![("data", data), ("codes", codes)]).bytes());
    assert_eq!((names(&found), units(&found)), (vec!["time", "sensor", "/codes"], vec!["s", "um", ""]));
    assert_eq!(found.values[2][..2], [10.5, 11.0]);
    assert!(found.values[2][2].is_nan() && found.notes[0].contains("scale_factor"));
    assert_eq!(found.heads[2].axis, Axis::Even { start: 0.0, step: 0.01 });
    assert_eq!(found.heads[0].axis, Axis::Unknown);
}

#[test]
fn a_rate_in_a_group_applies_to_its_datasets() {
    let group = Node::group(vec![("x", Node::vector(&[1.0, 2.0])), ("dt", Node::table(&[], &[0.25]))]);
    let found = table(&File::new(vec![("run", group)]).bytes());
    assert_eq!(found.heads[0].axis, Axis::Even { start: 0.0, step: 0.25 });
}

#[test]
fn numbered_groups_are_segments() {
    let run = |k: f64| Node::group(vec![("x", Node::vector(&[k, k + 0.5]))]);
    let found = table(&File::new(vec![("run_10", run(10.0)), ("run_9", run(9.0))]).bytes());
    assert_eq!(names(&found), ["segment", "/run/x"]);
    assert_eq!(found.values, [[9.0, 9.0, 10.0, 10.0], [9.0, 9.5, 10.0, 10.5]]);
    assert!(found.notes[0].contains("2 groups (/run_9 to /run_10)"), "{:?}", found.notes);
}

#[test]
fn arrays_of_matlab_are_stored_column_by_column() {
    let data = Node::table(&[2, 3], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).with("MATLAB_class", Attribute::text("double"));
    let rig = Node::group(vec![("data", data)]).with("MATLAB_class", Attribute::text("struct"));
    let found = table(&File::new(vec![("rig", rig)]).matlab());
    assert_eq!((found.format.as_str(), names(&found)), ("MATLAB 7.3", vec!["rig.data[1]", "rig.data[2]"]));
    assert_eq!(found.values[1], [4.0, 5.0, 6.0]);
}

#[test]
fn damaged_files_are_refused_with_the_reason() {
    let message = |bytes: &[u8]| read("x.h5", bytes).unwrap_err().to_string();
    let bytes = File::new(vec![("t", Node::vector(&[0.0, 0.5, 1.0]))]).bytes();
    assert!(message(&bytes[..bytes.len() - 8]).contains("cut off"));
    let huge = File::new(vec![("t", Node::claimed(&[1 << 40]))]).bytes();
    assert!(message(&huge).contains("dataset /t expands"), "{}", message(&huge));
    assert!(message(&File::new(vec![]).bytes()).contains("no column"));
    let mut deep = Node::vector(&[0.0, 1.0]);
    for _ in 0..50 {
        deep = Node::group(vec![("a", deep)]);
    }
    assert!(message(&File::new(vec![("a", deep)]).bytes()).contains("nested"));
}

#[test]
fn truncated_and_damaged_files_do_not_panic() {
    let run = |k: f64| Node::group(vec![("x", Node::vector(&[k, k + 0.5])), ("dt", Node::table(&[], &[k]))]);
    let data = Node::table(&[3, 2], &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
        .with("MATLAB_class", Attribute::text("double"))
        .with("units", Attribute::texts(&["s", "um"]))
        .with("scale_factor", Attribute::number(2.0));
    let file = File::new(vec![("run_1", run(1.0)), ("run_2", run(2.0)), ("data", data)]);
    for bytes in [file.bytes(), file.matlab()] {
        for end in 0..bytes.len() {
            let _ = is(&bytes[..end]);
            let _ = read("x", &bytes[..end]);
        }
        let mut state = 1_u64;
        let mut random = move |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        for _ in 0..3000 {
            let mut changed = bytes.clone();
            for _ in 0..=random(3) {
                // Only bytes after the MATLAB header, which is not read, are changed.
                let at = random(changed.len() - file.start(&changed)) + file.start(&changed);
                changed[at] = [0, 1, 0x7f, 0x80, 0xff, random(256) as u8][random(6)];
            }
            // The checksums are updated, because blocks with a wrong checksum are not read.
            checksummed(&mut changed, &file.blocks(&bytes));
            let _ = read("x", &changed);
        }
    }
}
