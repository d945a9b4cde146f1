// SPDX-License-Identifier: MPL-2.0

//! Where the camera is and how far it goes.

use super::{PanTilt, around_deg};

/// Smallest and largest value of something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
}

impl Range {
    /// A value, or the nearest to it within; where smallest and largest are crossed, the smallest.
    pub fn nearest(&self, value: f64) -> f64 {
        value.min(self.max).max(self.min)
    }
}

/// Where the camera looks, as far as it tells.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Position {
    /// Degrees, positive to the right.
    pub pan_deg: Option<f64>,
    /// Degrees, positive up.
    pub tilt_deg: Option<f64>,
    /// Part of the optical zoom's travel, 0 (wide) to 1; beyond it what cameras magnify digitally.
    pub zoom: Option<f64>,
}

impl Position {
    /// The direction, where it tells both angles.
    pub fn pan_tilt(&self) -> Option<PanTilt> {
        Some(PanTilt::new(self.pan_deg?, self.tilt_deg?))
    }
}

/// How far the camera can look and zoom, as far as it tells.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct HardLimits {
    /// Degrees.
    pub pan_deg: Option<Range>,
    /// Degrees.
    pub tilt_deg: Option<Range>,
    /// Parts of the optical zoom's travel.
    pub zoom: Option<Range>,
    /// Horizontal field of view in degrees: smallest zoomed in, largest zoomed out.
    pub field_angle_deg: Option<Range>,
}

impl HardLimits {
    /// These limits, and where they are silent those of `other`.
    pub fn or(self, other: Self) -> Self {
        Self {
            pan_deg: self.pan_deg.or(other.pan_deg),
            tilt_deg: self.tilt_deg.or(other.tilt_deg),
            zoom: self.zoom.or(other.zoom),
            field_angle_deg: self.field_angle_deg.or(other.field_angle_deg),
        }
    }
}

/// How far the camera may be moved, whatever it could.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SoftLimits {
    /// Degrees; the whole circle is no limit.
    pub pan_deg: Range,
    /// Degrees above the horizon.
    pub tilt_deg: Range,
    /// Parts of the optical zoom's travel.
    pub zoom: Range,
}

impl Default for SoftLimits {
    fn default() -> Self {
        Self {
            pan_deg: Range { min: -180.0, max: 180.0 },
            tilt_deg: Range { min: -180.0, max: 180.0 },
            zoom: Range { min: 0.0, max: 1.0 },
        }
    }
}

impl SoftLimits {
    /// Whether pan or tilt have a limit that one must know the camera's position to keep.
    pub fn bound_turns(&self) -> bool {
        let none = Self::default();
        (self.pan_deg, self.tilt_deg) != (none.pan_deg, none.tilt_deg)
    }

    /// Whether the zoom has a limit.
    pub fn bound_zoom(&self) -> bool {
        self.zoom != Self::default().zoom
    }

    /// A direction, or the nearest to it that is within.
    pub fn nearest(&self, position: PanTilt) -> PanTilt {
        let Range { min, max } = self.pan_deg;
        let pan = around_deg((min + max) / 2.0, position.pan);
        PanTilt::new(self.pan_deg.nearest(pan), self.tilt_deg.nearest(position.tilt))
    }
}

/// Whether a range of pan is so wide that it is no end: the camera turns round and round.
pub fn is_endless(pan_deg: Range) -> bool {
    pan_deg.max - pan_deg.min >= 359.0
}

/// What both allow.
pub fn narrower(hard: Option<Range>, soft: Range) -> Range {
    let hard = hard.unwrap_or(soft);
    Range { min: hard.min.max(soft.min), max: hard.max.min(soft.max) }
}

/// The numbers and names of the positions that are stored in the camera.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Presets(pub Vec<(u32, String)>);

impl Presets {
    /// The number of the preset of this name.
    pub fn number(&self, name: &str) -> Option<u32> {
        self.0.iter().find(|(_, known)| known == name).map(|(number, _)| *number)
    }
}

/// One row of a table of the camera: what a setting of it means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableRow {
    /// The setting, as commands and positions have it: a part of the fastest, or of the zoom's travel.
    pub setting: f64,
    /// What it means, in the table's unit.
    pub value: f64,
}
