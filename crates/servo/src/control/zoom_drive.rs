// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use super::zoom::ZoomController;
use crate::Time;
use crate::estimation::{LensFinding, MagnificationEstimator, Measurement, ZoomEstimator};
use crate::model::{CommandHistory, Delays, Lens, Range, SpeedMap};

/// Turns the wish for a target of some height into zoom speeds and places of one lens.
#[derive(Debug, Default)]
pub struct ZoomDrive {
    controller: ZoomController,
    track: ZoomEstimator,
    /// Of a lens of which the camera tells nothing.
    seen: Option<MagnificationEstimator>,
    /// Such a lens goes in where it is told to go out.
    reversed: bool,
    /// It zoomed in since it was last as wide as it goes.
    narrowed: bool,
}

/// What is wanted of the zoom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZoomGoal {
    /// The target's height as a part of the picture's.
    pub target_height: f64,
    /// The part of the zoom's travel that is not left.
    pub travel: Range,
}

/// A zoom from rest to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jump {
    /// Part of the zoom's travel to go to.
    pub travel: f64,
    /// By what that magnifies.
    pub factor: f64,
    /// Whether it is worth a move of its own; else it goes along with one.
    pub pressing: bool,
}

impl ZoomDrive {
    /// A rate of the magnification is made a zoom speed over this time: where the lens ends, the speed runs out.
    const AHEAD_S: f64 = 0.25;

    /// Takes a picture, with somebody in it or not, of a lens of which the camera tells nothing.
    pub fn watch(&mut self, measurement: &Measurement, delays: &Delays) {
        let seen = self.seen.get_or_insert_with(|| {
            self.track = ZoomEstimator::of_magnification();
            MagnificationEstimator::default()
        });
        match seen.see(measurement.ego_zoom, measurement.taken_at, &mut self.track, delays) {
            Some(LensFinding::Widest(widest)) => {
                self.controller.count_from(widest);
                self.narrowed = false;
            }
            Some(LensFinding::Reversed) => {
                self.reversed = !self.reversed;
                self.track.reverse();
                self.narrowed = true;
            }
            None => {}
        }
    }

    /// How far such a lens goes, as far as that was seen.
    pub fn ends(&self) -> Range {
        self.seen.as_ref().map_or(Range { min: 0.0, max: 0.0 }, MagnificationEstimator::ends)
    }

    /// Whether such a lens was seen to go nowhere.
    pub fn is_fixed(&self) -> bool {
        self.seen.as_ref().is_some_and(MagnificationEstimator::is_fixed)
    }

    /// The zoom speed that widens the view of such a lens, while nobody is there; `None`: it is as wide as it goes, or no picture
    /// would show that it is.
    pub fn widening(&self, now: Time) -> Option<f64> {
        let is_shown = |seen: &MagnificationEstimator| seen.is_seen(now) && !seen.is_fixed();
        let wanted = self.narrowed && self.seen.as_ref().is_some_and(is_shown);
        wanted.then(|| self.part(-ZoomController::WIDENING))
    }

    /// It stays as it is, however narrow the view is.
    pub fn leave(&mut self) {
        self.narrowed = false;
    }

    /// The part of the zoom's travel that the last picture showed, or the camera last told.
    pub fn last_travel(&self) -> Option<f64> {
        self.track.last()
    }

    /// Takes a picture.
    pub fn see(&mut self, measurement: &Measurement, lens: &Lens, delays: &Delays) {
        if let Some(travel) = self.travel_shown(measurement.taken_at, delays) {
            self.controller.see(measurement, lens.magnification(travel));
        }
    }

    /// Forgets the target.
    pub fn forget(&mut self) {
        self.controller.forget();
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        self.controller.check_invariants();
        self.seen.iter().for_each(MagnificationEstimator::check_invariants);
        self.track.commands().check_invariants();
    }

    /// The camera told its zoom, or does not tell.
    pub fn told(&mut self, at: Time, travel: Option<f64>, delays: &Delays) {
        if let Some(travel) = travel {
            self.track.told(at, travel, delays);
        }
    }

    /// From then on the zoom moves at what is called a part of its fastest.
    pub fn commanded(&mut self, at: Time, told: f64) {
        let speed = self.sense() * told;
        self.narrowed |= speed > 0.0;
        self.track.commanded(at, speed);
    }

    /// The speeds it was told, as the pan of a history.
    pub fn commands(&self) -> &CommandHistory {
        self.track.commands()
    }

    /// Whether a picture shows the zoom moving, or some that is to come does.
    pub fn moves(&self, taken_at: Time, delays: &Delays, now: Time) -> bool {
        self.track.moves(delays.sent_by(taken_at)) || self.track.moves(now)
    }

    /// Whether it was last told to move.
    pub fn is_moving(&self, now: Time) -> bool {
        self.track.moves(now)
    }

    /// The part of the zoom's travel that a picture shows.
    pub fn travel_shown(&self, taken_at: Time, delays: &Delays) -> Option<f64> {
        self.travel(delays.sent_by(taken_at), delays)
    }

    /// The part of the zoom's travel that comes of the commands sent until then.
    fn travel(&self, sent_until: Time, delays: &Delays) -> Option<f64> {
        match &self.seen {
            Some(seen) if seen.is_at_rest() => self.track.last(),
            Some(seen) => self.track.travel(sent_until, delays).map(|travel| seen.ends().nearest(travel)),
            None => self.track.travel(sent_until, delays),
        }
    }

    /// The zoom speed for a command sent now, -1 to 1 in hundredths; `None` where the camera does not tell its zoom.
    pub fn speed(
        &mut self,
        goal: &ZoomGoal,
        lens: &Lens,
        measurement: &Measurement,
        delays: &Delays,
        now: Time,
    ) -> Option<f64> {
        let travel = self.travel(now, delays)?;
        let lead = now - measurement.taken_at + delays.sum();
        let rate = self.controller.rate(goal.target_height, lens.magnification(travel), lead);
        let there = lens.travel_magnified(travel, (rate * Self::AHEAD_S).exp())?;
        let per_s = (goal.travel.nearest(there) - travel) / Self::AHEAD_S;
        Some(self.part(per_s))
    }

    /// The part of the fastest, in hundredths, that is so much of the travel per second.
    fn part(&self, per_s: f64) -> f64 {
        let boost = self.seen.as_ref().map_or(1.0, |seen| seen.boost(per_s));
        let part = (boost * per_s / self.track.fastest_per_s()).clamp(-1.0, 1.0);
        SpeedMap::part(SpeedMap::level_of(self.sense() * part))
    }

    /// -1 of a lens that goes in where it is told to go out.
    fn sense(&self) -> f64 {
        if self.reversed { -1.0 } else { 1.0 }
    }

    /// The zoom to do at once, for the height to be right `lead` after the last picture; `None`: it is well as it is.
    pub fn jump(
        &self,
        goal: &ZoomGoal,
        lens: &Lens,
        delays: &Delays,
        now: Time,
        lead: Duration,
    ) -> Option<Jump> {
        let travel = self.travel(now, delays)?;
        let (factor, pressing) =
            self.controller.factor(goal.target_height, lens.magnification(travel), lead)?;
        let there = goal.travel.nearest(lens.travel_magnified(travel, factor)?);
        let factor = lens.magnification(there) / lens.magnification(travel);
        // Less than a hundredth is what rounding leaves at the lens' ends.
        ((factor - 1.0).abs() > 0.01).then_some(Jump { travel: there, factor, pressing })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ptztrack_contract::Rect;

    const TRAVEL: Range = Range { min: 0.0, max: 1.0 };
    const GOAL: ZoomGoal = ZoomGoal { target_height: 0.4, travel: TRAVEL };
    const LATENCY: Duration = Duration::from_millis(200);

    fn delays() -> Delays {
        Delays::of_sum(LATENCY, Duration::ZERO)
    }

    fn lens() -> Lens {
        Lens::linear(60.0, TRAVEL, 10.0)
    }

    /// A drive that has seen a target of this height, at a part of the travel.
    fn drive(travel: f64, height: f64) -> (ZoomDrive, Measurement, Time) {
        let mut drive = ZoomDrive::default();
        drive.told(Time::from_millis(100), Some(travel), &delays());
        let bounds = Rect { x: 0.45, y: 0.5 - height / 2.0, width: 0.1, height };
        let mut seen = Measurement::at(0.5, 0.5, Time::ZERO);
        for picture in 10..40 {
            seen = Measurement { bounds, taken_at: Time::from_millis(40 * picture), ..seen };
            drive.see(&seen, &lens(), &delays());
        }
        let now = seen.taken_at;
        (drive, seen, now)
    }

    fn speed(goal: ZoomGoal, travel: f64, height: f64) -> f64 {
        let (mut drive, seen, now) = drive(travel, height);
        drive.speed(&goal, &lens(), &seen, &delays(), now).unwrap()
    }

    #[test]
    fn it_zooms_in_on_a_small_target_and_out_of_a_tall_one() {
        assert!(speed(GOAL, 0.1, 0.2) > 0.0);
        assert!(speed(GOAL, 0.1, 0.8) < 0.0);
        assert_eq!(speed(GOAL, 0.1, 0.4), 0.0);
    }

    #[test]
    fn it_ends_where_the_lens_or_the_limits_do() {
        assert_eq!(speed(GOAL, 1.0, 0.2), 0.0);
        assert_eq!(speed(GOAL, 0.0, 0.8), 0.0);
        let narrow = ZoomGoal { travel: Range { min: 0.05, max: 0.1 }, ..GOAL };
        assert_eq!((speed(narrow, 0.1, 0.2), speed(narrow, 0.05, 0.8)), (0.0, 0.0));
        assert!(speed(narrow, 0.3, 0.4) < 0.0, "back into the limits");
    }

    #[test]
    fn at_once_it_goes_where_the_height_is_right() {
        let (drive_, _, now) = drive(0.0, 0.25);
        let Jump { travel, factor, .. } = drive_.jump(&GOAL, &lens(), &delays(), now, LATENCY).unwrap();
        assert!((factor - 1.6).abs() < 0.01 && (lens().magnification(travel) - 1.6).abs() < 0.01);
        let (drive_, _, now) = drive(1.0, 0.25);
        assert_eq!(drive_.jump(&GOAL, &lens(), &delays(), now, LATENCY), None);
    }

    #[test]
    fn a_zoom_that_is_not_told_is_left_alone() {
        let mut drive = ZoomDrive::default();
        let seen = Measurement::at(0.5, 0.5, Time::from_millis(1000));
        drive.see(&seen, &lens(), &delays());
        assert_eq!(drive.speed(&GOAL, &lens(), &seen, &delays(), seen.taken_at), None);
    }
}
