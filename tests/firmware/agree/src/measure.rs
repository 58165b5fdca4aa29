//! Measures instructions and stack of a function.

use core::arch::asm;
use cortex_m::Peripherals;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::register::msp;

/// Counts instructions with SysTick.
///
/// With `-icount shift=6` of QEMU, an instruction takes 64 ns. A tick of the board's 25 MHz clock is 40 ns.
#[derive(Debug)]
pub struct Counter(());

impl Counter {
    /// Largest value of SysTick (24 bits).
    pub const MOST: u32 = 0x00ff_ffff;

    /// Starts SysTick; returns `None` on a second call.
    pub fn start() -> Option<Self> {
        let mut systick = Peripherals::take()?.SYST;
        systick.set_clock_source(SystClkSource::Core);
        systick.set_reload(Self::MOST);
        systick.clear_current();
        systick.enable_counter();
        Some(Self(()))
    }

    /// Returns the ticks of `f`, including two readings of SysTick; at most [`MOST`](Self::MOST).
    pub fn ticks(&self, f: impl FnOnce()) -> u32 {
        let from = SYST::get_current();
        f();
        from.wrapping_sub(SYST::get_current()) & Self::MOST
    }

    /// Converts ticks to instructions.
    pub fn instructions(ticks: u64) -> u64 {
        (ticks * 10 + 8) / 16
    }

    /// Returns whether the count is right for a loop of known length; without `-icount` it is not.
    pub fn is_true(&self) -> bool {
        const TURNS: u32 = 10_000;
        let ticks = self.ticks(|| {
            // SAFETY: decrements its own register, with two instructions per turn.
            unsafe { asm!("2:", "subs {n}, {n}, #1", "bne 2b", n = inout(reg) TURNS => _, options(nomem, nostack)) }
        });
        Self::instructions(ticks.into()).abs_diff(2 * u64::from(TURNS)) <= 8
    }
}

const PAINT: u32 = 0xa5c3_3c5a;

/// Returns the stack of `f` (bytes), if it is less than `depth`.
#[inline(never)]
pub fn stack(depth: usize, f: impl FnOnce()) -> usize {
    let top = msp::read() as usize & !3;
    let bottom = top - depth;
    for word in (bottom..top).step_by(4) {
        // SAFETY: this RAM is between the stack and the statics (the map has 4 MB). Nothing is stored below the stack
        // pointer, no interrupt is enabled, and the loop calls no function.
        unsafe { core::ptr::write_volatile(word as *mut u32, PAINT) }
    }
    call(f);
    let mut untouched = bottom;
    // SAFETY: as above, but read only.
    while untouched < top && unsafe { core::ptr::read_volatile(untouched as *const u32) } == PAINT {
        untouched += 4;
    }
    top - untouched
}

/// Calls `f` in its own stack frame, below that of the caller.
#[inline(never)]
fn call(f: impl FnOnce()) {
    f();
}
