// SPDX-License-Identifier: MPL-2.0

//! What a scene is judged by. The first four figures were fixed before anything was compared by them; nothing else decides.

use std::collections::BTreeSet;

use crate::{
    metrics::{LASTING_S, SPECK, contains_target, d_gc, holds, is_out, mean, overlap_with},
    record::{Estimate, FrameRecord, Run, Suite},
};

/// A box holds somebody whose true box it overlaps by this much (intersection over union) or more.
const HELD_IOU: f64 = 0.3;
/// A region shows somebody whole whose box it overlaps by this much or more, as boxes are held against each other (PETS).
const SHOWN_IOU: f64 = 0.4;
/// What is followed is somebody if their part in the box is this much or more.
const SOMEBODY: f64 = 0.1;

/// Figures of one scene; `None` where there is nothing to count in.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Endpoints {
    /// Of the pictures in which a tenth of the person or more is to be seen, the share in which the box holds them.
    pub held: Option<f64>,
    /// Closed loop: mean d_gc, a picture in which the person's middle is outside counting as 1. Open loop, where the camera is not the
    /// tracker's: from the middle of the box to that of the true box, in the same unit, over the pictures in which a tenth of
    /// them or more is to be seen; no box, or one farther away, counts as 1.
    pub distance: Option<f64>,
    /// How often the box went from holding somebody, and no longer did, to holding somebody else; where there is nobody else, `None`.
    pub changes: Option<usize>,
    /// How often something was followed that never was anybody.
    pub pursuits: usize,
    /// Whether the target was elsewhere for more than half a second on end although the person was whole in view and a region showed
    /// them; `None` where nobody heard the detector.
    pub elsewhere: Option<bool>,
    /// For how long was counted, seconds.
    pub seconds: f64,
}

impl Endpoints {
    /// Of a run in a stratum.
    pub fn of(run: &Run) -> Self {
        let frames = &run.frames;
        let share = |holds: fn(&FrameRecord) -> f64| {
            mean(&frames.iter().filter(|frame| contains_target(frame)).map(holds).collect::<Vec<_>>())
        };
        let somebody = || frames.iter().filter(|frame| frame.truth.is_some());
        let distance = match run.suite {
            Suite::OpenLoop => share(off),
            _ => mean(&somebody().map(off_the_middle).collect::<Vec<_>>()),
        };
        Self {
            held: share(|frame| f64::from(u8::from(is_held(frame)))),
            distance,
            changes: frames.iter().any(|frame| !frame.others.is_empty()).then(|| changes(frames)),
            pursuits: pursuits_of_nobody(frames),
            elsewhere: frames
                .iter()
                .any(|frame| frame.best_region.is_some())
                .then(|| is_lastingly_elsewhere(frames, run.frame_rate)),
            seconds: frames.len() as f64 / run.frame_rate,
        }
    }
}

fn placed(frame: &FrameRecord) -> Option<&Estimate> {
    frame.estimate.as_ref().filter(|estimate| estimate.has_place())
}

fn is_held(frame: &FrameRecord) -> bool {
    let overlap = placed(frame)
        .zip(frame.truth.as_ref())
        .map(|(estimate, person)| overlap_with(&estimate.bounds, &person.bounds));
    overlap.is_some_and(|overlap| overlap >= HELD_IOU)
}

fn off_the_middle(frame: &FrameRecord) -> f64 {
    if is_out(frame) { 1.0 } else { d_gc(frame).map_or(1.0, |distance| distance.min(1.0)) }
}

fn off(frame: &FrameRecord) -> f64 {
    let centres = placed(frame).zip(frame.truth.as_ref());
    centres.map_or(1.0, |(estimate, person)| {
        let ((x, y), (u, v)) = (estimate.bounds.centre(), person.bounds.centre());
        let radius = f64::from(frame.size.0).hypot(f64::from(frame.size.1)) / 2.0;
        ((x - u).hypot(y - v) / radius).min(1.0)
    })
}

fn is_lastingly_elsewhere(frames: &[FrameRecord], frame_rate: f64) -> bool {
    frames
        .chunk_by(|one, next| is_elsewhere(one) == is_elsewhere(next))
        .any(|same| is_elsewhere(&same[0]) && same.len() as f64 / frame_rate > LASTING_S)
}

/// There is a target, and it is not the person, who is whole in view in a region.
fn is_elsewhere(frame: &FrameRecord) -> bool {
    let is_whole = frame.truth.as_ref().is_some_and(|person| person.visible > 1.0 - SPECK);
    let is_shown = frame.best_region.is_some_and(|overlap| overlap >= SHOWN_IOU);
    is_whole && is_shown && placed(frame).is_some() && !holds(frame)
}

/// Number of whom the box holds: of several it stays with whom it held `before`, else it is who it holds best.
fn who(frame: &FrameRecord, before: Option<u32>) -> Option<u32> {
    let estimate = placed(frame)?;
    let people = frame.truth.iter().chain(&frame.others);
    let overlaps = people.map(|person| (overlap_with(&estimate.bounds, &person.bounds), person.id));
    let held: Vec<_> = overlaps.filter(|(overlap, _)| *overlap >= HELD_IOU).collect();
    let same = held.iter().find(|(_, id)| Some(*id) == before);
    let best = held.iter().max_by(|one, other| one.0.total_cmp(&other.0));
    same.or(best).map(|(_, id)| *id)
}

fn changes(frames: &[FrameRecord]) -> usize {
    let mut held = None;
    let is_change = |frame: &&FrameRecord| {
        let Some(now) = who(frame, held) else { return false };
        held.replace(now).is_some_and(|before| before != now)
    };
    frames.iter().filter(is_change).count()
}

fn pursuits_of_nobody(frames: &[FrameRecord]) -> usize {
    let (mut all, mut of_somebody) = (BTreeSet::new(), BTreeSet::new());
    for frame in frames {
        let Some(estimate) = placed(frame) else { continue };
        all.insert(estimate.id);
        if frame.coverage.iter().any(|coverage| coverage.hit || coverage.covered >= SOMEBODY) {
            of_somebody.insert(estimate.id);
        }
    }
    all.difference(&of_somebody).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        record::{Bounds, GroundTruth, TargetState},
        report::made_up,
    };

    /// At ten pictures a second.
    fn of(suite: Suite, frames: &[FrameRecord]) -> Endpoints {
        Endpoints::of(&Run { suite, ..made_up::run(frames.to_vec()) })
    }

    fn tracked() -> FrameRecord {
        made_up::tracked((80, 60))
    }

    fn unseen() -> FrameRecord {
        FrameRecord { estimate: None, coverage: Vec::new(), ..tracked() }
    }

    /// The box is to the right of where it was; of a picture whose radius is 50 pixels.
    fn shifted(mut frame: FrameRecord, pixels: f64) -> FrameRecord {
        if let Some(estimate) = &mut frame.estimate {
            estimate.bounds.left += pixels;
        }
        frame
    }

    #[test]
    fn held_is_a_share_of_what_is_to_be_seen() {
        let mut hidden = unseen();
        if let Some(truth) = &mut hidden.truth {
            truth.visible = 0.05;
        }
        let frames = [tracked(), shifted(tracked(), 8.0), shifted(tracked(), 9.0), unseen(), hidden];
        // A box 16 pixels wide that is 8 off overlaps by 8 of 24, one that is 9 off by 7 of 25.
        assert_eq!(of(Suite::OpenLoop, &frames).held, Some(0.5));
        assert_eq!(of(Suite::OpenLoop, &[made_up::frame((80, 60))]).held, None);
    }

    #[test]
    fn the_distance_is_the_tracker_s_in_open_and_the_camera_s_in_closed_loop() {
        let frames = [tracked(), shifted(tracked(), 10.0), shifted(tracked(), 1000.0), unseen()];
        let open = of(Suite::OpenLoop, &frames).distance.unwrap();
        assert!((open - (0.0 + 0.2 + 1.0 + 1.0) / 4.0).abs() < 1e-9, "{open}");
        let mut away = tracked();
        if let Some(truth) = &mut away.truth {
            truth.centroid = (-1.0, 30.0);
        }
        assert_eq!(of(Suite::ClosedLoop, &[tracked(), unseen(), away]).distance, Some(1.0 / 3.0));
    }

    #[test]
    fn the_target_is_elsewhere_where_a_region_shows_the_whole_person_beside_it() {
        let away = |best_region| FrameRecord { best_region, coverage: Vec::new(), ..tracked() };
        let (shown, parts) = (away(Some(0.5)), away(Some(0.2)));
        let is_elsewhere = |frames: &[FrameRecord]| of(Suite::OpenLoop, frames).elsewhere;
        assert_eq!(is_elsewhere(&vec![shown.clone(); 6]), Some(true));
        assert_eq!(is_elsewhere(&vec![shown.clone(); 5]), Some(false), "no longer than half a second");
        assert_eq!(is_elsewhere(&vec![parts; 20]), Some(false));
        assert_eq!(is_elsewhere(&vec![away(None); 20]), None);
        let held = FrameRecord { best_region: Some(0.5), ..tracked() };
        assert_eq!(
            is_elsewhere(&[vec![shown; 4], vec![held], vec![away(Some(0.5)); 4]].concat()),
            Some(false)
        );
    }

    #[test]
    fn a_change_is_from_holding_one_to_holding_another() {
        let other = GroundTruth {
            id: 2,
            bounds: Bounds { left: 60.0, top: 15.0, width: 16.0, height: 30.0 },
            ..tracked().truth.unwrap()
        };
        let among = |frame: FrameRecord| FrameRecord { others: vec![other.clone()], ..frame };
        let [one, none, two] = [tracked(), unseen(), shifted(tracked(), 28.0)].map(among);
        let frames = [&one, &none, &one, &none, &two, &two, &one].map(Clone::clone);
        assert_eq!(of(Suite::OpenLoop, &frames).changes, Some(2));
        assert_eq!(of(Suite::OpenLoop, &[tracked()]).changes, None);
        // Whom it holds it stays with, however much better it holds another.
        let beside = GroundTruth { bounds: Bounds { left: 38.0, ..other.bounds }, ..other.clone() };
        let between = FrameRecord { others: vec![beside], ..shifted(tracked(), 5.0) };
        assert_eq!(of(Suite::OpenLoop, &[one, between]).changes, Some(0));
    }

    #[test]
    fn a_pursuit_of_nobody_never_was_on_anybody() {
        let follows = |id, covered| {
            let mut frame = tracked();
            if let Some(estimate) = &mut frame.estimate {
                estimate.id = id;
            }
            frame.coverage.iter_mut().for_each(|one| (one.hit, one.covered) = (false, covered));
            frame
        };
        let mut searching = follows(9, 0.0);
        if let Some(estimate) = &mut searching.estimate {
            estimate.state = TargetState::Searching;
        }
        let frames = [follows(1, 0.0), follows(1, 0.3), follows(2, 0.05), follows(2, 0.0), searching];
        let endpoints = of(Suite::OpenLoop, &frames);
        assert_eq!((endpoints.pursuits, endpoints.seconds), (1, 0.5));
    }
}
