//! The simulated plant as a device at a socket, in real time, in a thread of the test.

use std::net::TcpListener;
use std::thread::JoinHandle;

use hyst_hw::wire::{Device, Follower, Identity, Status};
use hyst_hw::{Plant, PlantBoard, PlantConfig, Tcp, serve};

/// A device that waits for one host.
#[derive(Debug)]
pub struct Served {
    address: String,
    thread: JoinHandle<Status>,
}

impl Served {
    /// The plant of this description, which follows references too, on a clock of `rate_hz`.
    ///
    /// # Panics
    /// When there is no such plant, or no socket.
    pub fn plant(description: &str, rate_hz: f64) -> Self {
        let config = PlantConfig::from_toml(description).expect("a plant");
        let mut board = PlantBoard::new(Plant::new(config).expect("a plant"), rate_hz).expect("a rate of the plant");
        let identity = Identity { follows: true, ..board.identity(rate_hz) };
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("it has an address").to_string();
        let thread = std::thread::spawn(move || {
            let mut device: Device<Follower, 512, 4096> = Device::new(identity, Follower::new());
            let (stream, _) = listener.accept().expect("a host comes");
            // The end of the line is no error here.
            let _ = serve(&mut device, &mut board, &mut Tcp::over(stream).expect("a socket"), || false);
            device.status()
        });
        Self { address, thread }
    }

    /// What `--daq` calls it.
    pub fn daq(&self) -> String {
        format!("tcp:{}", self.address)
    }

    /// How the device stood when its host was gone.
    ///
    /// # Panics
    /// When the device did.
    pub fn when_left(self) -> Status {
        self.thread.join().expect("the device does not panic")
    }
}
