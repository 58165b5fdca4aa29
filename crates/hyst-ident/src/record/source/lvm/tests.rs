use super::*;
use crate::record::source::Axis;
use proptest::prelude::*;

fn file_header(decimal: char, x_columns: &str) -> String {
    format!(
        "LabVIEW Measurement\t\r\nWriter_Version\t2\r\nSeparator\tTab\r\nDecimal_Separator\t{decimal}\r\nMulti_Headings\tYes\r\n\
         X_Columns\t{x_columns}\r\nTime_Pref\tRelative\r\n***End_of_Header***\t\r\n\t\r\n"
    )
}

fn segment(time: &str, rows: &[&str]) -> String {
    let rows: String = rows.iter().map(|row| format!("{row}\t\r\n")).collect();
    format!(
        "Channels\t2\t\t\r\nSamples\t2\t2\t\r\nDate\t2024/02/29\t2024/02/29\t\r\nTime\t{time}\t{time}\t\r\nY_Unit_Label\tVolts\tµm\t\r\n\
         X_Dimension\tTime\tTime\t\r\nX0\t0.5\t0.5\t\r\nDelta_X\t0.1\t0.1\t\r\n***End_of_Header***\t\t\t\r\n\
         X_Value\tU\tPosition\tComment\r\n{rows}"
    )
}

fn one() -> String {
    file_header('.', "One") + &segment("10:00:00.0", &["0.5\t1.25\t-3e-1", "0.6\tNaN\t4"])
}

fn names(table: &Table) -> Vec<&str> {
    table.heads.iter().map(|head| head.name.as_str()).collect()
}

fn error(text: &str) -> String {
    read("x.lvm", text.as_bytes()).unwrap_err().to_string()
}

#[test]
fn one_column_of_times_is_shared() {
    let table = read("x.lvm", one().as_bytes()).unwrap();
    assert_eq!(names(&table), ["X_Value", "U", "Position"]);
    let units: Vec<Option<&str>> = table.heads.iter().map(|head| head.unit.as_deref()).collect();
    assert_eq!(units, [Some("s"), Some("Volts"), Some("µm")]);
    assert_eq!(table.heads[2].axis, Axis::Column(0));
    assert_eq!((&table.values[0], &table.values[2]), (&vec![0.5, 0.6], &vec![-0.3, 4.0]));
    assert!(table.values[1][1].is_nan());
    assert!(table.notes.is_empty(), "{:?}", table.notes);
    // The code page of Windows.
    let latin: Vec<u8> = one().chars().map(|c| c as u8).collect();
    assert_eq!(read("x.lvm", &latin).unwrap().heads[2].unit.as_deref(), Some("µm"));
    assert!(is(&latin) && is(&[MARK, &latin].concat()) && !is(b"LabVIEW"));
}

#[test]
fn rows_without_times_have_even_times() {
    let text = file_header(',', "No")
        + &segment("10:00:00,0", &["\t1,25\t3", "\t2,25\t4"]).replace("0.5", "0,5").replace("0.1", "0,1");
    let table = read("x.lvm", text.as_bytes()).unwrap();
    assert_eq!(names(&table), ["U", "Position"]);
    assert_eq!(table.heads[0].axis, Axis::Even { start: 0.5, step: 0.1 });
    assert_eq!(table.values, [[1.25, 2.25], [3.0, 4.0]]);
}

#[test]
fn equal_times_of_all_channels_are_one_column() {
    let text = |second: &str| {
        file_header('.', "Multi")
            + "Channels\t2\t\t\t\r\nSamples\t2\t\t2\t\r\nY_Unit_Label\tV\t\tum\t\r\nX0\t0\t\t0\t\r\nDelta_X\t1\t\t1\t\r\n***End_of_Header***\r\n\
               X_Value\tU\tX_Value\tx\tComment\r\n0\t1\t0\t5\t\r\n"
            + &format!("1\t2\t{second}\t6\tremark\r\n")
    };
    let table = read("x.lvm", text("1").as_bytes()).unwrap();
    assert_eq!(names(&table), ["X_Value", "U", "x"]);
    assert_eq!((table.heads[1].unit.as_deref(), table.heads[2].unit.as_deref()), (Some("V"), Some("um")));
    assert_eq!(table.heads[2].axis, Axis::Column(0));
    let table = read("x.lvm", text("2").as_bytes()).unwrap();
    assert_eq!(names(&table), ["U.X_Value", "U", "x.X_Value", "x"]);
    assert_eq!((table.heads[1].axis, table.heads[3].axis), (Axis::Column(0), Axis::Column(2)));
    assert_eq!(table.values[2], [0.0, 2.0]);
}

#[test]
fn each_header_begins_a_segment() {
    let again = segment("10:00:07.0", &["0.5\t1\t2", "0.6\t3\t4"]);
    let table = read("x.lvm", (one() + "\r\n" + &again).as_bytes()).unwrap();
    assert_eq!(names(&table), ["X_Value", "U", "Position", "segment"]);
    assert_eq!(table.values[0], [0.5, 0.6, 7.5, 7.6]);
    assert_eq!(table.values[3], [0.0, 0.0, 1.0, 1.0]);
    assert!(table.notes[0].contains("segment 2 restart; 7 s are added to them"), "{:?}", table.notes);
    // Without a later date the segment starts one step later. Special blocks are ignored.
    let special = "***Start_Special***\r\n1\t2\r\n***End_Special***\r\n";
    let table = read("x.lvm", (one() + special + &segment("10:00:00.0", &["0.5\t1\t2"])).as_bytes()).unwrap();
    assert!((table.values[0][2] - 0.7).abs() < 1e-12, "{:?}", table.values[0]);
    let other = error(&(one() + &again.replace("Position", "Force")));
    assert!(other.contains("not those of the first segment"), "{other}");
}

#[test]
fn absolute_times_are_seconds_since_midnight() {
    let text = one()
        .replace("Relative", "Absolute")
        .replace("0.5\t1.25", "3814300800.000001\t1.25")
        .replace("0.6\t", "3814300800.100001\t");
    let table = read("x.lvm", text.as_bytes()).unwrap();
    let start = 3_814_300_800_i64.rem_euclid(86_400) as f64;
    assert_eq!(table.values[0], [start + 0.000_001, start + 0.100_001]);
}

#[test]
fn errors_state_line_and_column() {
    let message = error(&one().replace("1.25", "1,25"));
    assert!(message.contains("line 20, column \"U\": \"1,25\" is not a number"), "{message}");
    let message = error(&one().replace("0.5\t1.25\t-3e-1\t", "0.5\t1.25"));
    assert!(message.contains("line 20 has 2 cells"), "{message}");
    assert!(error("LabVIEW Measurement\t\r\n").contains("cut off"));
    assert!(error(&file_header('.', "One")).contains("no segment"));
    assert!(error(&file_header('.', "Two")).contains("X_Columns \"Two\""));
    let text = one();
    let cut = read("x.lvm", &text.as_bytes()[..text.len() - 5]);
    assert!(cut.is_err(), "one complete row: {cut:?}");
    let text = one() + "0.7\t1.";
    let table = read("x.lvm", text.as_bytes()).unwrap();
    assert_eq!(table.values[0].len(), 2);
    assert!(table.notes[0].contains("line 22 is cut off"), "{:?}", table.notes);
}

#[test]
fn truncated_files_do_not_panic() {
    let text = one() + &segment("10:00:07.0", &["0.5\t1\t2", "0.6\t3\t4"]);
    for length in 0..text.len() {
        let _ = read("x.lvm", &text.as_bytes()[..length]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]
    #[test]
    fn damaged_bytes_do_not_panic(changes in proptest::collection::vec((any::<prop::sample::Index>(), prop::sample::select(b"\t\n .,-0179eE*XSC\xB5\xFF".to_vec())), 1..8), multi: bool) {
        let mut bytes = (file_header('.', if multi { "Multi" } else { "One" })
            + &segment("10:00:00.0", &["0.5\t1.25\t-3e-1", "0.6\tNaN\t4"])
            + &segment("10:00:07.0", &["0.5\t1\t2", "0.6\t3\t4"])).into_bytes();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        let _ = read("x.lvm", &bytes);
    }
}
