// SPDX-License-Identifier: MPL-2.0

//! Relative moves, each waited for: the autotracker of Frigate, as its documentation and settings describe it
//! (<https://docs.frigate.video/configuration/autotracking>; zooming off, which is its default, and calibrated).
//!
//! Five pictures a second are looked at. Where the person's middle is far enough from the picture's, one move brings the place
//! to the middle where they will be at its end, by their mean velocity and by how long the camera was found to take for a move.
//! What is seen until the camera says that it rests leads to nothing. When nobody was seen for ten seconds it goes home.

use std::{collections::VecDeque, time::Duration};

use super::law::{Command, Law, Observation, Seen};

/// From one picture that is looked at to the next: `detect: fps: 5`.
const PERIOD: Duration = Duration::from_millis(200);
/// `timeout`, until it goes home.
const TIMEOUT: Duration = Duration::from_secs(10);
/// Distances, in parts of the picture's longer side as the box lies, below which nothing is done: with a velocity to go by, and without.
const NEAR: f64 = 0.08;
const NEAR_UNPREDICTED: f64 = 0.03;
/// No velocity is believed from this on, pictures a second.
const FASTEST: f64 = 0.5;
/// Places from which a velocity is taken.
const REMEMBERED: usize = 4;
/// A move takes this, seconds: in any case, and for each half of a view in pan and in tilt. Its calibration's straight line.
const MOVE_S: (f64, f64) = (0.20, 0.21);

/// See above.
#[derive(Debug, Default)]
pub(super) struct RelativeMoves {
    /// When the next picture is looked at.
    due: Duration,
    /// When, and along which pan and tilt in degrees, they were seen.
    seen: VecDeque<(Duration, (f64, f64))>,
    home: bool,
}

impl Law for RelativeMoves {
    fn command(&mut self, observation: &Observation) -> Option<Command> {
        if observation.time < self.due {
            return None;
        }
        self.due = observation.time + PERIOD;
        let Some(target) = observation.target else { return self.go_home(observation) };
        self.home = false;
        let first = self.seen.is_empty();
        self.remember(observation.time, target.bearing_deg);
        let velocity = self.velocity(observation.half_view_deg);
        if observation.moving || !first && is_near(&target, velocity.is_some()) {
            return None;
        }
        let (x, y) = target.offset;
        let duration_s = MOVE_S.0 + MOVE_S.1 * (x.abs() + y.abs());
        let (dx, dy) = velocity.unwrap_or_default();
        let there = |place: f64, speed: f64| (place + speed * duration_s).clamp(-1.0, 1.0);
        Some(Command::Centre(there(x, dx), there(y, dy)))
    }
}

impl RelativeMoves {
    fn go_home(&mut self, observation: &Observation) -> Option<Command> {
        let gone = observation.time.checked_sub(self.seen.back()?.0)? >= TIMEOUT;
        if gone {
            self.seen.clear();
        }
        (gone && !std::mem::replace(&mut self.home, true)).then_some(Command::Home)
    }

    fn remember(&mut self, time: Duration, bearing_deg: (f64, f64)) {
        self.seen.push_back((time, bearing_deg));
        if self.seen.len() > REMEMBERED {
            self.seen.pop_front();
        }
    }

    /// Half views a second, as seen from a camera at rest; `None` where it is too fast to be true, or not known yet.
    fn velocity(&self, half_view_deg: (f64, f64)) -> Option<(f64, f64)> {
        let (&(before, from), &(now, to)) = (self.seen.front()?, self.seen.back()?);
        let step_s = now.checked_sub(before).filter(|step| !step.is_zero())?.as_secs_f64();
        let speed = |from: f64, to: f64, half: f64| (to - from) / half / step_s;
        let velocity = (speed(from.0, to.0, half_view_deg.0), speed(from.1, to.1, half_view_deg.1));
        (velocity.0.abs().max(velocity.1.abs()) <= 2.0 * FASTEST).then_some(velocity)
    }
}

/// The larger the box, the nearer.
fn is_near(target: &Seen, predicted: bool) -> bool {
    let largest = target.size.0.max(target.size.1).max(f64::EPSILON);
    let near = if predicted { NEAR } else { NEAR_UNPREDICTED };
    target.offset.0.hypot(target.offset.1) / 2.0 < near * (1.0 - largest.ln())
}

#[cfg(test)]
mod tests {
    use virtual_camera::{Clock, RoomSettings, Settings, VirtualCamera, World};

    use super::*;

    const HALF_VIEW_DEG: (f64, f64) = (30.0, 20.0);

    /// Somebody along that pan, seen by a camera that looks straight ahead.
    fn seen(ms: u64, pan_deg: f64, moving: bool) -> Observation {
        let offset = (pan_deg / HALF_VIEW_DEG.0, 0.0);
        let target = Some(Seen { offset, size: (0.1, 0.4), bearing_deg: (pan_deg, 0.0) });
        Observation { time: Duration::from_millis(ms), target, half_view_deg: HALF_VIEW_DEG, moving }
    }

    fn nobody(ms: u64) -> Observation {
        Observation { target: None, ..seen(ms, 0.0, false) }
    }

    #[test]
    fn five_pictures_a_second_are_looked_at() {
        let mut law = RelativeMoves::default();
        let moves: Vec<_> =
            (0..25).map(|n| law.command(&seen(40 * n, 15.0, false))).map(|said| said.is_some()).collect();
        assert_eq!(moves.iter().filter(|moved| **moved).count(), 5);
        assert_eq!(law.command(&seen(1000, 15.0, false)), Some(Command::Centre(0.5, 0.0)));
    }

    #[test]
    fn the_first_move_is_made_at_once_and_later_ones_from_a_distance_on() {
        let mut law = RelativeMoves::default();
        assert_eq!(law.command(&seen(0, 0.3, false)), Some(Command::Centre(0.01, 0.0)));
        // 0.08 (1 - ln 0.4) of a picture are 0.31 of half a view, 9.2 degrees of 30.
        let mut stood = |ms: u64, pan_deg| {
            (0..5).map(|n| law.command(&seen(ms + 200 * n, pan_deg, false))).last().unwrap()
        };
        assert_eq!(stood(200, 9.0), None);
        assert_eq!(stood(1200, 9.3), Some(Command::Centre(0.31, 0.0)));
    }

    #[test]
    fn nothing_is_done_while_the_camera_moves_but_the_velocity_is_seen() {
        let mut law = RelativeMoves::default();
        law.command(&seen(0, 12.0, false));
        for n in 1..4 {
            assert_eq!(law.command(&seen(200 * n, 12.0 + 1.2 * n as f64, true)), None);
        }
        let Some(Command::Centre(x, y)) = law.command(&seen(800, 16.8, false)) else { panic!("no move") };
        // A fifth of half a view a second, for as long as a move of 0.56 takes.
        assert!((x - (0.56 + 0.2 * (MOVE_S.0 + 0.56 * MOVE_S.1))).abs() < 1e-9 && y == 0.0, "{x} {y}");
    }

    #[test]
    fn moves_end_at_the_edge_and_a_jump_is_no_velocity() {
        let mut law = RelativeMoves::default();
        for n in 0..4 {
            law.command(&seen(200 * n, 20.0 + 5.0 * n as f64, true));
        }
        assert_eq!(law.command(&seen(800, 40.0, false)), Some(Command::Centre(1.0, 0.0)));
        assert_eq!(law.command(&seen(1000, 10.0, false)), Some(Command::Centre(1.0 / 3.0, 0.0)));
    }

    #[test]
    fn it_goes_home_once_when_nobody_was_seen_for_ten_seconds() {
        let mut law = RelativeMoves::default();
        assert_eq!(law.command(&nobody(0)), None, "nobody was ever there");
        law.command(&seen(200, 1.0, false));
        let said: Vec<_> = (2..100).filter_map(|n| Some((n, law.command(&nobody(200 * n))?))).collect();
        assert_eq!(said, [(51, Command::Home)]);
        assert!(law.command(&seen(20_000, 1.0, false)).is_some());
    }

    /// As its calibration does: thirty moves from nothing to half a view in pan and tilt, and the straight line through their times.
    #[test]
    fn moves_take_as_long_as_the_calibration_finds() {
        let size = (640, 480);
        let world = World::Room(RoomSettings::test(1, 1).unwrap());
        let camera =
            VirtualCamera::start(Settings { world, clock: Clock::Stepped, ..Settings::default() }).unwrap();
        let step = Duration::from_millis(10);
        let rest = |camera: &VirtualCamera| {
            let begin = camera.now();
            while camera.status().moving {
                camera.advance_to(camera.now() + step);
            }
            (camera.now() - begin).as_secs_f64()
        };
        let points: Vec<_> = (0..30)
            .map(|n| {
                let part = f64::from(n) / 29.0;
                assert!(camera.operate(&Command::Centre(part, part).query(size)));
                let took_s = rest(&camera);
                assert!(camera.operate("move=home"));
                rest(&camera);
                (2.0 * part, took_s)
            })
            .collect();
        let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
        let (x, y) = (mean(|point| point.0), mean(|point| point.1));
        let slope = (mean(|point| point.0 * point.1) - x * y) / (mean(|point| point.0 * point.0) - x * x);
        let found = (y - slope * x, slope);
        assert!((found.0 - MOVE_S.0).abs() < 0.01 && (found.1 - MOVE_S.1).abs() < 0.01, "{found:?}");
    }
}
