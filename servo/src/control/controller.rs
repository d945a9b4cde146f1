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
/// It switches modes as the servos of disk drives do, from seeking to tracking: a new target is sought in haste, once and by
/// dead reckoning, and then followed calmly by what the pictures show.
#[derive(Debug, Default)]
pub struct Controller {
    pan: Axis,
    tilt: Axis,
    /// The target was in the middle once, as far as was reckoned: it is followed now.
    found: bool,
    /// Scales the gain of a loop that oscillates; what the target does by itself is followed all the same.
    pub oscillation: OscillationGuard,
    /// The speed steps in force, for the quantiser's hysteresis.
    pub speed_steps: (i8, i8),
}

impl Controller {
    /// The rate that brings the error to zero within about 1/gain while the target moves on.
    pub fn rate(&mut self, offset: &Offset, in_force: PanTilt, law: &ControlLaw) -> PanTilt {
        let Offset { seen, expected, reckoned, target } = *offset;
        let (zone_deg, scale) = (law.dead_zone_deg, self.oscillation.gain_scale());
        self.pan.start_or_rest((seen.pan, expected.pan, zone_deg.pan), target.pan);
        self.tilt.start_or_rest((seen.tilt, expected.tilt, zone_deg.tilt), target.tilt);
        // What oscillated is wrong about the camera: it reckons wrongly too.
        self.found |=
            scale < 1.0 || reckoned.pan.abs() <= zone_deg.pan && reckoned.tilt.abs() <= zone_deg.tilt;
        let correction = if self.found { expected * (scale * law.gain) } else { reckoned * law.seek_gain };
        let wanted = correction + target;
        PanTilt {
            pan: self.pan.rate(wanted.pan, in_force.pan, law),
            tilt: self.tilt.rate(wanted.tilt, in_force.tilt, law),
        }
    }

    /// Another target: what was seen so far tells nothing of it.
    pub fn meet(&mut self) {
        self.found = false;
        self.oscillation.clear();
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        self.oscillation.check_invariants();
        let (pan, tilt) = self.speed_steps;
        assert!(pan.unsigned_abs() <= 100 && tilt.unsigned_abs() <= 100, "speed steps {pan}, {tilt}");
    }

    /// Both axes at rest.
    pub fn rest(&mut self) {
        (self.pan, self.tilt) = (Axis::default(), Axis::default());
        self.found = false;
    }

    /// The speed steps for a rate.
    pub fn quantise(&mut self, rate: PanTilt, map: &SpeedMap) -> (i8, i8) {
        self.speed_steps = (map.step(rate.pan, self.speed_steps.0), map.step(rate.tilt, self.speed_steps.1));
        self.speed_steps
    }
}

#[derive(Debug, Default)]
struct Axis {
    moving: bool,
}

impl Axis {
    /// The part of the dead zone that an axis must reach to come to rest: the rest is left to a tracker's tremble.
    const REST: f64 = 1.0 / 3.0;

    fn start_or_rest(&mut self, (seen_deg, error_deg, dead_zone_deg): (f64, f64, f64), target_deg_s: f64) {
        let rest_deg = Self::REST * dead_zone_deg;
        self.moving = if self.moving {
            // Rests only for a target that would not leave the zone within a second.
            error_deg.abs() > rest_deg || target_deg_s.abs() > rest_deg
        } else {
            // Starts for nothing that is foreseen only: once in a while a tremble looks like a start.
            error_deg.abs() > dead_zone_deg && seen_deg * error_deg.signum() > rest_deg
        };
    }

    fn rate(&self, wanted_deg_s: f64, in_force_deg_s: f64, law: &ControlLaw) -> f64 {
        let wanted = if self.moving { wanted_deg_s } else { 0.0 };
        let slewed =
            wanted.clamp(in_force_deg_s - law.max_change_deg_s, in_force_deg_s + law.max_change_deg_s);
        slewed.clamp(-law.max_deg_s, law.max_deg_s)
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
        Offset { seen: error, expected: error, reckoned: error, target: PanTilt::new(target, 0.0) }
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
            let [seen, expected] = [seen, expected].map(|error| PanTilt::new(error, 0.0));
            controller
                .rate(&Offset { seen, expected, reckoned: expected, target: still() }, still(), &LAW)
                .pan
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
            let [expected, reckoned] = [10.0, reckoned].map(|error| PanTilt::new(error, 0.0));
            controller
                .rate(&Offset { seen: expected, expected, reckoned, target: still() }, still(), &law)
                .pan
        };
        assert_eq!((rate(10.0), rate(4.0), rate(0.5), rate(10.0)), (30.0, 12.0, 10.0, 10.0));
        controller.meet();
        assert_eq!(pan(&mut controller, 10.0, 0.0, &law), 30.0);
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
