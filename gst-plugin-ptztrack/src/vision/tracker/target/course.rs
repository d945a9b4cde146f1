// SPDX-License-Identifier: MPL-2.0

//! How a target went on before something began to hide it. What is seen of somebody who goes behind a wall stays at its edge, and so
//! does a box that is laid over it: place and velocity are then no longer theirs.

use opencv::core::Point2f;

use crate::vision::tracker::ego_motion::EgoMotion;

/// Where a target would be had it gone on as it did when it was last seen whole. In pixels of the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Course {
    pub middle: Point2f,
    /// Against the background, per second.
    pub velocity: Point2f,
}

impl Course {
    /// Goes on for `dt_s`, in which the background moved as `ego`.
    pub fn go_on(&mut self, ego: EgoMotion, dt_s: f32) {
        self.middle += ego.at(self.middle) + self.velocity * dt_s;
    }

    /// Takes over place and velocity as they are measured now, as far as they are those of the target: 0 to 1.
    pub fn correct(&mut self, measured: Self, share: f32) {
        self.middle += (measured.middle - self.middle) * share;
        self.velocity += (measured.velocity - self.velocity) * share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_stays_at_the_edge_of_a_wall_goes_on_behind_it() {
        let velocity = Point2f::new(100.0, 0.0);
        let at = |x: f32, velocity: Point2f| Course { middle: Point2f::new(x, 50.0), velocity };
        let mut course = at(0.0, velocity);
        let turning = EgoMotion::translation(Point2f::new(-3.0, 0.0));
        for n in 1..=10 {
            course.go_on(turning, 0.04);
            course.correct(at(n as f32, velocity), 1.0);
        }
        assert_eq!(course, at(10.0, velocity));
        for _ in 0..20 {
            course.go_on(turning, 0.04);
            course.correct(at(10.0, Point2f::default()), 0.0);
        }
        assert!((course.middle.x - 30.0).abs() < 1e-3 && course.velocity == velocity, "{course:?}");
    }
}
