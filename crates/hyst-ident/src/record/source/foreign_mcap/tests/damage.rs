//! Files that are truncated, damaged, or designed to use much memory.

use super::build::*;
use super::{Table, fault, read, table};

/// Files with all kinds of messages, with and without chunks.
fn files() -> Vec<Vec<u8>> {
    let schema = "std_msgs/Header header\nfloat64 x # V\nfloat32[3] y\nint16[] z\nP[] p\n===\nMSG: lab/P\nbool a\nP[] p\n===\nMSG: std_msgs/Header\n\
                  builtin_interfaces/Time stamp\nstring frame_id\n";
    let message = |k: i32| {
        let mut cdr = Cdr::new(k % 2 == 0);
        cdr.put(k).put(5_u32).text("a").put(1.0).put(1_f32).put(2_f32).put(3_f32).put(1_u32).put(4_i16);
        cdr.put(1_u32).put(1_u8).put(1_u32).put(0_u8).put(0_u32).done()
    };
    let ros = || Topic::new("/r", "cdr", ("lab/msg/S", "ros2msg", schema.as_bytes()), (0..4).map(message).collect());
    let json_schema = r##"{"properties": {"x": {"unit": "V"}, "s": {"$ref": "#"}}}"##;
    let texts = [r#"{"x": 1, "s": {"x": [1, 2]}}"#, r#"{"x": NaN, "s": {"x": [3, 4]}}"#, r#"{"x": 1e300, "y": -5}"#];
    let json = || Topic::json("/j", json_schema, &texts);
    let topics = || [json(), ros(), protobuf_topic()];
    let (stated, messages) = records(&topics());
    let inside = [stated.clone(), messages].concat();
    let packed = zstd::encode_all(inside.as_slice(), 3).unwrap();
    let chunks = [MAGIC, &chunk("", inside.len(), &inside), &stated, &record(2, &[0; 20]), MAGIC].concat();
    let zstd = [MAGIC, &chunk("zstd", inside.len(), &packed), &stated, &record(2, &[0; 20]), MAGIC].concat();
    vec![log(&topics()), chunks, zstd, log(&[json()]), log(&[ros()]), log(&[protobuf_topic()])]
}

/// Reads bytes that may be damaged.
fn check(bytes: &[u8]) {
    if let Ok(Table { heads, values, .. }) = read("x.mcap", bytes) {
        assert_eq!(heads.len(), values.len());
        for (head, values) in heads.iter().zip(&values) {
            assert!(head.rows == Some(values.len()) && values.len() >= 2);
            if let super::Axis::Column(time) = head.axis {
                assert_eq!(heads[time].rows, head.rows);
            }
        }
    }
}

#[test]
fn truncation_at_any_byte_does_not_panic() {
    for file in files() {
        assert!(read("x.mcap", &file).is_ok());
        (0..file.len()).for_each(|length| check(&file[..length]));
    }
}

#[test]
fn wrong_bytes_do_not_panic() {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = move |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below as u64) as usize
    };
    for file in files() {
        for _ in 0..1500 {
            let mut bytes = file.clone();
            for _ in 0..=random(4) {
                let at = random(bytes.len());
                match random(5) {
                    0 => bytes[at] ^= 1 << random(8),
                    1 => bytes[at] = random(256) as u8,
                    2 => bytes[at] = 0xff,
                    3 => drop(bytes.remove(at)),
                    _ => bytes.insert(at, random(256) as u8),
                }
            }
            check(&bytes);
        }
    }
}

#[test]
fn channels_are_found_at_the_end_if_their_first_chunk_is_damaged() {
    let (stated, messages) = records(&[Topic::json("/a", "{}", &["1", "2"])]);
    let bytes = [MAGIC, &chunk("zstd", 10, b"damaged"), &messages, &stated, &record(2, &[0; 20]), MAGIC].concat();
    let table = table(&bytes);
    assert_eq!(table.values[1], [1.0, 2.0]);
    assert!(
        table.notes[0].starts_with("1 damaged piece of the log left out: a chunk cannot be unpacked"),
        "{:?}",
        table.notes
    );
}

/// A chunk of messages that repeats one text, with other texts at its end.
fn repeated(text: &str, times: usize, last: &[&str]) -> Vec<u8> {
    let texts: Vec<&str> = std::iter::repeat_n(text, times).chain(last.iter().copied()).collect();
    let (stated, messages) = records(&[Topic::json("/a", "{}", &texts)]);
    let inside = [stated, messages].concat();
    assert!(inside.len() < 64 << 20);
    [MAGIC, &chunk("zstd", inside.len(), &zstd::encode_all(inside.as_slice(), 3).unwrap())].concat()
}

#[test]
fn the_memory_of_columns_is_limited_by_the_size_of_the_file() {
    let array = format!("[{}1]", "1,".repeat(250));
    let text = fault(&repeated(&array, 60_000, &[]));
    assert!(text.contains("far more than a log of"), "{text}");
    // A field that occurs once needs a value in each row.
    let last = format!("{{{}\"x\": 1}}", (0..500).map(|k| format!("\"x{k}\": 1,")).collect::<String>());
    let text = fault(&repeated("{}", 200_000, &[&last]));
    assert!(text.contains("far more than a log of"), "{text}");
    let text = fault(&repeated("{}", 200_000, &[]));
    assert!(text.contains("200000 messages without numbers"), "{text}");
}

#[test]
fn nesting_is_limited() {
    let deep = format!("{}1{}", "[".repeat(100_000), "]".repeat(100_000));
    assert!(fault(&log(&[Topic::json("/a", "{}", &[deep.as_str(); 2])])).contains("recursion limit"));
    let chain: String = (0..100).map(|k| format!("===\nMSG: lab/T{k}\nT{} t\n", k + 1)).collect();
    let schema = format!("T0 t\n{chain}===\nMSG: lab/T100\nfloat64 x\n");
    let topic = Topic::new("/a", "cdr", ("lab/msg/S", "ros2msg", schema.as_bytes()), vec![vec![0, 1, 0, 0]; 2]);
    assert!(fault(&log(&[topic])).contains("nested more than 32 deep"));
}
