use super::*;
use std::io::Write;

fn record(kind: u8, body: &[u8]) -> Vec<u8> {
    [&[kind], (body.len() as u64).to_le_bytes().as_slice(), body].concat()
}

fn message(text: &str) -> Vec<u8> {
    record(op::MESSAGE, &[&[0; 22], text.as_bytes()].concat())
}

fn chunk(compression: &str, size: usize, sum: u32, packed: &[u8]) -> Vec<u8> {
    let name = (compression.len() as u32).to_le_bytes();
    let (size, length) = ((size as u64).to_le_bytes(), (packed.len() as u64).to_le_bytes());
    record(
        op::CHUNK,
        &[&[0; 16], size.as_slice(), &sum.to_le_bytes(), &name, compression.as_bytes(), &length, packed].concat(),
    )
}

fn lz4(bytes: &[u8]) -> Vec<u8> {
    let blocks = lz4_flex::frame::FrameInfo::new().block_size(lz4_flex::frame::BlockSize::Max64KB);
    let mut encoder = lz4_flex::frame::FrameEncoder::with_frame_info(blocks, Vec::new());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn messages(bytes: &[u8]) -> (Vec<String>, usize, Option<String>) {
    let mut records = LogRecords::new(bytes).unwrap();
    let texts = records.by_ref().filter_map(|record| match record {
        Record::Message { data, .. } => Some(String::from_utf8_lossy(&data).into_owned()),
        _ => None,
    });
    let texts = texts.collect();
    (texts, records.damaged(), records.problem().map(str::to_owned))
}

#[test]
fn chunks_of_every_compression_are_read() {
    let inside = [message("one"), message("two")].concat();
    let mut sum = flate2::Crc::new();
    sum.update(&inside);
    let sum = sum.sum();
    let zstd = zstd::encode_all(inside.as_slice(), 3).unwrap();
    let parts = [
        chunk("", inside.len(), sum, &inside),
        chunk("zstd", inside.len(), sum, &zstd),
        message("between"),
        chunk("lz4", inside.len(), 0, &lz4(&inside)),
    ];
    let bytes = [MAGIC, &parts.concat()].concat();
    let expected = ["one", "two", "one", "two", "between", "one", "two"].map(str::to_owned).to_vec();
    assert_eq!(messages(&bytes), (expected, 0, None));
    let wrong = [MAGIC, &chunk("zstd", inside.len(), sum ^ 1, &zstd), &message("after")].concat();
    assert_eq!(messages(&wrong), (vec!["after".to_owned()], 1, Some("the checksum of a chunk is wrong".to_owned())));
    let other = [MAGIC, &chunk("brotli", inside.len(), sum, &zstd)].concat();
    assert_eq!(messages(&other).1, 1);
}

#[test]
fn complete_records_of_a_truncated_chunk_are_read() {
    let inside: Vec<u8> = (0..200).flat_map(|k| message(&format!("message {k}"))).collect();
    for (name, packed) in
        [("", inside.clone()), ("lz4", lz4(&inside)), ("zstd", zstd::encode_all(inside.as_slice(), 3).unwrap())]
    {
        let bytes = [MAGIC, &chunk(name, inside.len(), 0, &packed)].concat();
        for length in MAGIC.len()..bytes.len() {
            let (texts, damaged, _) = messages(&bytes[..length]);
            assert!(damaged == 0 && texts.iter().enumerate().all(|(k, text)| *text == format!("message {k}")));
        }
        assert_eq!(messages(&bytes).0.len(), 200);
    }
    // Compressed bytes are in blocks. The complete blocks of a truncated chunk are read.
    let noise = |k: u32| k.wrapping_mul(2_654_435_761) ^ (k.wrapping_mul(k) << 7);
    let inside: Vec<u8> = (0..60_000).flat_map(|k| message(&format!("message {k} {}", noise(k)))).collect();
    let packed =
        [("", inside.clone()), ("lz4", lz4(&inside)), ("zstd", zstd::encode_all(inside.as_slice(), 3).unwrap())];
    for (name, packed) in packed {
        let bytes = [MAGIC, &chunk(name, inside.len(), 0, &packed)].concat();
        let count = messages(&bytes[..bytes.len() * 3 / 4]).0.len();
        assert!((30_000..60_000).contains(&count), "{name}: {count}");
    }
}

#[test]
fn a_chunk_that_unpacks_to_too_many_bytes_is_not_read() {
    let zeros = vec![0; 65 << 20];
    let packed = zstd::encode_all(zeros.as_slice(), 3).unwrap();
    let bytes = [MAGIC, &chunk("zstd", zeros.len(), 0, &packed), &message("after")].concat();
    let (texts, damaged, problem) = messages(&bytes);
    assert_eq!((texts.as_slice(), damaged), (["after".to_owned()].as_slice(), 1));
    assert!(problem.unwrap().ends_with("the limit is 67108864 bytes"));
    // A stated size that is too small does not bypass the limit.
    let bytes = [MAGIC, &chunk("zstd", 100, 0, &packed)].concat();
    assert_eq!(messages(&bytes).0.len(), 0);
    // Many chunks do not bypass it either.
    let zeros = &zeros[..9 * (4 << 20)];
    let one = chunk("zstd", zeros.len(), 0, &zstd::encode_all(zeros, 3).unwrap());
    assert_eq!(messages(&[MAGIC, &one, &one].concat()).1, 1);
}

#[test]
fn records_after_one_with_invalid_lengths_are_read() {
    let huge = u32::MAX.to_le_bytes();
    for kind in 0..=255 {
        for body in [[vec![1; 4], huge.repeat(12)].concat(), huge.repeat(20), vec![0; 40], vec![]] {
            for length in 0..=body.len() {
                let bytes = [MAGIC, &record(kind, &body[..length]), &message("after")].concat();
                assert_eq!(messages(&bytes).0.last().map(String::as_str), Some("after"));
            }
        }
    }
}

#[test]
fn a_list_of_offsets_may_end_within_a_pair() {
    // The parser reads the last pair to its end. It would then take the following bytes for a length and reserve
    // gigabytes.
    let (size, huge) = (3_u32.to_le_bytes(), u32::MAX.to_le_bytes().repeat(20));
    let body = [[0; 32].as_slice(), &size, &[0; 3], &[0; 7], &[0; 8], &huge].concat();
    assert!(!layout::fits(op::CHUNK_INDEX, &body));
    let whole = [[0; 32].as_slice(), &10_u32.to_le_bytes(), &[0; 10], &[0; 8], &[0; 4], &[0; 16]].concat();
    assert!(layout::fits(op::CHUNK_INDEX, &whole));
}
