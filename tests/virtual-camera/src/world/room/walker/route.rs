// SPDX-License-Identifier: MPL-2.0

//! A way by waypoints: where somebody goes who turns, stops and sits down as people do.

use std::f64::consts::{PI, TAU};

use super::walk::{Moment, RATE};

/// Metres per second squared: of setting off and of stopping, and of a runner.
const BRISK: f64 = 1.8;
const RUNNING: f64 = 3.0;
/// Radians per second and per second squared: how fast somebody turns.
const TURNING: f64 = 2.6;
const TURNING_CHANGE: f64 = 14.0;
/// Radians per second of turning for each radian that is missing.
const KEENNESS: f64 = 3.5;
/// How near a waypoint counts as reached, in metres: of one passed, of one stopped at.
const PASSED: f64 = 0.35;
const REACHED: f64 = 0.04;
/// How long it takes to sit down or to rise, in seconds.
const SITTING_DOWN: f64 = 1.5;
/// How long it takes to raise the arms or to lower them, in seconds.
const RAISING: f64 = 0.6;
/// Time in which everybody comes to a stand, in seconds.
const STOPPING: f64 = 1.5;
/// Nobody needs longer for a way; a route that is never finished ends here, in seconds.
const LONGEST: f64 = 900.0;

/// One thing after the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Leg {
    /// Goes past a place on the floor (x, z in metres) at a speed in metres per second.
    Past((f64, f64), f64),
    /// Goes there and stops.
    To((f64, f64), f64),
    /// Turns on the spot to a heading in radians, from z towards x.
    Face(f64),
    /// Stands for some seconds.
    Stand(f64),
    /// Sits down backwards, sits for some seconds, and rises.
    Sit(f64),
    /// Stands, and holds both arms ahead for some seconds.
    Reach(f64),
}

/// Where somebody goes, by legs.
#[derive(Debug, Clone)]
pub(super) struct Way {
    /// x and z in metres.
    pub start: (f64, f64),
    /// Radians from z towards x.
    pub heading: f64,
    /// Seconds until they set off.
    pub departure: f64,
    /// How far above the middle of the first view they come in, in degrees.
    pub above_deg: f64,
    pub legs: Vec<Leg>,
}

/// Who goes a way, from the world's start until they stand still, and when they have gone all of it, in seconds.
pub(super) fn follow(way: &Way) -> (Vec<Moment>, f64) {
    let ((x, z), heading) = (way.start, way.heading);
    let now = Moment { x, z, heading, speed: 0.0, turning: 0.0, seated: 0.0, reaching: 0.0 };
    let mut walker = Follower { now, moments: vec![now] };
    walker.stay(way.departure, |_, _| {});
    for leg in &way.legs {
        match *leg {
            Leg::Past(place, speed) => walker.go(place, speed, false),
            Leg::To(place, speed) => walker.go(place, speed, true),
            Leg::Face(heading) => walker.face(heading),
            Leg::Stand(seconds) => walker.stay(seconds, |_, _| {}),
            Leg::Sit(seconds) => walker.stay(seconds + 2.0 * SITTING_DOWN, |now, time| {
                now.seated = eased(time, seconds, SITTING_DOWN);
            }),
            Leg::Reach(seconds) => walker.stay(seconds + 2.0 * RAISING, |now, time| {
                now.reaching = eased(time, seconds, RAISING);
            }),
        }
    }
    let duration = (walker.moments.len() - 1) as f64 / RATE;
    walker.stay(STOPPING, |_, _| {});
    (walker.moments, duration)
}

struct Follower {
    now: Moment,
    moments: Vec<Moment>,
}

impl Follower {
    fn go(&mut self, place: (f64, f64), speed: f64, stops: bool) {
        loop {
            let (x, z) = (place.0 - self.now.x, place.1 - self.now.z);
            let left = x.hypot(z);
            let over =
                if stops { left < REACHED || (left < 0.2 && self.now.speed < 0.05) } else { left < PASSED };
            if over || self.moments.len() as f64 > LONGEST * RATE {
                return;
            }
            let missing = within_half_turn(x.atan2(z) - self.now.heading);
            let acceleration = if speed > 2.5 { RUNNING } else { BRISK };
            // Who has to turn far goes slowly meanwhile; who is to stop brakes in time.
            let turned = speed * missing.cos().max(0.12);
            let wanted = if stops { turned.min((2.0 * acceleration * left).sqrt()) } else { turned };
            self.step(wanted, acceleration, KEENNESS * missing);
        }
    }

    fn face(&mut self, heading: f64) {
        loop {
            let missing = within_half_turn(heading - self.now.heading);
            if missing.abs() < 0.02 || self.moments.len() as f64 > LONGEST * RATE {
                return;
            }
            self.step(0.0, BRISK, KEENNESS * missing);
        }
    }

    /// Stands for some seconds; `holds` says how, by the time since then.
    fn stay(&mut self, seconds: f64, holds: impl Fn(&mut Moment, f64)) {
        for step in 0..(seconds * RATE) as u32 {
            holds(&mut self.now, f64::from(step) / RATE);
            self.step(0.0, 2.0 * BRISK, 0.0);
        }
        (self.now.seated, self.now.reaching) = (0.0, 0.0);
    }

    fn step(&mut self, speed: f64, acceleration: f64, turning: f64) {
        let limited = |wanted: f64, now: f64, change: f64| now + (wanted - now).clamp(-change, change);
        let now = self.now;
        let turning = limited(turning.clamp(-TURNING, TURNING), now.turning, TURNING_CHANGE / RATE);
        let speed = limited(speed, now.speed, acceleration / RATE);
        let (sin, cos) = (now.heading + turning / RATE / 2.0).sin_cos();
        self.now = Moment {
            x: now.x + speed / RATE * sin,
            z: now.z + speed / RATE * cos,
            heading: now.heading + turning / RATE,
            speed,
            turning,
            ..now
        };
        self.moments.push(self.now);
    }
}

/// Up from 0 to 1 within so many seconds, held for `seconds`, and down again, at a time since the beginning of that.
fn eased(time: f64, seconds: f64, within: f64) -> f64 {
    let share = (time.min(seconds + 2.0 * within - time) / within).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}

/// The same angle from -π to π.
fn within_half_turn(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn somebody_comes_where_they_are_sent_without_jumping() {
        let legs = [
            Leg::Past((0.0, 5.0), 1.4),
            Leg::To((3.0, 6.0), 4.0),
            Leg::Stand(1.0),
            Leg::Past((0.0, 7.0), 1.0),
            Leg::To((-2.0, 5.0), 1.4),
            Leg::Face(0.0),
            Leg::Sit(2.0),
        ];
        let way =
            Way { start: (-4.0, 5.5), heading: PI / 2.0, departure: 0.8, above_deg: 0.0, legs: legs.into() };
        let (moments, duration) = follow(&way);
        assert!((15.0..40.0).contains(&duration), "{duration}");
        for pair in moments.windows(2) {
            let way = (pair[1].x - pair[0].x).hypot(pair[1].z - pair[0].z) * RATE;
            assert!(way <= 4.01, "{pair:?}");
            assert!((pair[1].speed - pair[0].speed).abs() * RATE < 3.7, "{pair:?}");
            assert!((pair[1].heading - pair[0].heading).abs() * RATE < TURNING + 0.01, "{pair:?}");
        }
        let near = |place: (f64, f64)| {
            moments.iter().any(|moment| (moment.x - place.0).hypot(moment.z - place.1) < PASSED)
        };
        assert!(near((0.0, 5.0)) && near((3.0, 6.0)) && near((0.0, 7.0)));
        let last = moments.last().unwrap();
        assert!((last.x + 2.0).hypot(last.z - 5.0) < 0.21, "{last:?}");
        assert!(within_half_turn(last.heading).abs() < 0.1 && last.seated < 0.01, "{last:?}");
        assert!(moments.iter().any(|moment| moment.seated > 0.999));
    }
}
