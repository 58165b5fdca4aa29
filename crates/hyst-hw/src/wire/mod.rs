//! The protocol over serial lines, CAN buses and sockets.
//!
//! Host and board use the same source. It has no heap, no clock and no drivers.
//!
//! - `frame.rs`: frames on a byte stream.
//! - `iso_tp.rs`: messages over a CAN bus.
//! - `message.rs`: requests and answers.
//! - `board.rs`: the amplifier and the sensors of a device.
//! - `control.rs`: the interface of a controller.
//! - `device.rs`: the device's side of the protocol; `device/answer.rs`: its answers to requests.
//! - `lasting.rs`: the duration of a condition, for example of a tracking error that is too large.
//! - `recipe.rs`: a model, a PID and a force observer as bytes.
//! - `follower.rs`: a controller that follows references with them.
//! - `server.rs`: requests and answers over the drivers of a board.

mod board;
mod control;
mod device;
mod follower;
mod frame;
mod iso_tp;
mod lasting;
mod message;
mod recipe;
mod server;

pub use board::{Board, Shown};
pub use control::{Control, Open};
pub use device::{Device, PATIENCE_S};
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
