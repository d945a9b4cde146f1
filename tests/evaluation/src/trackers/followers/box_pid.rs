// SPDX-License-Identifier: MPL-2.0

//! A controller of the box's place in the picture, whose output is the camera's speed: what "PTZ with PID" mostly means. Shape,
//! dead zone and rate are those of Roboflow's block "PTZ Tracking (ONVIF)"
//! (<https://inference.roboflow.com/workflows/blocks/ptz_tracking(onvif)/>).
//!
//! Of an axis on which the box is outside of the dead zone the speed is a PID of the offset; the axis with the smaller offset
//! goes as much slower. Where nobody is seen it stops at once. Gains count in views a second for each view of offset, whatever
//! speeds the camera has, and are the best of four pairs in tests 1, 20, 38 and 56 of seed 1: its own are meant to be tuned.

use std::time::Duration;

use super::law::{Command, Law, Observation};

/// Proportional gain, 1/s, and derivative gain; the integral one is zero.
const GAINS: (f64, f64) = (4.0, 0.3);
/// `dead_zone`, 50 pixels of 640: parts of a view.
const DEAD_ZONE: f64 = 50.0 / 640.0;
/// `camera_update_rate_limit`: from one change of speed to the next. A stop does not wait.
const PERIOD: Duration = Duration::from_millis(250);
/// Views a second at most: what cameras allow.
const FASTEST: f64 = 2.0;

/// See above.
#[derive(Debug, Default)]
pub(super) struct BoxPid {
    /// When it was seen last, and its offset in parts of a view.
    before: Option<(Duration, [f64; 2])>,
    /// When the speed may change.
    due: Duration,
    turning: [bool; 2],
}

impl Law for BoxPid {
    fn command(&mut self, observation: &Observation) -> Option<Command> {
        let speeds = self.speeds(observation);
        let turning = speeds.map(|speed| speed != 0.0);
        let stops = (0..2).any(|axis| self.turning[axis] && !turning[axis]);
        let goes = turning.contains(&true) && observation.time >= self.due;
        if !stops && !goes {
            return None;
        }
        if turning.contains(&true) {
            self.due = observation.time + PERIOD;
        }
        self.turning = turning;
        let (half_width, half_height) = observation.half_view_deg;
        Some(Command::Turn(speeds[0] * 2.0 * half_width, speeds[1] * 2.0 * half_height))
    }
}

impl BoxPid {
    /// Of pan and tilt, views a second.
    fn speeds(&mut self, observation: &Observation) -> [f64; 2] {
        let Some(target) = observation.target else {
            self.before = None;
            return [0.0; 2];
        };
        let offset = [target.offset.0 / 2.0, target.offset.1 / 2.0];
        let before = self.before.replace((observation.time, offset));
        let largest = offset[0].abs().max(offset[1].abs());
        [0, 1].map(|axis| {
            let rate = before.map_or(0.0, |(then, before)| {
                let step_s = observation.time.saturating_sub(then).as_secs_f64();
                if step_s > 0.0 { (offset[axis] - before[axis]) / step_s } else { 0.0 }
            });
            let speed = (GAINS.0 * offset[axis] + GAINS.1 * rate).clamp(-FASTEST, FASTEST);
            let outside = offset[axis].abs() > DEAD_ZONE;
            if outside { speed * offset[axis].abs() / largest } else { 0.0 }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::law::Seen;
    use super::*;

    fn seen(ms: u64, x: f64, y: f64) -> Observation {
        let target = Some(Seen { offset: (x, y), size: (0.1, 0.4), bearing_deg: (0.0, 0.0) });
        Observation { time: Duration::from_millis(ms), target, half_view_deg: (30.0, 20.0), moving: false }
    }

    fn nobody(ms: u64) -> Observation {
        Observation { target: None, ..seen(ms, 0.0, 0.0) }
    }

    fn turn(said: Option<Command>) -> (f64, f64) {
        match said {
            Some(Command::Turn(pan, tilt)) => (pan, tilt),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_camera_turns_towards_the_box_in_proportion() {
        let (pan, tilt) = turn(BoxPid::default().command(&seen(0, 0.5, 0.0)));
        assert!((pan - GAINS.0 * 0.25 * 60.0).abs() < 1e-9 && tilt == 0.0, "{pan} {tilt}");
        let (pan, tilt) = turn(BoxPid::default().command(&seen(0, -0.8, 0.4)));
        assert!((pan + GAINS.0 * 0.4 * 60.0).abs() < 1e-9, "{pan}");
        assert!(
            (tilt - GAINS.0 * 0.2 * 40.0 / 2.0).abs() < 1e-9,
            "half as far, so half as fast again: {tilt}"
        );
    }

    #[test]
    fn nothing_is_done_in_the_dead_zone() {
        assert_eq!(BoxPid::default().command(&seen(0, 0.15, -0.15)), None);
        assert_eq!(BoxPid::default().command(&nobody(0)), None);
    }

    #[test]
    fn speeds_wait_for_their_turn_and_a_stop_does_not() {
        let mut law = BoxPid::default();
        assert!(law.command(&seen(0, 0.5, 0.0)).is_some());
        assert_eq!(law.command(&seen(40, 0.6, 0.0)), None);
        assert_eq!(law.command(&seen(80, 0.1, 0.0)), Some(Command::Turn(0.0, 0.0)));
        assert_eq!(law.command(&seen(120, 0.1, 0.0)), None, "it is told once");
        assert_eq!(law.command(&seen(160, 0.5, 0.0)), None);
        let (pan, _) = turn(law.command(&seen(260, 0.5, 0.0)));
        assert!(pan > 0.0);
        assert_eq!(law.command(&nobody(300)), Some(Command::Turn(0.0, 0.0)));
    }

    #[test]
    fn a_box_that_runs_away_is_followed_faster() {
        let mut law = BoxPid::default();
        law.command(&seen(0, 0.3, 0.0));
        let (pan, _) = turn(law.command(&seen(250, 0.5, 0.0)));
        assert!((pan - (GAINS.0 * 0.25 + GAINS.1 * 0.4) * 60.0).abs() < 1e-9, "{pan}");
    }
}
