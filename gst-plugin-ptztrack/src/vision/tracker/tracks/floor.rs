// SPDX-License-Identifier: MPL-2.0

//! How tall people are in the picture by where their feet are: on a floor, one line holds for all of them (Hoiem et al. 2008, "Putting
//! Objects in Perspective"). The lower the camera, the steeper the line: from about 2.5 m down a trunk over a table is as tall as
//! somebody farther away.

use opencv::core::{Point2f, Rect2f};

use super::track::{DOWN_NOISE, Track};
use crate::vision::tracker::ego_motion::EgoMotion;
use crate::vision::tracker::geometry::Frame;

/// Time constant over which earlier people are forgotten, seconds.
const MEMORY_S: f64 = 30.0;
/// Seconds of people seen whole from which the line is known.
const KNOWN_S: f64 = 2.0;
/// The largest difference from the line, as a share of the height there, of somebody seen whole.
const DIFFER: f32 = 0.25;
/// How far from the mean of the feet the line is known: in their standard deviations, and in heights.
const REACH: (f32, f32) = (2.0, 0.25);

/// The least squares line through the rows of people's feet and their heights, both in pixels.
#[derive(Debug, Default)]
pub(super) struct Floor {
    weight_s: f64,
    /// Means.
    feet: f32,
    height: f32,
    /// Variances and covariance, pixels².
    feet_variance: f32,
    height_variance: f32,
    covariance: f32,
}

impl Floor {
    /// Carries the line into the next picture, as the background goes in the middle of it. Where nobody knows how the camera moved,
    /// nothing is known any more.
    pub fn carry(&mut self, ego: Option<EgoMotion>, frame: Frame, dt_s: f64) {
        let Some(ego) = ego else { return self.clear() };
        if self.weight_s == 0.0 {
            return;
        }
        let carried = |row: f32| ego.apply(Point2f::new(frame.width / 2.0, row)).y;
        let (feet, head) = (carried(self.feet), carried(self.feet - self.height));
        let scale = (feet - head) / self.height;
        if !(feet.is_finite() && scale.is_finite() && scale > 0.0) {
            return self.clear();
        }
        (self.feet, self.height) = (feet, feet - head);
        for variance in [&mut self.feet_variance, &mut self.height_variance, &mut self.covariance] {
            *variance *= scale * scale;
        }
        self.weight_s *= (-dt_s / MEMORY_S).exp();
    }

    /// Learns from all who are seen from head to foot. Anyone whose height does not match the line counts for less.
    pub fn watch<'a>(&mut self, tracks: impl Iterator<Item = &'a Track>, frame: Frame, dt_s: f64) {
        let whole = tracks.filter(|track| track.shows_its_size()).map(Track::seen_bounds);
        for bounds in whole.filter(|bounds| frame.cut_sides(*bounds) == [false; 4]) {
            let error = self.error(bounds).unwrap_or(0.0) / DIFFER;
            self.learn(bounds, dt_s / f64::from(1.0 + error * error));
        }
    }

    fn learn(&mut self, bounds: Rect2f, weight_s: f64) {
        self.weight_s += weight_s;
        let share = (weight_s / self.weight_s) as f32;
        let (feet, height) = (bounds.br().y - self.feet, bounds.height - self.height);
        self.feet += share * feet;
        self.height += share * height;
        let mixed = |variance: f32, product: f32| (1.0 - share) * (variance + share * product);
        self.feet_variance = mixed(self.feet_variance, feet * feet);
        self.height_variance = mixed(self.height_variance, height * height);
        self.covariance = mixed(self.covariance, feet * height);
    }

    /// How much the height grows with each row down. The feet are not seen exactly.
    fn slope(&self) -> f32 {
        self.covariance / (self.feet_variance + (DOWN_NOISE * self.height).powi(2)).max(f32::EPSILON)
    }

    /// By what share of the height at its feet a box is taller or less tall than the line; `None` where no line fits people.
    fn error(&self, bounds: Rect2f) -> Option<f32> {
        let slope = self.slope();
        let spread = (self.height_variance - slope * self.covariance).max(0.0).sqrt();
        let expected = self.height + slope * (bounds.br().y - self.feet);
        let is_known = self.weight_s >= KNOWN_S && spread < DIFFER * self.height;
        (is_known && expected > 0.0).then(|| (bounds.height / expected - 1.0).abs())
    }

    /// Whether the feet of a box are where others' were.
    fn reaches(&self, bounds: Rect2f) -> bool {
        let reach = REACH.0 * self.feet_variance.sqrt() + REACH.1 * self.height;
        (bounds.br().y - self.feet).abs() <= reach
    }

    /// Whether `seen` is as tall as people are at its feet, and `larger` is not, so that nothing of who is seen is hidden.
    pub fn shows_whole(&self, seen: Rect2f, larger: Rect2f) -> bool {
        let errors = self.error(seen).zip(self.error(larger));
        self.reaches(seen) && errors.is_some_and(|(seen, larger)| seen <= DIFFER && larger > DIFFER)
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use ptztrack_contract::Homography;

    const FRAME: Frame = Frame { width: 640.0, height: 480.0 };

    fn standing(feet: f32, height: f32) -> Rect2f {
        Rect2f::new(300.0, feet - height, 0.4 * height, height)
    }

    /// People between the rows 240 and 440, taller by a third of a pixel with each row.
    fn hall() -> Floor {
        let mut floor = Floor::default();
        for n in 0..100 {
            let feet = 240.0 + 2.0 * n as f32;
            floor.learn(standing(feet, height_at(feet)), 0.1);
        }
        floor
    }

    fn height_at(feet: f32) -> f32 {
        80.0 + (feet - 240.0) / 3.0
    }

    #[test]
    fn people_are_as_tall_as_others_where_they_stand() {
        let floor = hall();
        for feet in [250.0, 340.0, 430.0] {
            let height = height_at(feet);
            assert!(floor.error(standing(feet, height)).is_some_and(|error| error < 0.03), "{feet}");
            assert!(floor.shows_whole(standing(feet, height), standing(feet + height, 2.0 * height)));
        }
    }

    #[test]
    fn who_stands_behind_a_table_is_not_seen_whole() {
        // Half of somebody is not as tall as people are there, whatever the box is.
        for larger in [standing(400.0, 133.0), standing(400.0, 250.0)] {
            assert!(!hall().shows_whole(standing(330.0, 63.0), larger));
        }
        // From a camera so low what is seen of somebody is as tall as others are there: but so is all of them.
        let mut low = Floor::default();
        for n in 0..100 {
            low.learn(standing(240.0 + n as f32, 110.0 + 0.7 * (n as f32 - 60.0)), 0.1);
        }
        let (trunk, whole) = (standing(320.0, 96.0), standing(420.0, 194.0));
        assert!(low.error(trunk).is_some_and(|error| error < DIFFER) && !low.reaches(whole));
        assert!(!low.shows_whole(trunk, whole));
    }

    #[test]
    fn nothing_is_known_of_another_part_of_the_floor_nor_after_a_moment() {
        assert!(!hall().shows_whole(standing(60.0, 20.0), standing(90.0, 60.0)));
        let mut floor = Floor::default();
        floor.learn(standing(300.0, 100.0), 1.0);
        assert_eq!(floor.error(standing(300.0, 100.0)), None);
    }

    #[test]
    fn a_line_that_fits_nobody_is_none() {
        let mut floor = Floor::default();
        for n in 0..100 {
            floor.learn(standing(300.0, if n % 2 == 0 { 60.0 } else { 180.0 }), 0.1);
        }
        assert_eq!(floor.error(standing(300.0, 60.0)), None);
    }

    #[test]
    fn it_goes_with_the_background_and_is_lost_with_it() {
        let mut floor = hall();
        floor.carry(Some(EgoMotion::translation(Point2f::new(0.0, -50.0))), FRAME, 0.1);
        floor.carry(Some(EgoMotion::zoom(1.5)), FRAME, 0.1);
        let (feet, height) = (1.5 * (340.0 - 50.0), 1.5 * height_at(340.0));
        assert!(floor.error(standing(feet, height)).is_some_and(|error| error < 0.03), "{floor:?}");
        floor.carry(None, FRAME, 0.1);
        assert_eq!(floor.error(standing(feet, height)), None);
    }

    /// A level camera that turns by a right angle sees the same floor.
    #[test]
    fn a_turn_changes_nothing() {
        const FOCAL: f64 = 600.0;
        let (sin, cos) = 1.0_f64.to_radians().sin_cos();
        let (across, down) = (f64::from(FRAME.width) / 2.0, f64::from(FRAME.height) / 2.0);
        let centred = Homography([[cos, 0.0, -FOCAL * sin], [0.0, 1.0, 0.0], [sin / FOCAL, 0.0, cos]]);
        let ego = EgoMotion::around(centred, Point2f::new(across as f32, down as f32));
        let mut floor = hall();
        for _ in 0..90 {
            floor.carry(Some(ego), FRAME, 0.01);
        }
        for feet in [250.0, 430.0] {
            assert!(
                floor.error(standing(feet, height_at(feet))).is_some_and(|error| error < 0.05),
                "{floor:?}"
            );
        }
    }

    proptest! {
        #[test]
        fn the_line_is_that_of_least_squares(people in prop::collection::vec((100.0_f32..400.0, 20.0_f32..200.0), 2..30)) {
            let mut floor = Floor::default();
            people.iter().for_each(|&(feet, height)| floor.learn(standing(feet, height), 0.1));
            let mean = |value: &dyn Fn(&(f32, f32)) -> f32| people.iter().map(value).sum::<f32>() / people.len() as f32;
            let (feet, height) = (mean(&|one| one.0), mean(&|one| one.1));
            prop_assert!((floor.height - height).abs() < 0.1 && (floor.feet - feet).abs() < 0.1);
            let moments = [
                (floor.covariance, mean(&|one| (one.0 - feet) * (one.1 - height))),
                (floor.feet_variance, mean(&|one| (one.0 - feet).powi(2))),
                (floor.height_variance, mean(&|one| (one.1 - height).powi(2))),
            ];
            for (found, expected) in moments {
                prop_assert!((found - expected).abs() < 1.0 + 0.001 * expected.abs(), "{found} {expected}");
            }
        }
    }
}
