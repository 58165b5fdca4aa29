//! Frames of the protocol, of a CAN bus and of a CAN adapter.

use std::io;
use std::time::Duration;

use hyst_hw::wire::{
    Ask, Chunk, Deframer, Exchange, IsoTp, MAX_FRAME, MOST_SAMPLES, Measured, Reply, Request, State, Status, Tell,
    encode,
};
use hyst_hw::{Bus, Line, Slcan};

use super::random::Random;
use super::sealed::CRC;

fn status() -> Status {
    Status {
        state: State::Running,
        session: 1,
        tick: 9,
        present_v: 2.0,
        output: 0.4,
        received: 7,
        room: 50,
        measured: 6,
    }
}

/// Damaged frames of requests and replies.
pub(super) fn frames(random: &mut Random) {
    let mut stream = Vec::new();
    for number in 0..random.below(4) as u32 {
        let drives = (0..random.below(30)).map(|k| k as f32).collect();
        let ask = match random.below(3) {
            0 => Ask::Describe,
            1 => Ask::Exchange(Exchange { session: 1, heard: 2, first: 3, drives }),
            _ => Ask::Model(Chunk {
                offset: 0,
                total: 900,
                sum: random.number() as u32,
                bytes: random.bytes(200).into_iter().collect(),
            }),
        };
        stream.extend_from_slice(encode(&Request { number, ask }, &mut [0; MAX_FRAME]).expect("a frame"));
        let sample =
            Measured { tick: 1, drive_v: 2.0, output: 3.0, temperature_degc: 20.0, load_n: 0.0, force_n: Some(0.5) };
        let samples = std::iter::repeat_n(sample, random.below(MOST_SAMPLES + 1)).collect();
        let tell = Tell::Samples { status: status(), first: 0, samples };
        stream.extend_from_slice(encode(&Reply { number, tell }, &mut [0; MAX_FRAME]).expect("a frame"));
    }
    if random.once_in(2) {
        // A random payload with a valid checksum.
        let payload = random.bytes(60);
        let sum = CRC.checksum(&payload).to_le_bytes();
        let mut stuffed = vec![0; 100];
        let length = cobs::encode(&[payload, sum.to_vec()].concat(), &mut stuffed);
        stream.extend_from_slice(&stuffed[..=length]);
    }
    random.damage(&mut stream);
    stream.extend(random.bytes(20));
    let good = encode(&Request { number: 77, ask: Ask::Hello }, &mut [0; MAX_FRAME]).expect("a frame").to_vec();
    stream.push(0);
    stream.extend(good);
    let (mut requests, mut replies) = (Deframer::new(), Deframer::new());
    let mut last = None;
    for piece in stream.chunks(1 + random.below(200)) {
        let mut fresh = piece;
        while let Some(request) = requests.next::<Request>(&mut fresh) {
            last = Some(request);
        }
        let mut fresh = piece;
        while replies.next::<Reply>(&mut fresh).is_some() {}
    }
    assert_eq!(last, Some(Ok(Request { number: 77, ask: Ask::Hello })), "a valid frame is not received");
}

/// Frames of a CAN bus.
pub(super) fn can(random: &mut Random) {
    let fd = random.once_in(2);
    let (mut from, mut to) = (IsoTp::<MAX_FRAME>::new(fd), IsoTp::<MAX_FRAME>::new(fd));
    for _ in 0..random.below(4) {
        from.give_up();
        let _ = from.send(&random.bytes(MAX_FRAME + 20));
        for _ in 0..80 {
            let mut frame = match from.frame() {
                Some(frame) => frame.to_vec(),
                None if random.once_in(2) => break,
                None => random.bytes(64),
            };
            if random.once_in(6) {
                random.damage(&mut frame);
            }
            if let Some(message) = to.take(&frame) {
                assert!(message.len() <= MAX_FRAME);
            }
            while let Some(answer) = to.frame() {
                assert!(answer.len() <= 64);
                let mut answer = answer.to_vec();
                if random.once_in(6) {
                    random.damage(&mut answer);
                }
                let _ = from.take(&answer);
            }
        }
    }
    // After any damage, an intact message arrives.
    from.give_up();
    from.send(&[7; 100]).expect("no message is in transfer");
    let mut arrived = false;
    for _ in 0..40 {
        let Some(frame) = from.frame() else { break };
        arrived |= to.take(&frame) == Some(&[7; 100]);
        while let Some(answer) = to.frame() {
            let _ = from.take(&answer);
        }
    }
    assert!(arrived, "an intact message does not arrive");
}

/// A serial line from which these bytes arrive.
struct Received(Vec<u8>);

impl Line for Received {
    fn send(&mut self, _: &[u8]) -> io::Result<()> {
        Ok(())
    }
    fn receive(&mut self, bytes: &mut [u8], _: Duration) -> io::Result<usize> {
        if self.0.is_empty() {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let count = bytes.len().min(self.0.len());
        self.0.drain(..count).zip(bytes).for_each(|(from, to)| *to = from);
        Ok(count)
    }
}

/// Text of a CAN adapter.
pub(super) fn slcan(random: &mut Random) {
    let frames = [
        "t6a03010203\r",
        "T000006a1211ab\r",
        "z\r",
        "\x07",
        "d6a19000102030405060708090a0b\r",
        "b6a0F",
        "V1013\r",
        "t12380011223344556677\r",
    ];
    let mut text: Vec<u8> = (0..random.below(8)).flat_map(|_| random.of(&frames).bytes().collect::<Vec<_>>()).collect();
    random.damage(&mut text);
    text.extend(random.bytes(30));
    // Ends an unfinished line.
    text.extend_from_slice(b"\rt6a1207a5\r");
    let mut bus = Slcan::open(Received(text), 500_000).expect("it opens");
    let mut last = None;
    while let Ok(Some((id, data))) = bus.receive(Duration::from_secs(3600)) {
        assert!(data.len() <= 64);
        last = Some((id, data.to_vec()));
    }
    assert_eq!(last, Some((0x6a1, vec![0x07, 0xa5])), "a valid frame is not received");
}
