// SPDX-License-Identifier: MPL-2.0

//! How long a target is followed, and stands.

use opencv::core::{Point2f, Rect2f};
use ptztrack_contract::ReleaseReason;

use super::ego_motion::EgoMotion;
use super::geometry::{breadth, centre, length};
use super::target::YOUNG_S;
use super::tracks::motion;

/// Time over which the place of a target is averaged, seconds: longer than a sway, shorter than it takes the
/// errors of the measured camera motion to add up.
const MEMORY_S: f32 = 3.0;
/// How far from there a target has moved, in breadths of it: who sways or waves does not get there, who walks does
/// from a sixth of a width per second on.
const REACH: f32 = 0.5;
/// By which factor, as a logarithm, its size has changed then: it comes nearer, or leaves.
const GROWTH: f32 = 0.2;
/// What was chosen because it moves must go somewhere, in breadths of it from one end of its way to the other: what a
/// screen shows does not leave the screen.
const TRIAL_REACH: f32 = 1.0;
/// Breadths that count for a change of size by one, as a logarithm: who comes straight towards the camera goes somewhere,
/// too.
const NEARER: f32 = 2.0;
/// Until then its way must grow by a quarter of a breadth every so many seconds of being seen: who is near the camera is
/// broad and takes longer, and what sways turns back.
const TRIAL_S: f64 = 1.8;
const TRIAL_STEP: f32 = 0.25;

/// After how many seconds a target is given up; infinite: never.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeLimits {
    /// Of standing still.
    pub stationary_s: f64,
    /// Of being followed, hidden or not.
    pub tracked_s: f64,
}

/// How long a target was followed, and stood still.
///
/// Whether it stands is asked of the world, not of the picture: the motion of the background is taken off.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct DwellTime {
    tracked_s: f64,
    still_s: f64,
    /// From its average place, in breadths of it.
    offset: Point2f,
    /// From its average size, as a logarithm.
    growth: f32,
    /// The way of a target that was chosen because it moves.
    trial: Option<Way>,
}

/// Where something was since it was chosen, in breadths of it from there: across, down and towards the camera.
#[derive(Debug, Clone, Copy, Default)]
struct Way {
    now: [f32; 3],
    least: [f32; 3],
    most: [f32; 3],
    /// How long the way was when it last grew by a step.
    grown: f32,
}

impl Way {
    fn go(&mut self, step: Point2f, growth: f32) {
        for (axis, step) in [step.x, step.y, NEARER * growth].into_iter().enumerate() {
            self.now[axis] += step;
            self.least[axis] = self.least[axis].min(self.now[axis]);
            self.most[axis] = self.most[axis].max(self.now[axis]);
        }
    }

    fn length(&self) -> f32 {
        let along = self.most.iter().zip(self.least).map(|(most, least)| most - least);
        along.map(|along| along * along).sum::<f32>().sqrt()
    }

    /// Whether it is yet to get somewhere.
    fn is_short(&self) -> bool {
        self.length() <= TRIAL_REACH
    }

    /// Whether it has grown by another step.
    fn grows(&mut self) -> bool {
        let grows = self.length() >= self.grown + TRIAL_STEP;
        if grows {
            self.grown = self.length();
        }
        grows
    }
}

impl DwellTime {
    /// Of a target that was chosen because it moves, and has yet to go somewhere.
    pub fn on_trial() -> Self {
        Self { trial: Some(Way::default()), ..Self::default() }
    }

    /// Whether it has yet to go somewhere: a screen may have been chosen as well as a person.
    pub fn is_on_trial(&self) -> bool {
        self.trial.is_some_and(|way| way.is_short())
    }

    /// Whether it was chosen because it moves, and not by somebody's word.
    pub fn is_of_motion(&self) -> bool {
        self.trial.is_some()
    }

    /// Takes a frame, `dt_s` seconds after the last one, in which the target was seen or not.
    pub fn pass(&mut self, dt_s: f64) {
        self.tracked_s += dt_s;
    }

    /// Takes the target's box when it was last seen before those seconds, carried along with the background, its box after them,
    /// and how the background moved in them.
    ///
    /// Only frames in which it is seen tell whether the target stands: the others do not count.
    pub fn watch(&mut self, before: Rect2f, after: Rect2f, ego: EgoMotion, dt_s: f64) {
        let keep = MEMORY_S / (MEMORY_S + dt_s as f32);
        // A side that moves alone shows or hides a part of what is in the box.
        let step = motion(ego.apply_to(before), after) / breadth(after).max(1.0);
        self.offset = (self.offset + step) * keep;
        let scale = ego.scale_at(centre(before));
        let (across, down) =
            ((after.width / (before.width * scale)).ln(), (after.height / (before.height * scale)).ln());
        // A side of the box that moves alone is no approach.
        let growth = if across * down > 0.0 { across.abs().min(down.abs()).copysign(down) } else { 0.0 };
        self.growth = (self.growth + growth) * keep;
        let (stays, grows) = match &mut self.trial {
            Some(way) if way.is_short() => {
                // A young box is still finding the size of what it lies on.
                way.go(step, if self.tracked_s > f64::from(YOUNG_S) { growth } else { 0.0 });
                (way.is_short(), way.grows())
            }
            _ => (length(self.offset) <= REACH && self.growth.abs() <= GROWTH, false),
        };
        // What is not a number fails as well, and is forgotten.
        *self = if stays {
            Self { still_s: if grows { 0.0 } else { self.still_s + dt_s }, ..*self }
        } else {
            Self { tracked_s: self.tracked_s, trial: self.trial, ..Self::default() }
        };
    }

    /// Why the target is to be given up now, if it is.
    pub fn exhausted(&self, limits: TimeLimits) -> Option<ReleaseReason> {
        let patience_s =
            if self.is_on_trial() { TRIAL_S.min(limits.stationary_s) } else { limits.stationary_s };
        if self.still_s > patience_s {
            Some(ReleaseReason::Stationary)
        } else {
            (self.tracked_s > limits.tracked_s).then_some(ReleaseReason::MaxTrackingTime)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::geometry::around;
    use super::*;
    use proptest::prelude::*;

    const DT: f64 = 0.04;
    const WIDTH: f32 = 40.0;
    const LIMITS: TimeLimits = TimeLimits { stationary_s: 10.0, tracked_s: f64::INFINITY };

    /// Whether a target is given up as standing within `seconds`, its middle in pixels and its size by time, in a
    /// picture that moves as `ego` every frame.
    fn given_up(seconds: f32, ego: EgoMotion, path: impl Fn(f32) -> (Point2f, f32)) -> bool {
        let mut dwell = DwellTime::default();
        let box_at = |time| {
            let (middle, size) = path(time);
            around(middle, WIDTH * size, 2.25 * WIDTH * size)
        };
        let mut carried = box_at(0.0);
        (1..=(seconds / DT as f32) as usize).any(|frame| {
            let (before, now) = (box_at((frame - 1) as f32 * DT as f32), box_at(frame as f32 * DT as f32));
            // The camera carries the box from where the picture had it; its own way comes on top.
            let scale = ego.scale_at(centre(carried)) * now.height / before.height;
            let middle = ego.apply(centre(carried)) + (centre(now) - centre(before));
            let after = around(middle, carried.width * scale, carried.height * scale);
            dwell.pass(DT);
            dwell.watch(carried, after, ego, DT);
            carried = after;
            dwell.exhausted(LIMITS).is_some()
        })
    }

    fn along(x: f32) -> (Point2f, f32) {
        (Point2f::new(x, 0.0), 1.0)
    }

    #[test]
    fn who_stands_is_given_up_when_the_time_is_over_and_not_before() {
        let still = EgoMotion::default();
        assert!(!given_up(9.9, still, |_| along(0.0)));
        assert!(given_up(10.2, still, |_| along(0.0)));
    }

    #[test]
    fn who_comes_straight_towards_the_camera_does_not_stand() {
        assert!(!given_up(30.0, EgoMotion::default(), |time| (Point2f::default(), (0.1 * time).exp())));
    }

    #[test]
    fn who_stands_is_given_up_under_a_camera_that_zooms() {
        for zoom in [0.99, 1.01] {
            let ego = EgoMotion::zoom(zoom);
            assert!(given_up(11.0, ego, |_| along(0.0)), "{zoom}");
            assert!(!given_up(11.0, ego, |time| (Point2f::default(), (0.1 * time).exp())), "{zoom}");
        }
    }

    #[test]
    fn who_stops_has_all_the_time_again() {
        let walk_then_stand = |time: f32| along(60.0 * time.min(30.0));
        assert!(!given_up(39.0, EgoMotion::default(), walk_then_stand));
        assert!(given_up(41.0, EgoMotion::default(), walk_then_stand));
    }

    #[test]
    fn the_time_of_tracking_counts_however_it_moves() {
        let limits = TimeLimits { stationary_s: f64::INFINITY, tracked_s: 2.0 };
        let mut dwell = DwellTime::default();
        for frame in 0..8 {
            dwell.pass(0.25);
            let (before, after) = (60.0 * frame as f32, 60.0 * (frame + 1) as f32);
            let at = |x| around(Point2f::new(x, 0.0), WIDTH, 90.0);
            dwell.watch(at(before), at(after), EgoMotion::default(), 0.25);
            assert_eq!(dwell.exhausted(limits), None);
        }
        dwell.pass(0.25);
        assert_eq!(dwell.exhausted(limits), Some(ReleaseReason::MaxTrackingTime));
    }

    #[test]
    fn who_was_chosen_because_they_move_must_go_somewhere() {
        let given_up = |path: fn(f32) -> f32| {
            let mut dwell = DwellTime::on_trial();
            (0..100).any(|frame| {
                let at = |frame: usize| {
                    around(Point2f::new(WIDTH * path(frame as f32 * DT as f32), 0.0), WIDTH, 90.0)
                };
                dwell.watch(at(frame), at(frame + 1), EgoMotion::default(), DT);
                dwell.exhausted(LIMITS).is_some()
            })
        };
        assert!(given_up(|time| 0.4 * (4.0 * time).sin()), "what a screen shows stays on the screen");
        assert!(!given_up(|time| 1.5 * time), "a walker");
        assert!(!given_up(|time| 0.3 * time), "a slow one, or near");
        assert!(!given_up(|time| 0.7 * (1.5 * time).sin()), "who turns back and goes past where they began");
        assert!(!given_up(|time| 1.5 * time.min(1.2)), "who stops after a few steps");
    }

    /// The draught moves now one half of a plant, now all of it.
    #[test]
    fn a_side_that_moves_alone_goes_nowhere() {
        let mut dwell = DwellTime::on_trial();
        let at = |frame: usize| {
            let side = if (frame / 10).is_multiple_of(2) { 2.0 } else { 1.0 };
            Rect2f::new(100.0, 100.0, side * WIDTH, 90.0)
        };
        assert!((0..100).any(|frame| {
            dwell.watch(at(frame), at(frame + 1), EgoMotion::default(), DT);
            dwell.exhausted(LIMITS).is_some()
        }));
    }

    #[test]
    fn a_box_that_finds_its_size_goes_nowhere_but_who_comes_near_does() {
        let given_up = |size: fn(f32) -> f32| {
            let mut dwell = DwellTime::on_trial();
            (0..150).any(|frame| {
                let at = |frame: usize| {
                    let size = size(frame as f32 * DT as f32);
                    around(Point2f::default(), WIDTH * size, 90.0 * size)
                };
                dwell.pass(DT);
                dwell.watch(at(frame), at(frame + 1), EgoMotion::default(), DT);
                dwell.exhausted(LIMITS).is_some()
            })
        };
        assert!(given_up(|time| 2.0_f32.powf((1.5 * time).min(1.0))), "a film, then the screen");
        assert!(!given_up(|time| 8.0 / (8.0 - 1.2 * time.min(4.0))), "from eight metres to three");
    }

    #[test]
    fn nonsense_is_forgotten() {
        let mut dwell = DwellTime::default();
        dwell.watch(Rect2f::default(), Rect2f::default(), EgoMotion::default(), f64::INFINITY);
        let person = around(Point2f::default(), WIDTH, 90.0);
        for _ in 0..20 {
            dwell.watch(person, person, EgoMotion::default(), 1.0);
        }
        assert_eq!(dwell.exhausted(LIMITS), Some(ReleaseReason::Stationary));
    }

    proptest! {
        #[test]
        fn a_sway_is_no_motion(reach in 0.0_f32..0.2, period_s in 0.5_f32..6.0, phase in 0.0_f32..6.0) {
            let sway = |time: f32| along(reach * WIDTH * (std::f32::consts::TAU * time / period_s + phase).sin());
            prop_assert!(given_up(20.0, EgoMotion::default(), sway));
        }

        #[test]
        fn the_camera_s_motion_is_not_the_target_s(pan in -20.0_f32..20.0, tilt in -8.0_f32..8.0) {
            let ego = EgoMotion::translation(Point2f::new(pan, tilt));
            prop_assert!(given_up(11.0, ego, |_| along(0.0)));
            // The camera keeps a walker where they are in the picture.
            prop_assert!(!given_up(11.0, ego, |time| along(-25.0 * pan.signum() * pan.abs().max(2.0) * time)));
        }

        #[test]
        fn a_walk_is_a_motion(speed in 0.3_f32..5.0, angle in 0.0_f32..6.3) {
            let walk = |time: f32| {
                let way = speed * WIDTH * time;
                (Point2f::new(way * angle.cos(), way * angle.sin()), 1.0)
            };
            prop_assert!(!given_up(30.0, EgoMotion::default(), walk));
        }
    }

    #[test]
    fn the_trial_ends_when_it_has_gone_its_breadth() {
        let mut dwell = DwellTime::on_trial();
        let at = |x: f32| around(Point2f::new(x, 0.0), WIDTH, 2.25 * WIDTH);
        let mut go = |from: f32, to: f32| {
            dwell.watch(at(from), at(to), EgoMotion::default(), DT);
            dwell.is_on_trial()
        };
        assert!(go(0.0, 0.9 * WIDTH) && go(0.9 * WIDTH, 0.1 * WIDTH), "to and fro");
        assert!(!go(0.1 * WIDTH, 1.1 * WIDTH));
        assert!(!DwellTime::default().is_on_trial());
    }
}
