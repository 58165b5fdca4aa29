//! Lines: serial ports and sockets.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::path::Path;
use std::time::Duration;

use serialport::{ErrorKind as ErrorKindOfPort, SerialPort, SerialPortType};

use super::Line;

/// Shortest timeout that the operating systems support.
const MIN_TIMEOUT: Duration = Duration::from_millis(1);
/// Time limit for writing a frame. A frame of 600 bytes takes 0.6 s at 9600 baud.
const WRITE_TIMEOUT: Duration = Duration::from_secs(2);
/// Time limit for connecting to a host.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Returns the number of bytes read; 0 if none has arrived yet. The end of the connection is an error.
fn received(read: io::Result<usize>) -> io::Result<usize> {
    match read {
        Ok(0) => Err(io::Error::new(ErrorKind::UnexpectedEof, "the other end closed the connection")),
        Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
            Ok(0)
        }
        other => other,
    }
}

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

/// A serial port: a UART, a USB serial device or a pseudo terminal.
#[derive(Debug)]
pub struct Serial {
    port: Box<dyn SerialPort>,
}

/// Errors on opening a serial port.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// There is no port of this name.
    #[error("{port}: there is no such port{}", found(there))]
    Absent {
        /// The port.
        port: String,
        /// Ports of this computer.
        there: Vec<String>,
    },
    /// Another program uses the port.
    #[error("{port}: another program uses the port; close it first")]
    Busy {
        /// The port.
        port: String,
    },
    /// The user has no permission.
    #[error("{port}: permission denied; on Linux add yourself to the port's group (often dialout) and log in again")]
    Denied {
        /// The port.
        port: String,
    },
    /// Another error of the operating system.
    #[error("{port}: cannot be opened: {source}")]
    Other {
        /// The port.
        port: String,
        /// Error of the operating system.
        source: serialport::Error,
    },
}

fn found(there: &[String]) -> String {
    if there.is_empty() {
        "; this computer has none".to_owned()
    } else {
        format!("; this computer has {}", there.join(", "))
    }
}

impl Serial {
    /// Uses an open port.
    pub fn over(port: Box<dyn SerialPort>) -> Self {
        Self { port }
    }

    /// Opens the port `name` at `baud` bit/s, for exclusive use.
    ///
    /// # Errors
    /// If the port does not exist, another program uses it, or the user has no permission.
    pub fn open(name: &str, baud: u32) -> Result<Self, OpenError> {
        let port = || name.to_owned();
        serialport::new(name, baud).timeout(MIN_TIMEOUT).open().map(|port| Self { port }).map_err(|source| {
            let text = source.to_string().to_lowercase();
            match source.kind() {
                // The library reports a busy port as a missing device, too.
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
        // The port has one timeout for both directions. Writing needs more: a full buffer empties at the baud rate.
        if self.port.timeout() != WRITE_TIMEOUT {
            self.port.set_timeout(WRITE_TIMEOUT)?;
        }
        self.port.write_all(bytes)
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        let patience = patience.max(MIN_TIMEOUT);
        if patience != self.port.timeout() {
            self.port.set_timeout(patience)?;
        }
        received(self.port.read(bytes))
    }
}

/// A serial port of this computer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Port {
    /// Name of the port in the operating system.
    pub name: String,
    /// Description of the device at the port, if known.
    pub what: String,
}

/// Returns the serial ports of this computer.
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
