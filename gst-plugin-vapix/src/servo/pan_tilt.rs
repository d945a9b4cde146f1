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

    /// The larger of both sizes.
    pub fn largest(&self) -> f64 {
        self.pan.abs().max(self.tilt.abs())
    }
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
