// SPDX-License-Identifier: MPL-2.0

//! What is measured: where the target is, how it moves, and what the camera does not say of itself.
//!
//! The camera is learned while a target is followed, from how the background moves in the picture (the tracker's
//! ego-motion), against what was commanded and where the camera says it looks:
//!
//! ```text
//! rotation seen in the picture ─┬─ against positions told ── field of view   (how many degrees a picture is wide)
//!                               ├─ against commands ──────── latency         (when they agree best)
//!                               ├─ against speeds told ───── speed map       (degrees per second of a step)
//!                               └─ against signs ─────────── axes            (which way each turns the picture)
//! growth of the background ──────── against commands ──────── magnification   (of a lens that the camera does not tell)
//! ```
//! Each is learned by itself and bounded, and starts from what the camera told or the user set. Only a
//! position gives degrees: without one the field of view stays as it is, and the speed map fits to it, so
//! that a command still does in the picture what it is meant to.

mod axes;
mod calibration;
mod field_of_view;
mod frozen_picture;
mod latency;
mod magnification;
mod measurement;
mod mounting;
mod rate;
mod recursive_least_squares;
mod speed_map;
mod target;
mod zoom;

pub use axes::{AxisEstimator, AxisFinding};
use calibration::ObservedRotation;
pub use calibration::{Estimates, SelfCalibration};
use field_of_view::FieldOfViewEstimator;
pub use frozen_picture::FrozenPictureDetector;
use latency::LatencyEstimator;
pub use magnification::{LensFinding, MagnificationEstimator};
pub use measurement::{Measurement, Visibility};
pub use mounting::Mounting;
pub use rate::{RateAverage, Samples};
use recursive_least_squares::RecursiveLeastSquares;
use speed_map::{Maps, SpeedMapEstimator};
pub use target::{Offset, Prediction, TargetEstimator};
pub use zoom::ZoomEstimator;
