// SPDX-License-Identifier: MPL-2.0

//! How the background moves in the picture while the camera turns or zooms, in pixels.

use opencv::core::{Point2f, Rect2f};
use ptztrack_contract::{Homography, Point};

use super::geometry::{around, centre};
use crate::vision::Observation;

/// From a pixel of the last picture to where a static world has it now.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct EgoMotion {
    motion: Homography,
    /// Nobody saw it: it is taken to have gone on.
    is_coasted: bool,
}

impl EgoMotion {
    /// What was seen of it; `None` where it is not known.
    pub fn of(seen: &Observation) -> Option<Self> {
        Some(Self::in_pixels(seen.scene?.camera_motion?.homography, false, seen))
    }

    /// What was seen of it, or else what it is taken to have been; `None` where neither is known.
    pub fn seen_or_coasted(seen: &Observation) -> Option<Self> {
        Self::of(seen).or_else(|| Some(Self::in_pixels(seen.scene?.coasted_motion?, true, seen)))
    }

    fn in_pixels(motion: Homography, is_coasted: bool, seen: &Observation) -> Self {
        Self { motion: motion.scaled(seen.luma.width() as f64, seen.luma.height() as f64), is_coasted }
    }

    /// Nobody saw it: it is taken to have gone on.
    pub fn is_coasted(&self) -> bool {
        self.is_coasted
    }

    #[cfg(test)]
    fn seen(motion: Homography) -> Self {
        Self { motion, is_coasted: false }
    }

    /// The picture moves as a whole.
    #[cfg(test)]
    pub fn translation(shift: Point2f) -> Self {
        Self::seen(Homography::translation(f64::from(shift.x), f64::from(shift.y)))
    }

    /// The picture grows around its first pixel.
    #[cfg(test)]
    pub fn zoom(growth: f32) -> Self {
        let growth = f64::from(growth);
        Self::seen(Homography([[growth, 0.0, 0.0], [0.0, growth, 0.0], [0.0, 0.0, 1.0]]))
    }

    /// By a homography of pixels counted from `origin`.
    #[cfg(test)]
    pub fn around(centred: Homography, origin: Point2f) -> Self {
        let (x, y) = (f64::from(origin.x), f64::from(origin.y));
        Self::seen(Homography::translation(-x, -y).then(&centred).then(&Homography::translation(x, y)))
    }

    /// Where a background point of the last picture is now.
    pub fn apply(&self, point: Point2f) -> Point2f {
        let moved = self.motion.apply(Point { x: f64::from(point.x), y: f64::from(point.y) });
        Point2f::new(moved.x as f32, moved.y as f32)
    }

    /// How far a background point moved that was at `point` in the last picture.
    pub fn at(&self, point: Point2f) -> Point2f {
        self.apply(point) - point
    }

    /// Where a box that lies on the background is now.
    pub fn apply_to(&self, bounds: Rect2f) -> Rect2f {
        let scale = self.scale_at(centre(bounds));
        around(self.apply(centre(bounds)), bounds.width * scale, bounds.height * scale)
    }

    /// How much larger things are shown, whichever way the camera turned: at the middle of the way that `middle`, that of the picture,
    /// went, where a turn enlarges nothing.
    pub fn magnification(&self, middle: Point2f) -> f32 {
        self.scale_at(middle - self.at(middle) / 2.0)
    }

    /// How the size of things changed at `point`: towards the sides of the picture a turning camera enlarges.
    pub fn scale_at(&self, point: Point2f) -> f32 {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.motion.0;
        let determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
        let depth = g * f64::from(point.x) + h * f64::from(point.y) + i;
        // The root of the determinant of the map's derivative.
        (determinant / depth.powi(3)).abs().sqrt() as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn boxes_grow_as_their_corners_part(g in -2e-4..2e-4, h in -2e-4..2e-4, x in 0.0_f32..640.0, y in 0.0_f32..480.0) {
            let ego = EgoMotion::seen(Homography([[1.02, 0.01, 5.0], [-0.01, 0.99, -3.0], [g, h, 1.0]]));
            let corner = |dx: f32, dy: f32| ego.apply(Point2f::new(x + dx, y + dy));
            let (right, down) = (corner(1.0, 0.0) - corner(-1.0, 0.0), corner(0.0, 1.0) - corner(0.0, -1.0));
            let area = (right.x * down.y - right.y * down.x).abs() / 4.0;
            prop_assert!((ego.scale_at(Point2f::new(x, y)) - area.sqrt()).abs() < 1e-2);
        }
    }
}
