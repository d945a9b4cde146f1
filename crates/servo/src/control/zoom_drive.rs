// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use super::zoom::ZoomController;
use crate::estimation::{Measurement, ZoomEstimator};
use crate::model::{CommandHistory, Delays, Lens, Range};

/// Turns the wish for a target of some height into zoom speeds and zoom steps of one lens.
#[derive(Debug, Default)]
pub struct ZoomDrive {
    controller: ZoomController,
    track: ZoomEstimator,
}

/// What is wanted of the zoom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZoomGoal {
    /// The target's height as a part of the picture's.
    pub target_height: f64,
    /// Zoom steps that are not left.
    pub steps: Range,
}

/// A zoom from rest to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jump {
    /// Zoom step to go to.
    pub step: u16,
    /// By what that magnifies.
    pub factor: f64,
    /// Whether it is worth a move of its own; else it goes along with one.
    pub pressing: bool,
}

impl ZoomDrive {
    /// A rate of the magnification is made a zoom speed over this time: where the lens ends, the speed runs out.
    const AHEAD_S: f64 = 0.25;

    /// Takes a picture.
    pub fn see(&mut self, measurement: &Measurement, lens: &Lens, delays: &Delays) {
        if let Some(step) = self.step_shown(measurement.taken_at, delays) {
            self.controller.see(measurement, lens.magnification(step));
        }
    }

    /// Forgets the target.
    pub fn forget(&mut self) {
        self.controller.forget();
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        self.controller.check_invariants();
        self.track.commands().check_invariants();
    }

    /// The camera told its zoom step, or does not tell.
    pub fn told(&mut self, at: Duration, step: Option<f64>, delays: &Delays) {
        if let Some(step) = step {
            self.track.told(at, step, delays);
        }
    }

    /// From then on the zoom moves at a speed step.
    pub fn commanded(&mut self, at: Duration, speed: i8) {
        self.track.commanded(at, speed);
    }

    /// The speed steps it was told, as the pan of a history.
    pub fn commands(&self) -> &CommandHistory {
        self.track.commands()
    }

    /// Whether a picture shows the zoom moving, or some that is to come does.
    pub fn moves(&self, taken_at: Duration, delays: &Delays, now: Duration) -> bool {
        self.track.moves(delays.sent_by(taken_at)) || self.track.moves(now)
    }

    /// Whether it was last told to move.
    pub fn is_moving(&self, now: Duration) -> bool {
        self.track.moves(now)
    }

    /// The zoom step that a picture shows.
    pub fn step_shown(&self, taken_at: Duration, delays: &Delays) -> Option<f64> {
        self.track.step(delays.sent_by(taken_at), delays)
    }

    /// The zoom speed for a command sent now, -100 to 100; `None` where the camera does not tell its zoom.
    pub fn speed(
        &mut self,
        goal: &ZoomGoal,
        lens: &Lens,
        measurement: &Measurement,
        delays: &Delays,
        now: Duration,
    ) -> Option<i8> {
        let step = self.track.step(now, delays)?;
        let lead = now.saturating_sub(measurement.taken_at) + delays.sum();
        let rate = self.controller.rate(goal.target_height, lens.magnification(step), lead);
        let there = lens.step_magnified(step, (rate * Self::AHEAD_S).exp())?;
        let steps_s = (goal.steps.nearest(there) - step) / Self::AHEAD_S;
        // Saturates.
        Some((steps_s / self.track.full_step_s() * 100.0).round().clamp(-100.0, 100.0) as i8)
    }

    /// The zoom to do at once, for the height to be right `lead` after the last picture; `None`: it is well as it is.
    pub fn jump(
        &self,
        goal: &ZoomGoal,
        lens: &Lens,
        delays: &Delays,
        now: Duration,
        lead: Duration,
    ) -> Option<Jump> {
        let step = self.track.step(now, delays)?;
        let (factor, pressing) =
            self.controller.factor(goal.target_height, lens.magnification(step), lead)?;
        let there = goal.steps.nearest(lens.step_magnified(step, factor)?).round();
        let factor = lens.magnification(there) / lens.magnification(step);
        // Less than a hundredth is what rounding leaves at the lens' ends.
        ((factor - 1.0).abs() > 0.01).then_some(Jump { step: there as u16, factor, pressing })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ptztrack_contract::Rect;

    const STEPS: Range = Range { min: 1.0, max: 9999.0 };
    const GOAL: ZoomGoal = ZoomGoal { target_height: 0.4, steps: STEPS };
    const LATENCY: Duration = Duration::from_millis(200);

    fn delays() -> Delays {
        Delays::of_sum(LATENCY, Duration::ZERO)
    }

    fn lens() -> Lens {
        Lens::linear(60.0, STEPS, 10.0)
    }

    /// A drive that has seen a target of this height, at a zoom step.
    fn drive(step: f64, height: f64) -> (ZoomDrive, Measurement, Duration) {
        let mut drive = ZoomDrive::default();
        drive.told(Duration::from_millis(100), Some(step), &delays());
        let bounds = Rect { x: 0.45, y: 0.5 - height / 2.0, width: 0.1, height };
        let mut seen = Measurement::at(0.5, 0.5, Duration::ZERO);
        for picture in 10..40 {
            seen = Measurement { bounds, taken_at: Duration::from_millis(40 * picture), ..seen };
            drive.see(&seen, &lens(), &delays());
        }
        let now = seen.taken_at;
        (drive, seen, now)
    }

    fn speed(goal: ZoomGoal, step: f64, height: f64) -> i8 {
        let (mut drive, seen, now) = drive(step, height);
        drive.speed(&goal, &lens(), &seen, &delays(), now).unwrap()
    }

    #[test]
    fn it_zooms_in_on_a_small_target_and_out_of_a_tall_one() {
        assert!(speed(GOAL, 1000.0, 0.2) > 0);
        assert!(speed(GOAL, 1000.0, 0.8) < 0);
        assert_eq!(speed(GOAL, 1000.0, 0.4), 0);
    }

    #[test]
    fn it_ends_where_the_lens_or_the_limits_do() {
        assert_eq!(speed(GOAL, 9999.0, 0.2), 0);
        assert_eq!(speed(GOAL, 1.0, 0.8), 0);
        let narrow = ZoomGoal { steps: Range { min: 500.0, max: 1000.0 }, ..GOAL };
        assert_eq!((speed(narrow, 1000.0, 0.2), speed(narrow, 500.0, 0.8)), (0, 0));
        assert!(speed(narrow, 3000.0, 0.4) < 0, "back into the limits");
    }

    #[test]
    fn at_once_it_goes_where_the_height_is_right() {
        let (drive_, _, now) = drive(1.0, 0.25);
        let Jump { step, factor, .. } = drive_.jump(&GOAL, &lens(), &delays(), now, LATENCY).unwrap();
        assert!((factor - 1.6).abs() < 0.01 && (lens().magnification(step.into()) - 1.6).abs() < 0.01);
        let (drive_, _, now) = drive(9999.0, 0.25);
        assert_eq!(drive_.jump(&GOAL, &lens(), &delays(), now, LATENCY), None);
    }

    #[test]
    fn a_zoom_that_is_not_told_is_left_alone() {
        let mut drive = ZoomDrive::default();
        let seen = Measurement::at(0.5, 0.5, Duration::from_secs(1));
        drive.see(&seen, &lens(), &delays());
        assert_eq!(drive.speed(&GOAL, &lens(), &seen, &delays(), seen.taken_at), None);
    }
}
