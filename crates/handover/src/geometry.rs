// SPDX-License-Identifier: MPL-2.0

use nalgebra::{Unit, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// A unit vector: right, down, and forward of pan and tilt 0.
pub type Ray = Unit<Vector3<f64>>;

/// Where a camera looks, or has to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Direction {
    /// Degrees, positive to the right.
    pub pan_deg: f64,
    /// Degrees, positive up.
    pub tilt_deg: f64,
}

impl Direction {
    /// Degrees between this direction and another.
    pub fn angle_to_deg(self, other: Self) -> f64 {
        angle(&self.ray(), &other.ray()).to_degrees()
    }

    pub(crate) fn ray(self) -> Ray {
        let (pan, tilt) = (self.pan_deg.to_radians(), self.tilt_deg.to_radians());
        Unit::new_normalize(Vector3::new(pan.sin() * tilt.cos(), -tilt.sin(), pan.cos() * tilt.cos()))
    }

    pub(crate) fn of(ray: &Ray) -> Self {
        let pan = ray.x.atan2(ray.z);
        Self { pan_deg: pan.to_degrees(), tilt_deg: (-ray.y).clamp(-1.0, 1.0).asin().to_degrees() }
    }
}

/// Where a camera sees somebody's feet: a ray from its lens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Place([f64; 3]);

impl Place {
    /// In the picture of a camera that does not turn: 0 to 1 from its left and from its top. The lens need not be known, as the
    /// homography makes up for it.
    pub fn in_picture(x: f64, y: f64) -> Self {
        Self([x - 0.5, y - 0.5, 1.0])
    }

    /// In this direction from a camera that turns.
    pub fn towards(direction: Direction) -> Self {
        Self((*direction.ray()).into())
    }

    /// Degrees between this place and another, for a camera that turns. In a picture they are the same for all only about: a lens
    /// is not known.
    pub fn angle_to_deg(self, other: Self) -> f64 {
        angle(&self.ray(), &other.ray()).to_degrees()
    }

    pub(crate) fn ray(self) -> Ray {
        Unit::new_normalize(Vector3::from(self.0))
    }

    pub(crate) fn is_finite(self) -> bool {
        self.0.iter().all(|part| part.is_finite()) && self.0 != [0.0; 3]
    }
}

/// Radians between two rays.
pub fn angle(one: &Ray, other: &Ray) -> f64 {
    one.cross(other).norm().atan2(one.dot(other))
}

/// The plane that touches the sphere of directions at a ray.
pub struct Tangent {
    at: Ray,
    across: Vector3<f64>,
    along: Vector3<f64>,
}

impl Tangent {
    pub fn at(ray: Ray) -> Self {
        // Whichever axis it is not near to.
        let aside = if ray.y.abs() < 0.9 { Vector3::y() } else { Vector3::x() };
        let across = aside.cross(&ray).normalize();
        Self { at: ray, across, along: ray.cross(&across) }
    }

    /// Radians, of a ray on this side of the sphere.
    pub fn project(&self, ray: &Ray) -> Option<Vector2<f64>> {
        let depth = ray.dot(&self.at);
        (depth > 0.1).then(|| Vector2::new(ray.dot(&self.across), ray.dot(&self.along)) / depth)
    }

    pub fn ray(&self, place: Vector2<f64>) -> Ray {
        Unit::new_normalize(*self.at + self.across * place.x + self.along * place.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_direction_is_what_its_ray_is(pan_deg in -179.0..179.0f64, tilt_deg in -89.0..89.0f64) {
            let back = Direction::of(&Direction { pan_deg, tilt_deg }.ray());
            prop_assert!((back.pan_deg - pan_deg).abs() < 1e-6 && (back.tilt_deg - tilt_deg).abs() < 1e-6);
        }

        #[test]
        fn a_tangent_leads_back(pan in -180.0..180.0f64, tilt in -89.0..89.0f64, turn in -40.0..40.0f64) {
            let at = |pan_deg, tilt_deg| Direction { pan_deg, tilt_deg }.ray();
            let (middle, other) = (at(pan, tilt), at(pan + turn, tilt / 2.0));
            let tangent = Tangent::at(middle);
            if let Some(place) = tangent.project(&other) {
                prop_assert!(angle(&tangent.ray(place), &other) < 1e-9);
            }
        }
    }

    #[test]
    fn right_and_up_are_where_they_are() {
        let right = Direction { pan_deg: 90.0, tilt_deg: 0.0 }.ray();
        let up = Direction { pan_deg: 0.0, tilt_deg: 90.0 }.ray();
        assert!((right.x - 1.0).abs() < 1e-12 && (up.y + 1.0).abs() < 1e-12);
    }
}
