//! Lines over TCP connections.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use super::line::{Line, MIN_TIMEOUT, received};

/// Time limit for connecting to a host.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// A TCP connection, for example to a simulator or a bridge to a bus.
#[derive(Debug)]
pub struct Tcp {
    stream: TcpStream,
    /// Read timeout that is set at present.
    patience: Duration,
}

impl Tcp {
    /// Connects to `address`, given as `host:port`.
    ///
    /// # Errors
    /// If no program listens there.
    pub fn connect(address: impl ToSocketAddrs) -> io::Result<Self> {
        let mut last = io::Error::new(ErrorKind::InvalidInput, "the address has no IP address");
        for address in address.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, CONNECT_TIMEOUT) {
                Ok(stream) => return Self::over(stream),
                Err(error) => last = error,
            }
        }
        Err(last)
    }

    /// Uses an open socket.
    ///
    /// # Errors
    /// If the operating system refuses the options of the socket.
    pub fn over(stream: TcpStream) -> io::Result<Self> {
        // A request is one small packet, which must not wait for others.
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(MIN_TIMEOUT))?;
        Ok(Self { stream, patience: MIN_TIMEOUT })
    }
}

impl Line for Tcp {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.write_all(bytes)
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        let patience = patience.max(MIN_TIMEOUT);
        if patience != self.patience {
            self.stream.set_read_timeout(Some(patience))?;
            self.patience = patience;
        }
        received(self.stream.read(bytes))
    }
}
