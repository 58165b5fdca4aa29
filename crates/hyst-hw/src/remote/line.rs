//! The interface of a line to a device.

use std::io::{self, ErrorKind};
use std::time::{Duration, Instant};

/// Shortest timeout that the operating systems support.
pub(super) const MIN_TIMEOUT: Duration = Duration::from_millis(1);

/// A line that carries bytes in both directions: a serial port, a socket, or the frames of a bus.
pub trait Line {
    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// If the connection is lost.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Waits for bytes for at most `patience` and returns how many were received; 0 is not an error.
    ///
    /// # Errors
    /// If the connection is lost.
    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize>;

    /// Returns the present time on this line. A simulated line may have its own clock.
    fn now(&mut self) -> Instant {
        Instant::now()
    }

    /// Waits for `time`.
    fn pause(&mut self, time: Duration) {
        std::thread::sleep(time);
    }
}

impl<L: Line + ?Sized> Line for Box<L> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        (**self).send(bytes)
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        (**self).receive(bytes, patience)
    }

    fn now(&mut self) -> Instant {
        (**self).now()
    }

    fn pause(&mut self, time: Duration) {
        (**self).pause(time);
    }
}

/// Returns the number of bytes read; 0 if none has arrived yet. The end of the connection is an error.
pub(super) fn received(read: io::Result<usize>) -> io::Result<usize> {
    match read {
        Ok(0) => Err(io::Error::new(ErrorKind::UnexpectedEof, "the other end closed the connection")),
        Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
            Ok(0)
        }
        other => other,
    }
}
