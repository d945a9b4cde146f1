// SPDX-License-Identifier: MPL-2.0

//! Pan, tilt and zoom by who sits before the page.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::known::{Gaze, Known, Steering};

/// Cameras that zoom see no less and no more than that, in degrees, unless they show that they do.
const NARROWEST_DEG: f64 = 0.5;
const WIDEST_DEG: f64 = 120.0;

/// Where somebody turns a camera.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Turn {
    /// Parts of what it sees.
    pub right: f64,
    pub up: f64,
    /// Twice as near for each 1, half as near for each -1.
    pub zoom: f64,
}

impl Turn {
    /// From there, where it sees so much, in degrees.
    fn from(self, gaze: Gaze, [width_deg, height_deg]: [f64; 2]) -> Gaze {
        let zoomed_deg = width_deg / self.zoom.exp2();
        Gaze {
            pan_deg: (gaze.pan_deg + self.right * width_deg + 540.0).rem_euclid(360.0) - 180.0,
            tilt_deg: (gaze.tilt_deg + self.up * height_deg).clamp(-90.0, 90.0),
            fov_deg: if self.zoom == 0.0 { gaze.fov_deg } else { Some(zoomed_deg) },
        }
    }
}

impl Known {
    /// Whether it says where it looks, so that it can be turned from there.
    pub fn says_where_it_looks(&self) -> bool {
        !self.sight.borrow().1.poses.is_empty()
    }

    /// Turns it, and leaves it alone for so long; `false`: it is handed over. From where it was told to look last: on its way it can
    /// be told more.
    pub fn turn_here(&self, turn: Turn, left_alone: Duration) -> bool {
        let pose = self.sight.borrow().1.pose_about(Duration::ZERO);
        let Some(pose) = pose else { return !self.is_handed_over() };
        self.steer_by(|now| {
            let last = match now {
                Steering::HandedOver => return None,
                Steering::Turned(gaze, _) => gaze,
                _ => Gaze { pan_deg: pose.pan_deg, tilt_deg: pose.tilt_deg, fov_deg: None },
            };
            let width_deg = last.fov_deg.unwrap_or(pose.horizontal_fov_deg);
            let height_deg = pose.vertical_fov_deg * width_deg / pose.horizontal_fov_deg;
            let mut gaze = turn.from(last, [width_deg, height_deg]);
            let shown_deg = pose.horizontal_fov_deg;
            // However often somebody zooms: what no camera sees is refused, and every turn from there with it.
            let bound =
                |fov_deg: f64| fov_deg.min(WIDEST_DEG.max(shown_deg)).max(NARROWEST_DEG.min(shown_deg));
            gaze.fov_deg = gaze.fov_deg.map(bound);
            Some(Steering::Turned(gaze, Instant::now() + left_alone))
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use ptztrack_contract::lock::lock;

    use super::*;
    use crate::camera::{Control, Pose, Sight};

    #[test]
    fn it_is_turned_by_parts_of_what_it_sees_from_where_it_was_told_to_look() {
        let known = Known::new("door");
        let turn =
            |right, up, zoom| assert!(known.turn_here(Turn { right, up, zoom }, Duration::from_secs(5)));
        turn(1.0, 0.0, 0.0);
        assert_eq!(*lock(&known.steering), Steering::Follow, "nobody knows where it looks");
        let pose = Pose {
            age: Duration::ZERO,
            pan_deg: 170.0,
            tilt_deg: -5.0,
            horizontal_fov_deg: 60.0,
            vertical_fov_deg: 40.0,
        };
        let sight = Sight { poses: vec![pose], ..Sight::default() };
        known.sight.send_replace(Arc::new((Instant::now(), sight)));
        let gaze = || match *lock(&known.steering) {
            Steering::Turned(gaze, _) => gaze,
            other => panic!("{other:?}"),
        };
        turn(0.25, -0.25, 0.0);
        assert_eq!(gaze(), Gaze { pan_deg: -175.0, tilt_deg: -15.0, fov_deg: None });
        turn(0.0, 0.0, 1.0);
        assert_eq!(gaze(), Gaze { pan_deg: -175.0, tilt_deg: -15.0, fov_deg: Some(30.0) });
        turn(0.5, 1.0, 0.0);
        assert_eq!(gaze(), Gaze { pan_deg: -160.0, tilt_deg: 5.0, fov_deg: Some(30.0) });
        assert_eq!(known.control(), Control::Operator);
        (0..10).for_each(|_| turn(0.0, 0.0, -1.0));
        assert_eq!(gaze().fov_deg, Some(120.0), "no camera sees half of the world");
        (0..100).for_each(|_| turn(0.0, 0.0, 1.0));
        assert_eq!(gaze().fov_deg, Some(0.5));
        known.steer(Steering::HandedOver);
        assert!(!known.turn_here(Turn { right: 0.5, up: 0.0, zoom: 0.0 }, Duration::from_secs(5)));
        assert_eq!(*lock(&known.steering), Steering::HandedOver, "it is left alone until it is taken back");
    }
}
