//! CAN on Linux, against other implementations: ISO-TP and slcan of the kernel, and can-utils.
//!
//! The tests create CAN interfaces. They need root, can-utils and the kernel's CAN modules, and run only if `HYST_CAN`
//! is set. `cargo xtask can` starts a machine with all of that. Otherwise each test prints that it is skipped.
#![cfg(all(feature = "std", target_os = "linux"))]

mod adapter;
mod interface;
mod isotp;
mod refusals;
mod runs;
