//! CAN on Linux, against other implementations: ISO-TP and slcan of the kernel, and can-utils.
//!
//! The tests create CAN interfaces. They need root, can-utils and the kernel's CAN modules, so they are ignored unless
//! asked for. `cargo xtask can` runs them in a machine with all of that.
#![cfg(all(feature = "std", target_os = "linux"))]

mod adapter;
mod interface;
mod isotp;
mod refusals;
mod runs;
