//! ARMAX models: `A(q) y = B(q) u + d + C(q) e`.

mod delay;
mod fit;
mod innovations;
mod model;
mod modes;
mod order;
mod prediction;
mod stacked;
mod start;
#[cfg(test)]
mod tests;

pub use delay::estimate_delay;
pub use fit::{ArmaxOptions, Delay, fit_armax};
pub use model::Armax;
pub use modes::{Mode, Zero};
pub use order::{Order, OrderChoice, OrderRow, choose_order};
