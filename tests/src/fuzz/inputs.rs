//! Everything that reads external bytes: frames, CAN, controllers, models, records, logs, plants.

use std::io;
use std::sync::OnceLock;
use std::time::Duration;

use hyst_cli::log::{LoggedModel, LoggedSample, RunInfo, RunLog, recovered};
use hyst_core::{List, read_block};
use hyst_hw::wire::{
    Ask, Chunk, Control, Deframer, Exchange, Follower, IsoTp, MAX_FRAME, MOST_SAMPLES, Measured, Reply, Request, Shown,
    State, Status, Tell, encode, lateness, read_recipe,
};
use hyst_hw::{Bus, Line, Phase, Plant, PlantConfig, Sample, Slcan};
use hyst_ident::export::block;
use hyst_ident::model::Model;
use hyst_ident::record::{self, ColumnMap, Need, Record};

use super::random::Random;
use crate::controller::controller;
use crate::{PLANT, WARM, root};

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Returns the bytes of a controller with a valid checksum of its head.
fn with_check_sum(head: &[u8], block: &[u8]) -> Vec<u8> {
    [head, &CRC.checksum(head).to_le_bytes(), block].concat()
}

/// Returns a controller that a device can run, and the offset of its model's block.
pub(super) fn recipe() -> (&'static [u8], usize) {
    static RECIPE: OnceLock<(Vec<u8>, usize)> = OnceLock::new();
    let (bytes, block) = RECIPE.get_or_init(|| {
        let parts = controller(0.1, 8, [0.0, 100.0]);
        (parts.concat(), parts[0].len())
    });
    (bytes, *block)
}

/// Offset of the numbers of a controller: after `HYCT`, version and flags.
const NUMBERS: usize = 4 + 2;

/// Changes the content of a controller and corrects its checksums.
pub(super) fn reseal_recipe(random: &mut Random, recipe: &mut Vec<u8>) {
    let offset = self::recipe().1;
    // The checksum of the head is directly before the block.
    let (mut head, mut block) = (recipe[..offset - 4].to_vec(), recipe[offset..].to_vec());
    if random.once_in(2) {
        odd_number(random, &mut head[NUMBERS..]);
    }
    if !random.once_in(3) {
        reseal_block(random, &mut block);
    }
    *recipe = with_check_sum(&head, &block);
}

/// Replaces one of the numbers of eight bytes by an implausible one.
fn odd_number(random: &mut Random, bytes: &mut [u8]) {
    let odd = [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e308, -1e308, 1e-320, 1e9, 65.0, -0.0];
    let places = bytes.len() / 8;
    if places > 0 {
        let at = 8 * random.below(places);
        bytes[at..at + 8].copy_from_slice(&random.of(&odd).to_le_bytes());
    }
}

/// Damages the parameters of a block and corrects its length and checksum.
fn reseal_block(random: &mut Random, bytes: &mut Vec<u8>) {
    let mut payload = bytes[9..bytes.len() - 4].to_vec();
    if random.once_in(2) && payload.len() > 16 {
        // The numbers are not aligned to eight bytes.
        let from = random.below(8);
        odd_number(random, &mut payload[from..]);
    } else {
        random.damage(&mut payload);
    }
    bytes.truncate(5);
    bytes.extend((payload.len() as u32).to_le_bytes());
    bytes.extend(payload);
    let sum = CRC.checksum(bytes).to_le_bytes();
    bytes.extend(sum);
}

/// Returns the models of the documentation, one of each kind.
fn models() -> &'static [String] {
    static MODELS: OnceLock<Vec<String>> = OnceLock::new();
    MODELS.get_or_init(|| {
        let folder = root().join("docs").join("models");
        let files = std::fs::read_dir(&folder).expect("the models of the documentation");
        let mut paths: Vec<_> = files.filter_map(|file| Some(file.ok()?.path())).collect();
        paths.retain(|path| path.extension().is_some_and(|ending| ending == "json"));
        paths.sort();
        let read = |path| std::fs::read_to_string(path).expect("a model");
        paths.into_iter().map(read).filter(|text| text.len() < 20_000).collect()
    })
}

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

/// Controllers, and a run with those that could be read.
pub(super) fn controllers(random: &mut Random) {
    let mut bytes = recipe().0.to_vec();
    match random.below(4) {
        0 => random.damage(&mut bytes),
        1 => bytes = random.bytes(200),
        _ => reseal_recipe(random, &mut bytes),
    }
    let period = *random.of(&[0.001f32, 0.002, 0.1, f32::NAN, 0.0, 1e-30, 1e30]);
    let _ = (read_recipe(&bytes), lateness(&bytes, period));
    let mut follower = Follower::new();
    if follower.load(&bytes) {
        let shown = Shown { output: 3.0, temperature_degc: 20.0, load_n: 0.0 };
        if follower.prepare(period, &shown, 20.0, true) {
            follower.begin(3.0, &shown, 20.0);
            for k in 0..20 {
                let _ = follower.step(3.0 + 0.1 * k as f32, &shown);
            }
            let _ = (follower.step(f32::NAN, &shown), follower.step(1e30, &shown), follower.due());
        }
    }
}

/// Parameter blocks of every kind of model.
pub(super) fn blocks(random: &mut Random) {
    static BLOCKS: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    let blocks = BLOCKS.get_or_init(|| {
        models().iter().filter_map(|text| block(&Model::parse("model.json", text).expect("a model")).ok()).collect()
    });
    let mut bytes = random.of(blocks).clone();
    if random.once_in(3) {
        random.damage(&mut bytes);
    } else {
        reseal_block(random, &mut bytes);
    }
    let _ = read_block::<List<64>, List<16>>(&bytes);
    let _ = read_block::<Vec<f64>, Vec<f64>>(&bytes);
}

/// Model files; a file that was read can be written and exported.
pub(super) fn model_files(random: &mut Random) {
    let mut text = random.of(models()).clone().into_bytes();
    random.damage(&mut text);
    let Ok(text) = String::from_utf8(text) else { return };
    if let Ok(model) = Model::parse("model.json", &text) {
        let _ = block(&model);
        Model::parse("again.json", &model.to_json()).expect("the written file can be read");
    }
}

/// Records as CSV.
pub(super) fn records(random: &mut Random) {
    let mut text = String::from("segment,time_s,voltage_v,displacement_um,temperature_degc\n");
    for k in 0..random.below(40) {
        text += &format!(
            "{},{},{:.3},{:e},22.5\n",
            k / 20,
            k as f64 * 0.002,
            random.between(0.0, 100.0),
            random.between(-5.0, 20.0)
        );
    }
    let mut bytes = text.into_bytes();
    random.damage(&mut bytes);
    if random.once_in(8) {
        bytes.splice(0..0, *b"\xef\xbb\xbf");
    }
    let need = *random.of(&[Need::InputAndOutput, Need::Input, Need::Output]);
    if let Ok(record) = Record::parse("a.csv", &bytes, &ColumnMap::default(), need) {
        assert!(record.time().iter().all(|t| t.is_finite()));
    }
}

/// Logs: read, converted, recovered.
pub(super) fn logs(random: &mut Random) {
    static LOG: OnceLock<Vec<u8>> = OnceLock::new();
    let log = LOG.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.mcap");
        let json = &models()[0];
        let model = Model::parse("model.json", json).expect("a model");
        let output = record::OutputUnit::Micrometre;
        let model = Some(LoggedModel { model: &model, json });
        let info = RunInfo { device: "fuzz", output, sample_rate_hz: 4.0, model };
        let mut log = RunLog::create(&path, &info).expect("a log");
        for k in 0..12 {
            let time_s = 0.25 * f64::from(k);
            let sample =
                Sample { time_s, drive_v: 1.5, output: 0.3, temperature_degc: Some(20.0), load_n: None, force_n: None };
            log.sample(&LoggedSample::new(0, Phase::Record, &sample, Some(0.25))).expect("it is written");
        }
        log.finish().expect("it is written");
        std::fs::read(path).expect("a log")
    });
    let mut bytes = log.clone();
    random.damage(&mut bytes);
    if let Ok(log) = record::RunLog::parse("run.mcap", &bytes) {
        let _ = log.csv("run.mcap", true);
    }
    if let Ok(whole) = recovered(&bytes) {
        // A log without its channel is not the log of a run.
        let _ = record::RunLog::parse("again.mcap", &whole).map(|log| assert!(!log.lost.cut_off));
    }
}

/// Sections of a plant description.
const SECTIONS: &str = "\
[creep]
strength = 0.05
tau_min_s = 0.05
tau_max_s = 80
[[mode]]
hz = 100
damping = 0.02
gain = 0.9
[saturation]
high_um = 12
[[disturbance]]
kind = \"slew-limit\"
v_per_s = 900
[[disturbance]]
kind = \"bursts\"
um = 0.1
seconds = 0.2
every_s = 3
";

/// Descriptions of simulated plants.
pub(super) fn plants(random: &mut Random) {
    let mut text = format!("{PLANT}{WARM}{SECTIONS}").into_bytes();
    random.damage(&mut text);
    let Ok(text) = String::from_utf8(text) else { return };
    if let Ok(config) = PlantConfig::from_toml(&text)
        && config.actuator.relays <= 2000
    {
        let _ = Plant::new(config);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Damage to an invalid description tests little.
    #[test]
    fn the_plant_is_valid_before_it_is_damaged() {
        let config = PlantConfig::from_toml(&format!("{PLANT}{WARM}{SECTIONS}")).unwrap();
        assert_eq!(config.disturbances.len(), 2);
        Plant::new(config).unwrap();
    }

    #[test]
    fn an_unchanged_controller_gets_its_own_check_sum() {
        let (bytes, block) = recipe();
        assert_eq!(with_check_sum(&bytes[..block - 4], &bytes[block..]), bytes);
        assert!(read_recipe(bytes).is_ok());
    }
}
