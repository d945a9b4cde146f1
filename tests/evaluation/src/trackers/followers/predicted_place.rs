// SPDX-License-Identifier: MPL-2.0

//! Absolute moves to a predicted place: Tang and Bilodeau, "Evaluation of Trackers for Pan-Tilt-Zoom Scenarios" (arXiv:1711.04260),
//! with the mean velocity.
//!
//! Every picture that comes while the camera rests is looked at, and the camera is sent to where the target will be when the next
//! one comes: by its mean velocity in pan and tilt, and as far ahead as this picture came after the one before, so that the time
//! for computing and for turning is in it.

use std::{collections::VecDeque, time::Duration};

use super::law::{Command, Law, Observation};

/// Places from which the mean velocity is taken.
const REMEMBERED: usize = 4;

/// See above.
#[derive(Debug, Default)]
pub(super) struct PredictedPlace {
    /// When, and along which pan and tilt in degrees, it was seen.
    seen: VecDeque<(Duration, (f64, f64))>,
}

impl Law for PredictedPlace {
    fn command(&mut self, observation: &Observation) -> Option<Command> {
        if observation.moving {
            return None;
        }
        let Some(target) = observation.target else {
            self.seen.clear();
            return None;
        };
        self.seen.push_back((observation.time, target.bearing_deg));
        if self.seen.len() > REMEMBERED {
            self.seen.pop_front();
        }
        let (pan, tilt) = self.ahead();
        Some(Command::GoTo(target.bearing_deg.0 + pan, target.bearing_deg.1 + tilt))
    }
}

impl PredictedPlace {
    /// How far it will have gone when the next picture comes, degrees of pan and tilt.
    fn ahead(&self) -> (f64, f64) {
        let (Some(first), Some(last)) = (self.seen.front(), self.seen.back()) else { return (0.0, 0.0) };
        let before = self.seen.iter().rev().nth(1).unwrap_or(last);
        let span_s = last.0.saturating_sub(first.0).as_secs_f64();
        let share = if span_s > 0.0 { last.0.saturating_sub(before.0).as_secs_f64() / span_s } else { 0.0 };
        ((last.1.0 - first.1.0) * share, (last.1.1 - first.1.1) * share)
    }
}

#[cfg(test)]
mod tests {
    use super::super::law::Seen;
    use super::*;

    fn seen(ms: u64, bearing_deg: (f64, f64)) -> Observation {
        let target = Some(Seen { offset: (0.0, 0.0), size: (0.1, 0.4), bearing_deg });
        let time = Duration::from_millis(ms);
        Observation { time, target, half_view_deg: (30.0, 20.0), moving: false }
    }

    #[test]
    fn it_goes_to_where_the_target_will_be() {
        let mut law = PredictedPlace::default();
        assert_eq!(law.command(&seen(0, (1.0, -2.0))), Some(Command::GoTo(1.0, -2.0)));
        assert_eq!(law.command(&seen(100, (2.0, -2.0))), Some(Command::GoTo(3.0, -2.0)));
        // Twice as long until the next one: 3 degrees in 0.3 s so far.
        assert_eq!(law.command(&seen(300, (4.0, -2.0))), Some(Command::GoTo(6.0, -2.0)));
    }

    #[test]
    fn pictures_of_a_camera_that_moves_are_passed_over() {
        let mut law = PredictedPlace::default();
        law.command(&seen(0, (0.0, 0.0)));
        assert_eq!(law.command(&Observation { moving: true, ..seen(40, (9.0, 0.0)) }), None);
        assert_eq!(law.command(&seen(80, (1.0, 0.0))), Some(Command::GoTo(2.0, 0.0)));
    }

    #[test]
    fn who_was_gone_has_no_velocity() {
        let mut law = PredictedPlace::default();
        law.command(&seen(0, (0.0, 0.0)));
        law.command(&seen(40, (1.0, 0.0)));
        assert_eq!(law.command(&Observation { target: None, ..seen(80, (0.0, 0.0)) }), None);
        assert_eq!(law.command(&seen(120, (9.0, 1.0))), Some(Command::GoTo(9.0, 1.0)));
    }
}
