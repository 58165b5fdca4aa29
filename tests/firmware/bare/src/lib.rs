//! The core on bare metal and nothing else: no start-up code, no semihosting.
//!
//! Three functions for each case and precision, under the names `build.CASE.f32`, `reset.CASE.f32` and `step.CASE.f32`.
//! Linked alone, with all that it does not reach thrown away, each shows what it costs and what it can run into. The panic
//! handler calls a function that does not exist: **what can panic does not link**.
#![no_std]

use core::panic::PanicInfo;
use hyst_cases::{Case, State, list};
use hyst_core::{Env, Stage};

unsafe extern "C" {
    fn this_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    // SAFETY: there is no such function.
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

            // SAFETY (of all three names): nothing else is called like this.
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
