//! Parameters of a whole actuator: the operator, the stages around it, and the block of bytes that stores them.

#[cfg(feature = "block")]
mod block;
mod chain;
mod kind;
mod operator;

#[cfg(feature = "block")]
pub use block::{BLOCK_VERSION, BlockError, List, read_block, write_block};
pub use chain::{ChainParams, EffectParams};
pub use kind::{Kind, UnknownKind};
pub use operator::OperatorParams;
