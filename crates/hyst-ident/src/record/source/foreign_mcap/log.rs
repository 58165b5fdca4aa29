//! The topics of a file with the numbers of their messages.

use std::collections::HashMap;
use std::rc::Rc;

use mcap::records::{Channel, Record};

use crate::record::log::LogRecords;

use super::budget::Budget;
use super::decoder::{Decoder, Schema};
use super::series::Series;

/// Largest number of topics of one file. Further topics are not read.
const MAX_TOPICS: usize = 1024;
/// Size up to which the columns may always grow \[bytes\].
const ALWAYS_READ: usize = 64 << 20;
/// Largest ratio of the size of larger columns to the size of the file.
const MAX_EXPANSION: usize = 200;
/// Size up to which schemas are always read \[bytes\]. A parsed schema takes about forty times its size.
const ALWAYS_SCHEMAS: usize = 4 << 20;
/// Largest ratio of the size of larger schemas to the size of the file.
const MAX_SCHEMA_EXPANSION: usize = 20;

/// A topic that is read.
#[derive(Debug)]
pub(crate) struct Topic {
    pub(crate) series: Series,
    pub(crate) decoder: Rc<Decoder>,
    channel: Channel,
}

/// The topic that the messages of a channel belong to.
#[derive(Clone, Copy, Debug)]
enum Target {
    Topic(usize),
    Nowhere,
}

/// The contents of a file.
#[derive(Debug)]
pub(crate) struct Log {
    /// The topics in the order of their first messages.
    pub(crate) topics: Vec<Topic>,
    /// Topics that are not read, with the reason.
    pub(crate) left_out: Vec<String>,
    targets: HashMap<u16, Target>,
    decoders: HashMap<(u16, String), Result<Rc<Decoder>, String>>,
    budget: Budget,
    messages: usize,
    /// Number of messages whose channel is not known.
    orphans: usize,
    /// The problem of the first damaged record, and the number of damaged records.
    damaged: Option<(String, usize)>,
    is_closed: bool,
}

/// The schemas and channels of a file. They are before the messages and again at the end.
#[derive(Debug, Default)]
struct Catalogue {
    schemas: HashMap<u16, Schema>,
    channels: HashMap<u16, Channel>,
    /// Size of the schemas \[bytes\].
    size: usize,
}

impl Log {
    /// Reads all messages.
    ///
    /// # Errors
    /// If the file is not an MCAP file, or has far more numbers than its size allows.
    pub(crate) fn read(bytes: &[u8]) -> Result<Self, String> {
        let mut catalogue = Catalogue::default();
        let log = Self::pass(bytes, &mut catalogue)?;
        // If the chunk with a channel is damaged, the channel is found at the end of the file, and a second pass reads
        // its messages.
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
            budget: Budget::new(most),
            messages: 0,
            orphans: 0,
            damaged: None,
            is_closed: false,
        };
        let mut records = LogRecords::new(bytes).ok_or("the file does not begin like an MCAP file")?;
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
                    if log.budget.is_used_up() {
                        return Err(format!(
                            "the messages hold more than {most} numbers, far more than a log of {} bytes can hold; record again",
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
                series.miss(super::words::shortened(&fault));
            }
        }
    }

    /// Returns the topic of a channel.
    ///
    /// Channels that differ only in their number, for example after a restart of the recorder, are one topic.
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
                if self.topics.len() < MAX_TOPICS {
                    Ok(decoder)
                } else {
                    Err(format!("only {MAX_TOPICS} topics are read"))
                }
            });
        let same = self.topics.iter().filter(|topic| topic.channel.topic == channel.topic).count();
        let name = super::words::shortened(&channel.topic);
        let name = if same == 0 { name } else { format!("{name}#{}", same + 1) };
        match decoder {
            Ok(decoder) => {
                let series = Series::new(name, self.budget.clone());
                self.topics.push(Topic { series, decoder, channel: channel.clone() });
                Target::Topic(self.topics.len() - 1)
            }
            Err(reason) => {
                self.left_out.push(format!("{name} ({})", super::words::shortened(&reason)));
                Target::Nowhere
            }
        }
    }

    /// Returns whether there is no message.
    pub(crate) fn is_empty(&self) -> bool {
        self.messages == 0
    }

    /// Returns the encodings of the topics, such as `JSON and Protobuf`.
    pub(crate) fn encodings(&self) -> String {
        let mut words: Vec<&str> = self.topics.iter().map(|topic| topic.decoder.words()).collect();
        words.sort_unstable();
        words.dedup();
        words.join(" and ")
    }

    /// Returns whether the end of the file is present.
    pub(crate) fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// Returns notes on damaged parts of the file.
    pub(crate) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let Some((problem, count)) = &self.damaged {
            let pieces = if *count == 1 { "1 damaged piece" } else { &format!("{count} damaged pieces") };
            notes.push(format!("{pieces} of the log left out: {}", super::words::shortened(problem)));
        }
        if self.orphans > 0 {
            notes.push(format!("{} messages left out: their channel is not in the log", self.orphans));
        }
        notes
    }
}
