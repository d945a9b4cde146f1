//! What the camera does not say of itself, learned while a target is followed: from how the background moves
//! in the picture (the tracker's ego-motion), against what was commanded and where the camera says it looks.
//!
//! ```text
//! turn seen in the picture ─┬─ against positions told ── field of view   (how many degrees a picture is wide)
//!                           ├─ against commands ──────── latency         (when they agree best)
//!                           └─ against speed steps ───── speed map       (degrees per second of a step)
//! ```
//! Each is learned by itself and bounded, and starts from what the camera told or the user set. Only a
//! position gives degrees: without one the field of view stays as it is, and the speed map fits to it, so
//! that a command still does in the picture what it is meant to.

mod calibration;
mod field;
mod latency;
mod regression;
mod speed;

pub use calibration::{Calibration, Turn};
use field::FieldLearner;
use latency::LatencyLearner;
use regression::Regression;
use speed::{Maps, SpeedLearner};
