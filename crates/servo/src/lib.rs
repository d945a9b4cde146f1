// SPDX-License-Identifier: MPL-2.0

//! Model, estimation and control of a camera that follows a target: from where the target is in the picture to what
//! the camera is to do. No HTTP, no GStreamer: what any camera protocol would need.
//!
//! ```text
//! Measurement ─ estimation (angles, rates, prediction) ─ control (limits, zoom, home) ─ Actuation
//!                     │                                         │
//!                     └──────── model (projection, speeds, delays, what was commanded) ────────┘
//! ```
//! Angles are degrees, positive to the right and up; what a camera is told and tells of speed and zoom are parts of the whole
//! (-1 to 1 of the fastest, 0 to 1 of the lens' travel), and what these mean in degrees a second and magnification the model
//! knows. A [`Time`] is a moment, always given by the caller, so that tests turn the clock themselves; a
//! [`Duration`](std::time::Duration) lasts. [`Servo`] is the whole of it.

mod control;
mod estimation;
mod model;
mod servo;
mod settings;
mod time;

pub use control::{Access, Actuation, ActuatorStatus, Home, Mode, Motion};
pub use estimation::{AxisFinding, Estimates, Measurement, Mounting, Prediction, Visibility};
pub use model::{
    CameraModel, Capabilities, CommandHistory, Delays, HardLimits, Lens, PanTilt, Position, Presets, Range,
    SoftLimits, SpeedCurve, SpeedMap, SpeedUnit, TableRow, View, around_deg, is_endless, magnified, narrower,
};
pub use servo::Servo;
pub use settings::ServoSettings;
pub use time::Time;
