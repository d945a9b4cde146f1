//! How bright it is where: lamps, daylight and what walls throw back.

use super::view::{Vector, dot, scale, subtract};

/// The light of the room before any shadow.
#[derive(Debug, Clone)]
pub(crate) struct Light {
    /// Middles of the lamps.
    pub lamps: Vec<Vector>,
    /// Middles of the windows; their glow is weaker and falls off faster.
    pub windows: Vec<Vector>,
}

impl Light {
    /// What a surface at `point` facing along `normal` (a unit vector) sends back of its brightness: about 0.4 to 1.15.
    pub fn at(&self, point: Vector, normal: Vector) -> f64 {
        let falling = |&source: &Vector, strength: f64, radius: f64| {
            let way = subtract(source, point);
            let squared = dot(way, way);
            // Half Lambert: light thrown back by the walls comes from everywhere.
            let facing = 0.5 + 0.5 * dot(scale(way, 1.0 / squared.sqrt().max(1e-6)), normal);
            strength * facing / (1.0 + squared / (radius * radius))
        };
        let lamps: f64 = self.lamps.iter().map(|lamp| falling(lamp, 0.62, 2.4)).sum();
        let windows: f64 = self.windows.iter().map(|window| falling(window, 0.5, 1.5)).sum();
        let upwards = 0.06 * normal[1];
        // Bright places saturate as film does.
        let sum = 0.42 + lamps + windows + upwards;
        1.22 * (1.0 - (-1.3 * sum).exp())
    }
}
