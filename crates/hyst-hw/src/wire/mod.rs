//! What goes over a serial line, a CAN bus or a socket, the same source on host and board: no heap, no clock, no device.
//!
//! - `frame.rs`: bytes to frames and back.
//! - `iso_tp.rs`: messages over a CAN bus.
//! - `message.rs`: what host and device say to each other.
//! - `device.rs`: what a device does with it.
//! - `lasting.rs`: for how long something has gone on, as an error that is too large.
//! - `recipe.rs`: a model, a PID and a force observer as bytes.
//! - `follower.rs`: how a device follows references with them.
//! - `server.rs`: requests and answers over the drivers of a board.

mod device;
mod follower;
mod frame;
mod iso_tp;
mod lasting;
mod message;
mod recipe;
mod server;

pub use device::{Board, Control, Device, Open, PATIENCE_S, Shown};
pub use follower::{Follower, SATURATION_TOLERANCE, lateness};
pub use frame::{Deframer, FrameError, MAX_FRAME, MAX_PAYLOAD, encode};
pub use iso_tp::{CanData, IsoTp, IsoTpError, MOST_CAN};
pub use lasting::Lasting;
pub use message::{
    Ask, Chunk, Exchange, Fault, Field, Identity, MOST_CHUNK, MOST_DRIVES, MOST_NAME, MOST_SAMPLES, Measured, Mode,
    PROTOCOL, Refusal, Reply, Request, Start, State, Status, Tell, Unit, model_sum,
};
pub use recipe::{
    MOST_ELEMENTS, MOST_HEAD, MOST_PLAYS, Model, RECIPE, Recipe, RecipeError, head as recipe_head, read as read_recipe,
};
pub use server::{CanServer, SerialServer};
