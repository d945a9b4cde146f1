// SPDX-License-Identifier: MPL-2.0

//! Where a point of the room is in the picture.
//!
//! World: metres, x to the right, y up, z ahead at pan 0; the floor is y = 0. Axes of the camera as in
//! [`crate::geometry`]: x to the right, y down, z ahead.

use crate::{
    geometry::{Matrix, Pinhole, rotation},
    kinematics::Pose,
};

/// A place or direction in the room: x, y, z in metres.
pub(crate) type Vector = [f64; 3];

/// What is drawn on: luma at full, chroma at half the resolution.
pub(crate) use crate::picture::Picture as Canvas;

/// Where the camera hangs.
pub(crate) const CAMERA: Vector = [0.0, 2.5, 0.0];

/// A picture of the room to be taken: where the camera looks, and through which pinhole.
///
/// The pinhole's centre may lie anywhere, also outside of the picture: a view of any part of the image plane.
#[derive(Debug, Clone)]
pub(crate) struct View {
    /// From pixels' places to rays. Centres of pixels are at whole numbers, as everywhere in [`crate::geometry`].
    pub pinhole: Pinhole,
    /// Width and height in pixels.
    pub size: (usize, usize),
    /// From the camera's axes to the room's, y down in both.
    rotation: Matrix,
    /// Where the lens is.
    lens: Vector,
}

impl View {
    /// What a camera that looks along `pose` sees through `pinhole`.
    pub fn new(pose: &Pose, pinhole: Pinhole, size: (u32, u32)) -> Self {
        Self { pinhole, size: (size.0 as usize, size.1 as usize), rotation: rotation(pose), lens: CAMERA }
    }

    /// The same through a lens that is so many metres ahead of the axes that the camera turns about.
    pub fn ahead(self, offset_m: f64) -> Self {
        let [right, down, ahead] = self.rotation.map(|line| line[2] * offset_m);
        Self { lens: add(self.lens, [right, -down, ahead]), ..self }
    }

    /// The same through a lens somewhere else.
    pub fn with_lens(self, lens: Vector) -> Self {
        Self { lens, ..self }
    }

    /// Where the lens is.
    pub fn lens(&self) -> Vector {
        self.lens
    }

    /// The same view on the chroma planes.
    pub fn halved(&self) -> Self {
        let size = (self.size.0.div_ceil(2), self.size.1.div_ceil(2));
        Self { pinhole: self.pinhole.halved(), size, ..self.clone() }
    }

    /// The same direction through another pinhole, for a look at a part of the picture, or beyond its edge.
    pub fn through(&self, pinhole: Pinhole, size: (usize, usize)) -> Self {
        Self { pinhole, size, ..self.clone() }
    }

    /// A direction of the world in the axes of the camera.
    pub fn turned(&self, direction: Vector) -> Vector {
        let [x, y, z] = direction;
        [0, 1, 2]
            .map(|axis| self.rotation[0][axis] * x - self.rotation[1][axis] * y + self.rotation[2][axis] * z)
    }

    /// The direction of the world that a pixel shows, of depth 1 in the axes of the camera.
    pub fn ray(&self, x: f64, y: f64) -> Vector {
        let Pinhole { focal, centre_x, centre_y } = self.pinhole;
        let seen = [(x - centre_x) / focal, (y - centre_y) / focal, 1.0];
        let [right, down, ahead] = self.rotation.map(|line| dot(line, seen));
        [right, -down, ahead]
    }

    /// A place of the world in the axes of the camera; the last is its depth.
    pub fn seen(&self, point: Vector) -> Vector {
        self.turned(subtract(point, self.lens))
    }

    /// The pixel that shows what lies there in the camera's axes, which must be ahead (depth above 0).
    pub fn project(&self, seen: Vector) -> (f64, f64) {
        let scale = self.pinhole.focal / seen[2];
        (self.pinhole.centre_x + seen[0] * scale, self.pinhole.centre_y + seen[1] * scale)
    }

    /// The pixel that shows a place of the world, and the place's depth in metres; `None` behind the camera.
    pub fn pixel(&self, point: Vector) -> Option<((f64, f64), f64)> {
        let seen = self.seen(point);
        (seen[2] > 1e-3).then(|| (self.project(seen), seen[2]))
    }
}

pub(crate) fn subtract(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn scale(a: Vector, factor: f64) -> Vector {
    a.map(|value| value * factor)
}

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{aim, project, view_to_recording};
    use proptest::prelude::*;

    fn view(pan_deg: f64, tilt_deg: f64) -> View {
        let pose = Pose { pan_deg, tilt_deg, ..Pose::default() };
        View::new(&pose, Pinhole::new(640, 480, 40.0), (640, 480))
    }

    #[test]
    fn known_places_are_where_they_should_be() {
        let focal = 320.0 / 20f64.to_radians().tan();
        let ahead = view(0.0, 0.0);
        let near = |found: Option<((f64, f64), f64)>, x: f64, y: f64| {
            let ((found_x, found_y), _) = found.unwrap();
            assert!((found_x - x).hypot(found_y - y) < 1e-9, "{found_x} {found_y}");
        };
        near(ahead.pixel([0.0, 2.5, 6.0]), 319.5, 239.5);
        near(ahead.pixel([1.0, 2.5, 5.0]), 319.5 + focal / 5.0, 239.5);
        near(ahead.pixel([0.0, 1.5, 5.0]), 319.5, 239.5 + focal / 5.0);
        near(view(90.0, 0.0).pixel([5.0, 2.5, 0.0]), 319.5, 239.5);
        let aside = view(30.0, -20.0);
        near(aside.pixel(add(CAMERA, scale(aside.ray(100.0, 400.0), 7.0))), 100.0, 400.0);
        let floor = -(2.5f64 / 6.0).atan().to_degrees();
        near(view(0.0, floor).pixel([0.0, 0.0, 6.0]), 319.5, 239.5);
        assert!(ahead.pixel([0.0, 2.5, -1.0]).is_none());
        // A lens before its axes is nearer to what is ahead, and moves sideways as it turns.
        near(view(0.0, 0.0).ahead(0.1).pixel([1.0, 2.5, 5.1]), 319.5 + focal / 5.0, 239.5);
        near(view(90.0, 0.0).ahead(0.1).pixel([5.1, 2.5, -1.0]), 319.5 + focal / 5.0, 239.5);
    }

    proptest! {
        #[test]
        fn agrees_with_the_geometry_of_recordings(
            pan in -60.0f64..60.0, tilt in -40.0f64..20.0, x in 0.0f64..640.0, y in 0.0f64..480.0, depth in 1.0f64..9.0,
        ) {
            let pose = Pose { pan_deg: pan, tilt_deg: tilt, ..Pose::default() };
            let view = view(pan, tilt);
            let (right, down) = ((x - 319.5) / view.pinhole.focal, (y - 239.5) / view.pinhole.focal);
            let (pan_there, tilt_there) = aim(&pose, right, down);
            let (sin_pan, cos_pan) = pan_there.to_radians().sin_cos();
            let (sin_tilt, cos_tilt) = tilt_there.to_radians().sin_cos();
            let direction = [sin_pan * cos_tilt, sin_tilt, cos_pan * cos_tilt];
            let ((found_x, found_y), _) = view.pixel(add(CAMERA, scale(direction, depth))).unwrap();
            prop_assert!((found_x - x).hypot(found_y - y) < 1e-6);
            // And the recording of a camera looking ahead shows it where the homography says.
            let ahead = View::new(&Pose::default(), view.pinhole, (640, 480));
            if let Some(((u, v), _)) = ahead.pixel(add(CAMERA, scale(direction, depth))) {
                let found = project(&view_to_recording(&pose, &view.pinhole, &view.pinhole), x, y);
                prop_assert!((found.0 - u).hypot(found.1 - v) < 1e-6 * (1.0 + u.abs() + v.abs()));
            }
        }
    }
}
