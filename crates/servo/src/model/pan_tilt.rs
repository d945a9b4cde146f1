// SPDX-License-Identifier: MPL-2.0

use std::ops::{Add, Div, Mul, Sub};

/// A pair of angles (degrees) or of angular rates (degrees per second), positive to the right and up.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PanTilt {
    /// To the right.
    pub pan: f64,
    /// Up.
    pub tilt: f64,
}

impl PanTilt {
    /// The pair.
    pub fn new(pan: f64, tilt: f64) -> Self {
        Self { pan, tilt }
    }

    /// What `f` makes of both pans, and of both tilts.
    pub fn each(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self::new(f(self.pan, other.pan), f(self.tilt, other.tilt))
    }

    /// The scalar product.
    pub fn dot(self, other: Self) -> f64 {
        self.pan * other.pan + self.tilt * other.tilt
    }

    /// Whether both are numbers, and not infinite.
    pub fn is_finite(self) -> bool {
        self.pan.is_finite() && self.tilt.is_finite()
    }

    /// The turn from here to there, pan the short way round.
    pub fn turn_to(self, there: Self) -> Self {
        let turn = there - self;
        Self::new(around_deg(0.0, turn.pan), turn.tilt)
    }

    /// The larger of both sizes.
    pub fn largest(&self) -> f64 {
        self.pan.abs().max(self.tilt.abs())
    }
}

/// An angle in degrees as what it is within the circle around `middle_deg`: up to half a turn to either side of it.
pub fn around_deg(middle_deg: f64, angle_deg: f64) -> f64 {
    // The half turn itself is one to the right; what is within already is exactly that.
    angle_deg - 360.0 * ((angle_deg - middle_deg - 180.0) / 360.0).ceil()
}

impl Add for PanTilt {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::new(self.pan + other.pan, self.tilt + other.tilt)
    }
}

impl Sub for PanTilt {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self::new(self.pan - other.pan, self.tilt - other.tilt)
    }
}

impl Mul<f64> for PanTilt {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self::new(self.pan * factor, self.tilt * factor)
    }
}

impl Div<f64> for PanTilt {
    type Output = Self;

    fn div(self, divisor: f64) -> Self {
        Self::new(self.pan / divisor, self.tilt / divisor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_angle_is_taken_the_short_way_round() {
        for (middle, angle, expected) in [
            (0.0, 190.0, -170.0),
            (0.0, -190.0, 170.0),
            (0.0, 180.0, 180.0),
            (0.0, -180.0, 180.0),
            (0.0, 725.0, 5.0),
            (60.0, -179.8, 180.2),
            (60.0, -100.0, -100.0),
            (175.0, -10.0, 350.0),
        ] {
            assert!((around_deg(middle, angle) - expected).abs() < 1e-9, "{middle}, {angle}");
        }
    }
}
