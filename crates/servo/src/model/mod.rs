// SPDX-License-Identifier: MPL-2.0

//! What the camera is: what it can do, what it was told, what a place in its picture means.

mod camera;
mod command_history;
mod delays;
mod pan_tilt;
mod projection;
mod ranges;
mod speed_map;

pub use camera::{CameraModel, Capabilities, SpeedUnit};
pub use command_history::CommandHistory;
pub use delays::Delays;
pub use pan_tilt::{PanTilt, around_deg};
pub use projection::{Lens, View, magnified, rise_deg};
pub use ranges::{HardLimits, Position, Presets, Range, SoftLimits, TableRow, is_endless, narrower};
pub use speed_map::{SpeedCurve, SpeedMap};
