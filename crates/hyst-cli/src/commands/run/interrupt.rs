//! Ctrl-C during a run: the first one ramps the device to rest, the second one ends the program.
//!
//! A program has one handler. It acts on the current run; a command may have several runs in turn.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex, Once, PoisonError};

use hyst_ident::stop::Stop;

use crate::exit::Exit;
use crate::hosted;
use crate::output::say;

/// State of a run for the handler.
#[derive(Debug, Default)]
pub(super) struct Interrupt {
    /// Whether the run must end.
    pub(super) stop: Arc<AtomicBool>,
    /// Whether the device is at rest after the run.
    pub(super) over: AtomicBool,
    /// Whether the log has samples.
    pub(super) logged: AtomicBool,
    /// Path of the log, and whether a record is written after the run.
    pub(super) log: Option<PathBuf>,
    pub(super) recorded: bool,
    warned: AtomicBool,
}

static CURRENT: Mutex<Option<Arc<Interrupt>>> = Mutex::new(None);
static HANDLER: Once = Once::new();
/// Whether Ctrl-C was pressed.
static PRESSED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Returns whether Ctrl-C was pressed since the start of the program.
pub(in crate::commands) fn pressed() -> bool {
    PRESSED.load(Ordering::Relaxed)
}

/// Returns the flag that ends a computation after a run: that of the host, or Ctrl-C.
pub(in crate::commands) fn stopping() -> Stop {
    Stop::from(hosted::stop().unwrap_or_else(|| Arc::clone(&PRESSED)))
}

impl Interrupt {
    /// Makes this run the current one of the handler.
    pub(super) fn watch(self: &Arc<Self>) {
        *CURRENT.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(self));
        HANDLER.call_once(|| {
            let press = || {
                PRESSED.store(true, Ordering::Relaxed);
                let current = CURRENT.lock().unwrap_or_else(PoisonError::into_inner).clone();
                if let Some(current) = current {
                    current.press();
                }
            };
            if let Err(error) = ctrlc::set_handler(press) {
                say(&format!("warning: Ctrl-C will not ramp the device to rest: {error}; use hystctl stop instead"));
            }
        });
    }

    pub(super) fn new(stop: Arc<AtomicBool>, log: Option<PathBuf>, recorded: bool) -> Arc<Self> {
        Arc::new(Self { stop, log, recorded, ..Self::default() })
    }

    fn press(&self) {
        if self.over.load(Ordering::Relaxed) {
            // The measured data are being written: the first Ctrl-C in this phase does not end the program.
            if self.warned.swap(true, Ordering::Relaxed) {
                say("error: ended at once; measured data that were not yet written are lost");
                std::process::exit(i32::from(Exit::DeviceLost as u8));
            }
            say("note: stopping; the measured data are being written. Press Ctrl-C again to end at once");
        } else if self.stop.swap(true, Ordering::Relaxed) {
            // The second Ctrl-C does not wait for a device that does not answer.
            say(&format!(
                "error: ended before the device was at rest; its watchdog ramps it to rest, check that with hystctl status{}",
                self.kept()
            ));
            std::process::exit(i32::from(Exit::DeviceLost as u8));
        }
    }

    fn kept(&self) -> String {
        match self.log.as_ref().filter(|_| self.logged.load(Ordering::Relaxed)) {
            Some(path) => {
                format!("; the measured data, except for the last 0.5 s, are in {}", path.display())
            }
            None if self.recorded => {
                "; the measured data are lost; give --log as well, which is written during the run".to_owned()
            }
            None => String::new(),
        }
    }
}
