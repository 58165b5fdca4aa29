//! Virtual interfaces and helper programs for a test.

use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// MTU of an interface: bytes of a frame with its header, without and with CAN FD.
const CLASSIC: &str = "16";
const FD: &str = "72";

/// A virtual interface, deleted on drop.
pub(crate) struct Virtual {
    pub(crate) name: &'static str,
}

impl Virtual {
    /// Creates a bus of this name and sets it up.
    pub(crate) fn up(name: &'static str, fd: bool) -> Self {
        let made = Self::down(name, fd);
        ip(&["link", "set", name, "up"]);
        made
    }

    /// Creates a bus of this name that is down.
    pub(crate) fn down(name: &'static str, fd: bool) -> Self {
        ip(&["link", "add", name, "type", "vcan"]);
        let made = Self { name };
        ip(&["link", "set", name, "mtu", if fd { FD } else { CLASSIC }]);
        made
    }
}

impl Drop for Virtual {
    fn drop(&mut self) {
        let _ = Command::new("ip").args(["link", "del", self.name]).status();
    }
}

/// Runs `ip` with these arguments.
pub(crate) fn ip(arguments: &[&str]) {
    assert!(tried(arguments), "ip {}", arguments.join(" "));
}

/// Runs `ip` with these arguments and returns whether it succeeded.
pub(crate) fn tried(arguments: &[&str]) -> bool {
    Command::new("ip").args(arguments).status().expect("ip is installed").success()
}

/// A program, killed on drop.
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

/// Waits until the condition holds; an emulated machine is slow.
pub(crate) fn until(what: &str, mut condition: impl FnMut() -> bool) {
    let began = Instant::now();
    while !condition() {
        assert!(began.elapsed() < Duration::from_secs(60), "{what}");
        sleep(Duration::from_millis(5));
    }
}
