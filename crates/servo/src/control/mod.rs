// SPDX-License-Identifier: MPL-2.0

//! What the camera is to do, by what was estimated.

mod actuation;
mod controller;
mod home;
mod limits;
mod oscillation;
mod point_to_point;
mod zoom;
mod zoom_drive;

pub use actuation::{Access, Actuation, ActuatorStatus, Mode, Motion};
pub use controller::{ControlLaw, Controller};
pub use home::{Home, HomeReturn};
pub use limits::LimitEnforcer;
pub use oscillation::OscillationGuard;
pub use point_to_point::PointToPoint;
pub use zoom_drive::{Jump, ZoomDrive, ZoomGoal};
