//! The line on the device's side, by the traits that drivers of boards implement: [`embedded_io`] for a serial port,
//! [`embedded_can`] for a bus. Nothing here waits: a main loop calls `poll` as often as it comes round.

use embedded_can::nb::Can;
use embedded_can::{ExtendedId, Frame, Id, StandardId};
use embedded_io::{Read, ReadReady, Write, WriteReady};

use super::device::{Control, Device};
use super::frame::{Deframer, MAX_FRAME, encode};
use super::iso_tp::{CanData, IsoTp};
use super::message::Request;

/// Bytes, or frames, that are looked at in one `poll`: a flood of them does not keep the clock waiting.
const MOST_AT_ONCE: usize = 64;
/// Largest identifier of 11 bits.
const MOST_STANDARD: u32 = 0x7ff;

/// Answers over a serial line.
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
    /// Nothing was said yet.
    pub const fn new() -> Self {
        Self { deframer: Deframer::new(), answer: [0; MAX_FRAME], length: 0, sent: 0 }
    }

    /// Sends what is to be sent and takes what has come, as far as `line` goes along at once. One answer at a time: while it goes out, requests
    /// wait in the line.
    ///
    /// # Errors
    /// Those of the line.
    pub fn poll<C, L, const Q: usize, const M: usize>(
        &mut self,
        device: &mut Device<C, Q, M>,
        line: &mut L,
    ) -> Result<(), L::Error>
    where
        C: Control,
        L: Read + ReadReady + Write + WriteReady,
    {
        for _ in 0..MOST_AT_ONCE {
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
            // What was changed on the way is asked again.
            if let Some(Ok(request)) = self.deframer.next::<Request>(&mut &byte[..]) {
                self.length = encode(&device.answer(&request), &mut self.answer).map_or(0, <[u8]>::len);
                self.sent = 0;
            }
        }
        Ok(())
    }
}

/// Answers over a CAN bus of classic frames, by ISO-TP.
#[derive(Debug)]
pub struct CanServer {
    tp: IsoTp<MAX_FRAME>,
    deframer: Deframer,
    /// Identifier of the frames that this device hears, and of those that it sends.
    hears: u32,
    speaks: Option<Id>,
    /// Number of the request that is being answered.
    answers: u32,
    /// A frame for which the bus had no room.
    held: Option<CanData>,
}

impl CanServer {
    /// A device that hears frames with one identifier and sends them with another one.
    pub fn new(hears: u32, speaks: u32) -> Self {
        Self { tp: IsoTp::new(false), deframer: Deframer::new(), hears, speaks: id(speaks), answers: 0, held: None }
    }

    /// As [`SerialServer::poll`].
    ///
    /// # Errors
    /// Those of the bus.
    pub fn poll<C, B, const Q: usize, const M: usize>(
        &mut self,
        device: &mut Device<C, Q, M>,
        bus: &mut B,
    ) -> Result<(), B::Error>
    where
        C: Control,
        B: Can,
    {
        for _ in 0..MOST_AT_ONCE {
            let spoke = self.speak(bus)?;
            let frame = match bus.receive() {
                Ok(frame) => frame,
                Err(nb::Error::WouldBlock) if spoke => continue,
                Err(nb::Error::WouldBlock) => return Ok(()),
                Err(nb::Error::Other(error)) => return Err(error),
            };
            if number(frame.id()) != self.hears || frame.is_remote_frame() {
                continue;
            }
            let Some(mut message) = self.tp.take(frame.data()) else { continue };
            if let Some(Ok(request)) = self.deframer.next::<Request>(&mut message) {
                // Asked again while its answer is on the way: on a slow bus that is no reason to begin anew.
                if self.tp.busy() && !self.tp.waits() && request.number == self.answers {
                    continue;
                }
                self.answers = request.number;
                let reply = device.answer(&request);
                let mut bytes = [0; MAX_FRAME];
                if let Ok(answer) = encode(&reply, &mut bytes) {
                    // A host that asks again has not got the last answer.
                    self.tp.give_up();
                    let _ = self.tp.send(answer);
                }
            }
        }
        Ok(())
    }

    /// Sends the next frame, if there is one and the bus takes it. Gives whether it did.
    fn speak<B: Can>(&mut self, bus: &mut B) -> Result<bool, B::Error> {
        let Some(data) = self.held.take().or_else(|| self.tp.frame()) else { return Ok(false) };
        let Some(frame) = self.speaks.and_then(|id| B::Frame::new(id, &data)) else { return Ok(false) };
        match bus.transmit(&frame) {
            Ok(None) => Ok(true),
            // Another one had to give way, and is sent again.
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
    if number <= MOST_STANDARD {
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
