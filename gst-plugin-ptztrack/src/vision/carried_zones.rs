// SPDX-License-Identifier: MPL-2.0

//! Where zones lie in the picture of a camera that has turned since they were set.

use std::time::Duration;

use ptztrack_contract::{Homography, Point, View};

use super::camera_motion::displacement;
use super::zones::Zones;

/// The picture must have rested for so long before the servo's word is taken for it: words come before pictures do.
const REST: Duration = Duration::from_millis(600);
/// Frame widths and heights from one picture to the next below which it rests.
const RESTS: f64 = 0.002;
/// A picture that has moved by more than this since the zones were set is another view.
const SAME_VIEW: f64 = 0.02;
/// Of the picture, whose motion is taken.
const MIDDLE: Point = Point { x: 0.5, y: 0.5 };

/// Carries zones along: by the motion of the background while the camera turns, and by the servo's word once it rests, so
/// that no errors add up.
#[derive(Debug, Default)]
pub struct CarriedZones {
    zones: Zones,
    exclude_zones: Zones,
    /// Where the camera looked when the zones were set, where that is known.
    set_in: Option<View>,
    /// Where it looked when it last rested, and how the picture has moved since.
    rested_in: Option<View>,
    since: Homography,
    rest: Duration,
}

impl CarriedZones {
    /// The zones as they are set now; others begin where the camera looks.
    pub fn set(&mut self, zones: &Zones, exclude_zones: &Zones) {
        if (&self.zones, &self.exclude_zones) != (zones, exclude_zones) {
            *self = Self { zones: zones.clone(), exclude_zones: exclude_zones.clone(), ..Self::default() };
        }
    }

    /// Takes the next picture, to which the camera moved by `motion` within `elapsed`, or, where that was not seen, is taken to have moved
    /// by `coasted`; and the servo's last word.
    pub fn carry(
        &mut self,
        motion: Option<Homography>,
        coasted: Option<Homography>,
        elapsed: Duration,
        view: Option<View>,
    ) {
        let step = motion.or(coasted).unwrap_or(Homography::IDENTITY);
        self.since = self.since.then(&step);
        let rests = motion.is_some() && displacement(&step, MIDDLE) < RESTS;
        self.rest = if rests { self.rest.saturating_add(elapsed) } else { Duration::ZERO };
        let Some(view) = view.filter(|_| self.rest >= REST) else { return };
        if self.set_in.is_none() && self.rested_in.is_none() && displacement(&self.since, MIDDLE) < SAME_VIEW
        {
            self.set_in = Some(view);
        }
        if self.set_in.is_some() {
            (self.rested_in, self.since) = (Some(view), Homography::IDENTITY);
        }
    }

    /// Whether something at `point` of the last picture may be chosen: in `zones` (everywhere, where there are none) but
    /// not in `exclude_zones`.
    pub fn allow(&self, point: Point) -> bool {
        if self.zones.is_empty() && self.exclude_zones.is_empty() {
            return true;
        }
        let place = self.when_set(point);
        let inside = |zones: &Zones| place.is_some_and(|place| zones.contain(place));
        (self.zones.is_empty() || inside(&self.zones)) && !inside(&self.exclude_zones)
    }

    /// Where that point was in the picture in which the zones were set; `None` where that was behind the camera.
    fn when_set(&self, point: Point) -> Option<Point> {
        let point = self.since.inverse()?.apply(point);
        match (self.rested_in, self.set_in) {
            (Some(rested_in), Some(set_in)) => rested_in.place_in(&set_in, point),
            _ => Some(point),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ptztrack_contract::CameraEvent;

    const STEP: Duration = Duration::from_millis(100);
    const RIGHT_HALF: &str = "0.5,0 1,0 1,1 0.5,1";

    fn view(pan_deg: f64, tilt_deg: f64) -> Option<View> {
        let camera = CameraEvent {
            pan_deg: Some(pan_deg),
            tilt_deg: Some(tilt_deg),
            horizontal_fov_deg: Some(60.0),
            vertical_fov_deg: Some(40.0),
            ..CameraEvent::default()
        };
        camera.view()
    }

    fn motion(x: f64) -> Option<Homography> {
        Some(Homography::translation(x, 0.0))
    }

    fn zones(zones: &str, exclude_zones: &str) -> CarriedZones {
        let mut carried = CarriedZones::default();
        carried.set(&zones.parse().unwrap(), &exclude_zones.parse().unwrap());
        carried
    }

    fn at(x: f64) -> Point {
        Point { x, y: 0.5 }
    }

    #[test]
    fn a_camera_that_never_turns_has_them_where_they_were_set() {
        let mut carried = zones(RIGHT_HALF, "0.8,0 1,0 1,1 0.8,1");
        for _ in 0..100 {
            carried.carry(motion(0.0), None, STEP, None);
        }
        assert_eq!([0.3, 0.6, 0.9].map(|x| carried.allow(at(x))), [false, true, false]);
    }

    #[test]
    fn without_zones_everything_is_allowed_everywhere() {
        let mut carried = zones("", "");
        carried.carry(motion(-0.7), None, STEP, view(0.0, 0.0));
        assert!(carried.allow(at(0.1)) && carried.allow(at(0.9)));
    }

    #[test]
    fn they_go_with_the_background() {
        let mut carried = zones(RIGHT_HALF, "");
        for _ in 0..10 {
            carried.carry(motion(-0.03), None, STEP, None);
        }
        assert_eq!([0.1, 0.3, 0.9].map(|x| carried.allow(at(x))), [false, true, false]);
    }

    #[test]
    fn they_go_on_with_a_background_that_is_not_seen_for_a_moment() {
        let mut carried = zones(RIGHT_HALF, "");
        for picture in 0..10 {
            let (seen, coasted) =
                if picture % 2 == 0 { (motion(-0.03), None) } else { (None, motion(-0.03)) };
            carried.carry(seen, coasted, STEP, None);
        }
        assert_eq!([0.1, 0.3, 0.9].map(|x| carried.allow(at(x))), [false, true, false]);
    }

    #[test]
    fn the_servo_s_word_at_rest_makes_up_for_pictures_that_were_not_understood() {
        let mut carried = zones("", RIGHT_HALF);
        let rest = |carried: &mut CarriedZones, pan| {
            for _ in 0..7 {
                carried.carry(motion(0.0), None, STEP, view(pan, 0.0));
            }
        };
        rest(&mut carried, 0.0);
        assert_eq!([0.4, 0.6].map(|x| carried.allow(at(x))), [true, false]);
        carried.carry(None, None, STEP, None);
        rest(&mut carried, 15.0);
        // 15 of 60 degrees to the right, the middle of then is at tan(-15)/tan(30).
        assert_eq!([0.25, 0.29].map(|x| carried.allow(at(x))), [true, false]);
        rest(&mut carried, 180.0);
        assert!(carried.allow(at(0.1)) && carried.allow(at(0.9)), "behind the camera");
        rest(&mut carried, 0.0);
        assert_eq!([0.49, 0.51].map(|x| carried.allow(at(x))), [true, false]);
    }

    #[test]
    fn others_begin_where_the_camera_looks() {
        let mut carried = zones(RIGHT_HALF, "");
        carried.carry(motion(-0.5), None, STEP, None);
        assert!(carried.allow(at(0.1)));
        let right: Zones = RIGHT_HALF.parse().unwrap();
        carried.set(&right, &Zones::default());
        assert!(carried.allow(at(0.1)), "the same");
        carried.set(&right, &right);
        carried.set(&right, &Zones::default());
        assert!(!carried.allow(at(0.1)) && carried.allow(at(0.9)));
    }
}
