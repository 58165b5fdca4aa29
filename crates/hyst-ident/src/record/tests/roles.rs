//! Roles and units of columns.

use super::*;

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
