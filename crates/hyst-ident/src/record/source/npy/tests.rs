use super::*;
use crate::record::source::Axis;
use proptest::prelude::*;

fn npy(header: &str, values: &[u8]) -> Vec<u8> {
    [&b"\x93NUMPY\x01\x00"[..], &(header.len() as u16).to_le_bytes(), header.as_bytes(), values].concat()
}

/// An array of numbers of some type.
fn array(kind: &str, shape: &str, values: &[u8]) -> Vec<u8> {
    npy(&format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n"), values)
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn crc(bytes: &[u8]) -> u32 {
    bytes.iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| crc >> 1 ^ if crc & 1 == 1 { 0xEDB8_8320 } else { 0 })
    }) ^ !0
}

/// A ZIP archive without compression.
fn npz(members: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, content) in members {
        let offset = (bytes.len() as u32).to_le_bytes();
        let size = (content.len() as u32).to_le_bytes();
        let length = (name.len() as u16).to_le_bytes();
        let common =
            [&[20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0][..], &crc(content).to_le_bytes(), &size, &size, &length, &[0, 0]]
                .concat();
        bytes.extend([b"PK\x03\x04", &common[..], name.as_bytes(), content].concat());
        directory.extend([b"PK\x01\x02\x14\x00", &common[..], &[0; 10], &offset, name.as_bytes()].concat());
    }
    let count = (members.len() as u16).to_le_bytes();
    let (size, start) = ((directory.len() as u32).to_le_bytes(), (bytes.len() as u32).to_le_bytes());
    [bytes, directory, [b"PK\x05\x06\0\0\0\0", &count[..], &count, &size, &start, &[0, 0]].concat()].concat()
}

fn names(table: &Table) -> Vec<&str> {
    table.heads.iter().map(|head| head.name.as_str()).collect()
}

fn error(bytes: &[u8]) -> String {
    read("x.npy", bytes).unwrap_err().to_string()
}

#[test]
fn tables_have_numbered_columns_in_either_order() {
    let values = doubles(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let table = read("x.npy", &array("<f8", "(3, 2)", &values)).unwrap();
    assert_eq!(names(&table), ["1", "2"]);
    assert_eq!(table.values, [[1.0, 3.0, 5.0], [2.0, 4.0, 6.0]]);
    let fortran = npy("{'descr': '<f8', 'fortran_order': True, 'shape': (3, 2)}", &values);
    assert_eq!(read("x.npy", &fortran).unwrap().values, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    let row = read("x.npy", &array("<f8", "(1, 6)", &values)).unwrap();
    assert_eq!((names(&row), row.values[0].len()), (vec!["1"], 6));
    let message = error(&array("<f8", "(2, 3)", &values));
    assert!(message.contains("its shape is [2, 3]") && message.contains("column_stack"), "{message}");
}

#[test]
fn numbers_of_all_types_are_read() {
    let first = |kind: &str, values: &[u8]| read("x.npy", &array(kind, "(2,)", values)).unwrap().values[0].clone();
    assert_eq!(first("|i1", &[0xFF, 1]), [-1.0, 1.0]);
    assert_eq!(first(">i2", &[0xFF, 0xFE, 1, 0]), [-2.0, 256.0]);
    assert_eq!(first("<u4", &[0xFF, 0xFF, 0xFF, 0xFF, 1, 0, 0, 0]), [4_294_967_295.0, 1.0]);
    assert_eq!(first("<i8", &[(-3_i64).to_le_bytes(), 4_i64.to_le_bytes()].concat()), [-3.0, 4.0]);
    assert_eq!(first("|b1", &[1, 0]), [1.0, 0.0]);
    assert_eq!(first(">f4", &[0.1_f32.to_be_bytes(), (-2.5_f32).to_be_bytes()].concat()), [f64::from(0.1_f32), -2.5]);
    // Half precision: 1.5, and the smallest number.
    assert_eq!(first("<f2", &[0x00, 0x3E, 0x01, 0x80]), [1.5, -(2_f64.powi(-24))]);
}

#[test]
fn dates_are_seconds_since_midnight() {
    let start = 1_700_000_000_i64 / 86_400 * 86_400;
    let micro = |seconds: i64, micro: i64| ((start + seconds) * 1_000_000 + micro).to_le_bytes();
    let values = [micro(60, 1), micro(60, 3), i64::MIN.to_le_bytes()].concat();
    let table = read("x.npy", &array("<M8[us]", "(3,)", &values)).unwrap();
    assert_eq!(table.values[0][..2], [60.000_001, 60.000_003]);
    assert!(table.values[0][2].is_nan());
    assert_eq!(table.heads[0].unit.as_deref(), Some("s"));
    let table =
        read("x.npy", &array("<m8[25ms]", "(2,)", &[4_i64.to_le_bytes(), (-2_i64).to_le_bytes()].concat())).unwrap();
    assert_eq!(table.values[0], [0.1, -0.05]);
}

#[test]
fn fields_of_structured_arrays_are_columns() {
    let header = "{'descr': [('t', '<u2'), ('', '|V1'), (('title', 'pos'), [('x', '|i1'), ('y', '|i1')]), ('f', '|u1', (2,))], \
                  'fortran_order': False, 'shape': (2,), }";
    let table = read("x.npy", &npy(header, &[1, 0, 9, 2, 3, 4, 5, 10, 0, 9, 20, 30, 40, 50])).unwrap();
    assert_eq!(names(&table), ["t", "pos.x", "pos.y", "f[1]", "f[2]"]);
    assert_eq!(table.values, [[1.0, 10.0], [2.0, 20.0], [3.0, 30.0], [4.0, 40.0], [5.0, 50.0]]);
    // Latin-1 in the header.
    let header = b"{'descr': [('\xB5m', '|u1')], 'fortran_order': False, 'shape': (2,)}";
    let bytes = [&b"\x93NUMPY\x01\x00"[..], &(header.len() as u16).to_le_bytes(), header, &[1, 2]].concat();
    assert_eq!(names(&read("x.npy", &bytes).unwrap()), ["µm"]);
}

#[test]
fn archives_have_names_units_and_rates() {
    let unicode = |text: &str| text.chars().flat_map(|c| u32::from(c).to_le_bytes()).collect::<Vec<u8>>();
    let members = [
        ("data.npy", array("<f8", "(3, 2)", &doubles(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]))),
        ("columns.npy", array("<U2", "(2,)", &unicode("u\0x2"))),
        ("slow.npy", array("<f8", "(2,)", &doubles(&[7.0, 8.0]))),
        ("slow_unit.npy", array("|S2", "()", b"mV")),
        ("fs.npy", array("<i8", "()", &1000_i64.to_le_bytes())),
        ("operator.npy", array("|S3", "()", b"Bob")),
    ];
    let bytes = npz(&members);
    assert!(is(&bytes));
    let table = read("x.npz", &bytes).unwrap();
    assert_eq!(names(&table), ["data/u", "data/x2", "slow"]);
    assert_eq!(table.values[1], [2.0, 4.0, 6.0]);
    assert_eq!(table.heads[2].unit.as_deref(), Some("mV"));
    assert_eq!(table.heads[0].axis, Axis::Even { start: 0.0, step: 1e-3 });
    // This column is shorter, so the rate does not apply.
    assert_eq!(table.heads[2].axis, Axis::Unknown);
    let bare = npz(&members[..1]);
    assert_eq!(names(&read("x.npz", &bare).unwrap()), ["data[1]", "data[2]"]);
    for length in 0..bytes.len() {
        let _ = read("x.npz", &bytes[..length]);
    }
    assert!(is(&bytes[..bytes.len() / 2]) && !is(b"PK\x03\x04"));
}

#[test]
fn damaged_files_are_refused() {
    let whole = array("<f8", "(3, 2)", &doubles(&[0.0; 6]));
    for length in 0..whole.len() {
        let message = error(&whole[..length]);
        assert!(message.contains("cut") || message.contains("header"), "{message}");
    }
    for shape in ["(18446744073709551615, 3)", "(99999999999999999999,)", "(-1,)", "3"] {
        error(&array("<f8", shape, &[0; 48]));
    }
    // Elements without bytes.
    assert!(error(&array("|S0", "(1000000000000,)", &[])).contains("no array has columns"));
    assert!(error(&array("|O", "(2,)", &[0; 16])).contains("pickled"));
    let deep = format!("{{'descr': {}, 'fortran_order': False, 'shape': (2,)}}", "[".repeat(5000));
    assert!(error(&npy(&deep, &[])).contains("header"));
    let wide = format!("{{'descr': [('a', {}, (4096,))], 'shape': (2,)}}", "[('a', [], (4096,))]");
    assert!(error(&npy(&wide, &[])).contains("more than 4096 fields"));
    let long = format!("{{'descr': [('{}', '|u1', (4096,))], 'shape': (2,)}}", "a".repeat(60_000));
    assert!(error(&npy(&long, &[0; 8192])).contains("fields"));
    let complex = array("<c16", "(2,)", &[0; 32]);
    assert!(error(&complex).contains("complex"), "{}", error(&complex));
}

#[test]
fn an_archive_that_expands_too_far_is_refused() {
    use std::io::Write;
    let mut packed = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::best());
    packed.write_all(&array("<f8", "(2,)", &doubles(&[1.0, 2.0]))).unwrap();
    for _ in 0..65 {
        packed.write_all(&vec![0; 1 << 20]).unwrap();
    }
    let size = (packed.total_in() as u32).to_le_bytes();
    let packed = packed.finish().unwrap();
    let mut bytes = npz(&[("a.npy", packed)]);
    // Set method 8 (deflate) and the size in both headers.
    let directory = bytes.windows(4).rposition(|word| word == b"PK\x01\x02").unwrap();
    bytes[8] = 8;
    bytes[directory + 10] = 8;
    bytes[22..26].copy_from_slice(&size);
    bytes[directory + 24..directory + 28].copy_from_slice(&size);
    let message = read("x.npz", &bytes).unwrap_err().to_string();
    assert!(message.contains("\"a\"") && message.contains("expands to more than 200 times"), "{message}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]
    #[test]
    fn damaged_bytes_do_not_panic(changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6), is_archive: bool) {
        let header = "{'descr': [('t', '<u2'), ('f', '|u1', (2,)), ('x', '<M8[us]')], 'fortran_order': False, 'shape': (3, 1), }";
        let mut bytes = npy(header, &[7; 36]);
        if is_archive {
            bytes = npz(&[("a.npy", bytes), ("fs.npy", array("<f8", "()", &doubles(&[10.0])))]);
        }
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        let _ = read("x.npy", &bytes);
    }
}
