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
use hyst_hw::wire::{Deframer, MAX_FRAME, Request, encode};
use hyst_onboard::{OnBoard, RATE_HZ, servo};

#[entry]
fn main() -> ! {
    let mut line = Uart::open();
    let (mut servo, mut actuator) = (servo(), OnBoard::default());
    let Some(mut clock) = Clock::start(RATE_HZ) else { panic!("SysTick is taken") };
    let mut deframer = Deframer::new();
    let (mut frame, mut length, mut sent) = ([0; MAX_FRAME], 0, 0);
    loop {
        if clock.passed() {
            servo.tick(&mut actuator);
        }
        // One answer at a time: while it goes out, requests wait in the line.
        if sent < length {
            sent += usize::from(line.send(frame[sent]));
            continue;
        }
        let Some(byte) = line.receive() else { continue };
        // What was changed on the way is asked again.
        if let Some(Ok(request)) = deframer.next::<Request>(&mut &[byte][..]) {
            let reply = servo.answer(&request);
            length = encode(&reply, &mut frame).map_or(0, <[u8]>::len);
            sent = 0;
        }
    }
}

/// Ends the emulation.
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
