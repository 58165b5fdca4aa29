//! Lines: serial ports and sockets.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::path::Path;
use std::time::Duration;

use serialport::{ErrorKind as ErrorKindOfPort, SerialPort, SerialPortType};

use super::Line;

/// Shortest wait that the systems know.
const SHORTEST: Duration = Duration::from_millis(1);
/// How long a frame may take to be taken: one of 600 bytes at 9600 baud takes 0.6 s.
const LONGEST_WRITE: Duration = Duration::from_secs(2);
/// How long to try to reach a host.
const REACH: Duration = Duration::from_secs(5);

/// What `read` came to; that nothing has come yet is no error, that nothing will is one.
fn came(read: io::Result<usize>) -> io::Result<usize> {
    match read {
        Ok(0) => Err(io::Error::new(ErrorKind::UnexpectedEof, "the other end closed it")),
        Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
            Ok(0)
        }
        other => other,
    }
}

/// A socket: a simulator, a bridge to a bus.
#[derive(Debug)]
pub struct Tcp {
    stream: TcpStream,
    /// The wait that the system was told last.
    patience: Duration,
}

impl Tcp {
    /// Connects to `address`, as `host:port`.
    ///
    /// # Errors
    /// When nobody listens there.
    pub fn connect(address: impl ToSocketAddrs) -> io::Result<Self> {
        let mut last = io::Error::new(ErrorKind::InvalidInput, "the address leads nowhere");
        for address in address.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, REACH) {
                Ok(stream) => return Self::over(stream),
                Err(error) => last = error,
            }
        }
        Err(last)
    }

    /// Over a socket that is there.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn over(stream: TcpStream) -> io::Result<Self> {
        // A request is one small packet that waits for its answer.
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(SHORTEST))?;
        Ok(Self { stream, patience: SHORTEST })
    }
}

impl Line for Tcp {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.write_all(bytes)
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        let patience = patience.max(SHORTEST);
        if patience != self.patience {
            self.stream.set_read_timeout(Some(patience))?;
            self.patience = patience;
        }
        came(self.stream.read(bytes))
    }
}

/// A serial port: a UART, a USB device that shows itself as one, a pseudo terminal.
#[derive(Debug)]
pub struct Serial {
    port: Box<dyn SerialPort>,
}

/// Why a serial port cannot be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// There is none of this name.
    #[error("{port}: there is no such port{}", found(there))]
    Absent {
        /// The port.
        port: String,
        /// Ports that are there.
        there: Vec<String>,
    },
    /// Another program has it.
    #[error("{port}: another program holds the port; end that first")]
    Busy {
        /// The port.
        port: String,
    },
    /// The user may not.
    #[error("{port}: permission denied; on Linux add yourself to the port's group (often dialout) and log in again")]
    Denied {
        /// The port.
        port: String,
    },
    /// Something else.
    #[error("{port}: cannot be opened: {source}")]
    Other {
        /// The port.
        port: String,
        /// What the system said.
        source: serialport::Error,
    },
}

fn found(there: &[String]) -> String {
    if there.is_empty() { "; none is connected".to_owned() } else { format!("; there are {}", there.join(", ")) }
}

impl Serial {
    /// Over a port that is open.
    pub fn over(port: Box<dyn SerialPort>) -> Self {
        Self { port }
    }

    /// Opens the port `name` at `baud` bits a second, for this program alone.
    ///
    /// # Errors
    /// When it is not there, another program has it, or the user may not.
    pub fn open(name: &str, baud: u32) -> Result<Self, OpenError> {
        let port = || name.to_owned();
        serialport::new(name, baud).timeout(SHORTEST).open().map(|port| Self { port }).map_err(|source| {
            let text = source.to_string().to_lowercase();
            match source.kind() {
                // A port that is there but cannot be had is told as no device, too.
                ErrorKindOfPort::NoDevice if Path::new(name).exists() => OpenError::Busy { port: port() },
                _ if text.contains("busy") => OpenError::Busy { port: port() },
                ErrorKindOfPort::Io(ErrorKind::PermissionDenied) => OpenError::Denied { port: port() },
                ErrorKindOfPort::NoDevice | ErrorKindOfPort::Io(ErrorKind::NotFound) => {
                    OpenError::Absent { port: port(), there: ports().into_iter().map(|p| p.name).collect() }
                }
                _ => OpenError::Other { port: port(), source },
            }
        })
    }
}

impl Line for Serial {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        // The port's one wait holds for both directions: a full buffer that empties at the line's speed is no end of the line.
        if self.port.timeout() != LONGEST_WRITE {
            self.port.set_timeout(LONGEST_WRITE)?;
        }
        self.port.write_all(bytes)
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        let patience = patience.max(SHORTEST);
        if patience != self.port.timeout() {
            self.port.set_timeout(patience)?;
        }
        came(self.port.read(bytes))
    }
}

/// A serial port that is there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Port {
    /// What the system calls it.
    pub name: String,
    /// What is known of the device behind it.
    pub what: String,
}

/// The serial ports that are there.
pub fn ports() -> Vec<Port> {
    let what = |kind: SerialPortType| match kind {
        SerialPortType::UsbPort(usb) => {
            let words = [usb.manufacturer, usb.product, usb.serial_number].into_iter().flatten().collect::<Vec<_>>();
            format!("USB {:04x}:{:04x} {}", usb.vid, usb.pid, words.join(" ")).trim_end().to_owned()
        }
        SerialPortType::BluetoothPort => "Bluetooth".to_owned(),
        SerialPortType::PciPort => "built in".to_owned(),
        SerialPortType::Unknown => String::new(),
    };
    let there = serialport::available_ports().unwrap_or_default();
    there.into_iter().map(|port| Port { name: port.port_name, what: what(port.port_type) }).collect()
}
