// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use crate::Time;

use ptztrack_contract::{Point, Rect, TargetState, Vector};

/// How the tracker knows where the target is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Visibility {
    /// It sees it.
    Seen,
    /// It is hidden, and predicted.
    Predicted,
    /// It was lost in this picture.
    Lost,
    /// There is none.
    Gone,
    /// There is to be none: it was let go on purpose.
    Released,
}

impl From<TargetState> for Visibility {
    fn from(state: TargetState) -> Self {
        match state {
            TargetState::Tracking => Self::Seen,
            TargetState::Occluded => Self::Predicted,
            TargetState::Lost => Self::Lost,
            TargetState::Searching => Self::Gone,
        }
    }
}

/// The target in one picture, as estimation needs it: what the tracker's record in the contract says, with the shape of the
/// picture and the time it was taken by the servo's own clock. That record is GStreamer's, which nothing here may know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// How the tracker knows.
    pub visibility: Visibility,
    /// Which target.
    pub id: u64,
    /// Where, in frame widths and heights from the top left.
    pub centroid: Point,
    /// The box about it, in the same units.
    pub bounds: Rect,
    /// Its motion in the picture, frames per second.
    pub velocity: Vector,
    /// The background's motion in the picture, same unit, where it was seen.
    pub ego_velocity: Option<Vector>,
    /// The logarithm of the background's magnification per second, where it was seen.
    pub ego_zoom: Option<f64>,
    /// For how long the picture has shown the same, where that was seen.
    pub unchanged_for: Option<Duration>,
    /// Size of the picture in pixels.
    pub size: (u32, u32),
    /// Width by height of the picture as displayed.
    pub aspect: f64,
    /// When the picture was taken, as far as its timestamp tells.
    pub taken_at: Time,
}

impl Measurement {
    /// A box that comes this near to the picture's edge may be cut off by it.
    pub const EDGE: f64 = 0.005;

    /// What a background at rest seems to move in a second, in fields of view.
    pub const NOISE_FIELDS_S: f64 = 0.02;

    /// How many fields of view a second the background moves, where it was seen.
    pub fn background_fields_s(&self) -> Option<f64> {
        // A zoom moves the picture's edges by half as much as it grows.
        let zoom = self.ego_zoom.map_or(0.0, |zoom| zoom.abs() / 2.0);
        self.ego_velocity.map(|ego| ego.x.hypot(ego.y).max(zoom))
    }

    /// What the background would show had the camera only turned; `None` where it was not seen.
    pub fn without_zoom(&self) -> Option<Self> {
        let (turned, zoom) = self.ego_velocity.zip(self.ego_zoom)?;
        let Point { x, y } = self.centroid;
        let ego_velocity = Vector { x: turned.x - zoom * (x - 0.5), y: turned.y - zoom * (y - 0.5) };
        Some(Self { ego_velocity: Some(ego_velocity), ..*self })
    }

    /// Whether it may be cut off by one side of the picture, which it moves out of: sideways, and up or down.
    pub fn leaves_view(&self) -> (bool, bool) {
        let Rect { x, y, width, height } = self.bounds;
        let leaves = |from: f64, length: f64, speed: f64| {
            let (low, high) = (from < Self::EDGE, from + length > 1.0 - Self::EDGE);
            length > 0.0 && (low && !high && speed < 0.0 || high && !low && speed > 0.0)
        };
        (leaves(x, width, self.velocity.x), leaves(y, height, self.velocity.y))
    }

    /// A target of ordinary size that is seen there, and does not move: what tests and examples begin with.
    pub fn at(x: f64, y: f64, taken_at: Time) -> Self {
        Self {
            visibility: Visibility::Seen,
            id: 1,
            centroid: Point { x, y },
            bounds: Rect { x: x - 0.05, y: y - 0.1, width: 0.1, height: 0.2 },
            velocity: Vector::default(),
            ego_velocity: None,
            ego_zoom: None,
            unchanged_for: None,
            size: (640, 480),
            aspect: 4.0 / 3.0,
            taken_at,
        }
    }
}
