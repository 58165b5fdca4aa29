//! Instructions and stack of a function.

use core::arch::asm;
use cortex_m::Peripherals;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::register::msp;

/// Counts instructions with SysTick. QEMU's `-icount shift=6` makes an instruction last 64 ns, a tick of the board's
/// 25 MHz clock is 40 ns.
#[derive(Debug)]
pub struct Counter(());

impl Counter {
    /// The most that SysTick's 24 bits hold.
    pub const MOST: u32 = 0x00ff_ffff;

    /// Starts SysTick. Only once: `None` from then on.
    pub fn start() -> Option<Self> {
        let mut systick = Peripherals::take()?.SYST;
        systick.set_clock_source(SystClkSource::Core);
        systick.set_reload(Self::MOST);
        systick.clear_current();
        systick.enable_counter();
        Some(Self(()))
    }

    /// Ticks that `f` takes, two readings of SysTick included, at most [`MOST`](Self::MOST).
    pub fn ticks(&self, f: impl FnOnce()) -> u32 {
        let from = SYST::get_current();
        f();
        from.wrapping_sub(SYST::get_current()) & Self::MOST
    }

    /// Instructions that take `ticks`.
    pub fn instructions(ticks: u64) -> u64 {
        (ticks * 10 + 8) / 16
    }

    /// Whether a loop of known length counts as what it is: without `-icount` it does not.
    pub fn is_true(&self) -> bool {
        const TURNS: u32 = 10_000;
        let ticks = self.ticks(|| {
            // SAFETY: counts a register of its own down, two instructions a turn.
            unsafe { asm!("2:", "subs {n}, {n}, #1", "bne 2b", n = inout(reg) TURNS => _, options(nomem, nostack)) }
        });
        Self::instructions(ticks.into()).abs_diff(2 * u64::from(TURNS)) <= 8
    }
}

const PAINT: u32 = 0xa5c3_3c5a;

/// Bytes of stack that `f` uses, if they are fewer than the `watched` ones.
#[inline(never)]
pub fn stack(watched: usize, f: impl FnOnce()) -> usize {
    let top = msp::read() as usize & !3;
    let bottom = top - watched;
    for word in (bottom..top).step_by(4) {
        // SAFETY: RAM between the stack and the statics (the map has 4 MB); nothing lies below the stack pointer, no
        // interrupt is on, and the loop calls nothing.
        unsafe { core::ptr::write_volatile(word as *mut u32, PAINT) }
    }
    call(f);
    let mut untouched = bottom;
    // SAFETY: as above, read only.
    while untouched < top && unsafe { core::ptr::read_volatile(untouched as *const u32) } == PAINT {
        untouched += 4;
    }
    top - untouched
}

/// A frame of its own, below the one whose stack pointer was read.
#[inline(never)]
fn call(f: impl FnOnce()) {
    f();
}
