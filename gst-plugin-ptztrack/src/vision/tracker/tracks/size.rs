// SPDX-License-Identifier: MPL-2.0

//! How large somebody is.

use opencv::core::Rect2f;

use super::axis::Axis;
use super::floor::Floor;
use super::track::{DOWN_NOISE, FIRST_RATE, FIRST_SIZE, Track};
use crate::vision::tracker::geometry::{breadth, centre, is_upright, overlap};

/// Seconds in which a track has found its size.
pub(super) const SIZE_TIME_S: f64 = 1.0;
/// What is seen has another size than the track where their intersection over union is below this, and that is its size once it has been so
/// for so long, seconds. What is larger shows more of it; what is smaller may be what something hides.
const GROWS: (f32, f64) = (0.65, 0.4);
const SHRINKS: (f32, f64) = (0.5, 5.0);
/// How long what is smaller must stand on the floor as others do, seconds.
const STANDS_S: f64 = 0.4;

impl Track {
    /// What is seen of it alone is `whole`, of which the picture `cut` off these sides (left, top, right, bottom): where that is much larger
    /// or smaller for long, this is its size. Somebody who stands upright never gets as broad as two: what is, is somebody and what is beside
    /// them.
    pub(super) fn resize(&mut self, whole: Rect2f, floor: &Floor, cut: [bool; 4], dt_s: f64) {
        let bounds = self.bounds();
        let [left, top, right, bottom] = cut;
        let is_broad = is_upright(bounds) && !is_upright(whole) && whole.width > 2.0 * breadth(bounds);
        let is_taller = whole.height > bounds.height;
        let (unlike, after_s) = if is_taller { GROWS } else { SHRINKS };
        if (is_broad && !left && !right) || overlap(bounds, whole) >= unlike {
            (self.journey.unlike_s, self.journey.stands_s) = (0.0, 0.0);
            return;
        }
        let stands = !is_taller && !top && !bottom && floor.shows_whole(whole, bounds);
        self.journey.unlike_s += dt_s;
        self.journey.stands_s = if stands { self.journey.stands_s + dt_s } else { 0.0 };
        if self.journey.unlike_s >= after_s || self.journey.stands_s >= STANDS_S {
            self.become_whole(whole);
        }
    }

    /// Whether it stands upright, and all of it is seen by itself, neither more nor less.
    pub fn shows_its_size(&self) -> bool {
        self.is_seen_whole()
            && self.journey.age_s >= SIZE_TIME_S
            && is_upright(self.seen_bounds())
            && overlap(self.seen_bounds(), self.bounds()) >= GROWS.0
    }

    /// Is as large as this from now on: what was seen before were parts of it.
    pub fn become_whole(&mut self, whole: Rect2f) {
        (self.journey.unlike_s, self.journey.stands_s) = (0.0, 0.0);
        let deviations = [DOWN_NOISE, FIRST_RATE, FIRST_SIZE].map(|deviation| deviation * whole.height);
        let resized = |axis: Axis, middle: f32, size: f32| {
            let mut resized = Axis::new(middle, size, deviations);
            resized.rate = axis.rate;
            resized
        };
        let middle = centre(whole);
        self.across = resized(self.across, middle.x, whole.width);
        self.down = resized(self.down, middle.y, whole.height);
    }
}
