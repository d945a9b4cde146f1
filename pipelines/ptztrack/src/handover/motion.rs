// SPDX-License-Identifier: MPL-2.0

//! Who of those whom one camera sees is whom another one sees: by where they are and by where they go.

use handover::Direction;

/// Beyond so many standard deviations it is somebody else: one of a hundred who are right, place and rate having two dimensions each.
const GATE: f64 = 3.6;
/// The same of the place alone.
const PLACE_GATE: f64 = 3.0;
/// How fast somebody goes is known no better than to so many degrees per second ...
const RATE_DOUBT_DEG_S: f64 = 3.0;
/// ... and to this part of it: a track takes a while to learn it.
const RATE_DOUBT: f64 = 0.4;

/// Where somebody's feet are for a camera that turns, and how fast they go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    pub feet: Direction,
    /// Degrees per second to the right and up.
    rate_deg_s: [f64; 2],
}

impl Motion {
    pub fn between(feet: Direction, then: Direction, seconds: f64) -> Self {
        let turn = (then.pan_deg - feet.pan_deg + 540.0).rem_euclid(360.0) - 180.0;
        let right = turn * feet.tilt_deg.to_radians().cos();
        Self { feet, rate_deg_s: [right / seconds, (then.tilt_deg - feet.tilt_deg) / seconds] }
    }

    /// Whether they are surely on their way.
    pub fn goes(&self) -> bool {
        self.speed() > RATE_DOUBT_DEG_S
    }

    fn speed(&self) -> f64 {
        self.rate_deg_s[0].hypot(self.rate_deg_s[1])
    }
}

/// Somebody as a camera has to see them, by all that is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    pub motion: Motion,
    /// Standard deviation of the direction on either axis.
    pub doubt_deg: f64,
}

impl Expected {
    /// How far somebody is from that, in standard deviations; `None` where it is somebody else.
    pub fn distance(&self, seen: &Motion) -> Option<f64> {
        let [right, up] = [0, 1].map(|axis| seen.rate_deg_s[axis] - self.motion.rate_deg_s[axis]);
        let rate = right.hypot(up) / RATE_DOUBT_DEG_S.hypot(RATE_DOUBT * self.motion.speed());
        let distance = self.place_distance(seen).hypot(rate);
        (distance < GATE).then_some(distance)
    }

    /// Whether somebody may be there, wherever they go.
    pub fn is_place_of(&self, seen: &Motion) -> bool {
        self.place_distance(seen) < PLACE_GATE
    }

    fn place_distance(&self, seen: &Motion) -> f64 {
        self.motion.feet.angle_to_deg(seen.feet) / self.doubt_deg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(pan_deg: f64, rate_deg_s: f64) -> Motion {
        Motion { feet: Direction { pan_deg, tilt_deg: -10.0 }, rate_deg_s: [rate_deg_s, 0.0] }
    }

    #[test]
    fn what_stays_where_somebody_passes_is_somebody_else() {
        let expected = Expected { motion: motion(20.0, 14.0), doubt_deg: 1.5 };
        let [walker, ghost, other] = [motion(22.0, 11.0), motion(20.5, 0.0), motion(20.0, -12.0)];
        assert!(expected.distance(&walker).is_some());
        // A track that nobody is behind any more is where they pass, but does not go.
        assert!(expected.distance(&ghost).is_none_or(|off| off > expected.distance(&walker).unwrap()));
        assert_eq!(expected.distance(&other), None);
        assert!(expected.is_place_of(&other) && !expected.is_place_of(&motion(30.0, 14.0)));
    }

    #[test]
    fn who_stands_is_found_where_they_stand() {
        let expected = Expected { motion: motion(-170.0, 0.0), doubt_deg: 2.0 };
        assert!(expected.distance(&motion(-171.0, 1.0)).is_some());
        assert_eq!(expected.distance(&motion(-160.0, 0.0)), None);
    }

    #[test]
    fn a_rate_goes_the_short_way_round() {
        let at = |pan_deg| Direction { pan_deg, tilt_deg: 0.0 };
        let motion = Motion::between(at(179.0), at(-179.0), 0.2);
        assert!((motion.speed() - 10.0).abs() < 1e-9, "{motion:?}");
    }
}
