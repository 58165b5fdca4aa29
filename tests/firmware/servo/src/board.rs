//! Board support: serial line and clock. For another board, change this file and the memory map.

use core::convert::Infallible;
use core::ptr::{read_volatile, write_volatile};
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::Peripherals;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::exception;
use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};

/// Core clock of the mps2-an386 \[Hz\].
const CLOCK_HZ: f32 = 25_000_000.0;

/// Number of clock periods since the start.
static PERIODS: AtomicU32 = AtomicU32::new(0);

#[exception]
fn SysTick() {
    PERIODS.fetch_add(1, Ordering::Relaxed);
}

/// The sample clock.
pub struct Clock {
    systick: SYST,
    seen: u32,
}

impl Clock {
    /// Starts the clock; returns `None` on a second call.
    pub fn start(rate_hz: f32) -> Option<Self> {
        let mut systick = Peripherals::take()?.SYST;
        systick.set_clock_source(SystClkSource::Core);
        systick.enable_interrupt();
        let mut clock = Self { systick, seen: 0 };
        clock.set(rate_hz);
        clock.systick.enable_counter();
        Some(clock)
    }

    /// Sets the rate from now on. The slowest rate is 1.5 Hz, because the counter has 24 bits.
    pub fn set(&mut self, rate_hz: f32) {
        self.systick.set_reload((CLOCK_HZ / rate_hz) as u32 - 1);
        self.systick.clear_current();
    }

    /// Returns the number of periods since the last call.
    pub fn passed(&mut self) -> u32 {
        let now = PERIODS.load(Ordering::Relaxed);
        let passed = now.wrapping_sub(self.seen);
        self.seen = now;
        passed
    }
}

/// The first UART of the CMSDK (Arm DDI 0479).
pub struct Uart(());

const UART: usize = 0x4000_4000;
const DATA: usize = UART;
const STATE: usize = UART + 0x04;
const CONTROL: usize = UART + 0x08;
const DIVIDER: usize = UART + 0x10;
const SEND_FULL: u32 = 1;
const RECEIVED: u32 = 2;

fn read(register: usize) -> u32 {
    // SAFETY: this board has a UART register at this address. Only `Uart`, which exists once, reads and writes it.
    unsafe { read_volatile(register as *const u32) }
}

fn write(register: usize, value: u32) {
    // SAFETY: as in `read`.
    unsafe { write_volatile(register as *mut u32, value) }
}

impl Uart {
    /// Opens the UART at 926 kbit/s, for both directions.
    pub fn open() -> Self {
        write(DIVIDER, 27);
        write(CONTROL, 0b11);
        // Discard a byte from before.
        read(DATA);
        Self(())
    }
}

impl ErrorType for Uart {
    type Error = Infallible;
}

impl ReadReady for Uart {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(read(STATE) & RECEIVED != 0)
    }
}

impl Read for Uart {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        let Some(byte) = bytes.first_mut() else { return Ok(0) };
        while !self.read_ready()? {}
        *byte = read(DATA) as u8;
        Ok(1)
    }
}

impl WriteReady for Uart {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(read(STATE) & SEND_FULL == 0)
    }
}

impl Write for Uart {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let Some(byte) = bytes.first() else { return Ok(0) };
        while !self.write_ready()? {}
        write(DATA, u32::from(*byte));
        Ok(1)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        while !self.write_ready()? {}
        Ok(())
    }
}
