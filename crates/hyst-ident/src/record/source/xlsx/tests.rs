//! Workbooks built from parts written by hand.

use std::io::Write;

use proptest::prelude::*;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::*;
use crate::record::source::Axis;

const TYPES: &str = r#"<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"></Types>"#;
const STYLES: &str = r#"<styleSheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><cellXfs count="2"><xf numFmtId="0"/><xf numFmtId="22"/></cellXfs></styleSheet>"#;

/// A workbook of sheets with these names and rows of cells in XML.
fn workbook(sheets: &[(&str, &str)]) -> Vec<u8> {
    let relation = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";
    let (mut list, mut relations, mut parts) = (String::new(), String::new(), Vec::new());
    for (k, (name, rows)) in sheets.iter().enumerate() {
        list += &format!(r#"<sheet name="{name}" sheetId="{0}" r:id="rId{0}"/>"#, k + 1);
        relations += &format!(
            r#"<Relationship Id="rId{0}" Type="{relation}/worksheet" Target="worksheets/sheet{0}.xml"/>"#,
            k + 1
        );
        let xml = format!(
            r#"<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>{rows}</sheetData></worksheet>"#
        );
        parts.push((format!("xl/worksheets/sheet{}.xml", k + 1), xml));
    }
    let book = format!(
        r#"<workbook xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main" xmlns:r="{relation}"><sheets>{list}</sheets></workbook>"#
    );
    let package = "http://schemas.openxmlformats.org/package/2006/relationships";
    parts.push(("xl/workbook.xml".to_owned(), book));
    parts.push((
        "xl/_rels/workbook.xml.rels".to_owned(),
        format!(r#"<Relationships xmlns="{package}">{relations}</Relationships>"#),
    ));
    let root = format!(r#"<Relationship Id="rId1" Type="{relation}/officeDocument" Target="xl/workbook.xml"/>"#);
    parts.push(("_rels/.rels".to_owned(), format!(r#"<Relationships xmlns="{package}">{root}</Relationships>"#)));
    parts.push(("xl/styles.xml".to_owned(), STYLES.to_owned()));
    parts.insert(0, ("[Content_Types].xml".to_owned(), TYPES.to_owned()));
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, xml) in parts {
        zip.start_file(name, SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored)).unwrap();
        zip.write_all(xml.as_bytes()).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// Rows of cells: a number, `@` and a number for a date, `^` and a number for a number written as text, or text.
/// Nothing makes an empty cell.
fn rows(text: &str) -> String {
    let cell = |at: String, cell: &str| match (cell, cell.strip_prefix('@'), cell.strip_prefix('^')) {
        ("", _, _) => String::new(),
        (_, Some(days), _) => format!(r#"<c r="{at}" s="1"><v>{days}</v></c>"#),
        (_, _, Some(text)) => format!(r#"<c r="{at}" t="inlineStr"><is><t>{text}</t></is></c>"#),
        _ if cell.parse::<f64>().is_ok() => format!(r#"<c r="{at}"><v>{cell}</v></c>"#),
        _ => format!(r#"<c r="{at}" t="inlineStr"><is><t>{cell}</t></is></c>"#),
    };
    let row = |(k, line): (usize, &str)| {
        let cells: String =
            line.split('|').zip('A'..).map(|(text, column)| cell(format!("{column}{}", k + 1), text)).collect();
        format!(r#"<row r="{}">{cells}</row>"#, k + 1)
    };
    text.lines().enumerate().map(row).collect()
}

fn sheet(text: &str) -> Table {
    read("x.xlsx", &workbook(&[("Sheet1", &rows(text))])).unwrap_or_else(|error| panic!("{error}"))
}

fn names(table: &Table) -> Vec<&str> {
    table.heads.iter().map(|head| head.name.as_str()).collect()
}

#[track_caller]
fn refused(bytes: &[u8]) -> String {
    read("x.xlsx", bytes).unwrap_err().to_string()
}

#[test]
fn names_and_units_are_above_the_numbers() {
    let table =
        sheet("Stack 7\nSerial number|1234\nDate|@45425.5\n\nTime|Drive|Sensor\n[s]|V|µm\n0|1.5|-2\n0.5|2.5|-3");
    assert_eq!(names(&table), ["Time", "Drive", "Sensor"]);
    let units: Vec<_> = table.heads.iter().map(|head| head.unit.as_deref()).collect();
    assert_eq!(units, [Some("s"), Some("V"), Some("µm")]);
    assert_eq!(table.values, [[0.0, 0.5], [1.5, 2.5], [-2.0, -3.0]]);
    let table = sheet("Time [s]|Note|Drive [V]\n0|a|1\n1|b|2\n2|c|3");
    assert_eq!(names(&table), ["Time [s]", "Drive [V]"]);
    assert_eq!(names(&sheet("0|1\n1|2\n2|3")), ["1", "2"]);
    assert_eq!(names(&sheet("|a|b\n0|1|5\n1|2|5")), ["1", "a", "b"]);
}

#[test]
fn rows_are_aligned_and_empty_cells_are_nan() {
    let table = sheet("t|u|y\n0|1|\n1||5\n|||\n2|x|6\n^3,5|^1e1|7");
    assert_eq!(table.values[0], [0.0, 1.0, 2.0, 3.5]);
    assert!(
        table.values[1][0] == 1.0
            && table.values[1][1].is_nan()
            && table.values[1][2].is_nan()
            && table.values[1][3] == 10.0
    );
    assert!(table.values[2][0].is_nan() && table.values[2][1..] == [5.0, 6.0, 7.0]);
    assert_eq!(table.notes, ["cells with text between numbers are read as empty: column \"u\" (1)"]);
}

#[test]
fn dates_are_seconds_since_midnight() {
    // 2024-05-13 08:21:14 and 1 ms more, with 16 digits.
    let table = sheet("Time|u\n@45425.34807870370|1\n@45425.34807871528|2");
    assert_eq!(table.heads[0].unit.as_deref(), Some("s"));
    assert_eq!(table.values[0], [30_074.0, 30_074.001]);
    let table = sheet("Time|u\n^2024-05-13 08:21:14.000250|1\n^2024-05-13 08:21:14.000253|2");
    assert_eq!(table.values[0], [30_074.000_25, 30_074.000_253]);
}

#[test]
fn columns_of_other_sheets_have_the_sheet_name_as_prefix() {
    let info = rows("Amplifier|20 V/V\nAmplitude|100\nRate|1000\nCycles|5");
    let data = rows("t|u\n0|1\n1|2");
    let table = read("x", &workbook(&[("Info", &info), ("A", &data), ("B", &data)])).unwrap();
    let names = names(&table);
    assert_eq!(names[names.len() - 4..], ["t", "u", "B!t", "B!u"]);
    assert!(names[..names.len() - 4].iter().all(|name| name.starts_with("Info!")), "{names:?}");
}

#[test]
fn a_rate_above_the_table_is_an_even_axis() {
    let table = sheet("Sample rate [Hz]|1000\n\nDrive [V]|Sensor [nm]\n1|2\n3|4\n5|6");
    assert_eq!(table.heads[0].axis, Axis::Even { start: 0.0, step: 1e-3 });
}

#[test]
fn files_that_are_not_supported_are_refused_with_the_reason() {
    assert!(refused(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1 old").contains("before 2007"));
    let ods = [b"PK\x03\x04".as_slice(), &[0; 26], b"mimetypeapplication/vnd.oasis.opendocument.spreadsheet"].concat();
    assert!(refused(&ods).contains(".ods"));
    assert!(refused(&workbook(&[("S", &rows("a|b\nc|d"))])).contains("no sheet has a column of two or more numbers"));
    let far = r#"<row r="4294967295"><c r="A4294967295"><v>1</v></c></row>"#;
    assert!(read("x", &workbook(&[("S", far)])).is_err());
    let wide = r#"<row r="1"><c r="A1"><v>1</v></c></row><row r="1048576"><c r="A1048576"><v>1</v></c><c r="XFD1048576"><v>1</v></c></row>"#;
    assert_eq!(read("x", &workbook(&[("S", wide)])).unwrap().values, [[1.0, 1.0]]);
    assert!(refused(&workbook(&[("S", "<row><c>")])).contains("sheet \"S\": the cells cannot be read"));
    for other in [&b"PK\x03\x04word/document.xml"[..], b"\x89PNG", b""] {
        assert!(!is(other));
    }
}

#[test]
fn a_part_that_expands_too_far_is_refused() {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    zip.start_file("xl/worksheets/sheet1.xml", SimpleFileOptions::default()).unwrap();
    let blanks = vec![b' '; 1 << 20];
    (0..65).for_each(|_| zip.write_all(&blanks).unwrap());
    let message = refused(&zip.finish().unwrap().into_inner());
    assert!(message.contains("more than 64 MB"), "{message}");
}

#[test]
fn every_prefix_is_refused() {
    let bytes = workbook(&[("S", &rows("t|u\n0|1\n1|2"))]);
    assert!(is(&bytes) && is(&bytes[..bytes.len() / 2]));
    for end in 0..bytes.len() {
        assert!(read("x", &bytes[..end]).is_err(), "{end}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn damaged_bytes_do_not_panic(changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5)) {
        let mut bytes = workbook(&[("S", &rows("t|u\n0|@1\n1|2"))]);
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        is(&bytes);
        let _ = read("x", &bytes);
    }

    #[test]
    fn damaged_cells_do_not_panic(changes in proptest::collection::vec((any::<prop::sample::Index>(), prop::sample::select(&b"<>/&;\"'=0 9A-.er"[..])), 1..5)) {
        let mut xml = rows("t|u\n0|@45000.5\n1|2\n^2024-05-13|x");
        for (at, byte) in changes {
            let at = at.index(xml.len());
            if xml.is_char_boundary(at) && xml.is_char_boundary(at + 1) {
                xml.replace_range(at..=at, &char::from(byte).to_string());
            }
        }
        let _ = read("x", &workbook(&[("S", &xml)]));
    }
}
