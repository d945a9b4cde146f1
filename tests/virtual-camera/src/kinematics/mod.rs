// SPDX-License-Identifier: MPL-2.0

//! How the camera moves: motors, speed maps, delays. Time is always an argument, so that virtual time works too.

mod head;
mod motor;
mod speed;

use std::time::Duration;

pub use head::{Head, Motion, Snapshot};
pub use speed::{ProportionalRule, ProportionalSpeed, SpeedMap};

/// Where a camera looks. Endless pan counts its turns. Pan grows to the right, tilt upwards, zoom (1 to 9999) inwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Degrees.
    pub pan_deg: f64,
    /// Degrees.
    pub tilt_deg: f64,
    /// VAPIX zoom steps.
    pub zoom_step: f64,
}

impl Default for Pose {
    fn default() -> Self {
        Self { pan_deg: 0.0, tilt_deg: 0.0, zoom_step: ZOOM_RANGE.0 }
    }
}

/// Zoom steps from the widest to the narrowest view.
pub const ZOOM_RANGE: (f64, f64) = (1.0, 9999.0);

/// How far pan and tilt go, in degrees.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Limits {
    /// Leftmost and rightmost.
    pub pan_deg: (f64, f64),
    /// Lowest and highest.
    pub tilt_deg: (f64, f64),
}

/// The lens: zoom steps to field of view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Optics {
    /// Horizontal field of view at zoom step 1, in degrees.
    pub wide_fov_deg: f64,
    /// Magnification at zoom step 9999.
    pub max_magnification: f64,
}

impl Optics {
    /// Magnification, linear in the step (Axis' example table: 3868 is 2x, 7736 is 3x of 3.585x).
    pub fn magnification(&self, zoom_step: f64) -> f64 {
        let share = (zoom_step - ZOOM_RANGE.0) / (ZOOM_RANGE.1 - ZOOM_RANGE.0);
        1.0 + share.clamp(0.0, 1.0) * (self.max_magnification - 1.0)
    }

    /// Horizontal field of view in degrees: magnification divides the picture on the sensor, not the angle.
    pub fn fov_deg(&self, zoom_step: f64) -> f64 {
        let wide = (self.wide_fov_deg / 2.0).to_radians().tan();
        2.0 * (wide / self.magnification(zoom_step)).atan().to_degrees()
    }

    /// The zoom step that magnifies so much.
    pub fn zoom_step(&self, magnification: f64) -> f64 {
        let share = (magnification - 1.0) / (self.max_magnification - 1.0);
        ZOOM_RANGE.0 + share.clamp(0.0, 1.0) * (ZOOM_RANGE.1 - ZOOM_RANGE.0)
    }
}

/// How a camera moves; the default is an AXIS Q6034-E as far as it is known (thesis, table 5.1), a guess where it is not.
#[derive(Debug, Clone)]
pub struct Kinematics {
    /// Pan and tilt speed of a speed step.
    pub speed_map: SpeedMap,
    /// Speed limit by field of view, for continuous moves.
    pub proportional_speed: ProportionalSpeed,
    /// Degrees per second squared, pan and tilt. Undocumented.
    pub acceleration_deg_s2: f64,
    /// From a command's arrival to the first movement.
    pub command_delay: Duration,
    /// By how much later, at most, a command acts; each has its own.
    pub command_jitter: Duration,
    /// Play between motor and camera, pan and tilt, in degrees: positions told are the motor's.
    pub backlash_deg: f64,
    /// How far it turns; `None` is as far as there is a world to see.
    pub limits: Option<Limits>,
    /// Pan turns round and round; its limits are told as -180 and 180 degrees, which are no ends then.
    pub endless_pan: bool,
    /// Magnification at the narrowest view; `None` is the world's own.
    pub max_magnification: Option<f64>,
    /// Zoom steps per second at zoom speed 100. Undocumented.
    pub zoom_speed_step_s: f64,
}

impl Kinematics {
    /// How far it turns before a world that can be seen so far, as it is told.
    pub(crate) fn limits_in(&self, world: Limits) -> Limits {
        let limits = self.limits.unwrap_or(world);
        if self.endless_pan { Limits { pan_deg: (-180.0, 180.0), ..limits } } else { limits }
    }
}

/// The same direction from -180 to 180 degrees, as cameras tell it.
pub(crate) fn within_a_turn(pan_deg: f64) -> f64 {
    if pan_deg.abs() <= 180.0 { pan_deg } else { (pan_deg + 180.0).rem_euclid(360.0) - 180.0 }
}

impl Default for Kinematics {
    fn default() -> Self {
        Self {
            speed_map: SpeedMap::Cubic { max_deg_s: 450.0, floor_deg_s: 0.05 },
            proportional_speed: ProportionalSpeed {
                enabled: true,
                max_fields_s: 2.0,
                rule: ProportionalRule::Cap,
            },
            acceleration_deg_s2: 400.0,
            command_delay: Duration::from_millis(60),
            command_jitter: Duration::ZERO,
            backlash_deg: 0.0,
            limits: None,
            endless_pan: false,
            max_magnification: None,
            zoom_speed_step_s: 3000.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lens_of_the_q6034_e() {
        let optics = Optics { wide_fov_deg: 55.2, max_magnification: 18.0 };
        assert!((optics.fov_deg(1.0) - 55.2).abs() < 1e-9);
        assert!((optics.fov_deg(9999.0) - 3.327).abs() < 0.01, "{}", optics.fov_deg(9999.0));
        for magnification in [1.0, 2.0, 7.5, 18.0] {
            let step = optics.zoom_step(magnification);
            assert!((optics.magnification(step) - magnification).abs() < 1e-9);
        }
        assert_eq!(optics.zoom_step(100.0), 9999.0);
    }
}
