//! Arguments with a syntax of their own, and parsers of numbers with bounds.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use hyst_ident::record::ABSOLUTE_ZERO;

/// Minimum and maximum voltage of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct VoltageLimits {
    /// Minimum \[V\].
    pub(crate) low: f64,
    /// Maximum \[V\].
    pub(crate) high: f64,
}

impl FromStr for VoltageLimits {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let number = |part: &str| part.trim().parse::<f64>().ok().filter(|volts| volts.is_finite());
        match text.split_once(',').map(|(low, high)| (number(low), number(high))) {
            Some((Some(low), Some(high))) if low < high => Ok(Self { low, high }),
            Some((Some(_), Some(_))) => {
                Err("the first voltage must be below the second one; give MIN,MAX, for example 0,120".to_owned())
            }
            _ => Err("expected two voltages; give MIN,MAX, for example 0,120".to_owned()),
        }
    }
}

/// Device that plays a drive, as `--daq` names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Device {
    /// The simulated plant that this file describes.
    Simulated(PathBuf),
    /// A device at a serial port.
    Serial {
        /// Name of the port in the system.
        port: String,
        /// Baud rate \[bit/s\].
        baud: u32,
    },
    /// A device on a CAN bus, behind an adapter at a serial port.
    Slcan {
        /// Name of the port in the system.
        port: String,
        /// Baud rate of the port \[bit/s\].
        baud: u32,
        /// Bit rate of the bus \[bit/s\].
        bits_per_s: u32,
    },
    /// A device on a CAN bus at an interface of the system.
    Can {
        /// Name of the interface in the system.
        interface: String,
        /// Whether frames are CAN FD.
        fd: bool,
    },
    /// A device at a socket, as `host:port`.
    Tcp(String),
    /// The device of the program that runs the command.
    Host,
}

/// Baud rate of a serial port if the argument has none \[bit/s\].
const DEFAULT_BAUD: u32 = 115_200;
/// Bit rate of a CAN bus if the argument has none \[bit/s\].
const DEFAULT_CAN_BIT_RATE: u32 = 500_000;

impl Device {
    /// The file of a simulated plant.
    pub(crate) fn file(&self) -> Option<&Path> {
        match self {
            Self::Simulated(path) => Some(path),
            Self::Serial { .. } | Self::Slcan { .. } | Self::Can { .. } | Self::Tcp(_) | Self::Host => None,
        }
    }
}

impl FromStr for Device {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            Some(("host", "")) if crate::hosted::has_host() => Ok(Self::Host),
            Some(("sim", path)) if !path.is_empty() => Ok(Self::Simulated(path.into())),
            Some(("serial", port)) if !port.is_empty() => {
                let (port, baud) = port_and_rate(port, DEFAULT_BAUD, "serial:/dev/ttyACM0@921600")?;
                Ok(Self::Serial { port, baud })
            }
            Some(("slcan", port)) if !port.is_empty() => {
                let (port, bits_per_s) = port_and_rate(port, DEFAULT_CAN_BIT_RATE, "slcan:/dev/ttyACM0@250000")?;
                Ok(Self::Slcan { port, baud: DEFAULT_BAUD, bits_per_s })
            }
            Some(("tcp", address)) if address.contains(':') => Ok(Self::Tcp(address.to_owned())),
            Some(("can", interface)) if !interface.is_empty() => match interface.split_once(',') {
                None => Ok(Self::Can { interface: interface.to_owned(), fd: false }),
                Some((interface, "fd")) if !interface.is_empty() => {
                    Ok(Self::Can { interface: interface.to_owned(), fd: true })
                }
                Some(_) => {
                    Err("give can:INTERFACE, or can:INTERFACE,fd for CAN FD, for example can:can0,fd".to_owned())
                }
            },
            _ => Err(format!("expected a device; give {DEVICE_FORMS}")),
        }
    }
}

/// Help of `--daq`.
pub(super) const DEVICE_HELP: &str = "Device: sim:PLANT.toml (simulated plant, described by the file), serial:PORT[@BAUD], \
    slcan:PORT[@BITS_PER_S], can:INTERFACE[,fd] or tcp:HOST:PORT";

/// Syntax of `--daq`, for messages.
const DEVICE_FORMS: &str = "sim:PLANT.toml (the file describes the simulated plant), serial:PORT[@BAUD], \
    slcan:PORT[@BITS_PER_S], can:INTERFACE[,fd] or tcp:HOST:PORT";

/// Splits `PORT[@RATE]` into the port and the rate \[bit/s\]; without `@RATE` the rate is `default`.
fn port_and_rate(port: &str, default: u32, example: &str) -> Result<(String, u32), String> {
    let Some((port, rate)) = port.rsplit_once('@') else { return Ok((port.to_owned(), default)) };
    let rate = rate.parse().ok().filter(|rate| *rate > 0);
    let rate =
        rate.ok_or_else(|| format!("expected a positive integer after the @, in bit/s; give for example {example}"))?;
    Ok((port.to_owned(), rate))
}

/// Gains of a PID.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PidGains {
    /// kₚ \[V/y\].
    pub(crate) proportional: f64,
    /// kᵢ \[V/(y s)\].
    pub(crate) integral: f64,
    /// k_d \[V s/y\].
    pub(crate) derivative: f64,
}

impl FromStr for PidGains {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Option<Vec<f64>> =
            text.split(',').map(|part| part.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect();
        match numbers.as_deref() {
            Some([proportional, integral, rest @ ..]) if rest.len() < 2 => {
                let (proportional, integral) = (*proportional, *integral);
                Ok(Self { proportional, integral, derivative: rest.first().copied().unwrap_or_default() })
            }
            _ => Err("expected two or three numbers; give KP,KI or KP,KI,KD, for example 0.4,250".to_owned()),
        }
    }
}

/// Parses a positive, finite number.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    let usable = |x: &f64| x.is_finite() && *x > 0.0;
    text.parse().ok().filter(usable).ok_or_else(|| "expected a positive number".to_owned())
}

/// Parses a finite number.
pub(super) fn finite(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| "expected a finite number".to_owned())
}

/// Parses a temperature at or above absolute zero \[°C\].
pub(super) fn celsius(text: &str) -> Result<f64, String> {
    let usable = |degc: &f64| *degc >= ABSOLUTE_ZERO;
    finite(text).ok().filter(usable).ok_or_else(|| format!("expected a temperature in degC, {ABSOLUTE_ZERO} or above"))
}

/// Parses a time of zero or more \[s\].
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    let usable = |x: &f64| x.is_finite() && *x >= 0.0;
    text.parse().ok().filter(usable).ok_or_else(|| "expected a time in seconds, 0 or more".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_two_numbers_in_order() {
        assert_eq!("0, 120".parse(), Ok(VoltageLimits { low: 0.0, high: 120.0 }));
        for text in ["120", "120,0", "1,1", "a,1", "0,inf", "0,NaN", ""] {
            text.parse::<VoltageLimits>().unwrap_err();
        }
    }

    #[test]
    fn gains_are_two_or_three_numbers() {
        let gains = |proportional, integral, derivative| PidGains { proportional, integral, derivative };
        assert_eq!("0.4, 250".parse(), Ok(gains(0.4, 250.0, 0.0)));
        assert_eq!("0.4,250,1e-3".parse(), Ok(gains(0.4, 250.0, 1e-3)));
        for text in ["", "1", "1,2,3,4", "1,x", "1,NaN", "1,inf"] {
            text.parse::<PidGains>().unwrap_err();
        }
    }

    #[test]
    fn devices_have_a_kind_and_an_address() {
        assert_eq!("sim:a:b.toml".parse(), Ok(Device::Simulated("a:b.toml".into())));
        let serial = |port: &str, baud| Ok(Device::Serial { port: port.into(), baud });
        assert_eq!("serial:/dev/ttyACM0".parse(), serial("/dev/ttyACM0", 115_200));
        assert_eq!("serial:COM3@921600".parse(), serial("COM3", 921_600));
        assert_eq!("tcp:localhost:4000".parse(), Ok(Device::Tcp("localhost:4000".into())));
        let slcan = Device::Slcan { port: "COM4".into(), baud: 115_200, bits_per_s: 250_000 };
        assert_eq!("slcan:COM4@250000".parse(), Ok(slcan));
        assert!("serial:COM3@fast".parse::<Device>().unwrap_err().contains("921600"));
        let can = |interface: &str, fd| Ok(Device::Can { interface: interface.into(), fd });
        assert_eq!("can:can0".parse(), can("can0", false));
        assert_eq!("can:vcan1,fd".parse(), can("vcan1", true));
        for text in ["can:can0,", "can:can0,FD", "can:,fd", "can:can0,fd,fd"] {
            assert!(text.parse::<Device>().unwrap_err().contains("can:can0,fd"), "{text}");
        }
        for text in ["sim:", "sim", "plant.toml", "can:", "can", "slcan:", "serial:", "tcp:here"] {
            assert!(text.parse::<Device>().unwrap_err().contains("sim:PLANT.toml"), "{text}");
        }
    }

    #[test]
    fn numbers_outside_their_bounds_are_refused() {
        assert_eq!(positive("2.5"), Ok(2.5));
        for text in ["0", "-1", "nan", "inf", "x"] {
            positive(text).unwrap_err();
        }
        assert_eq!(finite("-3"), Ok(-3.0));
        finite("nan").unwrap_err();
        assert_eq!((celsius("-273.15"), celsius("23")), (Ok(-273.15), Ok(23.0)));
        for text in ["-273.16", "-300", "inf", "nan", "warm"] {
            assert!(celsius(text).unwrap_err().contains("-273.15"), "{text}");
        }
        assert_eq!(seconds("0"), Ok(0.0));
        seconds("-1").unwrap_err();
    }
}
