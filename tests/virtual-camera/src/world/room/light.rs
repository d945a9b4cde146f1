// SPDX-License-Identifier: MPL-2.0

//! How bright it is where: lamps, daylight and what walls throw back.

use super::view::{Vector, dot, scale, subtract};

/// The light of the room before any shadow.
#[derive(Debug, Clone)]
pub(crate) struct Light {
    /// Middles of the lamps.
    pub lamps: Vec<Vector>,
    /// Middles of the windows; their glow is weaker and falls off faster.
    pub windows: Vec<Vector>,
    /// How strong they are.
    pub strength: Strength,
}

/// What the sources of light give.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Strength {
    /// Light that comes from everywhere.
    around: f64,
    /// A lamp, and how far away it gives half of that, in metres.
    lamp: (f64, f64),
    /// A window, likewise.
    window: (f64, f64),
}

impl Strength {
    /// Lamps all over the ceiling, and daylight.
    pub const DAY: Self = Self { around: 0.42, lamp: (0.62, 2.4), window: (0.5, 1.5) };
    /// A few lamps in the dark, painted brighter than they are by [`Self::NIGHT_PAINTED`], so that the dark has shades.
    pub const NIGHT: Self = Self { around: 0.135, lamp: (1.0, 0.9), window: (0.09, 1.0) };
    /// Part of the painted light that there really is by night: 3 stops less.
    pub const NIGHT_PAINTED: f64 = 0.12;
}

impl Light {
    /// What a surface at `point` facing along `normal` (a unit vector) sends back of its brightness: about 0.4 to 1.15 by
    /// day, 0.2 to 1 as painted by night.
    pub fn at(&self, point: Vector, normal: Vector) -> f64 {
        let falling = |&source: &Vector, (strength, radius): (f64, f64)| {
            let way = subtract(source, point);
            let squared = dot(way, way);
            // Half Lambert: light thrown back by the walls comes from everywhere.
            let facing = 0.5 + 0.5 * dot(scale(way, 1.0 / squared.sqrt().max(1e-6)), normal);
            strength * facing / (1.0 + squared / (radius * radius))
        };
        let Strength { around, lamp, window } = self.strength;
        let lamps: f64 = self.lamps.iter().map(|source| falling(source, lamp)).sum();
        let windows: f64 = self.windows.iter().map(|source| falling(source, window)).sum();
        let upwards = 0.14 * around * normal[1];
        // Bright places saturate as film does.
        let sum = around + lamps + windows + upwards;
        1.22 * (1.0 - (-1.3 * sum).exp())
    }
}
