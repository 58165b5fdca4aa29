//! Requests of every kind with implausible values, in damaged frames and among random bytes, to a device that also
//! follows references.

use hyst_hw::wire::{
    Ask, Chunk, Deframer, Device, Exchange, Fault, Follower, MAX_FRAME, MOST_CHUNK, Mode, Request, Start, State, Tell,
    encode, model_sum,
};

use super::board::{CheckedBoard, RATES_HZ, SLEW_V_PER_S, identity};
use super::random::Random;
use super::sealed;

type Servo = Device<Follower, 128, 4096>;

/// Watchdog times of a start; short ones keep the test fast.
const SILENCES_S: [f32; 3] = [0.01, 0.05, 0.2];

fn tick(device: &mut Servo, board: &mut CheckedBoard, periods: usize) {
    for _ in 0..periods {
        // The limit of a run is at most that of the device.
        board.step = SLEW_V_PER_S / device.rate_hz();
        device.tick(board);
    }
}

fn odd(random: &mut Random) -> f32 {
    *random.of(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, 1e-40, 0.0, -0.0, 12.0, 50.0, 101.0, -11.0])
}

fn start(random: &mut Random) -> Start {
    let valid = Start {
        session: random.below(4) as u32,
        mode: *random.of(&[Mode::Voltage, Mode::Reference]),
        rate_hz: *random.of(&[100.0, 500.0, RATES_HZ[1]]),
        low_v: *random.of(&[-10.0, 0.0]),
        high_v: *random.of(&[20.0, 100.0]),
        slew_v_per_s: *random.of(&[2000.0, SLEW_V_PER_S]),
        hottest_degc: *random.of(&[10.0, 50.0, f32::INFINITY]),
        error: *random.of(&[0.1, 100.0, f32::INFINITY]),
        silence_s: *random.of(&SILENCES_S),
        force: false,
    };
    match random.below(8) {
        0 => Start { rate_hz: *random.of(&[f32::NAN, 0.0, -5.0, 1e9]), ..valid },
        1 => Start { low_v: odd(random), high_v: odd(random), ..valid },
        2 => Start { slew_v_per_s: *random.of(&[f32::NAN, 0.0, -1.0, 1e9, f32::INFINITY]), ..valid },
        3 => Start { silence_s: *random.of(&[f32::NAN, 0.0, -1.0, 1e9, f32::INFINITY]), ..valid },
        4 => Start { hottest_degc: odd(random), error: odd(random), ..valid },
        _ => valid,
    }
}

/// Returns a chunk of a controller, in order or not.
fn chunk(random: &mut Random, recipe: &[u8]) -> Chunk {
    let total = if random.once_in(8) { random.number() as u32 } else { recipe.len() as u32 };
    let offset =
        if random.once_in(8) { random.below(6000) } else { random.below(recipe.len() / MOST_CHUNK + 1) * MOST_CHUNK };
    let sum = if random.once_in(8) { random.number() as u32 } else { model_sum(recipe) };
    let bytes = recipe.iter().skip(offset).take(MOST_CHUNK).copied().collect();
    Chunk { offset: if random.once_in(16) { random.number() as u32 } else { offset as u32 }, total, sum, bytes }
}

/// Returns the present fault or another one.
fn fault(device: &Servo, random: &mut Random) -> Fault {
    match device.state() {
        State::Fault(fault) if random.below(8) > 0 => fault,
        _ => *random.of(&[Fault::Silence, Fault::Emergency]),
    }
}

fn ask(random: &mut Random, device: &Servo, recipe: &[u8]) -> Ask {
    match random.below(16) {
        0 => Ask::Hello,
        1 => Ask::Describe,
        2 => Ask::Stop,
        3 => Ask::Emergency,
        4 | 5 => Ask::Clear(fault(device, random)),
        6 | 7 => Ask::Start(start(random)),
        8 | 9 => Ask::Model(chunk(random, recipe)),
        _ => {
            let status = device.status();
            let nearby = |random: &mut Random, x: u32| match random.below(12) {
                0 => random.number() as u32,
                n => x.wrapping_add(2).wrapping_sub((n / 3) as u32),
            };
            let drives = (0..random.below(20))
                .map(|_| if random.once_in(40) { odd(random) } else { random.between(0.0, 20.0) as f32 });
            let drives = drives.collect();
            let session = if random.once_in(8) { random.below(4) as u32 } else { status.session };
            Ask::Exchange(Exchange {
                session,
                heard: nearby(random, status.measured),
                first: nearby(random, status.received),
                drives,
            })
        }
    }
}

/// Random requests, and a valid run after them.
pub(super) fn case(random: &mut Random) {
    let mut recipe = sealed::recipe().0.to_vec();
    if random.once_in(4) {
        sealed::reseal_recipe(random, &mut recipe);
    }
    let (mut device, mut board) = (Servo::new(identity(true), Follower::new()), CheckedBoard::new());
    let (mut deframer, mut stream) = (Deframer::new(), Vec::new());
    if random.once_in(2) {
        // Load the controller, so that more cases follow references.
        for (k, part) in recipe.chunks(MOST_CHUNK).enumerate() {
            let (offset, total) = ((k * MOST_CHUNK) as u32, recipe.len() as u32);
            let ask =
                Ask::Model(Chunk { offset, total, sum: model_sum(&recipe), bytes: part.iter().copied().collect() });
            device.answer(&Request { number: 0, ask });
        }
    }
    for number in 0..10 + random.below(60) as u32 {
        let ask = ask(random, &device, &recipe);
        let mut frame = encode(&Request { number, ask }, &mut [0; MAX_FRAME]).expect("a frame").to_vec();
        match random.below(12) {
            0 => random.damage(&mut frame),
            1 => frame = random.bytes(40),
            2 => frame.extend(frame.clone()),
            _ => {}
        }
        stream.extend(frame);
        // They arrive in pieces.
        let piece = if random.once_in(3) { random.below(stream.len() + 1) } else { stream.len() };
        let arrived: Vec<u8> = stream.drain(..piece).collect();
        let mut fresh = &arrived[..];
        while let Some(request) = deframer.next::<Request>(&mut fresh) {
            let Ok(request) = request else { continue };
            let reply = device.answer(&request);
            encode(&reply, &mut [0; MAX_FRAME]).expect("every reply fits a frame");
        }
        tick(&mut device, &mut board, random.below(20));
    }
    valid_run(&mut device, &mut board);
}

/// After silence the device must be at rest, and the next host must be able to run it.
fn valid_run(device: &mut Servo, board: &mut CheckedBoard) {
    let rate_hz = device.rate_hz();
    let silence = SILENCES_S.iter().fold(0.0f32, |longest, s| longest.max(*s));
    tick(device, board, ((silence + 110.0 / 2000.0) * rate_hz) as usize + 30);
    assert_ne!(device.state(), State::Running, "the device runs without a host");
    assert_eq!(board.volts, 0.0, "the device is not at rest: {:?}", device.state());
    let reply = |device: &mut Servo, ask| device.answer(&Request { number: 1, ask }).tell;
    if let State::Fault(fault) = device.state() {
        assert!(matches!(reply(device, Ask::Clear(fault)), Tell::Status(status) if status.state == State::Idle));
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
    assert!(matches!(reply(device, Ask::Start(start)), Tell::Status(status) if status.state == State::Running));
    let drives = [10.0, 20.0, 30.0];
    let block = |heard, first, drives: &[f32]| {
        Ask::Exchange(Exchange { session: 99, heard, first, drives: drives.iter().copied().collect() })
    };
    reply(device, block(0, 0, &drives));
    tick(device, board, 5);
    let Tell::Samples { samples, .. } = reply(device, block(0, 3, &[])) else { panic!("no samples") };
    assert!(samples.iter().map(|sample| sample.drive_v).eq(drives), "{samples:?}");
    reply(device, Ask::Stop);
    tick(device, board, 20);
    assert_eq!((device.state(), board.volts), (State::Idle, 0.0));
}
