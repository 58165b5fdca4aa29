//! Reference firmware: an actuator that follows references, at the end of a serial line.
//!
//! The clock and the line are this board's (`board.rs`), the actuator is a simulated one (`hyst-onboard`); everything else is the same source
//! as on the host. On a real board `OnBoard` is replaced by the converters.
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
    // Whatever stood there before a reset: the device takes it for granted that it begins at rest.
    actuator.put_out(REST_V);
    let mut rate_hz = RATE_HZ;
    let Some(mut clock) = Clock::start(rate_hz) else { panic!("SysTick is taken") };
    let mut server = SerialServer::new();
    loop {
        // Periods for which it comes too late are lost: made up for at once, they would be a jump of the output.
        if let Some(late) = clock.passed().checked_sub(1) {
            servo.missed(late);
            servo.tick(&mut actuator);
        }
        let Ok(()) = server.poll(&mut servo, &mut line);
        // Slew, patience and watchdog count periods of the run's rate, of which this board has one; another may leave the host a choice.
        if servo.rate_hz() != rate_hz {
            rate_hz = servo.rate_hz();
            clock.set(rate_hz);
        }
    }
}

/// Ends the emulation. A board puts its output to rest first, by the shortest way that does not need what has just failed, and has a hardware watchdog
/// that does it where even this is not reached.
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
