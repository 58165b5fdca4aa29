//! MCAP files for tests, built byte by byte.

pub(crate) const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Time of the first message: 01:01:01 of a day \[ns\].
pub(crate) const START: u64 = 20_000 * 86_400_000_000_000 + 3_661_000_000_000;
/// Time between messages \[ns\].
pub(crate) const STEP: u64 = 250_000_000;

/// A topic with its messages.
pub(crate) struct Topic<'a> {
    pub(crate) topic: &'a str,
    pub(crate) encoding: &'a str,
    /// Name, encoding and text.
    pub(crate) schema: (&'a str, &'a str, &'a [u8]),
    pub(crate) messages: Vec<Vec<u8>>,
    pub(crate) times: Vec<u64>,
}

impl<'a> Topic<'a> {
    pub(crate) fn new(
        topic: &'a str,
        encoding: &'a str,
        schema: (&'a str, &'a str, &'a [u8]),
        messages: Vec<Vec<u8>>,
    ) -> Self {
        let times = (0..messages.len() as u64).map(|k| START + k * STEP).collect();
        Self { topic, encoding, schema, messages, times }
    }

    pub(crate) fn json(topic: &'a str, schema: &'a str, messages: &[&str]) -> Self {
        let messages = messages.iter().map(|text| text.as_bytes().to_vec()).collect();
        Self::new(topic, "json", ("Sample", "jsonschema", schema.as_bytes()), messages)
    }

    fn stated(&self, id: u16) -> Vec<u8> {
        let (name, encoding, data) = self.schema;
        let schema =
            [&id.to_le_bytes(), text(name.as_bytes()).as_slice(), &text(encoding.as_bytes()), &text(data)].concat();
        let ids = [id.to_le_bytes(), id.to_le_bytes()].concat();
        let channel = [ids.as_slice(), &text(self.topic.as_bytes()), &text(self.encoding.as_bytes()), &[0; 4]].concat();
        [record(3, &schema), record(4, &channel)].concat()
    }

    fn messages(&self, id: u16) -> impl Iterator<Item = (u64, Vec<u8>)> {
        self.times.iter().zip(&self.messages).map(move |(time, data)| {
            let head = [id.to_le_bytes().as_slice(), &[0; 4], &time.to_le_bytes(), &time.to_le_bytes()].concat();
            (*time, record(5, &[head.as_slice(), data].concat()))
        })
    }
}

pub(crate) fn record(kind: u8, body: &[u8]) -> Vec<u8> {
    [&[kind], (body.len() as u64).to_le_bytes().as_slice(), body].concat()
}

fn text(bytes: &[u8]) -> Vec<u8> {
    [(bytes.len() as u32).to_le_bytes().as_slice(), bytes].concat()
}

/// Returns schemas and channels, and messages.
pub(crate) fn records(topics: &[Topic<'_>]) -> (Vec<u8>, Vec<u8>) {
    let stated = topics.iter().zip(1..).flat_map(|(topic, id)| topic.stated(id)).collect();
    let messages = topics
        .iter()
        .zip(1..)
        .flat_map(|(topic, id)| topic.messages(id).map(|(_, message)| message))
        .flatten()
        .collect();
    (stated, messages)
}

/// A chunk without a checksum.
pub(crate) fn chunk(compression: &str, size: usize, packed: &[u8]) -> Vec<u8> {
    let (size, packed_size) = ((size as u64).to_le_bytes(), (packed.len() as u64).to_le_bytes());
    record(6, &[&[0; 16], size.as_slice(), &[0; 4], &text(compression.as_bytes()), &packed_size, packed].concat())
}

/// A file without chunks.
pub(crate) fn log(topics: &[Topic<'_>]) -> Vec<u8> {
    let (stated, messages) = records(topics);
    [MAGIC, &record(1, &[0; 8]), &stated, &messages, &record(2, &[0; 20]), MAGIC].concat()
}

/// A ROS 2 message.
pub(crate) struct Cdr {
    bytes: Vec<u8>,
    is_little: bool,
}

pub(crate) trait Bytes {
    fn little(self) -> Vec<u8>;
}

macro_rules! bytes {
    ($($number:ty)*) => {$(
        impl Bytes for $number {
            fn little(self) -> Vec<u8> {
                self.to_le_bytes().to_vec()
            }
        }
    )*};
}

bytes!(i8 u8 i16 i32 u32 i64 f32 f64);

impl Cdr {
    pub(crate) fn new(is_little: bool) -> Self {
        Self { bytes: Vec::new(), is_little }
    }

    pub(crate) fn put(&mut self, number: impl Bytes) -> &mut Self {
        let mut bytes = number.little();
        if !self.is_little {
            bytes.reverse();
        }
        self.bytes.resize(self.bytes.len().next_multiple_of(bytes.len()), 0);
        self.bytes(&bytes)
    }

    pub(crate) fn text(&mut self, text: &str) -> &mut Self {
        self.put(text.len() as u32 + 1).bytes(text.as_bytes()).bytes(&[0])
    }

    pub(crate) fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.bytes.extend(bytes);
        self
    }

    pub(crate) fn done(&self) -> Vec<u8> {
        [&[0, u8::from(self.is_little), 0, 0], self.bytes.as_slice()].concat()
    }
}

/// A field of a Protobuf message, with its length.
fn inside(number: u8, bytes: &[u8]) -> Vec<u8> {
    [&[number << 3 | 2, bytes.len() as u8], bytes].concat()
}

/// A field of a descriptor: name, number, label, type and name of the type.
fn field(name: &str, number: u8, label: u8, kind: u8, of: &str) -> Vec<u8> {
    let of = if of.is_empty() { Vec::new() } else { inside(6, of.as_bytes()) };
    inside(2, &[inside(1, name.as_bytes()), vec![3 << 3, number, 4 << 3, label, 5 << 3, kind], of].concat())
}

/// Two messages with a stamp, a double, an integer, a text and packed doubles.
pub(crate) fn protobuf_topic() -> Topic<'static> {
    let stamp = [inside(1, b"Timestamp"), field("seconds", 1, 1, 3, ""), field("nanos", 2, 1, 5, "")].concat();
    let stamp =
        [inside(1, b"t.proto"), inside(2, b"google.protobuf"), inside(4, &stamp), inside(12, b"proto3")].concat();
    let fields = [
        field("timestamp", 1, 1, 11, ".google.protobuf.Timestamp"),
        field("voltage", 2, 1, 1, ""),
        field("count", 3, 1, 13, ""),
        field("word", 4, 1, 9, ""),
        field("data", 5, 3, 2, ""),
    ];
    let sample = [inside(1, b"Sample"), fields.concat()].concat();
    let sample =
        [inside(1, b"s.proto"), inside(2, b"lab"), inside(3, b"t.proto"), inside(4, &sample), inside(12, b"proto3")]
            .concat();
    let long = |file: &[u8]| [&[1 << 3 | 2, file.len() as u8 | 0x80, (file.len() >> 7) as u8], file].concat();
    let schema: &'static [u8] = [long(&stamp), long(&sample)].concat().leak();
    let data = inside(5, &[1_f32.to_le_bytes(), 2_f32.to_le_bytes()].concat());
    let message =
        |seconds: u8, rest: &[u8]| [inside(1, &[1 << 3, seconds, 2 << 3, 1]), data.clone(), rest.to_vec()].concat();
    let voltage = [&[2 << 3 | 1], 1.5_f64.to_le_bytes().as_slice()].concat();
    let rest = [voltage, vec![3 << 3, 0xac, 2], inside(4, b"hi")].concat();
    Topic::new("/pb", "protobuf", ("lab.Sample", "protobuf", schema), vec![message(10, &[]), message(11, &rest)])
}
