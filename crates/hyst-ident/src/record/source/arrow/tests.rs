//! Files built byte by byte.

use proptest::prelude::*;

use super::*;
use crate::record::source::Axis;

/// A value of a FlatBuffers table.
#[derive(Clone)]
enum Value {
    Byte(u8),
    Short(i16),
    Int(i32),
    Long(i64),
    Text(&'static str),
    Table(Fields),
    Tables(Vec<Fields>),
    /// A vector of this number of structs.
    Structs(usize, Vec<u8>),
}
use Value::{Byte, Int, Long, Short, Structs, Tables, Text};

type Fields = Vec<(usize, Value)>;

/// Returns the bytes of a table, and the place of the table in them.
fn flat(fields: &Fields) -> (Vec<u8>, usize) {
    let count = fields.iter().map(|(number, _)| number + 1).max().unwrap_or(0);
    let start = 4 + 2 * count;
    let mut bytes = vec![0; start + 4 + 8 * fields.len()];
    bytes[..2].copy_from_slice(&(start as u16).to_le_bytes());
    bytes[start..start + 4].copy_from_slice(&(start as u32).to_le_bytes());
    for (k, (number, value)) in fields.iter().enumerate() {
        let at = start + 4 + 8 * k;
        bytes[4 + 2 * number..][..2].copy_from_slice(&((at - start) as u16).to_le_bytes());
        let inline: [u8; 8] = match value {
            Byte(value) => i64::from(*value).to_le_bytes(),
            Short(value) => i64::from(*value).to_le_bytes(),
            Int(value) => i64::from(*value).to_le_bytes(),
            Long(value) => value.to_le_bytes(),
            value => {
                let end = bytes.len();
                let (target, within) = outside(value);
                bytes.extend(target);
                ((end + within - at) as i64).to_le_bytes()
            }
        };
        bytes[at..at + 8].copy_from_slice(&inline);
    }
    (bytes, start)
}

/// Returns the bytes of a value that is stored after the table, and the place of the value in them.
fn outside(value: &Value) -> (Vec<u8>, usize) {
    let vector = |count: usize, elements: &[u8]| [&(count as u32).to_le_bytes()[..], elements].concat();
    match value {
        Text(text) => (vector(text.len(), text.as_bytes()), 0),
        Structs(count, elements) => (vector(*count, elements), 0),
        Value::Table(fields) => flat(fields),
        Tables(tables) => {
            let mut bytes = vector(tables.len(), &vec![0; 4 * tables.len()]);
            for (k, table) in tables.iter().enumerate() {
                let (table, within) = flat(table);
                let offset = bytes.len() + within - (4 + 4 * k);
                bytes[4 + 4 * k..][..4].copy_from_slice(&(offset as u32).to_le_bytes());
                bytes.extend(table);
            }
            (bytes, 0)
        }
        _ => unreachable!("numbers are inside the table"),
    }
}

fn root(fields: &Fields) -> Vec<u8> {
    let (table, at) = flat(fields);
    [&(at as u32 + 4).to_le_bytes()[..], &table].concat()
}

fn message(kind: u8, header: Fields, body: &[u8]) -> Vec<u8> {
    let metadata = root(&vec![(1, Byte(kind)), (2, Value::Table(header)), (3, Long(body.len() as i64))]);
    [&[255; 4][..], &(metadata.len() as u32).to_le_bytes(), &metadata, body].concat()
}

fn field(name: &'static str, kind: u8, parameters: Fields) -> Fields {
    vec![(0, Text(name)), (2, Byte(kind)), (3, Value::Table(parameters))]
}

fn double(name: &'static str) -> Fields {
    field(name, 3, vec![(0, Short(2))])
}

/// Returns header and body of a batch. `columns` has rows, nulls and buffers of each column.
fn batch(rows: i64, columns: &[(i64, i64, &[Vec<u8>])]) -> (Fields, Vec<u8>) {
    let (mut nodes, mut buffers, mut body) = (Vec::new(), Vec::new(), Vec::new());
    for (rows, nulls, own) in columns {
        nodes.extend([rows.to_le_bytes(), nulls.to_le_bytes()].concat());
        for buffer in *own {
            buffers.extend([(body.len() as i64).to_le_bytes(), (buffer.len() as i64).to_le_bytes()].concat());
            body.extend(buffer);
        }
    }
    let (count, buffer_count) = (nodes.len() / 16, buffers.len() / 16);
    (vec![(0, Long(rows)), (1, Structs(count, nodes)), (2, Structs(buffer_count, buffers))], body)
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn longs(values: &[i64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

const END: [u8; 8] = [255, 255, 255, 255, 0, 0, 0, 0];

fn stream(schema: Fields, batches: &[(Fields, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = message(SCHEMA, schema, &[]);
    bytes.extend(batches.iter().flat_map(|(header, body)| message(BATCH, header.clone(), body)));
    bytes.extend(END);
    bytes
}

/// A stream with a time in ns, a voltage with its unit and a null, a text, and a displacement.
fn small_stream() -> Vec<u8> {
    let unit = (6, Tables(vec![vec![(0, Text("unit")), (1, Text("mV"))]]));
    let voltage = [double("u"), vec![unit]].concat();
    let fields = vec![field("t", 10, vec![(0, Short(3))]), voltage, field("note", 5, vec![]), double("y")];
    let start = 1_715_588_474_000_000_000;
    let (time, voltage) = (longs(&[start, start + 1]), doubles(&[1.5, 2.5]));
    let text = [vec![], vec![0; 12], vec![]];
    let columns = [
        (2, 0, &[vec![], time][..]),
        (2, 1, &[vec![0b10], voltage]),
        (2, 0, &text),
        (2, 0, &[vec![], doubles(&[-1.0, 0.1])]),
    ];
    stream(vec![(1, Tables(fields))], &[batch(2, &columns)])
}

/// A file with one column and two batches. The footer lists the batches `listed`.
fn small_file(listed: &[usize]) -> Vec<u8> {
    let mut bytes = b"ARROW1\0\0".to_vec();
    let mut places = Vec::new();
    for values in [[1.0, 2.0], [3.0, 4.0]] {
        let (header, body) = batch(2, &[(2, 0, &[vec![], doubles(&values)])]);
        places.push(longs(&[bytes.len() as i64, 0, 0]));
        bytes.extend(message(BATCH, header, &body));
    }
    let blocks = listed.iter().flat_map(|number| places[*number].clone()).collect();
    let schema = vec![(1, Tables(vec![double("u")]))];
    let footer = root(&vec![(1, Value::Table(schema)), (3, Structs(listed.len(), blocks))]);
    bytes.extend(&footer);
    bytes.extend((footer.len() as u32).to_le_bytes());
    bytes.extend(MAGIC);
    bytes
}

#[track_caller]
fn refused(bytes: &[u8]) -> String {
    read("x.arrow", bytes).unwrap_err().to_string()
}

#[test]
fn a_stream_is_read() {
    let bytes = small_stream();
    assert!(is(&bytes));
    let table = read("x.arrows", &bytes).unwrap();
    let heads: Vec<(&str, Option<&str>)> =
        table.heads.iter().map(|head| (head.name.as_str(), head.unit.as_deref())).collect();
    assert_eq!(heads, [("t", Some("s")), ("u", Some("mV")), ("y", None)]);
    assert_eq!(table.values[0], [30_074.0, 30_074.000_000_001]);
    assert!(table.values[1][0].is_nan() && table.values[1][1] == 2.5);
    assert_eq!(table.values[2], [-1.0, 0.1]);
    assert!(table.notes.is_empty());
    let table = read("x.arrows", &bytes[..bytes.len() - END.len()]).unwrap();
    assert!(table.notes[0].contains("no end mark"), "{:?}", table.notes);
}

#[test]
fn a_file_is_read_by_its_footer() {
    let bytes = small_file(&[0, 1]);
    assert!(is(&bytes));
    assert_eq!(read("x.feather", &bytes).unwrap().values, [[1.0, 2.0, 3.0, 4.0]]);
}

#[test]
fn structs_lists_and_dictionaries_become_columns() {
    let inner = [field("s", 13, vec![]), vec![(5, Tables(vec![double("a")]))]].concat();
    let list = [field("l", 16, vec![(0, Int(2))]), vec![(5, Tables(vec![double("item")]))]].concat();
    let coded = [double("d"), vec![(4, Value::Table(vec![(0, Long(7))]))]].concat();
    let schema =
        vec![(1, Tables(vec![inner, list, coded])), (2, Tables(vec![vec![(0, Text("fs")), (1, Text("500"))]]))];
    let mut bytes = message(SCHEMA, schema, &[]);
    let (dictionary, body) = batch(2, &[(2, 0, &[vec![], doubles(&[0.25, 0.5])])]);
    bytes.extend(message(DICTIONARY, vec![(0, Long(7)), (1, Value::Table(dictionary))], &body));
    let indices = [1_i32, 9].iter().flat_map(|index| index.to_le_bytes()).collect();
    let (header, body) = batch(
        2,
        &[
            (2, 1, &[vec![0b01]]),
            (2, 0, &[vec![], doubles(&[1.0, 2.0])]),
            (2, 0, &[vec![]]),
            (4, 0, &[vec![], doubles(&[10.0, 11.0, 20.0, 21.0])]),
            (2, 0, &[vec![], indices]),
        ],
    );
    bytes.extend(message(BATCH, header, &body));
    let table = read("x.arrows", &bytes).unwrap();
    let names: Vec<&str> = table.heads.iter().map(|head| head.name.as_str()).collect();
    assert_eq!(names, ["s.a", "l[1]", "l[2]", "d"]);
    assert!(table.values[0][0] == 1.0 && table.values[0][1].is_nan());
    assert_eq!(table.values[1..3], [[10.0, 20.0], [11.0, 21.0]]);
    assert!(table.values[3][0] == 0.5 && table.values[3][1].is_nan());
    assert_eq!(table.heads[3].axis, Axis::Even { start: 0.0, step: 0.002 });
}

#[test]
fn compressed_buffers_are_unpacked() {
    let values: Vec<f64> = (0..1000).map(|k| f64::from(k) / 8.0).collect();
    let plain = doubles(&values);
    let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
    std::io::Write::write_all(&mut encoder, &plain).unwrap();
    let packed = [encoder.finish().unwrap(), zstd::bulk::compress(&plain, 1).unwrap()];
    for (codec, packed) in packed.into_iter().enumerate() {
        for (length, packed) in [(plain.len() as i64, &packed), (-1, &plain)] {
            let buffer = [&length.to_le_bytes()[..], packed].concat();
            let (mut header, body) = batch(1000, &[(1000, 0, &[vec![], buffer])]);
            header.push((3, Value::Table(vec![(0, Byte(codec as u8))])));
            let bytes = stream(vec![(1, Tables(vec![double("u")]))], &[(header, body)]);
            assert_eq!(read("x", &bytes).unwrap().values[0], values);
        }
    }
}

#[test]
fn integers_of_all_widths_keep_their_values() {
    for (bits, signed) in
        [(8, true), (8, false), (16, true), (16, false), (32, true), (32, false), (64, true), (64, false)]
    {
        let minus_one = if signed { -1.0 } else { (2_f64.powi(bits)) - 1.0 };
        let bytes = [vec![255; bits as usize / 8], vec![1], vec![0; bits as usize / 8 - 1]].concat();
        let schema = vec![(1, Tables(vec![field("n", 2, vec![(0, Int(bits)), (1, Byte(u8::from(signed)))])]))];
        let table = read("x", &stream(schema, &[batch(2, &[(2, 0, &[vec![], bytes])])])).unwrap();
        // The largest 64-bit integer is rounded up to the nearest double.
        assert_eq!(table.values[0], [minus_one, 1.0], "{bits}");
    }
}

#[test]
fn files_that_are_not_supported_are_refused_with_the_reason() {
    assert!(refused(b"FEA1 and more").contains("pandas.read_feather(\"x.arrow\").to_feather"));
    let big = stream(vec![(0, Short(1)), (1, Tables(vec![double("u")]))], &[]);
    assert!(refused(&big).contains("big-endian"));
    let text = stream(vec![(1, Tables(vec![field("note", 5, vec![])]))], &[]);
    assert!(refused(&text).contains("no column holds two or more numbers"));
    let unknown = stream(vec![(1, Tables(vec![field("u", 99, vec![])]))], &[]);
    assert!(refused(&unknown).contains("column \"u\" has a type that is not known (number 99)"));
    let short = stream(vec![(1, Tables(vec![double("u")]))], &[batch(2, &[(2, 0, &[vec![], vec![0; 15]])])]);
    assert!(refused(&short).contains("column \"u\": a buffer is shorter than its column"));
    let uneven = stream(vec![(1, Tables(vec![double("u")]))], &[batch(3, &[(2, 0, &[vec![], vec![0; 16]])])]);
    assert!(refused(&uneven).contains("not as long as the others"));
    for other in [&b"ARROW"[..], b"\xff\xff\xff\xff", &[255; 64], b"time_s,voltage_v\n0,1\n", b""] {
        assert!(!is(other));
    }
}

#[test]
fn memory_is_limited_by_the_size_of_the_file() {
    // A few bytes of Zstandard unpack to 64 MB of zeros. Two such columns exceed the limit.
    let rows = 8 << 20;
    let packed = zstd::bulk::compress(&vec![0; 8 * rows], 1).unwrap();
    let buffer = [&(8 * rows as i64).to_le_bytes()[..], &packed].concat();
    let column = [vec![], buffer];
    let (mut header, body) = batch(rows as i64, &[(rows as i64, 0, &column[..]), (rows as i64, 0, &column)]);
    header.push((3, Value::Table(vec![(0, Byte(1))])));
    let bytes = stream(vec![(1, Tables(vec![double("u"), double("y")]))], &[(header, body)]);
    assert!(refused(&bytes).contains("column \"y\": the numbers unpack to more than 200 times"));
    let claim = batch(1 << 50, &[(1 << 50, 0, &[vec![], vec![]])]);
    assert!(refused(&stream(vec![(1, Tables(vec![double("u")]))], &[claim])).contains("200 times"));
    // A thousand columns of lists of a thousand numbers.
    let list = [field("l", 16, vec![(0, Int(1000))]), vec![(5, Tables(vec![double("item")]))]].concat();
    let lists = stream(vec![(1, Tables(vec![list; 1000]))], &[]);
    assert!(refused(&lists).contains("more than 100000 columns"));
}

#[test]
fn overlapping_batches_are_refused() {
    assert_eq!(read("x", &small_file(&[1, 0])).unwrap().values, [[3.0, 4.0, 1.0, 2.0]]);
    assert!(refused(&small_file(&[0; 50])).contains("the list of batches"));
}

#[test]
fn every_prefix_is_refused_or_read() {
    let stream = small_stream();
    for end in 0..stream.len() {
        assert_eq!(read("x", &stream[..end]).is_ok(), end == stream.len() - END.len(), "{end}");
    }
    let file = small_file(&[0, 1]);
    for end in 0..file.len() {
        assert!(read("x", &file[..end]).is_err(), "{end}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn damaged_bytes_do_not_panic(changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6), of_file: bool) {
        let mut bytes = if of_file { small_file(&[0, 1]) } else { small_stream() };
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
