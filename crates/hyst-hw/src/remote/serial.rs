//! Lines over serial ports, and the serial ports of this computer.

use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::time::Duration;

use serialport::{ErrorKind as ErrorKindOfPort, SerialPort, SerialPortType};

use super::line::{Line, MIN_TIMEOUT, received};

/// Time limit for writing a frame. A frame of 600 bytes takes 0.6 s at 9600 baud.
const WRITE_TIMEOUT: Duration = Duration::from_secs(2);

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
