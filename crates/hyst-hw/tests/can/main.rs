//! CAN on Linux, against what others have written: the kernel's own ISO-TP and slcan, and can-utils.
//!
//! The tests make interfaces of their own, so they run where `HYST_CAN` is set, as root, with can-utils and the kernel's modules:
//! `cargo xtask can` starts a machine in which all of that is there. Elsewhere each of them says that it skips.
#![cfg(all(feature = "std", target_os = "linux"))]

mod adapter;
mod interface;
mod isotp;
mod refusals;
mod runs;
