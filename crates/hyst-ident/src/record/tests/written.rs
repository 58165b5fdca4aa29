//! Records are written as they were read.

use super::*;

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
