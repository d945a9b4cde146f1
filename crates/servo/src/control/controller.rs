// SPDX-License-Identifier: MPL-2.0

use super::OscillationGuard;
use crate::estimation::Offset;
use crate::model::{PanTilt, SpeedMap};

/// How the controller is to behave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlLaw {
    /// Degrees per second for a degree of error, 1/s.
    pub gain: f64,
    /// The same while a new target is sought.
    pub seek_gain: f64,
    /// The error in degrees that each axis tolerates at rest.
    pub dead_zone_deg: PanTilt,
    /// Degrees per second that neither axis exceeds.
    pub max_deg_s: f64,
    /// Degrees per second by which an axis' rate changes at most, from one command to the next.
    pub max_change_deg_s: f64,
}

/// Proportional control with feed-forward, a dead zone and bounded acceleration, each axis for itself.
///
/// Each axis switches modes, as the servos of disk drives do: it seeks a new target at a higher gain, by dead reckoning where the
/// background is not seen, and from then on follows it at the usual gain, by what the pictures show.
#[derive(Debug, Default)]
pub struct Controller {
    pan: Axis,
    tilt: Axis,
    /// Scales the gain of a loop that oscillates; what the target does by itself is followed all the same.
    pub oscillation: OscillationGuard,
    /// The levels of the speed map in force, for the quantiser's hysteresis.
    pub levels: (i8, i8),
}

impl Controller {
    /// The rate that brings the error to zero, within about 1/gain once the target is followed, while it moves on.
    pub fn rate(&mut self, offset: &Offset, in_force: PanTilt, law: &ControlLaw) -> PanTilt {
        let Offset { seen, expected, reckoned, steepness, target } = *offset;
        let scale = self.oscillation.gain_scale();
        // A loop that oscillates has a wrong model of the camera, so its dead reckoning is wrong too.
        let reckoned = reckoned.filter(|_| scale >= 1.0);
        let law = &ControlLaw { gain: scale * law.gain, ..*law };
        let [pan, tilt] = [|pair: PanTilt| pair.pan, |pair: PanTilt| pair.tilt].map(|axis| Motion {
            seen_deg: axis(seen),
            expected_deg: axis(expected),
            reckoned_deg: reckoned.map(axis),
            steepness,
            target_deg_s: axis(target),
            in_force_deg_s: axis(in_force),
            dead_zone_deg: axis(law.dead_zone_deg),
        });
        PanTilt { pan: self.pan.rate(&pan, law), tilt: self.tilt.rate(&tilt, law) }
    }

    /// Another target: what was learned from the last one does not apply.
    pub fn new_target(&mut self) {
        (self.pan.follows, self.tilt.follows) = (false, false);
        self.oscillation.clear();
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        self.oscillation.check_invariants();
        let (pan, tilt) = self.levels;
        assert!(pan.unsigned_abs() <= 100 && tilt.unsigned_abs() <= 100, "speed levels {pan}, {tilt}");
    }

    /// Both axes at rest.
    pub fn rest(&mut self) {
        (self.pan, self.tilt) = (Axis::default(), Axis::default());
    }

    /// The parts of the fastest for a rate.
    pub fn quantise(&mut self, rate: PanTilt, map: &SpeedMap) -> (f64, f64) {
        self.levels = (map.level(rate.pan, self.levels.0), map.level(rate.tilt, self.levels.1));
        (SpeedMap::part(self.levels.0), SpeedMap::part(self.levels.1))
    }
}

/// An [`Offset`] along one axis, and what that axis does now.
struct Motion {
    seen_deg: f64,
    expected_deg: f64,
    reckoned_deg: Option<f64>,
    steepness: f64,
    target_deg_s: f64,
    in_force_deg_s: f64,
    dead_zone_deg: f64,
}

#[derive(Debug, Default)]
struct Axis {
    moving: bool,
    /// The seek is over: by dead reckoning the target was in the dead zone, or nothing can be reckoned.
    follows: bool,
}

impl Axis {
    /// The part of the dead zone that an axis must reach to come to rest: the rest is left to a tracker's tremble.
    const REST: f64 = 1.0 / 3.0;

    fn rate(&mut self, motion: &Motion, law: &ControlLaw) -> f64 {
        self.start_or_rest(motion);
        let correction = self.correction(motion, law);
        let wanted = if self.moving { correction + motion.target_deg_s } else { 0.0 };
        let (now, change) = (motion.in_force_deg_s, law.max_change_deg_s);
        wanted.clamp(now - change, now + change).clamp(-law.max_deg_s, law.max_deg_s)
    }

    fn start_or_rest(&mut self, motion: &Motion) {
        let Motion { seen_deg, expected_deg, target_deg_s, dead_zone_deg, .. } = *motion;
        let rest_deg = Self::REST * dead_zone_deg;
        self.moving = if self.moving {
            // Rests only for a target that would not leave the zone within a second.
            expected_deg.abs() > rest_deg || target_deg_s.abs() > rest_deg
        } else {
            // Starts for nothing that is foreseen only: once in a while a tremble looks like a start.
            expected_deg.abs() > dead_zone_deg && seen_deg * expected_deg.signum() > rest_deg
        };
    }

    fn correction(&mut self, motion: &Motion, law: &ControlLaw) -> f64 {
        self.follows |= motion.reckoned_deg.is_none_or(|reckoned| reckoned.abs() <= motion.dead_zone_deg);
        let follow = law.gain * motion.expected_deg;
        match motion.reckoned_deg {
            // Steeply below the camera a direction says little of where the target will be: there it is sought as it is
            // followed.
            Some(reckoned) if !self.follows => {
                follow + (1.0 - motion.steepness) * (law.seek_gain * reckoned - follow)
            }
            _ => follow,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LAW: ControlLaw = ControlLaw {
        gain: 1.0,
        seek_gain: 1.0,
        dead_zone_deg: PanTilt { pan: 1.0, tilt: 1.0 },
        max_deg_s: 100.0,
        max_change_deg_s: 1000.0,
    };

    fn still() -> PanTilt {
        PanTilt::default()
    }

    fn pan(controller: &mut Controller, error: f64, target: f64, law: &ControlLaw) -> f64 {
        controller.rate(&offset(error, 0.0, target), still(), law).pan
    }

    fn offset(pan: f64, tilt: f64, target: f64) -> Offset {
        let error = PanTilt::new(pan, tilt);
        Offset {
            seen: error,
            expected: error,
            reckoned: Some(error),
            steepness: 0.0,
            target: PanTilt::new(target, 0.0),
        }
    }

    #[test]
    fn a_centred_target_moves_nothing_and_an_axis_moves_alone() {
        let mut controller = Controller::default();
        assert_eq!(controller.rate(&offset(0.9, -0.9, 0.0), still(), &LAW), still());
        let law = ControlLaw { gain: 2.0, ..LAW };
        assert_eq!(controller.rate(&offset(3.0, 0.9, 0.0), still(), &law), PanTilt::new(6.0, 0.0));
    }

    #[test]
    fn the_dead_zone_has_hysteresis() {
        let mut controller = Controller::default();
        for (error, rate) in [(0.9, 0.0), (1.1, 1.1), (0.4, 0.4), (0.3, 0.0), (0.9, 0.0)] {
            assert_eq!(pan(&mut controller, error, 0.0, &LAW), rate, "{error}");
        }
    }

    #[test]
    fn what_is_only_foreseen_starts_nothing() {
        let mut controller = Controller::default();
        let mut rate = |seen, expected| {
            let foreseen = offset(expected, 0.0, 0.0);
            controller.rate(&Offset { seen: PanTilt::new(seen, 0.0), ..foreseen }, still(), &LAW).pan
        };
        assert_eq!((rate(0.2, 5.0), rate(-0.9, 5.0), rate(0.5, 5.0), rate(0.2, 5.0)), (0.0, 0.0, 5.0, 5.0));
    }

    #[test]
    fn a_walking_target_is_followed_through_the_middle() {
        let mut controller = Controller::default();
        assert!(pan(&mut controller, 2.0, 5.0, &LAW) > 0.0);
        assert_eq!(pan(&mut controller, 0.0, 5.0, &LAW), 5.0);
    }

    #[test]
    fn a_lowered_gain_follows_the_target_all_the_same() {
        let mut controller =
            Controller { oscillation: OscillationGuard::lowered_to(0.5), ..Controller::default() };
        assert_eq!(pan(&mut controller, 2.0, 5.0, &LAW), 6.0);
    }

    #[test]
    fn a_new_target_is_sought_once_and_by_what_was_reckoned() {
        let law = ControlLaw { seek_gain: 3.0, ..LAW };
        let mut controller = Controller::default();
        let mut rate = |reckoned| {
            let reckoned = Some(PanTilt::new(reckoned, 0.0));
            controller.rate(&Offset { reckoned, ..offset(10.0, 0.0, 0.0) }, still(), &law).pan
        };
        assert_eq!((rate(10.0), rate(4.0), rate(0.5), rate(10.0)), (30.0, 12.0, 10.0, 10.0));
        controller.new_target();
        assert_eq!(pan(&mut controller, 10.0, 0.0, &law), 30.0);
    }

    #[test]
    fn steeply_below_a_new_target_is_sought_as_it_is_followed() {
        let law = ControlLaw { seek_gain: 3.0, ..LAW };
        let sought = |reckoned, steepness| {
            let reckoned = Some(PanTilt::new(reckoned, 0.0));
            let offset = Offset { reckoned, steepness, ..offset(10.0, 0.0, 0.0) };
            Controller::default().rate(&offset, still(), &law).pan
        };
        assert_eq!([0.0, 0.5, 1.0].map(|steepness| sought(10.0, steepness)), [30.0, 20.0, 10.0]);
        assert_eq!(sought(4.0, 1.0), 10.0);
    }

    #[test]
    fn an_axis_that_is_held_does_not_keep_the_other_from_following() {
        let law = ControlLaw { seek_gain: 3.0, ..LAW };
        let mut controller = Controller::default();
        let mut pan = |reckoned: Option<PanTilt>| {
            controller.rate(&Offset { reckoned, ..offset(10.0, 8.0, 0.0) }, still(), &law).pan
        };
        assert_eq!(pan(Some(PanTilt::new(4.0, 8.0))), 12.0);
        assert_eq!(pan(Some(PanTilt::new(0.5, 8.0))), 10.0);
        assert_eq!((pan(None), pan(Some(PanTilt::new(4.0, 8.0)))), (10.0, 10.0));
    }

    #[test]
    fn acceleration_and_deceleration_are_bounded() {
        let law = ControlLaw { max_change_deg_s: 10.0, ..LAW };
        let mut controller = Controller::default();
        let mut from = |rate: f64, error: f64| {
            controller.rate(&offset(error, 0.0, 0.0), PanTilt::new(rate, 0.0), &law).pan
        };
        assert_eq!((from(0.0, 50.0), from(10.0, 50.0), from(50.0, -5.0)), (10.0, 20.0, 40.0));
    }

    proptest! {
        #[test]
        fn no_axis_exceeds_the_maximum(pan in -180.0..180.0f64, tilt in -90.0..90.0f64, max in 0.1..200.0f64) {
            let law = ControlLaw { gain: 10.0, max_deg_s: max, ..LAW };
            let rate = Controller::default().rate(&offset(pan, tilt, 0.0), still(), &law);
            prop_assert!(rate.largest() <= max);
        }
    }
}
