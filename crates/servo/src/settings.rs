// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use crate::control::{Home, Mode};
use crate::estimation::{Mounting, Prediction};
use crate::model::{SoftLimits, SpeedCurve, SpeedMap};

/// Everything that can be set about the servo.
#[derive(Debug, Clone, PartialEq)]
pub struct ServoSettings {
    /// How the camera is to be moved, if it takes the words for that.
    pub mode: Mode,
    /// Degrees per second for a degree of error, 1/s.
    pub gain: f64,
    /// Offset from the middle that an axis at rest tolerates, as a part of the picture's width.
    pub dead_zone: f64,
    /// Degrees per second that neither axis exceeds.
    pub max_speed_deg_s: f64,
    /// Degrees per second that either axis' speed changes by in a second; a stop is at once.
    pub max_acceleration_deg_s2: f64,
    /// From sending a command to the motion, and from light on the sensor to the picture's timestamp, together.
    pub latency: Duration,
    /// Horizontal field of view in degrees; `None`: what the camera says.
    pub fov_deg: Option<f64>,
    /// How the picture lies to the camera's axes.
    pub mounting: Mounting,
    /// How the target's motion is carried forward.
    pub prediction: Prediction,
    /// The camera is stopped when the target was not seen for this long.
    pub stale_timeout: Duration,
    /// For how long after it was last seen the camera goes after a target that went out of view; zero: not at all.
    pub search_time: Duration,
    /// Degrees per second of the camera's fastest.
    pub camera_speed_deg_s: f64,
    /// How its speed grows up to there.
    pub speed_curve: SpeedCurve,
    /// How far the camera may be moved.
    pub limits: SoftLimits,
    /// The target's height that the zoom keeps, as a part of the picture's; `None` leaves the zoom as it is.
    pub target_height: Option<f64>,
    /// Whether latency, field of view and speed map are learned; the settings above are where that begins.
    pub learn: bool,
    /// Whether it is learned too which way each axis turns the picture; slow until that is known.
    pub learn_axes: bool,
    /// Whether the zoom of a camera that tells nothing of its lens is used by what the picture shows of it.
    pub learn_zoom: bool,
    /// Where the camera waits for a target; `None`: where the last one left it.
    pub home: Option<Home>,
    /// It goes there when nobody was there for this long, ...
    pub home_timeout: Duration,
    /// ... and as soon as it was met, unless somebody is there.
    pub home_at_start: bool,
}

impl ServoSettings {
    /// The speed map of a camera that does not tell its own.
    pub fn speed_map(&self) -> SpeedMap {
        SpeedMap::new(self.camera_speed_deg_s, self.speed_curve)
    }
}

impl Default for ServoSettings {
    fn default() -> Self {
        Self {
            mode: Mode::default(),
            gain: 2.0,
            dead_zone: 0.03,
            max_speed_deg_s: 100.0,
            max_acceleration_deg_s2: 600.0,
            latency: Duration::from_millis(200),
            fov_deg: None,
            mounting: Mounting::default(),
            prediction: Prediction::default(),
            stale_timeout: Duration::from_secs(1),
            search_time: Duration::from_secs(3),
            camera_speed_deg_s: 450.0,
            speed_curve: SpeedCurve::default(),
            limits: SoftLimits::default(),
            target_height: None,
            learn: true,
            learn_axes: false,
            learn_zoom: false,
            home: None,
            home_timeout: Duration::from_secs(10),
            home_at_start: false,
        }
    }
}
