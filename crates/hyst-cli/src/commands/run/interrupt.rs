//! Ctrl-C while a device is driven: the first one brings it to rest, the second one leaves at once.
//!
//! One program has one handler; it looks after the run that goes on, of which a command may have several, one after the other.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex, Once, PoisonError};

use hyst_ident::stop::Stop;

use crate::exit::Exit;
use crate::host;
use crate::output::say;

/// A run, as the handler knows it.
#[derive(Debug, Default)]
pub(super) struct Interrupt {
    /// Whether the run is to end.
    pub(super) stop: Arc<AtomicBool>,
    /// Whether the device is at rest again.
    pub(super) over: AtomicBool,
    /// Whether anything is in the log.
    pub(super) logged: AtomicBool,
    /// Where it is, and whether a record is written at the end.
    pub(super) log: Option<PathBuf>,
    pub(super) recorded: bool,
    warned: AtomicBool,
}

static CURRENT: Mutex<Option<Arc<Interrupt>>> = Mutex::new(None);
static HANDLER: Once = Once::new();
/// Set once Ctrl-C was pressed.
static ASKED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Whether Ctrl-C was pressed since the program began.
pub(in crate::commands) fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// What ends a computation after a run: the host, or Ctrl-C.
pub(in crate::commands) fn stopping() -> Stop {
    Stop::from(host::stop().unwrap_or_else(|| Arc::clone(&ASKED)))
}

impl Interrupt {
    /// Looks after this run from now on.
    pub(super) fn watch(self: &Arc<Self>) {
        *CURRENT.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(self));
        HANDLER.call_once(|| {
            let press = || {
                ASKED.store(true, Ordering::Relaxed);
                let current = CURRENT.lock().unwrap_or_else(PoisonError::into_inner).clone();
                if let Some(current) = current {
                    current.press();
                }
            };
            if let Err(error) = ctrlc::set_handler(press) {
                say(&format!("note: Ctrl-C will not ramp the device to rest: {error}"));
            }
        });
    }

    pub(super) fn new(stop: Arc<AtomicBool>, log: Option<PathBuf>, recorded: bool) -> Arc<Self> {
        Arc::new(Self { stop, log, recorded, ..Self::default() })
    }

    fn press(&self) {
        if self.over.load(Ordering::Relaxed) {
            // What was measured is being written: an impatient stop of the run is no wish to lose it.
            if self.warned.swap(true, Ordering::Relaxed) {
                say("error: left at once; what had not been written yet is lost");
                std::process::exit(i32::from(Exit::DeviceLost as u8));
            }
            say("note: stopping; what was measured is kept. Press Ctrl-C again to leave at once");
        } else if self.stop.swap(true, Ordering::Relaxed) {
            // Who asks twice does not want to wait for a device that does not answer.
            say(&format!(
                "error: left before the device was at rest; its watchdog brings it there, look whether it does (hystctl status){}",
                self.kept()
            ));
            std::process::exit(i32::from(Exit::DeviceLost as u8));
        }
    }

    fn kept(&self) -> String {
        match self.log.as_ref().filter(|_| self.logged.load(Ordering::Relaxed)) {
            Some(path) => {
                format!("; what was measured, but for the last half second, can be read in {}", path.display())
            }
            None if self.recorded => {
                "; what was measured is lost: give --log, too, which is written as it comes".to_owned()
            }
            None => String::new(),
        }
    }
}
