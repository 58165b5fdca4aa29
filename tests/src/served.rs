//! A device of the simulated plant, in real time at a socket of this process.

use std::net::TcpListener;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use hyst_hw::wire::{Board, Device, Follower, Shown, Status};
use hyst_hw::{Plant, PlantBoard, PlantConfig, Tcp, serve, serve_at};

type Servo = Device<Follower, 512, 4096>;

/// What has been put out, and how the device stands.
#[derive(Debug, Default)]
pub struct Told {
    /// All voltages \[V\].
    pub put_out: Vec<f32>,
    /// How often something was measured.
    pub measured: usize,
}

/// A served device; it ends with this.
#[derive(Debug)]
pub struct Served {
    address: String,
    /// What it has done.
    pub told: Arc<Mutex<Told>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Status>>,
}

struct Watched {
    board: PlantBoard,
    told: Arc<Mutex<Told>>,
}

impl Board for Watched {
    fn measure(&mut self) -> Shown {
        self.told.lock().expect("nobody panicked with it").measured += 1;
        self.board.measure()
    }

    fn put_out(&mut self, volts: f32) {
        self.told.lock().expect("nobody panicked with it").put_out.push(volts);
        self.board.put_out(volts);
    }
}

impl Served {
    /// A device that follows references, with the plant that `toml` describes, at `rate_hz`. It waits for one host after the other.
    ///
    /// # Panics
    /// When there is no such plant, or no socket.
    pub fn plant(toml: &str, rate_hz: f64) -> Self {
        Self::with(toml, rate_hz, |listener, device, board, stop| {
            serve_at(&listener, device, board, || stop.load(Ordering::Relaxed)).expect("a socket");
        })
    }

    /// The same, of which the time ends with its first host: how it stood then can be asked.
    ///
    /// # Panics
    /// When there is no such plant, or no socket.
    pub fn for_one_host(toml: &str, rate_hz: f64) -> Self {
        Self::with(toml, rate_hz, |listener, device, board, stop| {
            let (stream, _) = listener.accept().expect("a host comes");
            let mut line = Tcp::over(stream).expect("a socket");
            // The end of the line is no error here.
            let _ = serve(device, board, &mut line, || stop.load(Ordering::Relaxed));
        })
    }

    fn with(
        toml: &str,
        rate_hz: f64,
        serves: impl FnOnce(TcpListener, &mut Servo, &mut Watched, &AtomicBool) + Send + 'static,
    ) -> Self {
        let config = PlantConfig::from_toml(toml).expect("a plant");
        let board = PlantBoard::new(Plant::new(config).expect("a plant"), rate_hz).expect("its rate");
        let mut device: Servo = Device::new(board.identity(rate_hz, true), Follower::new());
        let listener = TcpListener::bind("127.0.0.1:0").expect("a socket");
        let address = listener.local_addr().expect("its address").to_string();
        let (told, stop) = (Arc::<Mutex<Told>>::default(), Arc::<AtomicBool>::default());
        let (mut board, ends) = (Watched { board, told: Arc::clone(&told) }, Arc::clone(&stop));
        let thread = std::thread::spawn(move || {
            serves(listener, &mut device, &mut board, &ends);
            device.status()
        });
        Self { address, told, stop, thread: Some(thread) }
    }

    /// What `--daq` calls it.
    pub fn daq(&self) -> String {
        format!("tcp:{}", self.address)
    }

    /// All voltages that were put out so far \[V\].
    ///
    /// # Panics
    /// When the device did.
    pub fn put_out(&self) -> Vec<f32> {
        self.told.lock().expect("the device has not panicked").put_out.clone()
    }

    /// Ends it, and gives how it stood.
    ///
    /// # Panics
    /// When the device did.
    pub fn end(self) -> Status {
        self.stop.store(true, Ordering::Relaxed);
        self.when_left()
    }

    /// How a device [for one host](Self::for_one_host) stood when its host was gone.
    ///
    /// # Panics
    /// When the device did.
    pub fn when_left(mut self) -> Status {
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
