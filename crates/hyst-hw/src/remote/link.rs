//! Requests to a device and their answers: sends a request again until its answer arrives.

use std::io;
use std::time::{Duration, Instant};

use super::error::RemoteError;
use super::line::Line;
use super::retransmit::Retransmit;
use crate::wire::{Ask, Deframer, FrameError, MAX_FRAME, Reply, Request, Tell, encode};

/// Longest wait for an answer, as a multiple of the first wait.
const MAX_BACKOFF: u32 = 8;
/// Minimum number of requests within the device's watchdog time.
///
/// A slower line sends as many as it can carry.
const MIN_REQUESTS_PER_SILENCE: u32 = 8;

/// Times of a request.
#[derive(Debug, Clone, Copy)]
pub(super) struct Timing {
    /// Time to wait for an answer before the request is sent again.
    pub(super) repeat: Duration,
    /// Watchdog time of the device.
    pub(super) silence: Duration,
    /// Time without an answer after which the device counts as lost.
    pub(super) lost: Duration,
}

/// The connection to a device: a line, and the numbers and times of the requests on it.
#[derive(Debug)]
pub(super) struct Link<L> {
    pub(super) line: L,
    /// Name of the line in messages.
    pub(super) name: String,
    deframer: Deframer,
    number: u32,
    /// Times at which the last request was sent and its answer arrived; `None` if ambiguous.
    pub(super) round_trip: Option<(Instant, Instant)>,
    /// Answer times on this line.
    retransmit: Retransmit,
    broken: u32,
    /// First error of the operating system on a lost connection. Later errors contain less information.
    gone: Option<(io::ErrorKind, String)>,
}

impl<L: Line> Link<L> {
    /// Returns the connection before the first request.
    pub(super) fn new(line: L, name: String, session: u32) -> Self {
        Self {
            line,
            name,
            deframer: Deframer::new(),
            // Answers to requests of an earlier program have other numbers.
            number: session.rotate_left(16),
            round_trip: None,
            retransmit: Retransmit::default(),
            broken: 0,
            gone: None,
        }
    }

    /// Returns the time since `then`, on the line's clock.
    pub(super) fn since(&mut self, then: Instant) -> Duration {
        self.line.now().saturating_duration_since(then)
    }

    /// Returns the error for an answer that does not match its request.
    pub(super) fn unexpected_answer(&self) -> RemoteError {
        RemoteError::Answer { line: self.name.clone() }
    }

    fn gone(&mut self, source: io::Error) -> RemoteError {
        let (kind, said) = self.gone.get_or_insert_with(|| (source.kind(), source.to_string()));
        RemoteError::Line { line: self.name.clone(), source: io::Error::new(*kind, said.clone()) }
    }

    /// Sends a request, repeatedly if necessary, and returns the answer.
    pub(super) fn ask(&mut self, ask: Ask, timing: Timing) -> Result<Tell, RemoteError> {
        self.number = self.number.wrapping_add(1);
        let request = Request { number: self.number, ask };
        let mut buffer = [0; MAX_FRAME];
        let frame = encode(&request, &mut buffer).map_err(|_| self.unexpected_answer())?;
        let began = self.line.now();
        let mut bytes = [0; 4096];
        let Timing { repeat: usual, silence, lost } = timing;
        let (mut repeat, mut asked) = (self.retransmit.first(usual, silence.min(lost) / 2), 0);
        // One request within the watchdog time is enough, so several are tried.
        let longest = (MAX_BACKOFF * repeat).min(silence / MIN_REQUESTS_PER_SILENCE).max(repeat);
        while self.since(began) < lost {
            // A zero ends an incomplete earlier frame.
            self.line.send(&[0]).and_then(|()| self.line.send(frame)).map_err(|source| self.gone(source))?;
            let sent = self.line.now();
            asked += 1;
            while let Some(patience) = repeat.checked_sub(self.since(sent)).filter(|d| !d.is_zero()) {
                let came = self.line.receive(&mut bytes, patience).map_err(|source| self.gone(source))?;
                let mut fresh = &bytes[..came];
                while let Some(reply) = self.deframer.next::<Reply>(&mut fresh) {
                    match reply {
                        Ok(reply) if reply.number == self.number => {
                            // If the request was sent twice, it is unknown which one was answered.
                            self.round_trip = (asked == 1).then(|| (sent, self.line.now()));
                            let took = self.since(began);
                            self.retransmit.answered(self.number, asked, took);
                            return Ok(reply.tell);
                        }
                        // A second answer to a request that was sent twice.
                        Ok(reply) => self.retransmit.answered_again(reply.number),
                        Err(FrameError::Message) if matches!(request.ask, Ask::Hello) => {
                            return Err(self.unexpected_answer());
                        }
                        Err(_) => self.broken += 1,
                    }
                }
            }
            // Wait longer each time, so that a slow line does not fill with requests.
            repeat = (2 * repeat).min(longest);
        }
        let advice = match request.ask {
            Ask::Hello if self.broken > 0 => {
                "other data arrives there: check the port, the baud rate and that the firmware speaks this protocol"
            }
            Ask::Hello => "check the port, the baud rate, that the device is powered and that no other program uses it",
            Ask::Emergency => {
                "ASSUME THAT NOTHING WAS STOPPED: switch the amplifier off, or press Ctrl-C in the terminal of the run; then check hystctl status"
            }
            _ => "a device that still runs ramps to rest by its watchdog; check the cable, then hystctl status",
        };
        let seconds = lost.as_secs_f64();
        Err(RemoteError::Silent { line: self.name.clone(), seconds, broken: self.broken, advice })
    }
}
