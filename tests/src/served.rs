//! A device with the simulated plant that runs in real time and listens on a socket of this process.

use std::net::TcpListener;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use hyst_hw::wire::{Board, Device, Follower, Shown, Status};
use hyst_hw::{Plant, PlantBoard, PlantConfig, Tcp, serve, serve_at};

type Servo = Device<Follower, 512, 4096>;

/// Outputs and measurements of the device so far.
#[derive(Debug, Default)]
pub struct Activity {
    /// All output voltages \[V\].
    pub put_out: Vec<f32>,
    /// Number of measurements.
    pub measured: usize,
}

/// A served device. Dropping it stops the device.
#[derive(Debug)]
pub struct Served {
    address: String,
    /// Outputs and measurements so far.
    pub activity: Arc<Mutex<Activity>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Status>>,
}

struct LoggedBoard {
    board: PlantBoard,
    activity: Arc<Mutex<Activity>>,
}

impl Board for LoggedBoard {
    fn measure(&mut self) -> Shown {
        self.activity.lock().expect("no thread panicked with the lock").measured += 1;
        self.board.measure()
    }

    fn put_out(&mut self, volts: f32) {
        self.activity.lock().expect("no thread panicked with the lock").put_out.push(volts);
        self.board.put_out(volts);
    }
}

impl Served {
    /// Starts a device that follows references, with the plant of the description `toml`, at `rate_hz`. It accepts one
    /// host after the other.
    ///
    /// # Panics
    /// If the plant or the socket cannot be created.
    pub fn plant(toml: &str, rate_hz: f64) -> Self {
        Self::with(toml, rate_hz, |listener, device, board, stop| {
            serve_at(&listener, device, board, || stop.load(Ordering::Relaxed)).expect("a socket");
        })
    }

    /// Starts such a device that stops when its first host disconnects, so that its last status can be read.
    ///
    /// # Panics
    /// If the plant or the socket cannot be created.
    pub fn for_one_host(toml: &str, rate_hz: f64) -> Self {
        Self::with(toml, rate_hz, |listener, device, board, stop| {
            let (stream, _) = listener.accept().expect("a host connects");
            let mut line = Tcp::over(stream).expect("a socket");
            // A closed connection is not an error here.
            let _ = serve(device, board, &mut line, || stop.load(Ordering::Relaxed));
        })
    }

    fn with(
        toml: &str,
        rate_hz: f64,
        serve: impl FnOnce(TcpListener, &mut Servo, &mut LoggedBoard, &AtomicBool) + Send + 'static,
    ) -> Self {
        let config = PlantConfig::from_toml(toml).expect("a plant");
        let board = PlantBoard::new(Plant::new(config).expect("a plant"), rate_hz).expect("its rate");
        let mut device: Servo = Device::new(board.identity(rate_hz, true), Follower::new());
        let listener = TcpListener::bind("127.0.0.1:0").expect("a socket");
        let address = listener.local_addr().expect("its address").to_string();
        let (activity, stop) = (Arc::<Mutex<Activity>>::default(), Arc::<AtomicBool>::default());
        let (mut board, stopped) = (LoggedBoard { board, activity: Arc::clone(&activity) }, Arc::clone(&stop));
        let thread = std::thread::spawn(move || {
            serve(listener, &mut device, &mut board, &stopped);
            device.status()
        });
        Self { address, activity, stop, thread: Some(thread) }
    }

    /// Returns the value of `--daq` for this device.
    pub fn daq(&self) -> String {
        format!("tcp:{}", self.address)
    }

    /// Returns all output voltages so far \[V\].
    ///
    /// # Panics
    /// If the device panicked.
    pub fn put_out(&self) -> Vec<f32> {
        self.activity.lock().expect("the device has not panicked").put_out.clone()
    }

    /// Stops the device and returns its last status.
    ///
    /// # Panics
    /// If the device panicked.
    pub fn end(self) -> Status {
        self.stop.store(true, Ordering::Relaxed);
        self.last_status()
    }

    /// Waits until the host of a device [for one host](Self::for_one_host) has disconnected. Returns the last status.
    ///
    /// # Panics
    /// If the device panicked.
    pub fn last_status(mut self) -> Status {
        self.thread.take().expect("it runs").join().expect("the device has not panicked")
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
