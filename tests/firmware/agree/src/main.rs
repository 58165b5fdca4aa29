//! Runs all cases on the machine and prints outputs and costs.
//!
//! It prints two lines per case and precision:
//!
//! ```text
//! case pi_10 f32 hash=0123456789abcdef steps=999 instructions=162837 worst=163 stack=56 build_stack=588 …
//! bits pi_10 f32 00000000 3dcccccd …
//! ```
//!
//! `instructions` is the sum over all steps, `worst` the maximum of one step, both minus an empty call. `stack` is the
//! stack of a step, including the call (16 to 32), `build_stack` that of building and resetting; `coefficients` and
//! `state` are their sizes. All sizes are in bytes. The last line is `done`.
#![no_std]
#![no_main]

mod measure;

use core::fmt::Write;
use core::hint::black_box;
use core::panic::PanicInfo;
use cortex_m::asm::wfi;
use cortex_m_rt::{ExceptionFrame, entry, exception};
use cortex_m_semihosting::{debug, hio, hprintln};
use hyst_cases::{Case, Fingerprint, Precision, SAMPLES, State, Visit, each, inputs};
use hyst_core::{Env, Stage};
use measure::{Counter, stack};

#[entry]
fn main() -> ! {
    let Some(counter) = Counter::start() else { panic!("SysTick is taken") };
    assert!(counter.is_true(), "the instruction count is wrong; start QEMU with -icount shift=6");
    each(&mut Bench { counter });
    hprintln!("done");
    end(debug::EXIT_SUCCESS)
}

/// Number of steps of a case; the first sample is a reset.
const STEPS: u64 = SAMPLES as u64 - 1;

/// Measured depth of the stack during build and reset, and during a step (bytes).
const DEEP: usize = 64 * 1024;
const SHALLOW: usize = 4 * 1024;

struct Bench {
    counter: Counter,
}

impl Bench {
    /// Returns the ticks of one step as a call, as in an interrupt routine.
    ///
    /// The call goes through a pointer, so that it is the same for all stages.
    #[inline(never)]
    fn step<T: Precision, S: Stage<T>>(
        &self,
        step: Step<T, S>,
        model: &S,
        state: &mut S::State,
        (env, u): (&Env<T>, T),
        y: &mut T,
    ) -> u64 {
        self.counter.ticks(|| *y = step(model, state, env, u)).into()
    }
}

/// [`Stage::step`] of one stage.
type Step<T, S> = fn(&S, &mut <S as Stage<T>>::State, &Env<T>, T) -> T;

fn pointer<T: Precision, S: Stage<T>>() -> Step<T, S> {
    black_box(|model, state, env, u| model.step(state, env, u))
}

/// A stage that does nothing.
struct Nothing;

impl<T: Precision> Stage<T> for Nothing {
    type State = ();
    fn state(&self) {}
    fn reset(&self, (): &mut (), _: &Env<T>, u0: T) -> T {
        u0
    }
    fn step(&self, (): &mut (), _: &Env<T>, u: T) -> T {
        u
    }
}

impl Visit for Bench {
    fn visit<C: Case, T: Precision>(&mut self) {
        let (mut u, mut env) = ([T::ZERO; SAMPLES], [Env::default(); SAMPLES]);
        inputs::<C, T>(&mut u, &mut env);
        let (mut y, mut again) = ([T::ZERO; SAMPLES], [T::ZERO; SAMPLES]);

        let mut built = None;
        let build_stack = stack(DEEP, || built = C::build::<T>().ok());
        let Some(model) = built else { panic!("{} cannot be built", C::NAME) };
        let mut state = model.state();
        let reset_stack = stack(DEEP, || y[0] = model.reset(&mut state, &env[0], u[0]));
        let mut step_stack = 0;

        let (nothing, step) = (pointer::<T, _>(), pointer::<T, C::Model<T>>());
        let mut idle = 0;
        for ((env, u), y) in env.iter().zip(&u).zip(&mut again).skip(1) {
            idle += self.step(nothing, &Nothing, &mut (), (env, *u), y);
        }
        let (mut all, mut worst) = (0, 0);
        for ((env, u), y) in env.iter().zip(&u).zip(&mut y).skip(1) {
            let ticks = self.step(step, &model, &mut state, (env, *u), y);
            all += ticks;
            worst = worst.max(ticks);
        }

        // Repeat as a block. A reset must remove all effects of the first run.
        again[0] = model.reset(&mut state, &env[0], u[0]);
        model.block(&mut state, &env[1..], &u[1..], &mut again[1..]);
        assert!(same(&y, &again), "{}: a block after a reset differs from steps", C::NAME);

        again[0] = model.reset(&mut state, &env[0], u[0]);
        for ((env, u), y) in env.iter().zip(&u).zip(&mut again).skip(1) {
            step_stack = stack(SHALLOW, || *y = step(&model, &mut state, env, *u)).max(step_stack);
        }
        assert!(same(&y, &again), "{}: a second run after a reset differs", C::NAME);
        assert!(
            build_stack.max(reset_stack) < DEEP && step_stack < SHALLOW,
            "{}: the stack is deeper than the measured depth",
            C::NAME
        );

        hprintln!(
            "case {} {} hash={:016x} steps={} instructions={} worst={} stack={} build_stack={} coefficients={} state={}",
            C::NAME,
            T::NAME,
            Fingerprint::of(&y).0,
            STEPS,
            Counter::instructions(all - idle),
            Counter::instructions(worst - idle / STEPS),
            step_stack,
            build_stack.max(reset_stack),
            size_of::<C::Model<T>>(),
            size_of::<State<C, T>>()
        );
        let mut line = Line::default();
        let _ = write!(line, "bits {} {}", C::NAME, T::NAME);
        for y in &y {
            let _ = write!(line, " {:0width$x}", y.bits(), width = 2 * size_of::<T>());
        }
        let _ = writeln!(line);
        line.send();
    }
}

fn same<T: Precision>(a: &[T], b: &[T]) -> bool {
    a.iter().zip(b).all(|(a, b)| a.bits() == b.bits())
}

/// A line that is sent in one write, because every write to the host stops the machine.
struct Line {
    text: [u8; 64 + 17 * SAMPLES],
    len: usize,
}

impl Default for Line {
    fn default() -> Self {
        Self { text: [0; 64 + 17 * SAMPLES], len: 0 }
    }
}

impl Write for Line {
    fn write_str(&mut self, s: &str) -> core::fmt::Result {
        let room = self.text.get_mut(self.len..self.len + s.len()).ok_or(core::fmt::Error)?;
        room.copy_from_slice(s.as_bytes());
        self.len += s.len();
        Ok(())
    }
}

impl Line {
    fn send(&self) {
        if let Ok(mut out) = hio::hstdout() {
            let _ = out.write_all(&self.text[..self.len]);
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
