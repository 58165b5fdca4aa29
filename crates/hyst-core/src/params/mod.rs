//! A whole actuator as parameters: which operator, which stages, in which file or block of bytes.

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
