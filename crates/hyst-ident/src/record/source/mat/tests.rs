//! MATLAB files of versions 4 to 7, built byte by byte.

mod writer;

use super::*;
use crate::record::source::Axis;
use writer::{array, cells, compressed, empty, file, numbers, structs, text, version_4};

#[track_caller]
fn table(bytes: &[u8]) -> Table {
    assert!(is(bytes));
    read("x.mat", bytes).unwrap_or_else(|error| panic!("{error}"))
}

fn message(bytes: &[u8]) -> String {
    read("x.mat", bytes).unwrap_err().to_string()
}

fn names(table: &Table) -> Vec<&str> {
    table.heads.iter().map(|head| head.name.as_str()).collect()
}

fn units(table: &Table) -> Vec<&str> {
    table.heads.iter().map(|head| head.unit.as_deref().unwrap_or("")).collect()
}

#[test]
fn vectors_and_tables_are_columns() {
    for big_endian in [false, true] {
        let variables = [
            array("t", &[3, 1], numbers(&[0.0, 0.5, 1.0])),
            array("y", &[1, 3], numbers(&[1.0, f64::NAN, 3.0])),
            array("m", &[3, 2], numbers(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0])),
            array("gain", &[1, 1], numbers(&[2.0])),
            array("wide", &[2, 3], numbers(&[0.0; 6])),
        ];
        let found = table(&file(&variables, big_endian));
        assert_eq!(found.format, "MATLAB 5");
        assert_eq!(names(&found), ["t", "y", "m[1]", "m[2]"]);
        assert_eq!(found.values[3], [4.0, 5.0, 6.0]);
        assert!(found.values[1][1].is_nan() && found.heads[0].rows == Some(3));
        assert!(found.notes[0].contains("\"wide\"") && found.notes[0].contains("transpose"), "{:?}", found.notes);
    }
}

#[test]
fn compressed_variables_and_version_4_are_read() {
    let plain = file(&[array("t", &[3, 1], numbers(&[0.0, 0.5, 1.0]))], false);
    assert_eq!(table(&compressed(&plain)).values, table(&plain).values);
    for big_endian in [false, true] {
        let found = table(&version_4(&[("t", 2, &[0.0, 1.0, 2.0, 3.0])], big_endian));
        assert_eq!((found.format.as_str(), names(&found)), ("MATLAB 4", vec!["t[1]", "t[2]"]));
        assert_eq!(found.values[1], [2.0, 3.0]);
    }
}

#[test]
fn structs_give_paths_and_a_rate_gives_times() {
    let inner = structs(&["voltage", "voltage_unit"], &[&[array("", &[2, 1], numbers(&[1.0, 2.0])), text("", "V")]]);
    let outer = structs(&["Fs", "run"], &[&[array("", &[1, 1], numbers(&[1000.0])), array("", &[1, 1], inner)]]);
    let found = table(&file(&[array("rig", &[1, 1], outer)], false));
    assert_eq!((names(&found), units(&found)), (vec!["rig.run.voltage"], vec!["V"]));
    assert_eq!(found.heads[0].axis, Axis::Even { start: 0.0, step: 1e-3 });
}

#[test]
fn lists_of_texts_name_the_columns_of_a_table() {
    let matrix = array("data", &[2, 2], numbers(&[0.0, 1.0, 5.0, 6.0]));
    let labels = array("names", &[1, 2], cells(&[text("", "Time"), text("", "Sensor")]));
    let symbols = array("units", &[1, 2], cells(&[text("", "s"), text("", "µm")]));
    let found = table(&file(&[matrix, labels, symbols], false));
    assert_eq!((names(&found), units(&found)), (vec!["Time", "Sensor"], vec!["s", "µm"]));
}

#[test]
fn signals_of_control_desk_are_read() {
    let signal = |name: &str, unit: &str, values: &[f64]| {
        [text("", name), text("", unit), array("", &[1, 2], numbers(values)), array("", &[1, 1], numbers(&[1.0]))]
    };
    let fields = ["Name", "Unit", "Data", "XIndex"];
    let x = structs(&fields, &[&signal("Time", "s", &[0.0, 0.1])]);
    let y = structs(&fields, &[&signal("Model/Out1", "V", &[1.0, 2.0]), &signal("Model/Out2", "-", &[3.0, 4.0])]);
    let experiment = structs(&["X", "Y"], &[&[array("", &[1, 1], x), array("", &[1, 2], y)]]);
    let found = table(&file(&[array("exp1", &[1, 1], experiment)], false));
    assert_eq!(names(&found), ["Time", "Model/Out1", "Model/Out2"]);
    assert_eq!(units(&found), ["s", "V", "-"]);
    assert_eq!(found.heads[2].axis, Axis::Column(0));
}

#[test]
fn times_of_simulink_are_read() {
    let vector = |values: &[f64]| array("", &[values.len() as i32, 1], numbers(values));
    let series = |values: &[f64]| {
        let info = structs(&["Units"], &[&[text("", "um")]]);
        array(
            "a",
            &[1, 1],
            structs(&["Time", "Data", "DataInfo"], &[&[vector(&[0.0, 0.2]), vector(values), array("", &[1, 1], info)]]),
        )
    };
    let found = table(&file(&[series(&[1.0, 2.0]), series(&[3.0, 4.0])], false));
    // Both share one clock.
    assert_eq!(names(&found), ["a.Time", "a.Data", "a.Data"]);
    assert_eq!((found.heads[1].axis, found.heads[2].axis), (Axis::Column(0), Axis::Column(0)));
    assert_eq!(found.heads[2].unit.as_deref(), Some("um"));

    let signals =
        structs(&["values", "label"], &[&[vector(&[1.0, 2.0]), text("", "u")], &[vector(&[3.0, 4.0]), text("", "y")]]);
    let out = structs(&["time", "signals"], &[&[vector(&[0.0, 0.2]), array("", &[1, 2], signals)]]);
    let found = table(&file(&[array("out", &[1, 1], out)], false));
    assert_eq!((names(&found), units(&found)), (vec!["out.time", "u", "y"], vec!["s", "", ""]));
    assert_eq!(found.heads[2].axis, Axis::Column(0));

    // In a matrix signal the last dimension is the time.
    let cube = array("", &[2, 1, 3], numbers(&[1.0, 10.0, 2.0, 20.0, 3.0, 30.0]));
    let series = structs(&["Time", "Data"], &[&[vector(&[0.0, 1.0, 2.0]), cube]]);
    let found = table(&file(&[array("s", &[1, 1], series)], false));
    assert_eq!(found.values[2], [10.0, 20.0, 30.0]);
}

#[test]
fn structs_of_the_same_signals_are_segments() {
    let run = |k: f64| [array("", &[2, 1], numbers(&[k, k + 0.5]))];
    let found = table(&file(&[array("run", &[1, 2], structs(&["x"], &[&run(1.0), &run(7.0)]))], false));
    assert_eq!(names(&found), ["segment", "run.x"]);
    assert_eq!(found.values, [[1.0, 1.0, 2.0, 2.0], [1.0, 1.5, 7.0, 7.5]]);
}

#[test]
fn arrays_that_cannot_be_read_are_named() {
    let complex = array("z", &[2, 1], numbers(&[1.0, 2.0])).complex();
    let wrong = message(&file(&[complex, text("remark", "none")], false));
    assert!(wrong.contains("x.mat: MATLAB 5: no column") && wrong.contains("\"z\" is complex"), "{wrong}");
    let wrong = message(&file(&[array("t", &[4, 1], numbers(&[1.0]))], false));
    assert!(wrong.contains("variable \"t\": 1 numbers found, but 4"), "{wrong}");
    let mut deep = empty();
    for _ in 0..100 {
        deep = array("deep", &[1, 1], structs(&["a"], &[&[deep]]));
    }
    assert!(message(&file(&[deep], false)).contains("nested"));
    let zeros = file(&[array("zeros", &[9 << 20, 1], numbers(&vec![0.0; 9 << 20]))], false);
    assert!(message(&compressed(&zeros)).contains("expands"));
}

/// A file with most kinds of arrays.
fn various() -> Vec<u8> {
    let vector = |values: &[f64]| array("", &[values.len() as i32, 1], numbers(values));
    let series = structs(&["Time", "Data", "Name"], &[&[vector(&[0.0, 0.2]), vector(&[1.0, 2.0]), text("", "u")]]);
    let runs = structs(&["x"], &[&[vector(&[1.0, 2.0])], &[vector(&[3.0, 4.0])]]);
    let lists = cells(&[text("", "Time"), text("", "Sensor")]);
    file(
        &[
            array("t", &[3, 1], numbers(&[0.0, 0.5, 1.0])),
            array("data", &[2, 2], numbers(&[0.0, 1.0, 5.0, 6.0])),
            array("names", &[1, 2], lists),
            array("s", &[1, 1], series),
            array("runs", &[1, 2], runs),
        ],
        false,
    )
}

#[test]
fn truncated_and_damaged_files_do_not_panic() {
    let plain = various();
    for bytes in [compressed(&plain), plain, version_4(&[("t", 1, &[0.0, 1.0]), ("y", 1, &[2.0, 3.0])], true)] {
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
                let at = random(changed.len());
                changed[at] = [0, 1, 0x7f, 0x80, 0xff, random(256) as u8][random(6)];
            }
            let _ = is(&changed);
            let _ = read("x", &changed);
        }
    }
}
