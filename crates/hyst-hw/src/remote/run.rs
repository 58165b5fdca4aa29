//! A run as the host knows it: the drives that the device has received and the samples that have arrived.

use crate::daq::Sample;
use crate::wire::{Exchange, Identity, MOST_DRIVES, Measured};

/// Time by which drives are sent ahead \[s\].
///
/// It bridges short delays of the host, and is short enough for a quick stop.
const LOOKAHEAD_S: f64 = 0.25;

/// State of a run on the host.
#[derive(Debug, Clone, Copy)]
pub(super) struct Run {
    session: u32,
    pub(super) rate_hz: f64,
    /// Number of drives that the device has received.
    pub(super) sent: u32,
    /// Number of samples that have arrived.
    pub(super) heard: u32,
    /// Number of the first drive for which the device has no room.
    pub(super) room: u32,
    /// Maximum number of drives that wait on the device. It bounds the delay of a change of the drive.
    lookahead: u32,
    /// Periods since the run began. The device's own count wraps at 2³².
    ticks: u64,
}

impl Run {
    /// Returns the state at the begin of a run; `room` is the number of the first drive for which the device has no
    /// room.
    pub(super) fn new(session: u32, rate_hz: f64, room: u32) -> Self {
        let lookahead = (LOOKAHEAD_S * rate_hz).ceil().clamp(8.0, 1e6) as u32;
        Self { session, rate_hz, sent: 0, heard: 0, room, lookahead, ticks: 0 }
    }

    /// Returns the next exchange, with those drives of `drive_v` that may be sent now.
    pub(super) fn next_exchange(&self, drive_v: &[f64]) -> Exchange {
        let ahead = self.lookahead.saturating_sub(self.sent.wrapping_sub(self.heard));
        let free = self.room.saturating_sub(self.sent).min(ahead) as usize;
        let drives = drive_v.iter().take(free.min(MOST_DRIVES)).map(|v| *v as f32).collect();
        Exchange { session: self.session, heard: self.heard, first: self.sent, drives }
    }

    /// Returns the full period count, from the known periods and the device's 32-bit count.
    pub(super) fn periods(&self, tick: u32) -> u64 {
        self.ticks + u64::from(tick.wrapping_sub(self.ticks as u32))
    }

    /// Appends samples that follow the last one; returns whether there is no gap.
    pub(super) fn append_samples(
        &mut self,
        identity: &Identity,
        first: u32,
        samples: &[Measured],
        measured: &mut Vec<Sample>,
    ) -> bool {
        let Some(known) = self.heard.checked_sub(first) else { return samples.is_empty() };
        for sample in samples.iter().skip(known as usize) {
            self.heard = self.heard.wrapping_add(1);
            self.ticks = self.periods(sample.tick);
            let has = |there: bool, value: f32| there.then_some(f64::from(value));
            measured.push(Sample {
                time_s: self.ticks as f64 / self.rate_hz,
                drive_v: f64::from(sample.drive_v),
                output: f64::from(sample.output),
                temperature_degc: has(identity.temperature, sample.temperature_degc),
                load_n: has(identity.load, sample.load_n),
                force_n: sample.force_n.map(f64::from),
            });
        }
        true
    }
}
