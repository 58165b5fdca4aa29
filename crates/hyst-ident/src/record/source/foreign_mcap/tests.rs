mod build;
mod damage;

use super::*;
use build::*;

fn table(bytes: &[u8]) -> Table {
    read("x.mcap", bytes).unwrap()
}

fn fault(bytes: &[u8]) -> String {
    read("x.mcap", bytes).unwrap_err().to_string()
}

/// Returns names, units and values of the columns.
fn columns(table: &Table) -> Vec<(&str, Option<&str>, &[f64])> {
    let columns = table.heads.iter().zip(&table.values);
    columns.map(|(head, values)| (head.name.as_str(), head.unit.as_deref(), values.as_slice())).collect()
}

#[test]
fn json_messages_have_the_units_of_their_schema() {
    let schema = r##"{"type": "object", "$defs": {"State": {"properties": {"value": {"type": "number", "unit": "V"}}}}, "properties": {
        "state": {"$ref": "#/$defs/State"}, "at": {"type": "array", "description": "position in nm", "items": {"type": "number"}}}}"##;
    let messages = [
        r#"{"state": {"value": 1.5}, "ok": true, "at": [1, 2], "note": "a"}"#,
        r#"{"state": {"value": null}, "ok": false, "at": [3, 4]}"#,
    ];
    let table = table(&log(&[Topic::json("/rig", schema, &messages)]));
    assert_eq!(table.format, "MCAP log of JSON messages");
    let expected: [(&str, Option<&str>, &[f64]); 4] = [
        ("/rig@time", Some("s"), &[3661.0, 3661.25]),
        ("/rig.ok", None, &[1.0, 0.0]),
        ("/rig.at[1]", Some("nm"), &[1.0, 3.0]),
        ("/rig.at[2]", Some("nm"), &[2.0, 4.0]),
    ];
    let found = columns(&table);
    assert_eq!(
        (found[1].0, found[1].1, found[1].2[0], found[1].2[1].is_nan()),
        ("/rig.state.value", Some("V"), 1.5, true)
    );
    assert_eq!([&found[..1], &found[2..]].concat(), expected);
    assert!(table.heads.iter().all(|head| head.axis == Axis::Column(0) && head.rows == Some(2)), "{:?}", table.heads);
    assert!(table.notes.is_empty(), "{:?}", table.notes);
}

#[test]
fn ros_2_messages_are_read_in_both_byte_orders() {
    let schema = "std_msgs/Header header\nint8 mode\nfloat64 voltage # V\nfloat32[2] at\nstring[] words\nPair pair\nint16[] data\nuint8[] image\nint64 last\n\
                  ===\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n===\nMSG: lab/Pair\nbool a\nuint32 b\n";
    for is_little in [true, false] {
        let message = |k: i32| {
            let mut cdr = Cdr::new(is_little);
            cdr.put(k + 100)
                .put(500_000_000_u32)
                .text("stack")
                .put(-1_i8)
                .put(0.5 * f64::from(k))
                .put(1.5_f32)
                .put(f32::MIN);
            cdr.put(2_u32).text("ab").text("").put(1_u8).put(7_u32);
            cdr.put(2_u32).put(-3_i16).put(4_i16).put(k as u32).bytes(&vec![0; k as usize]).put(-5_i64);
            cdr.done()
        };
        let topic = Topic::new(
            "/piezo",
            "cdr",
            ("lab/msg/Sample", "ros2msg", schema.as_bytes()),
            vec![message(0), message(1), message(2)],
        );
        let table = table(&log(&[topic]));
        let expected: [(&str, Option<&str>, &[f64]); 10] = [
            ("/piezo@time", Some("s"), &[100.5, 101.5, 102.5]),
            ("/piezo.mode", None, &[-1.0; 3]),
            ("/piezo.voltage", Some("V"), &[0.0, 0.5, 1.0]),
            ("/piezo.at[1]", None, &[1.5; 3]),
            ("/piezo.at[2]", None, &[f64::from(f32::MIN); 3]),
            ("/piezo.pair.a", None, &[1.0; 3]),
            ("/piezo.pair.b", None, &[7.0; 3]),
            ("/piezo.data[1]", None, &[-3.0; 3]),
            ("/piezo.data[2]", None, &[4.0; 3]),
            ("/piezo.last", None, &[-5.0; 3]),
        ];
        assert_eq!(columns(&table), expected);
        assert_eq!(
            table.notes,
            ["arrays of changing length or more than 256 values are left out: /piezo.image (0 to 2 values)"]
        );
    }
}

#[test]
fn protobuf_messages_have_the_times_of_their_stamps() {
    let table = table(&log(&[protobuf_topic()]));
    let expected: [(&str, Option<&str>, &[f64]); 5] = [
        ("/pb@time", Some("s"), &[10.000_000_001, 11.000_000_001]),
        ("/pb.voltage", None, &[0.0, 1.5]),
        ("/pb.count", None, &[0.0, 300.0]),
        ("/pb.data[1]", None, &[1.0, 1.0]),
        ("/pb.data[2]", None, &[2.0, 2.0]),
    ];
    assert_eq!(columns(&table), expected);
}

#[test]
fn topics_of_two_clocks_become_one_table() {
    let messages: Vec<String> = (0..20).map(|k| format!("{{\"x\": {k}}}")).collect();
    let messages: Vec<&str> = messages.iter().map(String::as_str).collect();
    let (fast, mut late, mut slow) = (
        Topic::json("/a", "{}", &messages),
        Topic::json("/b", "{}", &messages),
        Topic::json("/c", "{}", &messages[..5]),
    );
    late.times.iter_mut().for_each(|time| *time += STEP / 4);
    slow.times.iter_mut().for_each(|time| *time += 1);
    let table = table(&log(&[fast, late, slow]));
    let names: Vec<(&str, Axis)> = table.heads.iter().map(|head| (head.name.as_str(), head.axis)).collect();
    let expected = [
        ("/a@time", Axis::Column(0)),
        ("/a.x", Axis::Column(0)),
        ("/b.x", Axis::Column(0)),
        ("/c@time", Axis::Column(3)),
        ("/c.x", Axis::Column(3)),
    ];
    assert_eq!(names, expected);
    assert!(table.values[2][0].is_nan());
    assert_eq!((table.values[2][1], table.values[2][19], table.values[4].len()), (0.75, 18.75, 5));
    let note = "/b is interpolated linearly to the times of /a: its messages are 62.5 ms after those (period 250 ms); 1 row has no value";
    assert_eq!(table.notes, [note]);
}

#[test]
fn a_lost_message_gives_a_row_without_a_value() {
    let messages: Vec<String> = (0..20).map(|k| format!("{{\"x\": {k}}}")).collect();
    let messages: Vec<&str> = messages.iter().map(String::as_str).collect();
    let (whole, mut lossy) = (Topic::json("/a", "{}", &messages), Topic::json("/b", "{}", &messages));
    lossy.times.remove(7);
    lossy.messages.remove(7);
    let table = table(&log(&[whole, lossy]));
    assert_eq!((table.values[2][6], table.values[2][8]), (6.0, 8.0));
    assert!(table.values[2][7].is_nan());
    assert_eq!(table.notes, ["/b has no message at some times of /a: 1 row has no value"]);
}

#[test]
fn log_times_are_used_if_time_stamps_are_all_equal() {
    let stamped = [
        r#"{"header": {"stamp": {"sec": 0, "nanosec": 0}}, "x": NaN}"#,
        r#"{"header": {"stamp": {"sec": 0, "nanosec": 0}}, "x": 2, "t": "NaN"}"#,
    ];
    let mut topic = Topic::json("/a", "{}", &stamped);
    topic.times.reverse();
    let table = table(&log(&[topic]));
    assert_eq!(table.values[0], [3661.0, 3661.25]);
    assert_eq!((table.heads[3].name.as_str(), table.values[3][0], table.values[3][1].is_nan()), ("/a.x", 2.0, true));
    assert_eq!(table.notes, ["/a: the time stamps of its messages are all equal; the log times are used"]);
    let mut still = Topic::json("/a", "{}", &["1", "2"]);
    still.times = vec![5; 2];
    let table = read("x.mcap", &log(&[still])).unwrap();
    assert_eq!((table.heads[0].name.as_str(), table.heads[0].axis, table.heads.len()), ("/a", Axis::Unknown, 1));
}

#[test]
fn topics_that_cannot_be_read_are_named_with_the_reason() {
    assert_eq!(
        fault(MAGIC),
        "x.mcap: MCAP: the file has no message (the log was cut off: its end is missing); copy the file again, or record again"
    );
    let text =
        fault(&log(&[Topic::json("/a", "{}", &[r#"{"x": "text"}"#; 2]), Topic::json("/b", "{}", &["{\"x\": 1"; 2])]));
    assert!(text.contains("no topic has two messages with numbers: /a (2 messages without numbers); /b (2 messages cannot be read: not valid JSON: EOF"), "{text}");
    let other = |encoding, schema| {
        fault(&log(&[Topic::new("/a", encoding, ("lab/msg/X", schema, b"float64 x\nlab/Y y"), vec![vec![0; 12]; 2])]))
    };
    assert!(other("ros1", "ros1msg").contains("/a (its messages are in \"ros1\", which is not supported)"));
    assert!(other("cdr", "ros2idl").contains("/a (its schema is in \"ros2idl\", which is not supported)"));
    assert!(other("cdr", "ros2msg").contains("/a (its schema does not define \"lab/Y\")"));
    assert!(other("protobuf", "protobuf").contains("/a (its schema is damaged"));
    let mut editions = protobuf_topic();
    let schema = editions.schema.2;
    let at = schema.windows(6).position(|part| part == b"proto3").unwrap();
    let schema = [&schema[..at], b"protoX", &schema[at + 6..]].concat();
    editions.schema.2 = &schema;
    let text = fault(&log(&[editions]));
    assert!(text.contains("in the Protobuf syntax \"protoX\"; only proto2 and proto3 are supported"), "{text}");
    let cdr = |message: &[u8]| {
        fault(&log(&[Topic::new("/a", "cdr", ("lab/msg/X", "ros2msg", b"float64 x"), vec![message.to_vec(); 2])]))
    };
    assert!(cdr(&[0, 7, 0, 0, 1]).contains("its CDR representation is 0x0007"));
    assert!(cdr(&[0, 1, 0, 0, 1, 2]).contains("it ends after 6 bytes, in the field x"));
    let mut mixed = Topic::json("/a", "{}", &["1", "2", "x"]);
    mixed.times.truncate(3);
    assert_eq!(
        table(&log(&[mixed])).notes,
        ["/a: 1 message is not readable and left out (not valid JSON: expected value at line 1 column 1)"]
    );
}

#[test]
fn equal_channels_are_one_topic_and_others_are_numbered() {
    let (one, mut again) = (Topic::json("/a", "{}", &["1", "2"]), Topic::json("/a", "{}", &["3", "4"]));
    again.times.iter_mut().for_each(|time| *time += 2 * STEP);
    let (other, cut) = (Topic::json("/a", "{\"x\": 1}", &["5", "6"]), Topic::json("/b", "{}", &["7"]));
    let table = table(&log(&[one, again, other, cut]));
    let names: Vec<&str> = table.heads.iter().map(|head| head.name.as_str()).collect();
    assert_eq!(names, ["/a@time", "/a", "/a#2@time", "/a#2"]);
    assert_eq!(table.values[1], [1.0, 2.0, 3.0, 4.0]);
    assert_eq!(table.notes, ["left out: /b (1 message)"]);
}
