//! Errors that fits, searches and simulations share. They are public in [`fit`](crate::fit) and
//! [`everett`](crate::everett).

mod everett;
mod fit;

pub use everett::EverettError;
pub use fit::FitError;
