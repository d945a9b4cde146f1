// SPDX-License-Identifier: MPL-2.0

use ptztrack_contract::{Point, Rect, Vector};

use super::Measurement;

/// How the picture lies to the camera's axes: of a camera that hangs, or whose picture was turned on its way.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Mounting {
    /// Pan to the right turns the picture to the left.
    pub invert_pan: bool,
    /// Tilt up turns the picture down.
    pub invert_tilt: bool,
    /// By how much the picture is turned clockwise as it arrives: 0, 90, 180 or 270 degrees.
    pub rotation_deg: u32,
}

impl Mounting {
    /// The measurement as it would be in a picture whose right is pan's right, and whose top is tilt's up.
    pub fn along_axes(&self, measurement: Measurement) -> Measurement {
        let quarters = self.rotation_deg / 90 % 4;
        let upright = (0..quarters).fold(measurement, |measurement, _| quarter_back(&measurement));
        Measurement {
            centroid: self.mirrored(upright.centroid),
            bounds: self.mirrored_box(upright.bounds),
            velocity: self.mirrored_vector(upright.velocity),
            ego_velocity: upright.ego_velocity.map(|ego| self.mirrored_vector(ego)),
            ..upright
        }
    }

    /// Width by height of the picture along the axes, of one that arrives with this.
    pub fn aspect_along_axes(&self, aspect: f64) -> f64 {
        if self.rotation_deg / 90 % 2 == 1 { 1.0 / aspect } else { aspect }
    }

    /// Between a place along the axes and the camera's own picture, either way.
    pub fn mirrored(&self, Point { x, y }: Point) -> Point {
        Point { x: if self.invert_pan { 1.0 - x } else { x }, y: if self.invert_tilt { 1.0 - y } else { y } }
    }

    fn mirrored_vector(&self, Vector { x, y }: Vector) -> Vector {
        Vector { x: if self.invert_pan { -x } else { x }, y: if self.invert_tilt { -y } else { y } }
    }

    fn mirrored_box(&self, bounds: Rect) -> Rect {
        let Point { x, y } = self.mirrored(bounds.centre());
        Rect { x: x - bounds.width / 2.0, y: y - bounds.height / 2.0, ..bounds }
    }
}

/// Turned back, counter-clockwise, by a quarter.
fn quarter_back(measurement: &Measurement) -> Measurement {
    let turned = |Vector { x, y }: Vector| Vector { x: y, y: -x };
    let bounds = measurement.bounds;
    Measurement {
        centroid: Point { x: measurement.centroid.y, y: 1.0 - measurement.centroid.x },
        bounds: Rect {
            x: bounds.y,
            y: 1.0 - bounds.x - bounds.width,
            width: bounds.height,
            height: bounds.width,
        },
        velocity: turned(measurement.velocity),
        ego_velocity: measurement.ego_velocity.map(turned),
        size: (measurement.size.1, measurement.size.0),
        aspect: 1.0 / measurement.aspect,
        ..*measurement
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Time;

    fn seen() -> Measurement {
        let velocity = Vector { x: 0.1, y: 0.0 };
        Measurement { velocity, ..Measurement::at(0.75, 0.5, Time::ZERO) }
    }

    fn close(a: Point, b: Point) -> bool {
        (a.x - b.x).abs() < 1e-12 && (a.y - b.y).abs() < 1e-12
    }

    #[test]
    fn as_it_is_nothing_changes() {
        let measurement = Mounting::default().along_axes(seen());
        assert!(close(measurement.centroid, seen().centroid) && measurement.velocity == seen().velocity);
        assert_eq!((measurement.size, measurement.aspect), (seen().size, seen().aspect));
    }

    #[test]
    fn a_turned_picture_is_turned_back() {
        // What is to the right in a picture that was turned clockwise by a quarter was above.
        for (rotation_deg, x, y) in [(90, 0.5, 0.25), (180, 0.25, 0.5), (270, 0.5, 0.75)] {
            let mounting = Mounting { rotation_deg, ..Mounting::default() };
            let upright = mounting.along_axes(seen());
            assert!(close(upright.centroid, Point { x, y }), "{rotation_deg}: {:?}", upright.centroid);
            assert!(close(upright.bounds.centre(), upright.centroid), "{rotation_deg}");
            let (right, down) = (upright.velocity.x, upright.velocity.y);
            assert_eq!((right * 2.5, down * 2.5), (x - 0.5, y - 0.5), "{rotation_deg}");
            assert_eq!(upright.size.0 == 480, rotation_deg != 180);
        }
    }

    #[test]
    fn an_inverted_axis_mirrors_the_picture() {
        let mounting = Mounting { invert_pan: true, ..Mounting::default() };
        let mirrored = mounting.along_axes(seen());
        assert!(close(mirrored.centroid, Point { x: 0.25, y: 0.5 }) && mirrored.velocity.x < 0.0);
        assert!(close(mounting.mirrored(mirrored.centroid), seen().centroid));
        let mounting = Mounting { invert_tilt: true, ..Mounting::default() };
        assert!(close(mounting.mirrored(Point { x: 0.3, y: 0.2 }), Point { x: 0.3, y: 0.8 }));
    }
}
