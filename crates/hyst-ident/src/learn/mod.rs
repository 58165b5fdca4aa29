//! Iterative learning control: improves the drive of a repeated reference from the measured output.
//!
//! A pass plays a drive u. The model predicts the output v, and the output y is measured. The error is e = r − y. The
//! predicted output is changed by L e, and the model's inverse converts this change to a change of the drive (Moore
//! 1993; Leang and Devasia 2006 for piezo actuators, with a linear inverse). The filter L is computed from the
//! measurements:
//!
//! - D, the response of the measured output to a change of the predicted one, is 1 for an exact model. D contains gain
//!   and delay errors and missing modes. It is estimated from the first pass and from the changes between passes: as a
//!   rational response with a delay, and in narrow frequency bands. Its variance is s², plus a share of |D|² because
//!   the slope of a hysteresis varies. L = D* / (|D|² + s²) is the change with the smallest expected square of the
//!   remaining error. The variance is not exact: the rational response and the bands are estimated from the same
//!   passes.
//! - Each pass plays the drive several times. One more play before them is not used, so the memory of the actuator is
//!   that of this drive. The differences between the plays do not repeat (noise, creep, drift). Their power N in each
//!   band limits the correction of an error E to L (1 − 3 N / |E|²) E, or 0 if that is negative.
//!
//! A change starts from the best pass so far. After a worse pass it is halved. Learning ends at the repeatability, the
//! error between plays of the same drive.

mod bands;
mod error;
mod following;
mod holds;
mod inverse;
mod learner;
mod pass;
mod rational;
mod response;
mod spectrum;

pub use error::LearnError;
pub use inverse::LearnedDrive;
pub use learner::{LearnOptions, Learner};
pub use pass::{Ended, Pass};
