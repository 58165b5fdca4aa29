//! A few cases of each kind of `cargo xtask fuzz`, the same each time.

use hyst_tests::fuzz::{KINDS, Kind};

/// Cases of each kind.
const CASES: u64 = 1500;

fn all(name: &str) {
    let kind = Kind::named(name).expect("a kind");
    (0..CASES).for_each(|seed| kind.run(seed));
}

#[test]
fn every_kind_is_here() {
    let here = include_str!("fuzz.rs");
    assert!(KINDS.iter().all(|kind| here.contains(&format!("all(\"{}\")", kind.name))));
}

#[test]
fn a_bad_line_moves_nothing_beyond_its_limits_and_the_next_host_is_served() {
    all("line");
}

#[test]
fn no_request_moves_a_device_beyond_its_limits() {
    all("requests");
}

#[test]
fn frames_are_survived() {
    all("frames");
}

#[test]
fn frames_of_a_bus_are_survived() {
    all("can");
    all("slcan");
}

#[test]
fn controllers_are_survived() {
    all("controllers");
}

#[test]
fn blocks_and_model_files_are_survived() {
    all("blocks");
    all("models");
}

#[test]
fn records_logs_and_plants_are_survived() {
    all("records");
    all("logs");
    all("plants");
}

#[test]
fn files_of_other_programs_are_survived() {
    all("tables");
    all("matlab");
    all("hdf5");
    all("labview");
    all("numpy");
}

#[test]
fn tables_and_logs_of_other_programs_are_survived() {
    all("parquet");
    all("arrow");
    all("excel");
    all("messages");
}
