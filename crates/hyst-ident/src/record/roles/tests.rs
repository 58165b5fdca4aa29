//! Roles from headings, words and maps, and the messages of a refusal.

use super::*;
use crate::record::columns::{ColumnMap, Need};
use crate::record::error::Place;
use crate::record::source::Head;

fn layout(names: &[&str], map: &[&str], need: Need) -> Result<Layout, String> {
    let heads: Vec<Head> = names.iter().map(|name| Head::new(*name)).collect();
    let file = File { name: "x.csv", header: Some(Place::Line(1)), heads: &heads, texts: &[], counters: &[] };
    Layout::resolve(&file, &ColumnMap::parse(map).unwrap(), need, None).map_err(|error| error.to_string())
}

fn train(names: &[&str]) -> Result<Layout, String> {
    layout(names, &[], Need::InputAndOutput)
}

fn of(choice: &Option<Choice>) -> (usize, &str, Option<&str>) {
    let choice = choice.as_ref().unwrap();
    (choice.column, &choice.canonical, choice.unit.map(|unit| unit.symbol))
}

#[test]
fn columns_are_found_by_headings_with_units() {
    let found = train(&["Time (ms)", "Voltage [mV]", "Position, nm", "T (K)"]).unwrap();
    assert_eq!(found.time, Clock::Column { column: 0, per_second: 1e3 });
    assert_eq!(of(&found.input), (1, "voltage_v", Some("mV")));
    assert_eq!(of(&found.output), (2, "displacement_nm", None));
    assert_eq!(of(&found.temperature), (3, "temperature_degc", Some("K")));
    assert!(found.notes[1].contains("from mV to V"), "{:?}", found.notes);
}

#[test]
fn words_decide_between_columns_with_the_same_unit() {
    let found = train(&["Time (s)", "Monitor (V)", "Drive (V)", "Target position (µm)", "Position (µm)"]).unwrap();
    assert_eq!(of(&found.input), (2, "voltage_v", None));
    assert_eq!(of(&found.output).0, 4);
    let message = train(&["Time (s)", "CH1 (V)", "CH2 (V)", "Position (µm)"]).unwrap_err();
    assert!(message.contains("\"CH1 (V)\", \"CH2 (V)\" each could be the input"), "{message}");
    assert!(message.contains("--map 'voltage_v=CH1 (V)'"), "{message}");
}

#[test]
fn one_message_asks_for_all_units_that_are_not_stated() {
    let message = train(&["t", "V", "x"]).unwrap_err();
    assert!(message.contains("--map time_s=t --map voltage_v=V --map displacement_um=x"), "{message}");
    let message = train(&["1", "2", "3"]).unwrap_err();
    assert!(message.contains("--map time_s=1 --map voltage_v=2 --map displacement_um=3"), "{message}");
    assert!(message.contains("--rate"), "{message}");
    let found =
        layout(&["t", "V", "x"], &["time_s=1", "voltage_v=V", "displacement_um=-3"], Need::InputAndOutput).unwrap();
    assert_eq!(of(&found.output), (2, "displacement_um", None));
}

#[test]
fn the_words_of_a_path_suggest_the_role() {
    let message = train(&["voltage.Time", "voltage.Data", "displacement.Data"]).unwrap_err();
    let map = "--map time_s=voltage.Time --map voltage_v=voltage.Data --map displacement_um=displacement.Data";
    assert!(message.contains(map), "{message}");
    assert!(message.contains("\"voltage.Data\" may be the input"), "{message}");
}

#[test]
fn a_map_converts_and_refuses_another_dimension() {
    let names = ["time_s", "Vin [mV]", "displacement_um", "displacement_nm"];
    let found =
        layout(&names, &["voltage_v=Vin [mV]", "displacement_um=displacement_nm"], Need::InputAndOutput).unwrap();
    assert_eq!(of(&found.input), (1, "voltage_v", Some("mV")));
    assert_eq!(of(&found.output), (3, "displacement_um", Some("nm")));
    let message = layout(&names, &["displacement_um=Vin [mV]"], Need::InputAndOutput).unwrap_err();
    assert!(message.contains("is in mV"), "{message}");
}

#[test]
fn messages_have_a_limited_length() {
    let names: Vec<String> = (0..100_000).map(|k| format!("channel{k}{}", "x".repeat(100))).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let message = train(&names).unwrap_err();
    assert!(message.len() < 2000 && message.contains("and 99988 more"), "{message}");
}
