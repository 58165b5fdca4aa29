//! The line on the device's side.
//!
//! It uses the common driver traits: [`embedded_io`] for a serial port, [`embedded_can`] for a CAN bus. Nothing here
//! blocks: the main loop calls `poll` in each pass.

use embedded_can::nb::Can;
use embedded_can::{ExtendedId, Frame, Id, StandardId};
use embedded_io::{Read, ReadReady, Write, WriteReady};

use super::control::Control;
use super::device::Device;
use super::frame::{Deframer, MAX_FRAME, encode};
use super::iso_tp::{CanData, IsoTp};
use super::message::Request;

/// Maximum number of bytes or frames in one `poll`, so that many of them do not delay the clock.
const MAX_PER_POLL: usize = 64;
/// Largest standard identifier (11 bits).
const MAX_STANDARD_ID: u32 = 0x7ff;

/// Answers requests over a serial line.
#[derive(Debug)]
pub struct SerialServer {
    deframer: Deframer,
    answer: [u8; MAX_FRAME],
    length: usize,
    sent: usize,
}

impl Default for SerialServer {
    fn default() -> Self {
        Self::new()
    }
}

impl SerialServer {
    /// Returns a server without received bytes.
    pub const fn new() -> Self {
        Self { deframer: Deframer::new(), answer: [0; MAX_FRAME], length: 0, sent: 0 }
    }

    /// Sends the pending answer and reads requests, as far as `line` is ready.
    ///
    /// While an answer is being sent, requests wait in the line.
    ///
    /// # Errors
    /// The errors of the line.
    pub fn poll<C, L, const Q: usize, const M: usize>(
        &mut self,
        device: &mut Device<C, Q, M>,
        line: &mut L,
    ) -> Result<(), L::Error>
    where
        C: Control,
        L: Read + ReadReady + Write + WriteReady,
    {
        for _ in 0..MAX_PER_POLL {
            let rest = self.answer.get(self.sent..self.length).unwrap_or_default();
            if !rest.is_empty() {
                if !line.write_ready()? {
                    return Ok(());
                }
                self.sent += line.write(rest)?;
                continue;
            }
            let mut byte = [0];
            if !line.read_ready()? || line.read(&mut byte)? == 0 {
                return Ok(());
            }
            // The host repeats a damaged request.
            if let Some(Ok(request)) = self.deframer.next::<Request>(&mut &byte[..]) {
                self.length = encode(&device.answer(&request), &mut self.answer).map_or(0, <[u8]>::len);
                self.sent = 0;
            }
        }
        Ok(())
    }
}

/// Answers requests over a CAN bus with classic frames, by ISO-TP.
#[derive(Debug)]
pub struct CanServer {
    tp: IsoTp<MAX_FRAME>,
    deframer: Deframer,
    /// Identifiers of the frames that this device receives and sends.
    receive_id: u32,
    send_id: Option<Id>,
    /// Number of the request whose answer is being sent.
    answered_number: u32,
    /// A frame that the controller did not accept.
    held: Option<CanData>,
}

impl CanServer {
    /// Returns a server that receives frames with one identifier and sends frames with another one.
    pub fn new(receive_id: u32, send_id: u32) -> Self {
        Self {
            tp: IsoTp::new(false),
            deframer: Deframer::new(),
            receive_id,
            send_id: id(send_id),
            answered_number: 0,
            held: None,
        }
    }

    /// Sends the pending answer and reads requests, like [`SerialServer::poll`].
    ///
    /// # Errors
    /// The errors of the bus.
    pub fn poll<C, B, const Q: usize, const M: usize>(
        &mut self,
        device: &mut Device<C, Q, M>,
        bus: &mut B,
    ) -> Result<(), B::Error>
    where
        C: Control,
        B: Can,
    {
        for _ in 0..MAX_PER_POLL {
            let frame_sent = self.send_frame(bus)?;
            let frame = match bus.receive() {
                Ok(frame) => frame,
                Err(nb::Error::WouldBlock) if frame_sent => continue,
                Err(nb::Error::WouldBlock) => return Ok(()),
                Err(nb::Error::Other(error)) => return Err(error),
            };
            if number(frame.id()) != self.receive_id || frame.is_remote_frame() {
                continue;
            }
            let Some(mut message) = self.tp.take(frame.data()) else { continue };
            if let Some(Ok(request)) = self.deframer.next::<Request>(&mut message) {
                // The request is repeated while its answer is being sent: on a slow bus, continue with that answer.
                if self.tp.busy() && !self.tp.waits() && request.number == self.answered_number {
                    continue;
                }
                self.answered_number = request.number;
                let reply = device.answer(&request);
                let mut bytes = [0; MAX_FRAME];
                if let Ok(answer) = encode(&reply, &mut bytes) {
                    // The host did not receive the last answer, or does not need it.
                    self.tp.give_up();
                    let _ = self.tp.send(answer);
                }
            }
        }
        Ok(())
    }

    /// Sends the next frame, if any; returns whether the controller accepted it.
    fn send_frame<B: Can>(&mut self, bus: &mut B) -> Result<bool, B::Error> {
        let Some(data) = self.held.take().or_else(|| self.tp.frame()) else { return Ok(false) };
        let Some(frame) = self.send_id.and_then(|id| B::Frame::new(id, &data)) else { return Ok(false) };
        match bus.transmit(&frame) {
            Ok(None) => Ok(true),
            // The controller dropped another frame for this one; send that one again.
            Ok(Some(displaced)) => {
                self.held = CanData::from_slice(displaced.data()).ok();
                Ok(true)
            }
            Err(nb::Error::WouldBlock) => {
                self.held = Some(data);
                Ok(false)
            }
            Err(nb::Error::Other(error)) => Err(error),
        }
    }
}

fn id(number: u32) -> Option<Id> {
    if number <= MAX_STANDARD_ID {
        StandardId::new(number as u16).map(Id::Standard)
    } else {
        ExtendedId::new(number).map(Id::Extended)
    }
}

fn number(id: Id) -> u32 {
    match id {
        Id::Standard(id) => id.as_raw().into(),
        Id::Extended(id) => id.as_raw(),
    }
}
