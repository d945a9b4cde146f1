// SPDX-License-Identifier: MPL-2.0

//! How bright it is where: lamps, daylight and what walls throw back.

use super::view::{Vector, add, dot, scale, subtract};

/// The light of the room before any shadow.
#[derive(Debug, Clone)]
pub(crate) struct Light {
    /// Middles of the lamps.
    pub lamps: Vec<Vector>,
    /// Middles of the windows; their glow is weaker and falls off faster.
    pub windows: Vec<Vector>,
    /// Direction to the sun, of length 1, where it shines.
    pub sun: Option<Vector>,
    /// How strong they are.
    pub strength: Strength,
    /// The light from all around instead of all these, where that is known.
    pub surroundings: Option<Irradiance>,
}

/// The light on a surface by its direction: spherical harmonics of the first order, all that half a sphere of light leaves
/// of what is around (Ramamoorthi and Hanrahan, 2001, with the linear part alone).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Irradiance {
    mean: f64,
    /// How much more falls on what faces along x, y, z.
    more: Vector,
}

impl Irradiance {
    /// Adds light that comes from a direction of length 1.
    pub fn add(&mut self, direction: Vector, light: f64) {
        self.mean += light;
        // The cosine's own two parts: 1/4 and 1/2, that is 1 and 2.
        self.more = add(self.more, scale(direction, 2.0 * light));
    }

    /// As strong as `level` on the average of upright surfaces, nowhere stronger than `contrast` times that.
    pub fn levelled(self, level: f64, contrast: f64) -> Self {
        let more = scale(self.more, level / self.mean.max(1e-9));
        let length = dot(more, more).sqrt();
        Self { mean: level, more: scale(more, (level * (contrast - 1.0) / length.max(1e-9)).min(1.0)) }
    }

    /// On a surface facing along `normal`, of length 1.
    pub fn at(&self, normal: Vector) -> f64 {
        (self.mean + dot(self.more, normal)).max(0.2 * self.mean)
    }
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
    /// The sun, where it falls square to a surface.
    sun: f64,
}

impl Strength {
    /// Lamps all over the ceiling, and daylight.
    pub const DAY: Self = Self { around: 0.42, lamp: (0.62, 2.4), window: (0.5, 1.5), sun: 0.0 };
    /// A few lamps in the dark, painted brighter than they are by [`Self::NIGHT_PAINTED`], so that the dark has shades.
    pub const NIGHT: Self = Self { around: 0.135, lamp: (1.0, 0.9), window: (0.09, 1.0), sun: 0.0 };
    /// Under the sky, with or without the sun.
    pub const OPEN_AIR: Self = Self { around: 0.5, lamp: (0.0, 1.0), window: (0.0, 1.0), sun: 0.45 };
    /// Street lamps, painted as [`Self::NIGHT`] is.
    pub const STREET: Self = Self { around: 0.1, lamp: (0.9, 3.2), window: (0.0, 1.0), sun: 0.0 };
    /// Next to nothing but the camera's own infrared lamp, painted as [`Self::NIGHT`] is.
    pub const INFRARED: Self = Self { around: 0.03, lamp: (1.3, 6.0), window: (0.0, 1.0), sun: 0.0 };
    /// Part of the painted light that there really is by night: 3 stops less.
    pub const NIGHT_PAINTED: f64 = 0.12;
}

impl Light {
    /// The light from everywhere alone; lamps and the sun are still to be put up.
    pub fn even(strength: Strength) -> Self {
        Self { lamps: Vec::new(), windows: Vec::new(), sun: None, strength, surroundings: None }
    }

    /// What a surface at `point` facing along `normal` (a unit vector) sends back of its brightness: about 0.4 to 1.15 by
    /// day, 0.2 to 1 as painted by night.
    pub fn at(&self, point: Vector, normal: Vector) -> f64 {
        if let Some(surroundings) = &self.surroundings {
            return surroundings.at(normal);
        }
        let falling = |&source: &Vector, (strength, radius): (f64, f64)| {
            let way = subtract(source, point);
            let squared = dot(way, way);
            // Half Lambert: light thrown back by the walls comes from everywhere.
            let facing = 0.5 + 0.5 * dot(scale(way, 1.0 / squared.sqrt().max(1e-6)), normal);
            strength * facing / (1.0 + squared / (radius * radius))
        };
        let Strength { around, lamp, window, sun } = self.strength;
        let lamps: f64 = self.lamps.iter().map(|source| falling(source, lamp)).sum();
        let windows: f64 = self.windows.iter().map(|source| falling(source, window)).sum();
        let sun = self.sun.map_or(0.0, |towards| sun * dot(towards, normal).max(0.0));
        let upwards = 0.14 * around * normal[1];
        // Bright places saturate as film does.
        let sum = around + lamps + windows + sun + upwards;
        1.22 * (1.0 - (-1.3 * sum).exp())
    }
}
