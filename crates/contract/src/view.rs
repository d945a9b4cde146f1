// SPDX-License-Identifier: MPL-2.0

//! What a camera that turns about its own centre sees where: the only place at which angles become places of a picture.

use crate::{CameraEvent, Point};

/// Where a camera looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    pan: f64,
    tilt: f64,
    /// Half the width and height of what it sees at a distance of 1.
    reach: (f64, f64),
}

impl View {
    /// Where something that is seen at `point` (normalised) is in the picture of `other`; `None` behind that camera.
    pub fn place_in(&self, other: &Self, point: Point) -> Option<Point> {
        other.project(self.direction(point))
    }

    /// Pan and tilt, in degrees, that would bring what is seen at `point` (normalised) to the middle.
    pub fn angles_of(&self, point: Point) -> (f64, f64) {
        let [right, down, forward] = self.direction(point);
        (right.atan2(forward).to_degrees(), (-down).atan2(right.hypot(forward)).to_degrees())
    }

    /// Where what is seen in the middle at this pan and tilt, in degrees, is in the picture; `None` behind the camera.
    pub fn place_of(&self, pan_deg: f64, tilt_deg: f64) -> Option<Point> {
        let (pan, tilt) = (pan_deg.to_radians(), tilt_deg.to_radians());
        self.project([pan.sin() * tilt.cos(), -tilt.sin(), pan.cos() * tilt.cos()])
    }

    /// The direction of a point of the picture: right, down, forward of pan and tilt 0.
    fn direction(&self, point: Point) -> [f64; 3] {
        let (x, y) = ((2.0 * point.x - 1.0) * self.reach.0, (2.0 * point.y - 1.0) * self.reach.1);
        let (sin, cos) = self.tilt.sin_cos();
        let (down, forward) = (y * cos - sin, y * sin + cos);
        let (sin, cos) = self.pan.sin_cos();
        [x * cos + forward * sin, down, forward * cos - x * sin]
    }

    fn project(&self, [right, down, forward]: [f64; 3]) -> Option<Point> {
        let (sin, cos) = self.pan.sin_cos();
        let (x, forward) = (right * cos - forward * sin, right * sin + forward * cos);
        let (sin, cos) = self.tilt.sin_cos();
        let (y, z) = (down * cos + forward * sin, forward * cos - down * sin);
        let place = |value: f64, reach: f64| (value / (z * reach) + 1.0) / 2.0;
        (z > 1e-6).then(|| Point { x: place(x, self.reach.0), y: place(y, self.reach.1) })
    }
}

impl CameraEvent {
    /// Where the camera looks; `None` where it moves, or its angles or its field of view are not known.
    pub fn view(&self) -> Option<View> {
        let reach = |degrees: Option<f64>| {
            degrees
                .filter(|degrees| (1e-3..179.0).contains(degrees))
                .map(|fov| (fov.to_radians() / 2.0).tan())
        };
        if self.moving {
            return None;
        }
        Some(View {
            pan: self.pan_deg?.to_radians(),
            tilt: self.tilt_deg?.to_radians(),
            reach: (reach(self.horizontal_fov_deg)?, reach(self.vertical_fov_deg)?),
        })
    }

    /// How fast the picture goes to the right and down as the camera is told to turn, frame widths and heights per second; `None`
    /// where the field of view is not known.
    pub fn picture_rate(&self) -> Option<(f64, f64)> {
        let across = frames_per_s(self.pan_rate_deg_s, self.horizontal_fov_deg)?;
        let down = frames_per_s(self.tilt_rate_deg_s, self.vertical_fov_deg)?;
        Some((-across, down))
    }
}

fn frames_per_s(rate_deg_s: f64, fov_deg: Option<f64>) -> Option<f64> {
    fov_deg.filter(|fov_deg| *fov_deg > 0.0).map(|fov_deg| rate_deg_s / fov_deg)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const KNOWN: CameraEvent = CameraEvent {
        moving: false,
        pan_deg: Some(0.0),
        tilt_deg: Some(0.0),
        pan_rate_deg_s: 30.0,
        tilt_rate_deg_s: 10.0,
        horizontal_fov_deg: Some(60.0),
        vertical_fov_deg: Some(40.0),
    };

    #[test]
    fn a_camera_that_turns_says_nothing_of_where_it_looks() {
        assert!(KNOWN.view().is_some());
        assert_eq!(CameraEvent { horizontal_fov_deg: None, ..KNOWN }.view(), None, "no field of view");
        assert_eq!(CameraEvent { moving: true, ..KNOWN }.view(), None);
    }

    /// A camera that turns to the right and up sees the world go to the left and down.
    #[test]
    fn the_picture_goes_against_the_camera() {
        assert_eq!(KNOWN.picture_rate(), Some((-0.5, 0.25)));
        assert_eq!(CameraEvent { vertical_fov_deg: None, ..KNOWN }.picture_rate(), None);
    }

    /// 15 of 60 degrees to the right, what was in the middle is at tan(-15)/tan(30) of half the width.
    #[test]
    fn what_was_in_the_middle_goes_to_the_left_as_the_camera_turns_right() {
        let turned = CameraEvent { pan_deg: Some(15.0), ..KNOWN }.view().unwrap();
        let place = KNOWN.view().unwrap().place_in(&turned, Point { x: 0.5, y: 0.5 }).unwrap();
        let x = 0.5 - 0.5 * 15.0_f64.to_radians().tan() / 30.0_f64.to_radians().tan();
        assert!((place.x - x).abs() < 1e-12 && (place.y - 0.5).abs() < 1e-12, "{place:?}");
        let behind = CameraEvent { pan_deg: Some(180.0), ..KNOWN }.view().unwrap();
        assert_eq!(KNOWN.view().unwrap().place_in(&behind, Point { x: 0.5, y: 0.5 }), None);
    }

    #[test]
    fn the_middle_is_where_the_camera_looks() {
        let view = CameraEvent { pan_deg: Some(20.0), tilt_deg: Some(-30.0), ..KNOWN }.view().unwrap();
        let (pan, tilt) = view.angles_of(Point { x: 0.5, y: 0.5 });
        assert!((pan - 20.0).abs() < 1e-9 && (tilt + 30.0).abs() < 1e-9, "{pan}, {tilt}");
        assert!(view.place_of(25.0, -30.0).unwrap().x > 0.5 && view.place_of(20.0, -25.0).unwrap().y < 0.5);
    }

    proptest! {
        #[test]
        fn a_point_is_seen_in_the_direction_that_it_has(
            pan in -170.0..170.0f64, tilt in -80.0..30.0f64, x in 0.0..1.0f64, y in 0.0..1.0f64,
        ) {
            let view = CameraEvent { pan_deg: Some(pan), tilt_deg: Some(tilt), ..KNOWN }.view().unwrap();
            let seen = view.place_in(&view, Point { x, y }).unwrap();
            prop_assert!((seen.x - x).abs() < 1e-9 && (seen.y - y).abs() < 1e-9);
            let (pan_deg, tilt_deg) = view.angles_of(Point { x, y });
            let seen = view.place_of(pan_deg, tilt_deg).unwrap();
            prop_assert!((seen.x - x).abs() < 1e-9 && (seen.y - y).abs() < 1e-9);
        }
    }
}
