// SPDX-License-Identifier: MPL-2.0

//! The bounds: they know the truth of the picture at hand, more of it or less, and one of them never moves the camera.

use std::sync::Mutex;

use ptztrack_contract::{Point, TargetMeta, TargetState, Vector};

use super::{Cue, CurrentCue, Phase, attach_targets, normalised, rate};
use crate::{
    metrics::SPECK,
    pipeline::{Elements, PipelineError, lock},
    record::{GroundTruth, TrackerName},
};

pub(super) fn attach(
    pipeline: &gst::Pipeline,
    name: TrackerName,
    cue: &CurrentCue,
) -> Result<(), PipelineError> {
    let knows = Knowledge::of(name);
    let last = Mutex::default();
    attach_targets(&pipeline.pad("tracker", "src")?, cue, move |cue, buffer| {
        knows.tell(cue, buffer.pts(), &mut lock(&last))
    });
    Ok(())
}

/// What was told last, and when.
type Last = Option<(TargetMeta, Option<gst::ClockTime>)>;

/// What a bound knows beside where the person is while something of them is to be seen.
#[derive(Debug, Clone, Copy)]
struct Knowledge {
    /// How the background moves in the picture, which it tells the servo as ours does.
    ego_motion: bool,
    /// Where the person is while something hides them.
    hidden: bool,
}

impl Knowledge {
    fn of(name: TrackerName) -> Self {
        let hidden = name == TrackerName::OracleXray;
        Self { ego_motion: hidden || name == TrackerName::OracleEgo, hidden }
    }

    fn tell(self, cue: &Cue, time: Option<gst::ClockTime>, last: &mut Last) -> TargetMeta {
        let truth = cue.truth.as_ref().filter(|_| cue.phase != Phase::Before);
        let sees = |truth: &&GroundTruth| SPECK <= if self.hidden { truth.in_view } else { truth.visible };
        let mut target = match truth.filter(sees) {
            Some(truth) => see(truth, cue.size, time, last),
            None => match last.take() {
                Some(last) if self.ego_motion => coast(cue, last, time),
                Some((before, _)) => TargetMeta { state: TargetState::Occluded, ..before },
                None => TargetMeta::default(),
            },
        };
        if self.ego_motion && target.id > 0 && target.ego_velocity.is_none() {
            target.ego_velocity = last.as_ref().and_then(|(before, then)| {
                rate((before.centroid, *then), (carried(cue, before.centroid)?, time))
            });
        }
        *last = (target.id > 0).then(|| (target.clone(), time));
        target
    }
}

fn see(truth: &GroundTruth, size: (u32, u32), time: Option<gst::ClockTime>, last: &Last) -> TargetMeta {
    let centroid = Point { x: truth.centroid.0 / f64::from(size.0), y: truth.centroid.1 / f64::from(size.1) };
    let velocity = last.as_ref().map_or_else(Vector::default, |(before, then)| {
        // What happened while it was hidden is no velocity.
        let seen_before = before.state == TargetState::Tracking;
        let rate = rate((before.centroid, *then), (centroid, time)).filter(|_| seen_before);
        rate.unwrap_or(before.velocity)
    });
    TargetMeta {
        state: TargetState::Tracking,
        id: 1,
        bounds: normalised(truth.bounds, size),
        centroid,
        velocity,
        confidence: 1.0,
        ..TargetMeta::default()
    }
}

/// Where a place of the picture before is now, if it stands still in the world.
fn carried(cue: &Cue, place: Point) -> Option<Point> {
    let (width, height) = (f64::from(cue.size.0), f64::from(cue.size.1));
    // Homographies count from the middle of the first pixel, places from its edge.
    let (x, y) = virtual_camera::project(&cue.motion?, place.x * width - 0.5, place.y * height - 0.5);
    Some(Point { x: (x + 0.5) / width, y: (y + 0.5) / height })
}

/// Who is hidden goes on against the background as they did.
fn coast(
    cue: &Cue,
    (before, then): (TargetMeta, Option<gst::ClockTime>),
    time: Option<gst::ClockTime>,
) -> TargetMeta {
    let step_s =
        time.zip(then).and_then(|(now, then)| now.checked_sub(then)).map_or(0.0, gst::ClockTime::seconds_f64);
    let background = carried(cue, before.centroid).unwrap_or(before.centroid);
    let ego_velocity = rate((before.centroid, then), (background, time));
    let ego_before = before.ego_velocity.unwrap_or_default();
    let own = Vector { x: before.velocity.x - ego_before.x, y: before.velocity.y - ego_before.y };
    let centroid = Point { x: background.x + own.x * step_s, y: background.y + own.y * step_s };
    let mut bounds = before.bounds;
    bounds.x += centroid.x - before.centroid.x;
    bounds.y += centroid.y - before.centroid.y;
    let velocity = rate((before.centroid, then), (centroid, time)).unwrap_or(before.velocity);
    TargetMeta { state: TargetState::Occluded, bounds, centroid, velocity, ego_velocity, ..before }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Bounds;

    fn cue(phase: Phase, x: f64, visible: f64) -> Cue {
        let truth = GroundTruth {
            id: 0,
            bounds: Bounds { left: x - 10.0, top: 20.0, width: 20.0, height: 60.0 },
            centroid: (x, 45.0),
            visible,
            unhidden: visible,
            in_view: 1.0,
            position_m: None,
            direction_deg: None,
        };
        Cue { phase, truth: Some(truth), ..Cue::new((200, 100)) }
    }

    /// The background goes 2 pixels to the left.
    fn turning(cue: Cue) -> Cue {
        Cue { motion: Some([[1.0, 0.0, -2.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), ..cue }
    }

    fn ms(n: u64) -> Option<gst::ClockTime> {
        Some(gst::ClockTime::from_mseconds(n))
    }

    #[test]
    fn the_truth_is_told_from_the_first_box_on() {
        let (oracle, mut last) = (Knowledge::of(TrackerName::Oracle), None);
        let mut tell = |cue: Cue, time| oracle.tell(&cue, ms(time), &mut last);
        assert_eq!(tell(cue(Phase::Before, 90.0, 1.0), 0), TargetMeta::default());
        let first = tell(cue(Phase::FirstBox, 100.0, 1.0), 40);
        assert_eq!((first.state, first.velocity), (TargetState::Tracking, Vector::default()));
        assert_eq!(first.centroid, Point { x: 0.5, y: 0.45 });
        let second = tell(turning(cue(Phase::After, 104.0, 0.2)), 80);
        assert!((second.velocity.x - 0.5).abs() < 1e-9 && second.ego_velocity.is_none(), "{second:?}");
        let hidden = tell(cue(Phase::After, 112.0, 0.0), 120);
        assert_eq!((hidden.state, hidden.velocity), (TargetState::Occluded, second.velocity));
        assert_eq!(hidden.centroid, second.centroid);
        let again = tell(cue(Phase::After, 160.0, 1.0), 160);
        assert_eq!((again.state, again.velocity), (TargetState::Tracking, second.velocity));
    }

    #[test]
    fn who_knows_the_background_s_motion_tells_it_and_coasts_by_it() {
        let (oracle, mut last) = (Knowledge::of(TrackerName::OracleEgo), None);
        let mut tell = |cue: Cue, time| oracle.tell(&turning(cue), ms(time), &mut last);
        tell(cue(Phase::FirstBox, 100.0, 1.0), 0);
        // 4 pixels to the right in the picture, 6 against the background, in 40 ms.
        let seen = tell(cue(Phase::After, 104.0, 1.0), 40);
        assert!((seen.velocity.x - 0.5).abs() < 1e-9, "{seen:?}");
        assert!((seen.ego_velocity.unwrap().x + 0.25).abs() < 1e-9, "{seen:?}");
        let hidden = tell(cue(Phase::After, 0.0, 0.0), 80);
        assert_eq!(hidden.state, TargetState::Occluded);
        assert!((hidden.centroid.x - 108.0 / 200.0).abs() < 1e-9, "{hidden:?}");
    }

    #[test]
    fn only_one_sees_through_what_hides_the_person() {
        let state =
            |name| Knowledge::of(name).tell(&cue(Phase::FirstBox, 100.0, 0.0), ms(0), &mut None).state;
        assert_eq!(state(TrackerName::OracleXray), TargetState::Tracking);
        assert_eq!(state(TrackerName::OracleEgo), TargetState::Searching);
        assert_eq!(state(TrackerName::Oracle), TargetState::Searching);
    }
}
