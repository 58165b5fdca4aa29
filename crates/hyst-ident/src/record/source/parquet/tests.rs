//! Files made by the writer of the crate. Files of other programs are in tests/layouts.

use std::sync::Arc;

use parquet::basic::{Compression, ZstdLevel};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::{FixedLenByteArray, Int96};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use proptest::prelude::*;

use super::*;
use crate::record::source::Axis;

/// Values of a column of two rows; `None` is null.
enum Values {
    Double([Option<f64>; 2]),
    Float([f32; 2]),
    Int([i32; 2]),
    Long([i64; 2]),
    Flag([bool; 2]),
    Julian([Int96; 2]),
    Bytes([Vec<u8>; 2]),
    Text([&'static str; 2]),
}
use Values::{Bytes as FixedBytes, Double, Flag, Float, Int, Julian, Long, Text};

/// A file whose row groups all have the same two rows.
fn file(schema: &str, groups: usize, properties: WriterProperties, columns: &[Values]) -> Vec<u8> {
    let schema = Arc::new(parse_message_type(&format!("message m {{ {schema} }}")).unwrap());
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties)).unwrap();
    for _ in 0..groups {
        let mut group = writer.next_row_group().unwrap();
        for values in columns {
            let mut column = group.next_column().unwrap().unwrap();
            let written = match (column.untyped(), values) {
                (ColumnWriter::DoubleColumnWriter(writer), Double(values)) => {
                    let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
                    let there: Vec<f64> = values.iter().copied().flatten().collect();
                    writer.write_batch(&there, Some(&levels), None)
                }
                (ColumnWriter::FloatColumnWriter(writer), Float(values)) => writer.write_batch(values, None, None),
                (ColumnWriter::Int32ColumnWriter(writer), Int(values)) => writer.write_batch(values, None, None),
                (ColumnWriter::Int64ColumnWriter(writer), Long(values)) => writer.write_batch(values, None, None),
                (ColumnWriter::BoolColumnWriter(writer), Flag(values)) => writer.write_batch(values, None, None),
                (ColumnWriter::Int96ColumnWriter(writer), Julian(values)) => writer.write_batch(values, None, None),
                (ColumnWriter::FixedLenByteArrayColumnWriter(writer), FixedBytes(values)) => {
                    let values: Vec<FixedLenByteArray> = values.iter().map(|value| value.clone().into()).collect();
                    writer.write_batch(&values, None, None)
                }
                (ColumnWriter::ByteArrayColumnWriter(writer), Text(values)) => {
                    let values: Vec<_> = values.iter().map(|text| (*text).into()).collect();
                    writer.write_batch(&values, None, None)
                }
                _ => unreachable!("the values are of the column's type"),
            };
            written.unwrap();
            column.close().unwrap();
        }
        group.close().unwrap();
    }
    writer.into_inner().unwrap()
}

fn small() -> Vec<u8> {
    let properties = WriterProperties::builder().set_compression(Compression::ZSTD(ZstdLevel::default())).build();
    let schema =
        "optional double t; optional double u; required binary note (UTF8); required group s { required int32 y; }";
    let columns = [Double([Some(0.0), Some(0.5)]), Double([Some(1.25), None]), Text(["a", "b"]), Int([3, -4])];
    file(schema, 2, properties, &columns)
}

#[track_caller]
fn refused(bytes: &[u8]) -> String {
    read("x.parquet", bytes).unwrap_err().to_string()
}

#[test]
fn row_groups_are_concatenated() {
    let bytes = small();
    assert!(is(&bytes));
    let table = read("x.parquet", &bytes).unwrap();
    let names: Vec<&str> = table.heads.iter().map(|head| head.name.as_str()).collect();
    assert_eq!(names, ["t", "u", "s.y"]);
    assert_eq!(table.values[0], [0.0, 0.5, 0.0, 0.5]);
    assert!(table.values[1][0] == 1.25 && table.values[1][1].is_nan());
    assert_eq!(table.values[2], [3.0, -4.0, 3.0, -4.0]);
}

#[test]
fn all_types_are_converted_to_numbers() {
    let schema = "required float f; required boolean b; required int32 n (UINT_32); required int64 m (UINT_64);
        required int32 d (DATE); required int64 us (TIMESTAMP_MICROS); required int32 clock (TIME_MILLIS); required int96 old;
        required int32 dec (DECIMAL(9, 2)); required fixed_len_byte_array(2) half (FLOAT16); required fixed_len_byte_array(3) big (DECIMAL(6, 1));
        required fixed_len_byte_array(20) huge (DECIMAL(40, 1));";
    let mut days = [Int96::new(), Int96::new()];
    days[0].set_data(0, 0, 2_440_589);
    days[1].set_data(500, 0, 2_440_589);
    let columns = [
        Float([0.1, 0.5]),
        Flag([true, false]),
        Int([-1, 1]),
        Long([-1, 1]),
        Int([19_000, 19_001]),
        Long([1_715_588_474_000_000, 1_715_588_474_000_001]),
        Int([250, 251]),
        Julian(days),
        Int([123, -123]),
        FixedBytes([vec![0, 0x3c], vec![0, 0xc0]]),
        FixedBytes([vec![0, 0, 5], vec![255, 255, 251]]),
        FixedBytes([vec![0; 20], vec![0; 20]]),
    ];
    let table = read("x.parquet", &file(schema, 1, WriterProperties::default(), &columns)).unwrap();
    let found: Vec<(&str, Option<&str>, &[f64])> = table
        .heads
        .iter()
        .zip(&table.values)
        .map(|(head, values)| (head.name.as_str(), head.unit.as_deref(), &values[..]))
        .collect();
    let expected: [(&str, Option<&str>, &[f64]); 11] = [
        ("f", None, &[f64::from(0.1_f32), 0.5]),
        ("b", None, &[1.0, 0.0]),
        ("n", None, &[4_294_967_295.0, 1.0]),
        ("m", None, &[18_446_744_073_709_551_615.0, 1.0]),
        ("d", Some("s"), &[0.0, 86_400.0]),
        ("us", Some("s"), &[30_074.0, 30_074.000_001]),
        ("clock", Some("ms"), &[250.0, 251.0]),
        ("old", Some("s"), &[0.0, 5e-7]),
        ("dec", None, &[1.23, -1.23]),
        ("half", None, &[1.0, -2.0]),
        ("big", None, &[0.5, -0.5]),
    ];
    assert_eq!(found, expected);
}

#[test]
fn the_index_of_a_pandas_table_is_the_time_axis() {
    let pandas = KeyValue::new("pandas".to_owned(), r#"{"index_columns": ["t"]}"#.to_owned());
    let properties = WriterProperties::builder().set_key_value_metadata(Some(vec![pandas])).build();
    let bytes = file(
        "optional double u; optional double t;",
        1,
        properties,
        &[Double([Some(1.0), Some(2.0)]), Double([Some(0.0), Some(0.5)])],
    );
    let table = read("x.parquet", &bytes).unwrap();
    assert_eq!([table.heads[0].axis, table.heads[1].axis], [Axis::Column(1), Axis::Unknown]);
}

#[test]
fn files_that_are_not_supported_are_refused_with_the_reason() {
    let bytes = small();
    let cut = refused(&bytes[..bytes.len() - 1]);
    assert!(cut.starts_with("x.parquet: Parquet: the end of the file is missing;"), "{cut}");
    assert!(refused(b"PARE and PARE").contains("encrypted"));
    let mut long = bytes.clone();
    let at = long.len() - TRAILER;
    long[at..at + 4].copy_from_slice(&[255, 255, 255, 127]);
    assert!(refused(&long).contains("longer than the file"));
    let text = file("required binary note (UTF8);", 1, WriterProperties::default(), &[Text(["a", "b"])]);
    assert!(refused(&text).contains("no column holds two or more numbers"));
    assert!(!is(b"PAR") && !is(b"PK\x03\x04") && !is(b""));
}

#[test]
fn base64_is_decoded() {
    assert_eq!(base64("aGVsbG8="), Some(b"hello".to_vec()));
    assert_eq!(base64("aGVsbG8h"), Some(b"hello!".to_vec()));
    assert_eq!(base64("/+8="), Some(vec![0xff, 0xef]));
    assert_eq!(base64("a b"), None);
}

#[test]
fn every_prefix_is_refused() {
    let bytes = small();
    for end in 0..bytes.len() {
        assert!(read("x", &bytes[..end]).is_err(), "{end}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn damaged_bytes_do_not_panic(changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let mut bytes = small();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        is(&bytes);
        if let Ok(table) = read("x", &bytes) {
            prop_assert!(table.heads.len() == table.values.len());
        }
    }
}
