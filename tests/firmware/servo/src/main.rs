//! Reference firmware: an actuator that follows references, with a host on a serial line.
//!
//! Clock and line belong to this board (`board.rs`), and the actuator is simulated (`hyst-onboard`). Everything else is
//! the same source as on the host. On a real board, replace `OnBoard` with the converters.
#![no_std]
#![no_main]

mod board;

use core::panic::PanicInfo;

use board::{Clock, Uart};
use cortex_m::asm::wfi;
use cortex_m_rt::{ExceptionFrame, entry, exception};
use cortex_m_semihosting::{debug, hprintln};
use hyst_hw::wire::{Board, SerialServer};
use hyst_onboard::{OnBoard, RATE_HZ, REST_V, servo};

#[entry]
fn main() -> ! {
    let mut line = Uart::open();
    let (mut servo, mut actuator) = (servo(), OnBoard::default());
    // Set the rest voltage, which the device assumes at the start. A reset may leave another output.
    actuator.put_out(REST_V);
    let mut rate_hz = RATE_HZ;
    let Some(mut clock) = Clock::start(rate_hz) else { panic!("SysTick is taken") };
    let mut server = SerialServer::new();
    loop {
        // Missed periods are counted but not repeated: several drives at once would be a step of the output.
        if let Some(late) = clock.passed().checked_sub(1) {
            servo.missed(late);
            servo.tick(&mut actuator);
        }
        let Ok(()) = server.poll(&mut servo, &mut line);
        // Slew limit, tolerances and watchdog count periods of the run's rate. This board has one rate; others may have
        // several.
        if servo.rate_hz() != rate_hz {
            rate_hz = servo.rate_hz();
            clock.set(rate_hz);
        }
    }
}

/// Ends the emulation.
///
/// A real board sets its output to rest here, without the parts that have just failed. A hardware watchdog must do the
/// same if this function is not reached.
fn end(status: debug::ExitStatus) -> ! {
    debug::exit(status);
    loop {
        wfi();
    }
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    hprintln!("error: {}", info);
    end(debug::EXIT_FAILURE)
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    hprintln!("error: hard fault, {:?}", frame);
    end(debug::EXIT_FAILURE)
}
