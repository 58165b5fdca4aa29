//! `hystctl` with a device on a CAN bus over Linux sockets.
//!
//! The tests create interfaces, so they need root and the kernel's CAN modules: `cargo xtask can` runs them in a suitable
//! virtual machine. Otherwise they are ignored.
#![cfg(target_os = "linux")]

use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use hyst_hw::wire::{Device, Open};
use hyst_hw::{CanLine, FROM_DEVICE, Plant, PlantBoard, PlantConfig, SocketCan, TO_DEVICE, serve};
use hyst_tests::{Lab, PLANT, column};

const RATE_HZ: f64 = 500.0;

/// A bus with an actuator. Dropping it removes both.
struct Bus {
    name: &'static str,
    stop: Arc<AtomicBool>,
    device: Option<JoinHandle<()>>,
}

impl Drop for Bus {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let ended = self.device.take().map(JoinHandle::join);
        let _ = Command::new("ip").args(["link", "del", self.name]).status();
        assert!(ended.is_none_or(|ended| ended.is_ok()) || thread::panicking(), "the device failed");
    }
}

/// Starts the actuator of [`PLANT`] on a virtual bus.
fn bus(name: &'static str, fd: bool) -> Bus {
    for line in ["add NAME type vcan", if fd { "set NAME mtu 72" } else { "set NAME mtu 16" }, "set NAME up"] {
        let line = line.replace("NAME", name);
        assert!(Command::new("ip").arg("link").args(line.split(' ')).status().unwrap().success(), "ip link {line}");
    }
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    let line = SocketCan::open(name, fd).unwrap();
    let device = thread::spawn(move || {
        let plant = Plant::new(PlantConfig::from_toml(PLANT).unwrap()).unwrap();
        let mut board = PlantBoard::new(plant, RATE_HZ).unwrap();
        let mut device = Device::<Open, 256, 0>::new(board.identity(RATE_HZ, false), Open);
        let mut line = CanLine::new(line, FROM_DEVICE, TO_DEVICE, fd);
        serve(&mut device, &mut board, &mut line, || stopped.load(Ordering::Relaxed)).unwrap();
    });
    Bus { name, stop, device: Some(device) }
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn a_run_on_a_can_bus_plays_the_drive() {
    for (name, fd) in [("cli", false), ("cli-fd", true)] {
        let _bus = bus(name, fd);
        let lab = Lab::new();
        let volts: Vec<f64> = (0..1200).map(|k| 40.0 - 40.0 * (f64::from(k) * 0.02).cos()).collect();
        let rows = volts.iter().enumerate().map(|(k, v)| format!("{:.3},{v:.3}\n", k as f64 / RATE_HZ));
        lab.write("u.csv", format!("time_s,voltage_v\n{}", rows.collect::<String>()));
        let daq = if fd { format!("can:{name},fd") } else { format!("can:{name}") };
        let ran = lab.ok(&format!("run --daq {daq} --drive u.csv --record out.csv"));
        println!("{}", ran.stdout.trim());
        let (asked, record) = (column(&lab.read("u.csv"), "voltage_v"), lab.read("out.csv"));
        let (driven, shown) = (column(&record, "voltage_v"), column(&record, "displacement_um"));
        assert_eq!(driven.len(), asked.len());
        assert!(driven.iter().zip(&asked).all(|(driven, asked)| *driven == f64::from(*asked as f32)));
        // About 20 µm at 100 V: the actuator has moved.
        let top = shown.iter().copied().fold(f64::MIN, f64::max);
        assert!((10.0..20.0).contains(&top), "{top} µm");
    }
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn interfaces_are_listed_and_a_missing_one_is_rejected_with_advice() {
    let _bus = bus("cli-list", true);
    let lab = Lab::new();
    let found = lab.ok("devices --json").json();
    let found = found.as_array().expect("a list");
    assert!(
        found
            .iter()
            .any(|port| port["daq"] == "can:cli-list" && port["what"] == "CAN; can:cli-list,fd for CAN FD frames; up"),
        "{found:?}"
    );
    lab.write("u.csv", "time_s,voltage_v\n0,0\n0.002,1\n0.004,0\n");
    let message = lab.fails("run --daq can:cli-none --drive u.csv --record out.csv", 3);
    assert!(message.contains("this computer has cli-list"), "{message}");
}
