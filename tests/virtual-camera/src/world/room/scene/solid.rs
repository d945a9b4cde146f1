// SPDX-License-Identifier: MPL-2.0

//! Boxes: where they stand, what hides what, and their sides.

use std::sync::Arc;

use crate::world::room::{
    raster::{Material, Surface},
    view::{CAMERA, Vector, add, dot, scale, subtract},
};

const UP: Vector = [0.0, 1.0, 0.0];
pub(super) const DOWN: Vector = [0.0, -1.0, 0.0];

/// A box upright on something, turned about its upright axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) struct Solid {
    /// Middle of its bottom.
    pub base: Vector,
    /// Width, height, depth in metres.
    pub size: Vector,
    /// At 0 its front faces those who look along z, at 90° those who look to the left.
    pub yaw_deg: f64,
}

/// The materials of a box.
#[derive(Debug, Clone)]
pub(in super::super) struct Finish {
    pub sides: Arc<Material>,
    pub top: Arc<Material>,
    pub front: Arc<Material>,
}

impl Finish {
    /// One material all around.
    pub fn all(material: &Arc<Material>) -> Self {
        Self { sides: material.clone(), top: material.clone(), front: material.clone() }
    }
}

impl Solid {
    /// Along the width, and out of the front.
    pub fn axes(&self) -> (Vector, Vector) {
        let (sin, cos) = self.yaw_deg.to_radians().sin_cos();
        ([cos, 0.0, sin], [sin, 0.0, -cos])
    }

    /// A place by shares of its width, height and depth, from -1 to 1 in width and depth (front), 0 to 1 in height.
    pub fn place(&self, right: f64, up: f64, front: f64) -> Vector {
        let (width, ahead) = self.axes();
        let [w, h, d] = self.size;
        let flat = add(scale(width, right * w / 2.0), scale(ahead, front * d / 2.0));
        add(self.base, add(flat, scale(UP, up * h)))
    }

    fn corners(&self) -> [Vector; 8] {
        std::array::from_fn(|i| {
            let side = |bit: usize| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            self.place(side(0), (i >> 1 & 1) as f64, side(2))
        })
    }

    /// Its six faces: a point on each and the direction out of it.
    fn faces(&self) -> [(Vector, Vector); 6] {
        let (width, ahead) = self.axes();
        let (low, high) = (self.place(-1.0, 0.0, -1.0), self.place(1.0, 1.0, 1.0));
        let back = scale(ahead, -1.0);
        [(high, ahead), (low, back), (high, width), (low, scale(width, -1.0)), (high, UP), (low, DOWN)]
    }

    /// How far outside of it a point is, in metres; 0 within.
    pub fn distance(&self, point: Vector) -> f64 {
        let (width, ahead) = self.axes();
        let way = subtract(point, self.base);
        let [w, h, d] = self.size;
        let right = (dot(way, width).abs() - w / 2.0).max(0.0);
        let front = (dot(way, ahead).abs() - d / 2.0).max(0.0);
        let up = (way[1] - h).max(-way[1]).max(0.0);
        (right * right + front * front + up * up).sqrt()
    }

    /// Whether the camera sees it in front of all of `points`: one of its faces has the camera inside, the points outside.
    pub fn hides(&self, points: &[Vector]) -> bool {
        self.faces().iter().any(|&(on, out)| {
            let height = |point: Vector| dot(subtract(point, on), out);
            height(CAMERA) < 0.0 && points.iter().all(|&point| height(point) > -1e-6)
        })
    }

    /// Whether it must be drawn before `other`.
    pub fn precedes(&self, other: &Solid) -> bool {
        other.hides(&self.corners()) && !self.hides(&other.corners())
    }

    /// The sides that the camera sees.
    pub fn surfaces(&self, finish: &Finish) -> Vec<Surface> {
        let (width, ahead) = self.axes();
        let (back, left) = (scale(ahead, -1.0), scale(width, -1.0));
        let [w, h, d] = self.size;
        let face = |origin: Vector, u, v, size, material: &Arc<Material>| {
            let surface = Surface::rectangle(origin, u, v, size, material);
            surface.faces(CAMERA).then_some(surface)
        };
        let mut top = face(self.place(-1.0, 1.0, -1.0), width, ahead, (w, d), &finish.top);
        let mut front = face(self.place(-1.0, 1.0, 1.0), width, DOWN, (w, h), &finish.front);
        let mut rear = face(self.place(1.0, 1.0, -1.0), left, DOWN, (w, h), &finish.sides);
        let right = face(self.place(1.0, 1.0, 1.0), back, DOWN, (d, h), &finish.sides);
        let left = face(self.place(-1.0, 1.0, -1.0), ahead, DOWN, (d, h), &finish.sides);
        if let Some(top) = &mut top {
            top.joined = vec![rear.is_some(), right.is_some(), front.is_some(), left.is_some()];
        }
        if let Some(front) = &mut front {
            front.joined = vec![false, right.is_some(), false, left.is_some()];
        }
        if let Some(rear) = &mut rear {
            rear.joined = vec![false, left.is_some(), false, right.is_some()];
        }
        [top, front, rear, left, right].into_iter().flatten().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solid(x: f64, z: f64, yaw_deg: f64) -> Solid {
        Solid { base: [x, 0.0, z], size: [1.0, 0.8, 0.4], yaw_deg }
    }

    #[test]
    fn nearer_boxes_hide_farther_ones() {
        for yaw in [0.0, 20.0, 90.0] {
            assert!(solid(0.0, 8.0, yaw).precedes(&solid(0.0, 4.0, yaw)));
            assert!(!solid(0.0, 4.0, yaw).precedes(&solid(0.0, 8.0, yaw)));
        }
        assert!(solid(2.0, 4.0, 0.0).hides(&[[2.0, 0.0, 5.0], [2.0, 1.8, 5.0]]));
        assert!(!solid(2.0, 4.0, 0.0).hides(&[[2.0, 0.0, 3.5], [2.0, 1.8, 3.5]]));
    }

    #[test]
    fn distances_are_to_the_nearest_side() {
        let solid = solid(1.0, 5.0, 90.0);
        assert!((solid.distance([1.0, 0.4, 6.0]) - 0.5).abs() < 1e-9);
        assert!((solid.distance([2.0, 0.4, 5.0]) - 0.8).abs() < 1e-9);
        assert_eq!(solid.distance([1.0, 0.1, 5.1]), 0.0);
    }

    #[test]
    fn the_camera_sees_at_most_three_sides_of_a_box_below_it() {
        let material = Arc::new(super::super::paint::paint(2, (1.0, 1.0), None, |_, _| [0.5; 3]));
        for (x, yaw) in [(-3.0, 0.0), (2.0, 35.0), (0.0, 0.0)] {
            let sides = solid(x, 5.0, yaw).surfaces(&Finish::all(&material)).len();
            assert!((2..=3).contains(&sides), "{sides}");
        }
    }
}
