// SPDX-License-Identifier: MPL-2.0

//! What is replaced by the truth after the tracker: where its box is, and how large.

use std::collections::VecDeque;

use ptztrack_contract::TargetState;

use super::truth::Stage;
use crate::record::{Bounds, Estimate, FrameRecord, GroundTruth};

/// Errors are averaged over this time, seconds: what stays is bias or lag, the rest is jitter.
const WINDOW_S: f64 = 1.0;
/// The person's motion is measured over this time, seconds.
const STEP_S: f64 = 0.2;
/// Who moves more slowly than this has no direction to lag in, degrees per second.
const SLOWEST_DEG_S: f64 = 1.0;

/// Pixels to the right and down.
type Offset = (f64, f64);

/// A picture in which the box had a place.
struct Seen {
    time_s: f64,
    /// From the middle of the true box to that of the tracker's.
    error: Offset,
}

/// Replaces what the tracker said.
pub(super) struct Placement {
    stages: Vec<Stage>,
    recent: VecDeque<Seen>,
    /// Where the person was in the last moments: time, and pan and tilt in degrees.
    directions: VecDeque<(f64, (f64, f64))>,
    /// The error when the person was tracked last.
    tracked: Option<Offset>,
}

impl Placement {
    pub fn new(stages: &[Stage]) -> Self {
        Self { stages: stages.to_vec(), recent: VecDeque::new(), directions: VecDeque::new(), tracked: None }
    }

    /// What the tracker said of a picture, with what is replaced in it; to be asked picture by picture.
    pub fn replaced(&mut self, mut estimate: Estimate, picture: &FrameRecord) -> Estimate {
        let Some(person) = picture.truth.as_ref().filter(|_| estimate.has_place()) else {
            self.recent.clear();
            return estimate;
        };
        let (middle, there) = (estimate.bounds.centre(), person.bounds.centre());
        let mut error = (middle.0 - there.0, middle.1 - there.1);
        if estimate.state == TargetState::Tracking {
            self.tracked = Some(error);
        } else if let Some(tracked) = self.tracked.filter(|_| self.with(Stage::Speed)) {
            error = tracked;
        }
        self.recent.push_back(Seen { time_s: picture.time_s, error });
        self.recent.retain(|seen| seen.time_s > picture.time_s - WINDOW_S);
        let heading = self.heading(person, picture.time_s);
        let left = self.left(error, heading);
        let moved = (there.0 + left.0 - middle.0, there.1 + left.1 - middle.1);
        estimate.centroid = (estimate.centroid.0 + moved.0, estimate.centroid.1 + moved.1);
        let Bounds { width, height, .. } =
            if self.with(Stage::Size) { person.bounds } else { estimate.bounds };
        let (x, y) = (middle.0 + moved.0, middle.1 + moved.1);
        estimate.bounds = Bounds { left: x - width / 2.0, top: y - height / 2.0, width, height };
        estimate
    }

    fn with(&self, stage: Stage) -> bool {
        self.stages.contains(&stage)
    }

    /// What is left of an error when the parts that are replaced are taken off.
    fn left(&self, error: Offset, heading: Option<Offset>) -> Offset {
        let count = self.recent.len().max(1) as f64;
        let sum = |of: fn(&Seen) -> f64| self.recent.iter().map(of).sum::<f64>() / count;
        let mean = (sum(|seen| seen.error.0), sum(|seen| seen.error.1));
        let along = heading.map_or(0.0, |(x, y)| mean.0 * x + mean.1 * y);
        let lag = heading.map_or((0.0, 0.0), |(x, y)| (along * x, along * y));
        let parts = [
            (Stage::Lag, lag),
            (Stage::Bias, (mean.0 - lag.0, mean.1 - lag.1)),
            (Stage::Jitter, (error.0 - mean.0, error.1 - mean.1)),
        ];
        let replaced = parts.into_iter().filter(|(stage, _)| self.with(*stage));
        replaced.fold(error, |left, (_, part)| (left.0 - part.0, left.1 - part.1))
    }

    /// In which direction of the picture the person moves against the background, of length 1.
    fn heading(&mut self, person: &GroundTruth, time_s: f64) -> Option<Offset> {
        let (pan, tilt) = person.direction_deg?;
        self.directions.push_back((time_s, (pan, tilt)));
        while self.directions.len() > 2 && self.directions[1].0 <= time_s - STEP_S {
            self.directions.pop_front();
        }
        let (then_s, (from_pan, from_tilt)) = *self.directions.front()?;
        let moved = (pan - from_pan, from_tilt - tilt);
        let length = moved.0.hypot(moved.1);
        (length > SLOWEST_DEG_S * (time_s - then_s)).then(|| (moved.0 / length, moved.1 / length))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::made_up;

    /// The middle of the box off that of the true one, of a person who walks to the right at 10 degrees per second.
    fn errors(
        stages: &[Stage],
        off: impl Fn(usize) -> Offset,
        state: fn(usize) -> TargetState,
    ) -> Vec<Offset> {
        let mut placement = Placement::new(stages);
        let picture = |number: usize| {
            let mut frame = made_up::tracked((80, 60));
            frame.time_s = number as f64 * 0.04;
            let truth = frame.truth.as_mut().unwrap();
            truth.direction_deg = Some((0.4 * number as f64, 0.0));
            let there = truth.bounds;
            let mut said = frame.estimate.clone().unwrap();
            let (x, y) = off(number);
            said.bounds = Bounds { left: there.left + x, top: there.top + y, ..there };
            said.state = state(number);
            let (x, y) = placement.replaced(said, &frame).bounds.centre();
            (x - there.centre().0, y - there.centre().1)
        };
        (0..60).map(picture).collect()
    }

    fn always(_: usize) -> TargetState {
        TargetState::Tracking
    }

    fn near(found: Offset, x: f64, y: f64) -> bool {
        (found.0 - x).abs() < 0.2 && (found.1 - y).abs() < 0.2
    }

    #[test]
    fn an_error_is_of_three_parts() {
        // Behind by 4 pixels, too low by 3, and trembling by 2.
        let off = |number: usize| (-4.0 + [2.0, -2.0][number % 2], 3.0);
        let last = |stages: &[Stage]| errors(stages, off, always)[58];
        assert!(near(last(&[]), -2.0, 3.0));
        assert!(near(last(&[Stage::Bias, Stage::Jitter]), -4.0, 0.0), "lag alone");
        assert!(near(last(&[Stage::Lag, Stage::Jitter]), 0.0, 3.0), "bias alone");
        assert!(near(last(&[Stage::Lag, Stage::Bias]), 2.0, 0.0), "jitter alone");
        assert!(near(last(&[Stage::Lag, Stage::Bias, Stage::Jitter]), 0.0, 0.0));
    }

    #[test]
    fn who_is_hidden_goes_on_at_their_true_speed() {
        let state = |number: usize| if number < 30 { TargetState::Tracking } else { TargetState::Occluded };
        let off = |number: usize| (2.0 + number.saturating_sub(29) as f64, 0.0);
        let [ours, replaced] = [&[][..], &[Stage::Speed]].map(|stages| errors(stages, off, state));
        assert!(near(ours[50], 23.0, 0.0) && near(replaced[50], 2.0, 0.0), "{replaced:?}");
        assert_eq!(ours[..30], replaced[..30]);
    }
}
