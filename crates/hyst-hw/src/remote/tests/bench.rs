//! A device in memory, behind a line that loses, changes, duplicates and reorders frames.

use std::collections::VecDeque;
use std::io;
use std::time::Duration;

use super::super::{Line, RemoteOptions};
use crate::wire::{Board, Deframer, Device, Identity, MAX_FRAME, Open, Request, Shown, Unit, encode};

/// An amplifier whose sensor shows half the voltage of the previous period.
///
/// It stores all output voltages.
#[derive(Debug, Default)]
pub(super) struct Echo {
    pub(super) volts: f32,
    pub(super) put_out: Vec<f32>,
}

impl Board for Echo {
    fn measure(&mut self) -> Shown {
        Shown { output: 0.5 * self.volts, temperature_degc: 20.0, load_n: 0.0 }
    }
    fn put_out(&mut self, volts: f32) {
        self.volts = volts;
        self.put_out.push(volts);
    }
}

pub(super) fn identity() -> Identity {
    Identity {
        name: b"echo".iter().copied().collect(),
        min_v: -10.0,
        max_v: 100.0,
        rest_v: 0.0,
        max_slew_v_per_s: 50_000.0,
        min_rate_hz: 1.0,
        max_rate_hz: 10_000.0,
        output: Unit::Micrometre,
        temperature: true,
        load: false,
        follows: false,
        queue: 0,
        model: 0,
    }
}

/// Random numbers for the faults of the line.
#[derive(Debug)]
pub(super) struct Luck(pub(super) u64);

impl Luck {
    /// Returns a random number below `n`.
    pub(super) fn below(&mut self, n: u64) -> u64 {
        // SplitMix64 (Steele, Lea and Flood 2014).
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % n
    }
}

/// A device and the line to it. Each `receive` advances the time.
pub(super) struct Bench {
    pub(super) device: Device<Open, 128, 0>,
    pub(super) board: Echo,
    deframer: Deframer,
    /// One frame in this number is faulty; none if zero.
    fault_interval: u64,
    luck: Luck,
    /// Delayed frames.
    late: Vec<Vec<u8>>,
    pub(super) answers: VecDeque<u8>,
    pub(super) cut: bool,
    /// Its clock has stopped: it answers, but does nothing else.
    pub(super) frozen: bool,
}

impl Bench {
    pub(super) fn new(fault_interval: u64, seed: u64) -> Self {
        Self {
            device: Device::new(identity(), Open),
            board: Echo::default(),
            deframer: Deframer::new(),
            fault_interval,
            luck: Luck(seed),
            late: Vec::new(),
            answers: VecDeque::new(),
            cut: false,
            frozen: false,
        }
    }

    pub(super) fn pass(&mut self, periods: u32) {
        let periods = if self.frozen { 0 } else { periods };
        (0..periods).for_each(|_| self.device.tick(&mut self.board));
    }

    /// Returns the bytes of a frame that arrive.
    pub(super) fn carried(&mut self, frame: &[u8]) -> Vec<u8> {
        let mut bytes = frame.to_vec();
        if self.fault_interval == 0 || self.luck.below(self.fault_interval) > 0 {
            return bytes;
        }
        let at = self.luck.below(bytes.len() as u64) as usize;
        match self.luck.below(6) {
            0 => bytes.clear(),
            1 => bytes[at] ^= 1 << self.luck.below(8),
            2 => bytes.truncate(at),
            3 => bytes.extend_from_slice(frame),
            4 => {
                // It arrives after a later frame, once or twice.
                self.late.push(bytes.clone());
                bytes.clear();
            }
            _ => drop(bytes.remove(at)),
        }
        if self.luck.below(2) == 0
            && let Some(late) = self.late.pop()
        {
            bytes.extend(late);
        }
        bytes
    }

    pub(super) fn take(&mut self, bytes: &[u8]) {
        let mut fresh = bytes;
        let mut deframer = self.deframer.clone();
        while let Some(request) = deframer.next::<Request>(&mut fresh) {
            let Ok(request) = request else { continue };
            let reply = self.device.answer(&request);
            let frame = encode(&reply, &mut [0; MAX_FRAME]).unwrap().to_vec();
            let carried = self.carried(&frame);
            self.answers.extend(carried);
        }
        self.deframer = deframer;
    }
}

impl Line for &mut Bench {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.cut {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let carried = if bytes.len() > 1 { self.carried(bytes) } else { bytes.to_vec() };
        self.take(&carried);
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        if self.cut {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        self.pass(3);
        if self.answers.is_empty() {
            std::thread::sleep(patience.min(Duration::from_micros(300)));
        }
        let n = bytes.len().min(self.answers.len());
        self.answers.drain(..n).zip(bytes).for_each(|(from, to)| *to = from);
        Ok(n)
    }
}

pub(super) fn options() -> RemoteOptions {
    RemoteOptions {
        repeat: Duration::from_millis(1),
        // The test controls the time, so the watchdog must not end the run.
        silence_s: 50.0,
        ..RemoteOptions::with_session(7)
    }
}

pub(super) fn wave(n: usize) -> Vec<f64> {
    (0..n).map(|k| 50.0 - 50.0 * (k as f64 * 0.01).cos()).collect()
}
