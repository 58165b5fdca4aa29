//! Requests of every kind with odd values, in frames that are damaged, among bytes that are none, to a device that follows references too.

use hyst_hw::wire::{
    Ask, Chunk, Deframer, Device, Exchange, Fault, Follower, MAX_FRAME, MOST_CHUNK, Mode, Request, Start, State, Tell,
    encode, model_sum,
};

use super::inputs;
use super::luck::Luck;
use super::watched::{RATES_HZ, SLEW_V_PER_S, Watched, identity};

type Servo = Device<Follower, 128, 4096>;

/// As few periods of the longest silence that a start may ask for here.
const SILENCES_S: [f32; 3] = [0.01, 0.05, 0.2];

fn tick(device: &mut Servo, board: &mut Watched, periods: usize) {
    for _ in 0..periods {
        // What a run may do at most is what the device may.
        board.step = SLEW_V_PER_S / device.rate_hz();
        device.tick(board);
    }
}

fn odd(luck: &mut Luck) -> f32 {
    *luck.of(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, 1e-40, 0.0, -0.0, 12.0, 50.0, 101.0, -11.0])
}

fn start(luck: &mut Luck) -> Start {
    let sound = Start {
        session: luck.below(4) as u32,
        mode: *luck.of(&[Mode::Voltage, Mode::Reference]),
        rate_hz: *luck.of(&[100.0, 500.0, RATES_HZ[1]]),
        low_v: *luck.of(&[-10.0, 0.0]),
        high_v: *luck.of(&[20.0, 100.0]),
        slew_v_per_s: *luck.of(&[2000.0, SLEW_V_PER_S]),
        hottest_degc: *luck.of(&[10.0, 50.0, f32::INFINITY]),
        error: *luck.of(&[0.1, 100.0, f32::INFINITY]),
        silence_s: *luck.of(&SILENCES_S),
        force: false,
    };
    match luck.below(8) {
        0 => Start { rate_hz: *luck.of(&[f32::NAN, 0.0, -5.0, 1e9]), ..sound },
        1 => Start { low_v: odd(luck), high_v: odd(luck), ..sound },
        2 => Start { slew_v_per_s: *luck.of(&[f32::NAN, 0.0, -1.0, 1e9, f32::INFINITY]), ..sound },
        3 => Start { silence_s: *luck.of(&[f32::NAN, 0.0, -1.0, 1e9, f32::INFINITY]), ..sound },
        4 => Start { hottest_degc: odd(luck), error: odd(luck), ..sound },
        _ => sound,
    }
}

/// Parts of a controller, one after the other or not.
fn chunk(luck: &mut Luck, recipe: &[u8]) -> Chunk {
    let total = if luck.once_in(8) { luck.number() as u32 } else { recipe.len() as u32 };
    let offset =
        if luck.once_in(8) { luck.below(6000) } else { luck.below(recipe.len() / MOST_CHUNK + 1) * MOST_CHUNK };
    let sum = if luck.once_in(8) { luck.number() as u32 } else { model_sum(recipe) };
    let bytes = recipe.iter().skip(offset).take(MOST_CHUNK).copied().collect();
    Chunk { offset: if luck.once_in(16) { luck.number() as u32 } else { offset as u32 }, total, sum, bytes }
}

/// The fault that is there, or another.
fn fault(device: &Servo, luck: &mut Luck) -> Fault {
    match device.state() {
        State::Fault(fault) if luck.below(8) > 0 => fault,
        _ => *luck.of(&[Fault::Silence, Fault::Emergency]),
    }
}

fn ask(luck: &mut Luck, device: &Servo, recipe: &[u8]) -> Ask {
    match luck.below(16) {
        0 => Ask::Hello,
        1 => Ask::Describe,
        2 => Ask::Stop,
        3 => Ask::Emergency,
        4 | 5 => Ask::Clear(fault(device, luck)),
        6 | 7 => Ask::Start(start(luck)),
        8 | 9 => Ask::Model(chunk(luck, recipe)),
        _ => {
            let status = device.status();
            let near = |luck: &mut Luck, x: u32| match luck.below(12) {
                0 => luck.number() as u32,
                n => x.wrapping_add(2).wrapping_sub((n / 3) as u32),
            };
            let drives =
                (0..luck.below(20)).map(|_| if luck.once_in(40) { odd(luck) } else { luck.between(0.0, 20.0) as f32 });
            let drives = drives.collect();
            let session = if luck.once_in(8) { luck.below(4) as u32 } else { status.session };
            Ask::Exchange(Exchange {
                session,
                heard: near(luck, status.measured),
                first: near(luck, status.received),
                drives,
            })
        }
    }
}

/// Bytes by chance, and after them a sound run.
pub(super) fn case(luck: &mut Luck) {
    let mut recipe = inputs::recipe().0.to_vec();
    if luck.once_in(4) {
        inputs::reseal_recipe(luck, &mut recipe);
    }
    let (mut device, mut board) = (Servo::new(identity(true), Follower::new()), Watched::new());
    let (mut deframer, mut stream) = (Deframer::new(), Vec::new());
    if luck.once_in(2) {
        // So that references are followed more often than by luck.
        for (k, part) in recipe.chunks(MOST_CHUNK).enumerate() {
            let (offset, total) = ((k * MOST_CHUNK) as u32, recipe.len() as u32);
            let ask =
                Ask::Model(Chunk { offset, total, sum: model_sum(&recipe), bytes: part.iter().copied().collect() });
            device.answer(&Request { number: 0, ask });
        }
    }
    for number in 0..10 + luck.below(60) as u32 {
        let ask = ask(luck, &device, &recipe);
        let mut frame = encode(&Request { number, ask }, &mut [0; MAX_FRAME]).expect("a frame").to_vec();
        match luck.below(12) {
            0 => luck.damage(&mut frame),
            1 => frame = luck.bytes(40),
            2 => frame.extend(frame.clone()),
            _ => {}
        }
        stream.extend(frame);
        // They come in pieces.
        let piece = if luck.once_in(3) { luck.below(stream.len() + 1) } else { stream.len() };
        let arrived: Vec<u8> = stream.drain(..piece).collect();
        let mut fresh = &arrived[..];
        while let Some(request) = deframer.next::<Request>(&mut fresh) {
            let Ok(request) = request else { continue };
            let reply = device.answer(&request);
            encode(&reply, &mut [0; MAX_FRAME]).expect("every answer is a frame");
        }
        tick(&mut device, &mut board, luck.below(20));
    }
    sound_again(&mut device, &mut board);
}

/// Silence brings it to rest, and the next host finds a device that runs.
fn sound_again(device: &mut Servo, board: &mut Watched) {
    let rate_hz = device.rate_hz();
    let silence = SILENCES_S.iter().fold(0.0f32, |most, s| most.max(*s));
    tick(device, board, ((silence + 110.0 / 2000.0) * rate_hz) as usize + 30);
    assert_ne!(device.state(), State::Running, "it runs without a host");
    assert_eq!(board.volts, 0.0, "it is not at rest: {:?}", device.state());
    let told = |device: &mut Servo, ask| device.answer(&Request { number: 1, ask }).tell;
    if let State::Fault(fault) = device.state() {
        assert!(matches!(told(device, Ask::Clear(fault)), Tell::Status(status) if status.state == State::Idle));
    }
    let start = Start {
        session: 99,
        mode: Mode::Voltage,
        rate_hz: 1000.0,
        low_v: 0.0,
        high_v: 100.0,
        slew_v_per_s: 50_000.0,
        hottest_degc: f32::INFINITY,
        error: f32::INFINITY,
        silence_s: 1.0,
        force: false,
    };
    assert!(matches!(told(device, Ask::Start(start)), Tell::Status(status) if status.state == State::Running));
    let drives = [10.0, 20.0, 30.0];
    let block = |heard, first, drives: &[f32]| {
        Ask::Exchange(Exchange { session: 99, heard, first, drives: drives.iter().copied().collect() })
    };
    told(device, block(0, 0, &drives));
    tick(device, board, 5);
    let Tell::Samples { samples, .. } = told(device, block(0, 3, &[])) else { panic!("no samples") };
    assert!(samples.iter().map(|sample| sample.drive_v).eq(drives), "{samples:?}");
    told(device, Ask::Stop);
    tick(device, board, 20);
    assert_eq!((device.state(), board.volts), (State::Idle, 0.0));
}
