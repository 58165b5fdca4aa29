//! CAN through the sockets of Linux (SocketCAN): adapters with a Linux driver, and virtual buses.

use std::io::{self, ErrorKind};
use std::thread::sleep;
use std::time::{Duration, Instant};

use socketcan::{
    CanAnyFrame, CanFdFrame, CanFilter, CanFrame, CanSocket, EmbeddedFrame, ExtendedId, Id, Socket, SocketOptions,
    StandardId, frame::FdFlags,
};

use super::can::{Bus, MAX_EXTENDED_ID, MAX_STANDARD_ID};
use super::interfaces::{Interface, interfaces};
use crate::wire::CanData;

/// Time limit for sending a frame while the send queue is full.
const SEND_TIMEOUT: Duration = Duration::from_millis(500);
/// Time between two attempts to send a frame.
const RETRY_INTERVAL: Duration = Duration::from_micros(200);

/// A CAN interface of this machine.
#[derive(Debug)]
pub struct SocketCan {
    socket: AnySocket,
}

/// A socket for classic frames, or one for CAN FD frames too.
#[derive(Debug)]
enum AnySocket {
    Classic(CanSocket),
    Fd(socketcan::CanFdSocket),
}

/// Errors on opening a CAN interface.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SocketCanError {
    /// There is no CAN interface of this name.
    #[error("{interface}: there is no such CAN interface{}", found(there))]
    Absent {
        /// The interface.
        interface: String,
        /// CAN interfaces of this computer.
        there: Vec<String>,
    },
    /// The interface is not up.
    #[error("{interface}: the interface is down; set it up as root: {}", up_command(interface, *fd))]
    Down {
        /// The interface.
        interface: String,
        /// Whether CAN FD was requested.
        fd: bool,
    },
    /// The interface carries only classic frames.
    #[error(
        "{interface}: the interface carries no CAN FD; leave out \",fd\", or, if the adapter supports CAN FD, set it up again as root: {}",
        up_command(interface, true)
    )]
    ClassicOnly {
        /// The interface.
        interface: String,
    },
    /// The user has no permission.
    #[error(
        "{interface}: permission denied; Linux lets every user open CAN, so a container or a sandbox blocks it: start hystctl outside of it"
    )]
    Denied {
        /// The interface.
        interface: String,
    },
    /// The operating system has no CAN sockets.
    #[error(
        "{interface}: this Linux kernel has no CAN sockets; load the module as root (modprobe can-raw), or boot a kernel that has it; \
         an adapter at a serial port works without it (slcan:PORT)"
    )]
    NoCan {
        /// The interface.
        interface: String,
    },
    /// Another error of the operating system.
    #[error("{interface}: cannot be opened: {source}")]
    Other {
        /// The interface.
        interface: String,
        /// Error of the operating system.
        source: io::Error,
    },
}

fn found(there: &[String]) -> String {
    if there.is_empty() {
        "; this computer has none: connect the adapter and check that `ip link` shows it".to_owned()
    } else {
        format!("; this computer has {}", there.join(", "))
    }
}

/// Returns the command that sets an interface up, with the usual bit rates.
fn up_command(interface: &str, fd: bool) -> String {
    let faster = if fd { " dbitrate 2000000 fd on" } else { "" };
    format!("ip link set {interface} down; ip link set {interface} up type can bitrate 500000{faster}")
}

impl SocketCan {
    /// Opens the interface `name`; `fd`: with CAN FD frames. Other programs may use it at the same time.
    ///
    /// # Errors
    /// If the interface does not exist, is down or has no CAN FD, or if the operating system has no CAN sockets.
    pub fn open(name: &str, fd: bool) -> Result<Self, SocketCanError> {
        let interface = || name.to_owned();
        // Check for CAN sockets first: otherwise the operating system only reports a missing interface.
        CanSocket::open_iface(0).map_err(|error| reason(error, name, fd))?;
        let socket = if fd {
            if interfaces().contains(&Interface { name: interface(), up: true, fd: false }) {
                return Err(SocketCanError::ClassicOnly { interface: interface() });
            }
            socketcan::CanFdSocket::open(name).map(AnySocket::Fd)
        } else {
            CanSocket::open(name).map(AnySocket::Classic)
        };
        let socket = socket.map_err(|error| reason(error, name, fd))?;
        // An interface that is down can be opened; the error appears only here.
        match socket.pending_error() {
            Ok(None) => Ok(Self { socket }),
            Ok(Some(error)) | Err(error) => Err(reason(error, name, fd)),
        }
    }

    /// Receives only frames with this identifier; other frames do not wake the program.
    ///
    /// # Errors
    /// If the operating system refuses the filter.
    pub fn hear_only(&self, id: u32) -> io::Result<()> {
        let long = if id > MAX_STANDARD_ID { libc::CAN_EFF_FLAG } else { 0 };
        let exactly = libc::CAN_EFF_MASK | libc::CAN_EFF_FLAG | libc::CAN_RTR_FLAG;
        let filters = [CanFilter::new(id | long, exactly)];
        match &self.socket {
            AnySocket::Classic(socket) => socket.set_filters(&filters),
            AnySocket::Fd(socket) => socket.set_filters(&filters),
        }
    }
}

/// Returns the meaning of an error of the operating system.
fn reason(error: io::Error, name: &str, fd: bool) -> SocketCanError {
    let interface = name.to_owned();
    match error.raw_os_error() {
        Some(libc::ENODEV | libc::ENXIO) => {
            SocketCanError::Absent { interface, there: interfaces().into_iter().map(|i| i.name).collect() }
        }
        Some(libc::ENETDOWN) => SocketCanError::Down { interface, fd },
        Some(libc::EPERM | libc::EACCES) => SocketCanError::Denied { interface },
        Some(libc::EAFNOSUPPORT | libc::EPROTONOSUPPORT) => SocketCanError::NoCan { interface },
        _ => SocketCanError::Other { interface, source: error },
    }
}

impl AnySocket {
    /// Returns the error of the interface since it was opened, if any.
    fn pending_error(&self) -> io::Result<Option<io::Error>> {
        match self {
            Self::Classic(socket) => socket.as_raw_socket().take_error(),
            Self::Fd(socket) => socket.as_raw_socket().take_error(),
        }
    }

    fn write(&self, id: Id, data: &[u8]) -> io::Result<()> {
        let odd = || io::Error::new(ErrorKind::InvalidInput, "a CAN frame cannot have this number of bytes");
        match self {
            Self::Classic(socket) => socket.write_frame(&CanFrame::new(id, data).ok_or_else(odd)?),
            // With bit-rate switching, which is the purpose of CAN FD.
            Self::Fd(socket) => {
                let frame = CanFdFrame::with_flags(id, data, FdFlags::BRS).ok_or_else(odd)?;
                socket.write_frame(&frame)
            }
        }
    }

    fn read(&self, patience: Duration) -> io::Result<CanAnyFrame> {
        match self {
            Self::Classic(socket) => socket.read_frame_timeout(patience).map(CanAnyFrame::from),
            Self::Fd(socket) => socket.read_frame_timeout(patience),
        }
    }
}

impl Bus for SocketCan {
    fn send(&mut self, id: u32, data: &[u8]) -> io::Result<()> {
        let id = match id {
            0..=MAX_STANDARD_ID => StandardId::new(id as u16).map(Id::from),
            _ => ExtendedId::new(id).map(Id::from),
        };
        let id = id.ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "the identifier is larger than 29 bits"))?;
        let began = Instant::now();
        loop {
            let full = match self.socket.write(id, data) {
                // The send queue is full.
                Err(error) if error.raw_os_error() == Some(libc::ENOBUFS) => error,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                other => return other,
            };
            if began.elapsed() > SEND_TIMEOUT {
                let advice = "the bus accepts no frames: check that another device is on it, at the same bit rate, and that it is terminated";
                return Err(io::Error::new(full.kind(), advice));
            }
            sleep(RETRY_INTERVAL);
        }
    }

    fn receive(&mut self, patience: Duration) -> io::Result<Option<(u32, CanData)>> {
        // The system counts whole milliseconds, so round up.
        let patience = Duration::from_millis(patience.as_nanos().div_ceil(1_000_000) as u64);
        let frame = match self.socket.read(patience) {
            Ok(frame) => frame,
            Err(error)
                if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted) =>
            {
                return Ok(None);
            }
            Err(error) => return Err(error),
        };
        let (id, data) = match &frame {
            CanAnyFrame::Normal(frame) => (frame.id(), frame.data()),
            CanAnyFrame::Fd(frame) => (frame.id(), frame.data()),
            CanAnyFrame::Remote(_) | CanAnyFrame::Error(_) => return Ok(None),
        };
        let id = match id {
            Id::Standard(id) => Some(u32::from(id.as_raw())),
            Id::Extended(id) => Some(id.as_raw()).filter(|id| (MAX_STANDARD_ID + 1..=MAX_EXTENDED_ID).contains(id)),
        };
        Ok(id.and_then(|id| Some((id, CanData::from_slice(data).ok()?))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_error_says_what_to_do() {
        for (code, advice) in [
            (libc::ENODEV, "ip link"),
            (libc::ENETDOWN, "ip link set can7 up type can bitrate 500000 dbitrate 2000000 fd on"),
            (libc::EPERM, "outside of it"),
            (libc::EACCES, "outside of it"),
            (libc::EAFNOSUPPORT, "modprobe can-raw"),
            (libc::EPROTONOSUPPORT, "modprobe can-raw"),
            (libc::ENOMEM, "cannot be opened"),
        ] {
            let message = reason(io::Error::from_raw_os_error(code), "can7", true).to_string();
            assert!(message.starts_with("can7: ") && message.contains(advice), "{message}");
        }
        let there = vec!["can0".to_owned(), "vcan0".to_owned()];
        let message = SocketCanError::Absent { interface: "can7".to_owned(), there }.to_string();
        assert_eq!(message, "can7: there is no such CAN interface; this computer has can0, vcan0");
        let message = SocketCanError::ClassicOnly { interface: "can7".to_owned() }.to_string();
        assert!(message.contains("leave out \",fd\"") && message.contains("fd on"), "{message}");
    }

    #[test]
    fn a_missing_interface_is_reported() {
        for fd in [false, true] {
            match SocketCan::open("can-of-nobody", fd).unwrap_err() {
                SocketCanError::Absent { interface, .. }
                | SocketCanError::NoCan { interface }
                | SocketCanError::Denied { interface } => assert_eq!(interface, "can-of-nobody"),
                error => panic!("{error}"),
            }
        }
    }
}
