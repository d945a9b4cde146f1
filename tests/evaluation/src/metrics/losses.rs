// SPDX-License-Identifier: MPL-2.0

//! When the person was lost, and why, judged by the truth.
//!
//! The tracker *holds* the person in a picture when it says that it tracks, or that the target is hidden, and its centroid
//! lies inside their whole silhouette or its box covers a tenth of that; also where it says that they are hidden while less
//! than a tenth of them is to be seen. A *loss* is a time of more than half a second, after the first true positive, in
//! which it does not; or the whole run, where there never was one.

use virtual_camera::{Pose, aim};

use super::{CONTAINS, is_true_positive, tracked};
use crate::record::{FrameRecord, TargetState, named};

/// What lasts no longer than this is no loss, and no cause of one, seconds.
pub const LASTING_S: f64 = 0.5;
/// A box that covers a smaller part of the whole silhouette does not hold the person.
pub const COVERS: f64 = 0.1;
/// A box whose middle moves by no more than this part of its width within [`LASTING_S`], against the background, moves
/// with the wall.
const MOVES: f64 = 0.25;

named! {
    /// Why the person was lost: what held first for more than half a second from the beginning of the loss on, or else
    /// what held in most of its pictures.
    Cause, "cause" {
        /// It says that it tracks, at least a tenth of the person is inside the view, hidden or not, and the box moves with
        /// the wall.
        Background = "stuck on the background",
        /// It says that it tracks, and holds somebody else.
        SomebodyElse = "went over to somebody else",
        /// It says that it tracks, at least a tenth of the person is inside the view, and the box moves against the wall.
        SomethingElse = "went over to something else that moves",
        /// It does not say that it tracks, and since it was right for the last time less than a tenth of the person
        /// was unhidden.
        Hidden = "hidden too long",
        /// The same, and less than a tenth was inside the view; or it says that it tracks when it is so.
        OutOfView = "out of view",
        /// It does not say that it tracks, and since it was right for the last time neither was so.
        LetGo = "let go of someone in plain view",
        /// There was no true positive at all.
        NeverAcquired = "never acquired",
    }
}

/// The person was lost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loss {
    /// Why.
    pub cause: Cause,
    /// Index of the first picture in which they were not held.
    pub frame: usize,
    /// When that was, in seconds since the first counted picture.
    pub begin_s: f64,
    /// For how long, seconds.
    pub duration_s: f64,
}

/// All losses of a run, in order of time. None where there was nobody to follow.
pub fn losses(frames: &[FrameRecord]) -> Vec<Loss> {
    let Some(first) = frames.iter().position(is_true_positive) else {
        let anybody = frames.iter().any(|frame| frame.truth.is_some());
        let all = anybody.then(|| loss(frames, 0, frames.len(), Some(Cause::NeverAcquired)));
        return all.into_iter().collect();
    };
    let mut losses = Vec::new();
    let mut begin = first;
    for stretch in frames[first..].chunk_by(|a, b| holds(a) == holds(b)) {
        let end = begin + stretch.len();
        if !holds(&stretch[0]) && span_s(frames, begin, end) > LASTING_S {
            losses.push(loss(frames, begin, end, None));
        }
        begin = end;
    }
    losses
}

/// Whether the tracker holds the person, or need not.
pub fn holds(frame: &FrameRecord) -> bool {
    let Some(estimate) = frame.estimate.as_ref().filter(|estimate| estimate.has_place()) else {
        return false;
    };
    let unseen = frame.truth.as_ref().is_none_or(|truth| truth.visible < CONTAINS);
    let coasts = estimate.state == TargetState::Occluded && unseen;
    coasts || frame.on_target().is_some_and(|one| one.hit || one.covered >= COVERS)
}

fn loss(frames: &[FrameRecord], begin: usize, end: usize, cause: Option<Cause>) -> Loss {
    Loss {
        cause: cause.unwrap_or_else(|| why(frames, begin, end)),
        frame: begin,
        begin_s: frames.get(begin).map_or(0.0, |frame| frame.time_s),
        duration_s: span_s(frames, begin, end),
    }
}

/// From the picture `begin` to the picture `end`, or to the last one.
fn span_s(frames: &[FrameRecord], begin: usize, end: usize) -> f64 {
    let last = frames.get(end).or(frames.last());
    last.zip(frames.get(begin)).map_or(0.0, |(last, first)| last.time_s - first.time_s)
}

fn why(frames: &[FrameRecord], begin: usize, end: usize) -> Cause {
    let meanwhile = since_right(frames, begin);
    let causes: Vec<_> = (begin..end).map(|index| in_picture(frames, begin, index, meanwhile)).collect();
    let mut from = begin;
    for same in causes.chunk_by(|a, b| a == b) {
        if span_s(frames, from, from + same.len()) > LASTING_S {
            return same[0];
        }
        from += same.len();
    }
    let times = |cause: &Cause| causes.iter().filter(|other| *other == cause).count();
    // Of two that are as frequent the one that came first.
    causes.iter().copied().rev().max_by_key(times).unwrap_or(meanwhile)
}

/// What was so at any time from the last picture before `begin` in which it tracked and was right on.
fn since_right(frames: &[FrameRecord], begin: usize) -> Cause {
    let last = frames[..begin].iter().rposition(is_true_positive).unwrap_or(0);
    let mut truths = frames[last..=begin].iter().map(|frame| frame.truth.as_ref());
    let is_so =
        |so: fn(&crate::record::GroundTruth) -> bool| truths.clone().any(|truth| truth.is_some_and(so));
    if is_so(|truth| truth.unhidden < CONTAINS) {
        Cause::Hidden
    } else if is_so(|truth| truth.in_view < CONTAINS) || truths.any(|truth| truth.is_none()) {
        Cause::OutOfView
    } else {
        Cause::LetGo
    }
}

/// What is so in one picture of a loss.
fn in_picture(frames: &[FrameRecord], begin: usize, index: usize, meanwhile: Cause) -> Cause {
    let frame = &frames[index];
    let target = frame.truth.as_ref();
    if tracked(frame).is_none() {
        return meanwhile;
    }
    let others = frame.coverage.iter().filter(|one| target.is_none_or(|target| target.id != one.id));
    if others.clone().any(|one| one.hit || one.covered >= COVERS) {
        Cause::SomebodyElse
    } else if target.is_none_or(|target| target.in_view < CONTAINS) {
        Cause::OutOfView
    } else if moves_with_the_wall(&frames[begin..=index]) {
        Cause::Background
    } else {
        Cause::SomethingElse
    }
}

/// Whether the last box stays where the one [`LASTING_S`] before was in the world, or the first of these that was tracked.
fn moves_with_the_wall(frames: &[FrameRecord]) -> bool {
    let Some(now) = frames.last() else { return false };
    let before = frames.iter().find(|frame| {
        tracked(frame).is_some() && now.time_s - frame.time_s <= LASTING_S + f64::EPSILON.sqrt()
    });
    let moved_px = before.and_then(|before| {
        let ((pan, tilt), (pan_before, tilt_before)) = (direction_deg(now)?, direction_deg(before)?);
        let across = (pan - pan_before).to_radians() * tilt.to_radians().cos();
        Some(across.hypot((tilt - tilt_before).to_radians()) * now.focal_px)
    });
    let width = now.estimate.as_ref().map_or(0.0, |estimate| estimate.bounds.width);
    moved_px.is_some_and(|moved_px| moved_px <= MOVES * width)
}

/// Pan and tilt of the middle of the box, wherever the camera looked.
fn direction_deg(frame: &FrameRecord) -> Option<(f64, f64)> {
    let (x, y) = frame.estimate.as_ref()?.bounds.centre();
    let pose = Pose { pan_deg: frame.pan_deg, tilt_deg: frame.tilt_deg, zoom_step: frame.zoom };
    let ray = |place: f64, length: u32| (place - f64::from(length) / 2.0) / frame.focal_px;
    Some(aim(&pose, ray(x, frame.size.0), ray(y, frame.size.1)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        record::{Bounds, Estimate, GroundTruth, TargetState::*},
        report::made_up,
    };

    const SIZE: (u32, u32) = (640, 480);

    fn person(id: u32, x: f64) -> GroundTruth {
        let bounds = Bounds { left: x - 20.0, top: 180.0, width: 40.0, height: 120.0 };
        GroundTruth {
            id,
            bounds,
            centroid: bounds.centre(),
            visible: 1.0,
            unhidden: 1.0,
            in_view: 1.0,
            position_m: None,
            direction_deg: None,
        }
    }

    /// A second of true positives, then three of what `after` makes of the person, the estimate and the pan at a time.
    fn run(after: impl Fn(f64, &mut FrameRecord)) -> Vec<Loss> {
        let frames: Vec<_> = (0..100)
            .map(|n| {
                let time_s = f64::from(n) * 0.04;
                let truth = person(1, 320.0 + 40.0 * (time_s - 1.0).max(0.0));
                let bounds = truth.bounds;
                let estimate =
                    Estimate { state: Tracking, centroid: bounds.centre(), bounds, id: 1, features: 9 };
                let mut frame = FrameRecord {
                    time_s,
                    truth: Some(truth),
                    estimate: Some(estimate),
                    ..made_up::frame(SIZE)
                };
                if time_s >= 1.0 {
                    after(time_s - 1.0, &mut frame);
                }
                made_up::judged_by_boxes(frame)
            })
            .collect();
        losses(&frames)
    }

    fn put(frame: &mut FrameRecord, x: f64) {
        let bounds = person(1, x).bounds;
        frame.estimate =
            frame.estimate.take().map(|estimate| Estimate { bounds, centroid: bounds.centre(), ..estimate });
    }

    fn say(frame: &mut FrameRecord, state: TargetState) {
        frame.estimate = frame.estimate.take().map(|estimate| Estimate { state, ..estimate });
    }

    fn hide(frame: &mut FrameRecord) {
        frame.truth = frame.truth.take().map(|truth| GroundTruth { visible: 0.0, unhidden: 0.0, ..truth });
    }

    fn causes(after: impl Fn(f64, &mut FrameRecord)) -> Vec<Cause> {
        run(after).into_iter().map(|loss| loss.cause).collect()
    }

    #[test]
    fn who_is_held_is_not_lost() {
        assert_eq!(run(|_, _| {}), []);
        // Less than half a second is no loss, and being hidden is none.
        assert_eq!(
            run(|s, frame| if s < 0.46 {
                put(frame, 100.0)
            }),
            []
        );
        let hidden = |s: f64, frame: &mut FrameRecord| {
            if s < 1.2 {
                hide(frame);
                say(frame, Occluded);
                put(frame, 100.0);
            }
        };
        assert_eq!(run(hidden), []);
    }

    #[test]
    fn a_box_on_the_wall_is_stuck_there_whether_the_camera_turns_or_not() {
        assert_eq!(causes(|_, frame| put(frame, 200.0)), [Cause::Background]);
        let turning = |s: f64, frame: &mut FrameRecord| {
            frame.pan_deg = 5.0 * s;
            put(frame, 200.0 - frame.focal_px * (5.0 * s).to_radians());
        };
        assert_eq!(causes(turning), [Cause::Background]);
        let begins = run(|_, frame| put(frame, 200.0))[0];
        assert!(begins.frame == 25 && begins.begin_s == 1.0 && begins.duration_s > 2.9, "{begins:?}");
    }

    #[test]
    fn a_box_that_moves_against_the_wall_follows_something_or_somebody_else() {
        let away = |s: f64, frame: &mut FrameRecord| put(frame, 220.0 - 60.0 * s);
        assert_eq!(causes(away), [Cause::SomethingElse]);
        let with_another = |s: f64, frame: &mut FrameRecord| {
            frame.others.push(person(2, 220.0 - 60.0 * s));
            away(s, frame);
        };
        assert_eq!(causes(with_another), [Cause::SomebodyElse]);
    }

    #[test]
    fn who_stops_tracking_lost_what_was_hidden_gone_or_in_plain_view() {
        assert_eq!(causes(|_, frame| say(frame, Lost)), [Cause::LetGo]);
        let hidden = |s: f64, frame: &mut FrameRecord| {
            say(frame, if s < 0.8 { Occluded } else { Searching });
            if s < 1.0 {
                hide(frame);
            }
        };
        assert_eq!(causes(hidden), [Cause::Hidden]);
        let gone = |s: f64, frame: &mut FrameRecord| {
            say(frame, if s < 0.8 { Occluded } else { Lost });
            frame.truth = frame.truth.take().map(|truth| GroundTruth { visible: 0.0, in_view: 0.0, ..truth });
        };
        assert_eq!(causes(gone), [Cause::OutOfView]);
    }

    #[test]
    fn who_was_never_right_never_acquired() {
        let frames: Vec<_> = (0..50)
            .map(|n| FrameRecord {
                time_s: f64::from(n) * 0.04,
                truth: Some(person(1, 320.0)),
                ..made_up::frame(SIZE)
            })
            .collect();
        assert_eq!(losses(&frames).iter().map(|loss| loss.cause).collect::<Vec<_>>(), [Cause::NeverAcquired]);
        assert_eq!(losses(&[made_up::frame(SIZE)]), [], "there is nobody");
    }
}
