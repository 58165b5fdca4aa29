//! Interfaces that a test makes for itself, and programs beside it.

use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Bytes of a frame with its head, which is how an interface is told what it carries.
const CLASSIC: &str = "16";
const FD: &str = "72";

/// A virtual interface, which ends with it.
pub(crate) struct Virtual {
    pub(crate) name: &'static str,
}

/// Whether interfaces may be made here; says so if not.
pub(crate) fn here() -> bool {
    let here = std::env::var_os("HYST_CAN").is_some();
    if !here {
        println!("skipped: HYST_CAN is not set; cargo xtask can runs this in a machine with CAN");
    }
    here
}

impl Virtual {
    /// A bus of this name that is up, where interfaces may be made.
    pub(crate) fn up(name: &'static str, fd: bool) -> Option<Self> {
        let made = Self::down(name, fd)?;
        ip(&["link", "set", name, "up"]);
        Some(made)
    }

    /// The same, but down.
    pub(crate) fn down(name: &'static str, fd: bool) -> Option<Self> {
        if !here() {
            return None;
        }
        ip(&["link", "add", name, "type", "vcan"]);
        let made = Self { name };
        ip(&["link", "set", name, "mtu", if fd { FD } else { CLASSIC }]);
        Some(made)
    }
}

impl Drop for Virtual {
    fn drop(&mut self) {
        let _ = Command::new("ip").args(["link", "del", self.name]).status();
    }
}

/// Sets an interface up or down.
pub(crate) fn ip(arguments: &[&str]) {
    assert!(tried(arguments), "ip {}", arguments.join(" "));
}

/// The same; whether it could be done.
pub(crate) fn tried(arguments: &[&str]) -> bool {
    Command::new("ip").args(arguments).status().expect("there is ip").success()
}

/// A program that ends with it.
pub(crate) struct Program(pub(crate) Child);

impl Program {
    pub(crate) fn start(program: &str, arguments: &[&str]) -> Self {
        let child = Command::new(program).args(arguments).stdout(Stdio::piped()).spawn();
        Self(child.unwrap_or_else(|error| panic!("{program}: {error}")))
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Waits until it is so; a machine that is emulated takes its time.
pub(crate) fn until(what: &str, mut so: impl FnMut() -> bool) {
    let began = Instant::now();
    while !so() {
        assert!(began.elapsed() < Duration::from_secs(60), "{what}");
        sleep(Duration::from_millis(5));
    }
}
