//! The topics of a file with the numbers of their messages.

use std::collections::HashMap;
use std::rc::Rc;

use mcap::records::{Channel, Record};

use crate::record::log::LogRecords;

use super::decoder::{Decoder, Schema};
use super::room::Room;
use super::series::Series;

/// Topics of one file; further ones are left out.
const MAX_TOPICS: usize = 1024;
/// Bytes that the columns may take whatever the size of the file.
const ALWAYS_READ: usize = 64 << 20;
/// How many times the size of the file the columns may take beyond that.
const MAX_EXPANSION: usize = 200;
/// Bytes that schemas may have whatever the size of the file: a parsed one takes some forty times its size.
const ALWAYS_SCHEMAS: usize = 4 << 20;
/// How many times the size of the file the schemas may have beyond that.
const MAX_SCHEMA_EXPANSION: usize = 20;

/// A topic that is read.
#[derive(Debug)]
pub(crate) struct Topic {
    pub(crate) series: Series,
    pub(crate) decoder: Rc<Decoder>,
    channel: Channel,
}

/// Where the messages of a channel go.
#[derive(Clone, Copy, Debug)]
enum Target {
    Topic(usize),
    Nowhere,
}

/// What was read of a file.
#[derive(Debug)]
pub(crate) struct Log {
    /// In the order of their first messages.
    pub(crate) topics: Vec<Topic>,
    /// Topics of which nothing is read, with the reason.
    pub(crate) left_out: Vec<String>,
    targets: HashMap<u16, Target>,
    decoders: HashMap<(u16, String), Result<Rc<Decoder>, String>>,
    room: Room,
    messages: usize,
    /// Messages whose channel is not known.
    orphans: usize,
    /// What is wrong with the first damaged record, and how many there are.
    damaged: Option<(String, usize)>,
    is_closed: bool,
}

/// Schemas and channels, which the file states before the messages and repeats at its end.
#[derive(Debug, Default)]
struct Catalogue {
    schemas: HashMap<u16, Schema>,
    channels: HashMap<u16, Channel>,
    /// Bytes of the schemas.
    size: usize,
}

impl Log {
    /// Reads all messages.
    ///
    /// # Errors
    /// If the file is no MCAP file, or holds far more numbers than its size lets expect.
    pub(crate) fn read(bytes: &[u8]) -> Result<Self, String> {
        let mut catalogue = Catalogue::default();
        let log = Self::pass(bytes, &mut catalogue)?;
        // The chunk that states a channel may be damaged; the end of the file states it again.
        if log.orphans > 0 { Self::pass(bytes, &mut catalogue) } else { Ok(log) }
    }

    fn pass(bytes: &[u8], catalogue: &mut Catalogue) -> Result<Self, String> {
        let most = ALWAYS_READ.max(MAX_EXPANSION.saturating_mul(bytes.len())) / size_of::<f64>();
        let most_schemas = ALWAYS_SCHEMAS.max(MAX_SCHEMA_EXPANSION.saturating_mul(bytes.len()));
        let mut log = Self {
            topics: Vec::new(),
            left_out: Vec::new(),
            targets: HashMap::new(),
            decoders: HashMap::new(),
            room: Room::new(most),
            messages: 0,
            orphans: 0,
            damaged: None,
            is_closed: false,
        };
        let mut records = LogRecords::new(bytes).ok_or("the file does not begin as an MCAP file does")?;
        for record in &mut records {
            match record {
                Record::Schema { header, data } if catalogue.size.saturating_add(data.len()) <= most_schemas => {
                    let size = &mut catalogue.size;
                    catalogue.schemas.entry(header.id).or_insert_with(|| {
                        *size += data.len();
                        Schema { name: header.name, encoding: header.encoding, data: data.into_owned() }
                    });
                }
                Record::Channel(channel) => {
                    catalogue.channels.entry(channel.id).or_insert(channel);
                }
                Record::Message { header, data } => {
                    log.messages += 1;
                    log.add(header.channel_id, header.log_time, &data, catalogue);
                    if log.room.is_used_up() {
                        return Err(format!(
                            "the messages hold more than {most} numbers, far more than a log of {} bytes can; record again",
                            bytes.len()
                        ));
                    }
                }
                Record::Footer(_) => log.is_closed = true,
                _ => {}
            }
        }
        log.damaged = records.problem().map(|problem| (problem.to_owned(), records.damaged()));
        Ok(log)
    }

    /// Adds a message to its topic.
    fn add(&mut self, channel: u16, logged: u64, message: &[u8], catalogue: &Catalogue) {
        let target = match self.targets.get(&channel) {
            Some(target) => *target,
            None => {
                let Some(stated) = catalogue.channels.get(&channel) else {
                    self.orphans += 1;
                    return;
                };
                let target = self.open(stated, catalogue);
                self.targets.insert(channel, target);
                target
            }
        };
        let Target::Topic(at) = target else { return };
        let Topic { series, decoder, .. } = &mut self.topics[at];
        series.begin();
        match decoder.decode(message, series) {
            Ok(()) => series.keep(logged),
            Err(fault) => {
                series.discard();
                series.miss(super::shortened(&fault));
            }
        }
    }

    /// The topic of a channel. Channels that differ in nothing but their number, as after a restart of the recorder, are one topic.
    fn open(&mut self, channel: &Channel, catalogue: &Catalogue) -> Target {
        let alike = |topic: &Topic| {
            let other = &topic.channel;
            let of = |channel: &Channel| {
                catalogue.schemas.get(&channel.schema_id).map(|of| (&of.name, &of.encoding, &of.data))
            };
            other.topic == channel.topic
                && other.message_encoding == channel.message_encoding
                && of(other) == of(channel)
        };
        if let Some(at) = self.topics.iter().position(alike) {
            return Target::Topic(at);
        }
        let schema = catalogue.schemas.get(&channel.schema_id);
        let decoder = self
            .decoders
            .entry((channel.schema_id, channel.message_encoding.clone()))
            .or_insert_with(|| Decoder::new(&channel.message_encoding, schema).map(Rc::new))
            .clone()
            .and_then(|decoder| {
                if self.topics.len() < MAX_TOPICS { Ok(decoder) } else { Err(format!("{MAX_TOPICS} topics are read")) }
            });
        let same = self.topics.iter().filter(|topic| topic.channel.topic == channel.topic).count();
        let name = super::shortened(&channel.topic);
        let name = if same == 0 { name } else { format!("{name}#{}", same + 1) };
        match decoder {
            Ok(decoder) => {
                let series = Series::new(name, self.room.clone());
                self.topics.push(Topic { series, decoder, channel: channel.clone() });
                Target::Topic(self.topics.len() - 1)
            }
            Err(reason) => {
                self.left_out.push(format!("{name} ({})", super::shortened(&reason)));
                Target::Nowhere
            }
        }
    }

    /// Whether there is no message.
    pub(crate) fn is_empty(&self) -> bool {
        self.messages == 0
    }

    /// The encodings of the topics, as `JSON and Protobuf`.
    pub(crate) fn encodings(&self) -> String {
        let mut words: Vec<&str> = self.topics.iter().map(|topic| topic.decoder.words()).collect();
        words.sort_unstable();
        words.dedup();
        words.join(" and ")
    }

    /// Whether its end is there.
    pub(crate) fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// What of the file is damaged.
    pub(crate) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let Some((problem, count)) = &self.damaged {
            let pieces = if *count == 1 { "1 damaged piece" } else { &format!("{count} damaged pieces") };
            notes.push(format!("{pieces} of the log left out: {}", super::shortened(problem)));
        }
        if self.orphans > 0 {
            notes.push(format!("{} messages left out whose channel the log does not state", self.orphans));
        }
        notes
    }
}
