//! Recovers the complete parts of a log that was cut off.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Cursor};

use hyst_ident::record::LogRecords;
use mcap::records::{Metadata, Record};
use mcap::{Attachment, McapError};

use super::options;
use super::sink::into_io_error;

/// Returns a closed MCAP file with all complete records of `bytes`.
///
/// # Errors
/// When the bytes are not an MCAP file.
pub fn recovered(bytes: &[u8]) -> io::Result<Vec<u8>> {
    rewritten(bytes).map_err(into_io_error)
}

fn rewritten(bytes: &[u8]) -> Result<Vec<u8>, McapError> {
    let mut writer = options().create(Cursor::new(Vec::new()))?;
    let (mut schemas, mut channels) = (BTreeMap::from([(0, 0)]), BTreeMap::new());
    for record in LogRecords::new(bytes).ok_or(McapError::BadMagic)? {
        match record {
            Record::Schema { header, data } => {
                schemas.insert(header.id, writer.add_schema(&header.name, &header.encoding, &data)?);
            }
            Record::Channel(channel) => {
                if let Some(schema) = schemas.get(&channel.schema_id) {
                    let id =
                        writer.add_channel(*schema, &channel.topic, &channel.message_encoding, &channel.metadata)?;
                    channels.insert(channel.id, id);
                }
            }
            Record::Message { mut header, data } => {
                if let Some(id) = channels.get(&header.channel_id) {
                    header.channel_id = *id;
                    writer.write_to_known_channel(&header, &data)?;
                }
            }
            Record::Metadata(Metadata { name, metadata }) => writer.write_metadata(&Metadata { name, metadata })?,
            Record::Attachment { header, data, .. } => writer.attach(&Attachment {
                log_time: header.log_time,
                create_time: header.create_time,
                name: header.name,
                media_type: header.media_type,
                data: Cow::Borrowed(&data),
            })?,
            _ => {}
        }
    }
    writer.finish()?;
    Ok(writer.into_inner().into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{LoggedSample, RunInfo, RunLog};
    use hyst_hw::{Phase, Sample};
    use hyst_ident::record::OutputUnit;

    /// Returns a log of 20 samples in several chunks.
    fn log() -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let info = RunInfo { device: "test", output: OutputUnit::Newton, sample_rate_hz: 5.0, model: None };
        let mut log = RunLog::create(&path, &info).unwrap();
        for k in 0..20 {
            let sample = Sample {
                time_s: f64::from(k) * 0.2,
                drive_v: (f64::from(k) * 0.7).sin(),
                output: (f64::from(k) * 0.9).cos(),
                temperature_degc: Some(20.0 + f64::from(k)),
                load_n: None,
                force_n: None,
            };
            log.sample(&LoggedSample::new(0, Phase::Record, &sample, Some(0.5))).unwrap();
        }
        log.finish().unwrap();
        std::fs::read(path).unwrap()
    }

    fn messages(bytes: &[u8]) -> Vec<(u64, Vec<u8>)> {
        let read = mcap::MessageStream::new(bytes).unwrap().map(Result::unwrap);
        read.map(|message| (message.log_time, message.data.into_owned())).collect()
    }

    #[test]
    fn complete_chunks_are_recovered_wherever_the_log_is_cut() {
        let whole = log();
        let all = messages(&whole);
        let summary = mcap::Summary::read(&whole).unwrap().unwrap();
        let chunks: Vec<(u64, usize)> = summary
            .chunk_indexes
            .iter()
            .map(|c| (c.chunk_start_offset + c.chunk_length, summary.stream_chunk(&whole, c).unwrap().count()))
            .collect();
        assert_eq!(all.len(), 20);
        assert!(chunks.len() > 5, "{chunks:?}");
        for length in 0..=whole.len() {
            let cut = &whole[..length];
            if length < 8 {
                recovered(cut).expect_err("not an MCAP file");
                continue;
            }
            let again = recovered(cut).unwrap();
            let left = messages(&again);
            let safe: usize = chunks.iter().filter(|(end, _)| *end <= length as u64).map(|(_, count)| count).sum();
            assert!(left.len() >= safe, "{} of {safe} samples at {length} bytes", left.len());
            assert_eq!(left, all[..left.len()], "at {length} bytes");
            let summary = mcap::Summary::read(&again).unwrap().unwrap();
            assert_eq!(summary.stats.unwrap().message_count, left.len() as u64);
        }
        assert_eq!(messages(&recovered(&whole).unwrap()), all);
    }

    #[test]
    fn other_chunks_of_a_damaged_log_are_recovered() {
        let whole = log();
        let all = messages(&whole);
        let summary = mcap::Summary::read(&whole).unwrap().unwrap();
        for chunk in &summary.chunk_indexes {
            let inside = summary.stream_chunk(&whole, chunk).unwrap().count();
            // After the kind and the length of the record.
            let (from, to) =
                (chunk.chunk_start_offset as usize + 9, (chunk.chunk_start_offset + chunk.chunk_length) as usize);
            for at in from..to {
                // The first chunk holds the channel: if it is damaged, all samples are lost.
                let mut damaged = whole.clone();
                damaged[at] ^= 1 << (at % 8);
                let left = messages(&recovered(&damaged).unwrap());
                assert!(left.len() + inside >= all.len() || inside == 0, "{} left, byte {at}", left.len());
                assert!(left.iter().all(|message| all.contains(message)), "another sample, byte {at}");
            }
        }
    }
}
