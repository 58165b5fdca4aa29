//! CAN through the sockets of Linux (SocketCAN): any adapter that has a driver there, and virtual buses.

use std::io::{self, ErrorKind};
use std::thread::sleep;
use std::time::{Duration, Instant};

use socketcan::{
    CanAnyFrame, CanFdFrame, CanFilter, CanFrame, CanSocket, EmbeddedFrame, ExtendedId, Id, Socket, SocketOptions,
    StandardId, frame::FdFlags,
};

use super::can::{Bus, LARGEST, SHORT};
use super::interfaces::{Interface, interfaces};
use crate::wire::CanData;

/// How long the frames that wait to be sent may block the next one.
const FULL: Duration = Duration::from_millis(500);
/// How long to wait before it is tried again.
const AGAIN: Duration = Duration::from_micros(200);

/// A CAN interface of this machine.
#[derive(Debug)]
pub struct SocketCan {
    socket: Either,
}

/// Classic frames alone, or those of CAN FD too.
#[derive(Debug)]
enum Either {
    Classic(CanSocket),
    Fd(socketcan::CanFdSocket),
}

/// Why a CAN interface cannot be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SocketCanError {
    /// There is none of this name.
    #[error("{interface}: there is no such CAN interface{}", found(there))]
    Absent {
        /// The interface.
        interface: String,
        /// CAN interfaces that are there.
        there: Vec<String>,
    },
    /// It is not up.
    #[error("{interface}: the interface is down; set it up as root: {}", up(interface, *fd))]
    Down {
        /// The interface.
        interface: String,
        /// Whether CAN FD was asked for.
        fd: bool,
    },
    /// It carries classic frames only.
    #[error(
        "{interface}: the interface carries no CAN FD; leave out \",fd\", or set it up again as root, if the adapter can: {}",
        up(interface, true)
    )]
    ClassicOnly {
        /// The interface.
        interface: String,
    },
    /// The user may not.
    #[error(
        "{interface}: permission denied; anyone may use CAN on plain Linux, so a container or a sandbox forbids it: start outside of it"
    )]
    Denied {
        /// The interface.
        interface: String,
    },
    /// The system knows no CAN.
    #[error(
        "{interface}: this Linux knows no CAN sockets; load them as root (modprobe can-raw), or start a kernel that has them; an adapter at a serial port works without (slcan:PORT)"
    )]
    NoCan {
        /// The interface.
        interface: String,
    },
    /// Something else.
    #[error("{interface}: cannot be opened: {source}")]
    Other {
        /// The interface.
        interface: String,
        /// What the system said.
        source: io::Error,
    },
}

fn found(there: &[String]) -> String {
    if there.is_empty() {
        "; none is there: is the adapter connected, and does `ip link` show it?".to_owned()
    } else {
        format!("; there are {}", there.join(", "))
    }
}

/// The command that sets an interface up, at usual rates.
fn up(interface: &str, fd: bool) -> String {
    let faster = if fd { " dbitrate 2000000 fd on" } else { "" };
    format!("ip link set {interface} down; ip link set {interface} up type can bitrate 500000{faster}")
}

impl SocketCan {
    /// Opens the interface `name`, for frames of CAN FD too if `fd`. Other programs may have it open as well.
    ///
    /// # Errors
    /// When it is not there, down, or carries no such frames, or when the system knows no CAN.
    pub fn open(name: &str, fd: bool) -> Result<Self, SocketCanError> {
        let interface = || name.to_owned();
        // The system tells a missing interface before it tells that it knows no CAN at all.
        CanSocket::open_iface(0).map_err(|error| reason(error, name, fd))?;
        let socket = if fd {
            if interfaces().contains(&Interface { name: interface(), up: true, fd: false }) {
                return Err(SocketCanError::ClassicOnly { interface: interface() });
            }
            socketcan::CanFdSocket::open(name).map(Either::Fd)
        } else {
            CanSocket::open(name).map(Either::Classic)
        };
        let socket = socket.map_err(|error| reason(error, name, fd))?;
        // It can be opened while it is down, and says so only now.
        match socket.refused() {
            Ok(None) => Ok(Self { socket }),
            Ok(Some(error)) | Err(error) => Err(reason(error, name, fd)),
        }
    }

    /// Hears frames with this identifier only: the others do not wake the program.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn hear_only(&self, id: u32) -> io::Result<()> {
        let long = if id > SHORT { libc::CAN_EFF_FLAG } else { 0 };
        let exactly = libc::CAN_EFF_MASK | libc::CAN_EFF_FLAG | libc::CAN_RTR_FLAG;
        let filters = [CanFilter::new(id | long, exactly)];
        match &self.socket {
            Either::Classic(socket) => socket.set_filters(&filters),
            Either::Fd(socket) => socket.set_filters(&filters),
        }
    }
}

/// What the system's word means.
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

impl Either {
    /// What the system says of the interface since it was opened.
    fn refused(&self) -> io::Result<Option<io::Error>> {
        match self {
            Self::Classic(socket) => socket.as_raw_socket().take_error(),
            Self::Fd(socket) => socket.as_raw_socket().take_error(),
        }
    }

    fn write(&self, id: Id, data: &[u8]) -> io::Result<()> {
        let odd = || io::Error::new(ErrorKind::InvalidInput, "no CAN frame has that many bytes");
        match self {
            Self::Classic(socket) => socket.write_frame(&CanFrame::new(id, data).ok_or_else(odd)?),
            // At the higher rate: that is what an interface is set to FD for.
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
            0..=SHORT => StandardId::new(id as u16).map(Id::from),
            _ => ExtendedId::new(id).map(Id::from),
        };
        let id = id.ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "no CAN frame has that identifier"))?;
        let began = Instant::now();
        loop {
            let full = match self.socket.write(id, data) {
                // The frames before wait for the bus.
                Err(error) if error.raw_os_error() == Some(libc::ENOBUFS) => error,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                other => return other,
            };
            if began.elapsed() > FULL {
                let advice =
                    "the bus takes no frames: is another device on it, at the same bit rate, and is it terminated?";
                return Err(io::Error::new(full.kind(), advice));
            }
            sleep(AGAIN);
        }
    }

    fn receive(&mut self, patience: Duration) -> io::Result<Option<(u32, CanData)>> {
        // The system counts milliseconds; less than one would be none.
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
            Id::Extended(id) => Some(id.as_raw()).filter(|id| (SHORT + 1..=LARGEST).contains(id)),
        };
        Ok(id.and_then(|id| Some((id, CanData::from_slice(data).ok()?))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_refusal_says_what_to_do() {
        for (code, advice) in [
            (libc::ENODEV, "ip link"),
            (libc::ENETDOWN, "ip link set can7 up type can bitrate 500000 dbitrate 2000000 fd on"),
            (libc::EPERM, "start outside of it"),
            (libc::EACCES, "start outside of it"),
            (libc::EAFNOSUPPORT, "modprobe can-raw"),
            (libc::EPROTONOSUPPORT, "modprobe can-raw"),
            (libc::ENOMEM, "cannot be opened"),
        ] {
            let message = reason(io::Error::from_raw_os_error(code), "can7", true).to_string();
            assert!(message.starts_with("can7: ") && message.contains(advice), "{message}");
        }
        let there = vec!["can0".to_owned(), "vcan0".to_owned()];
        let message = SocketCanError::Absent { interface: "can7".to_owned(), there }.to_string();
        assert_eq!(message, "can7: there is no such CAN interface; there are can0, vcan0");
        let message = SocketCanError::ClassicOnly { interface: "can7".to_owned() }.to_string();
        assert!(message.contains("leave out \",fd\"") && message.contains("fd on"), "{message}");
    }

    #[test]
    fn an_interface_that_is_not_there_is_told() {
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
