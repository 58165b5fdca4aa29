//! The core on bare metal, without start-up code and semihosting.
//!
//! There are three functions for each case and precision: `build.CASE.f32`, `reset.CASE.f32` and `step.CASE.f32`. Each
//! one is linked alone, without unreachable code, to measure its size. The panic handler calls a function that does not
//! exist, so **a function that can panic does not link**.
#![no_std]

use core::panic::PanicInfo;
use hyst_cases::{Case, State, list};
use hyst_core::{Env, Stage};

unsafe extern "C" {
    fn this_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    // SAFETY: the function does not exist, so this code never links.
    unsafe { this_can_panic() }
}

macro_rules! export {
    ($($name:ident: $model:ty, $low:literal..$high:literal => $build:expr;)*) => {
        $(
            export!(@precision $name f32);
            export!(@precision $name f64);
        )*
    };
    (@precision $name:ident $t:ident) => {
        const _: () = {
            type Model = <list::$name as Case>::Model<$t>;

            // SAFETY (of all three names): no other symbol has this name.
            #[unsafe(export_name = concat!("build.", stringify!($name), ".", stringify!($t)))]
            fn build(slot: &mut Option<Model>) {
                *slot = list::$name::build::<$t>().ok();
            }

            #[unsafe(export_name = concat!("reset.", stringify!($name), ".", stringify!($t)))]
            fn reset(model: &Model, state: &mut State<list::$name, $t>, env: &Env<$t>, u0: $t) -> $t {
                model.reset(state, env, u0)
            }

            #[unsafe(export_name = concat!("step.", stringify!($name), ".", stringify!($t)))]
            fn step(model: &Model, state: &mut State<list::$name, $t>, env: &Env<$t>, u: $t) -> $t {
                model.step(state, env, u)
            }
        };
    };
}

hyst_cases::all_cases!(export);
