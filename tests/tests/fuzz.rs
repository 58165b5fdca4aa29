//! Runs the first cases of each kind of `cargo xtask fuzz`.

use hyst_tests::fuzz::{KINDS, Kind};

/// Cases of each kind.
const CASES: u64 = 1500;

fn all(name: &str) {
    let kind = Kind::named(name).expect("a kind");
    (0..CASES).for_each(|seed| kind.run(seed));
}

#[test]
fn every_kind_is_tested() {
    let tests = include_str!("fuzz.rs");
    assert!(KINDS.iter().all(|kind| tests.contains(&format!("all(\"{}\")", kind.name))));
}

#[test]
fn a_bad_line_keeps_limits_and_the_next_host_is_served() {
    all("line");
}

#[test]
fn requests_keep_the_limits_of_a_device() {
    all("requests");
}

#[test]
fn damaged_frames_cause_no_panic() {
    all("frames");
}

#[test]
fn damaged_can_frames_cause_no_panic() {
    all("can");
    all("slcan");
}

#[test]
fn damaged_controllers_cause_no_panic() {
    all("controllers");
}

#[test]
fn damaged_blocks_and_model_files_cause_no_panic() {
    all("blocks");
    all("models");
}

#[test]
fn damaged_records_logs_and_plants_cause_no_panic() {
    all("records");
    all("logs");
    all("plants");
}

#[test]
fn damaged_files_of_other_programs_cause_no_panic() {
    all("tables");
    all("matlab");
    all("hdf5");
    all("labview");
    all("numpy");
}

#[test]
fn damaged_tables_and_logs_of_other_programs_cause_no_panic() {
    all("parquet");
    all("arrow");
    all("excel");
    all("messages");
}
