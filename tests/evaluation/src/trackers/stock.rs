// SPDX-License-Identifier: MPL-2.0

//! What a GStreamer user has without us: the trackers of OpenCV in the stock `cvtracker` element.
//!
//! The element takes its box from properties when it sees its first picture, and cannot be told of another one later.
//! So pictures go past it until that of the first box. In that one it says nothing; later it attaches a region of
//! interest while it has the target, and none in pictures in which it has not.

use std::sync::Mutex;

use gst::prelude::*;
use gst_video::VideoRegionOfInterestMeta;
use ptztrack_contract::{Point, Rect, TargetMeta, TargetState};

use super::{Cue, CurrentCue, Phase, attach_targets, normalised, rate};
use crate::{
    pipeline::{Elements, PipelineError, lock},
    record::{Bounds, TrackerName},
};

/// Name of the regions of interest that it attaches.
const ROI: &str = "object";

pub(super) fn description(name: TrackerName) -> String {
    let algorithm = match name {
        TrackerName::Csrt => "CSRT",
        TrackerName::Kcf | TrackerName::KcfPredicted => "KCF",
        TrackerName::Mosse => "MOSSE",
        _ => "MedianFlow",
    };
    format!(
        "videoconvert ! cvtracker name=tracker algorithm={algorithm} draw-rect=false ! identity name=said"
    )
}

pub(super) fn attach(pipeline: &gst::Pipeline, cue: &CurrentCue) -> Result<(), PipelineError> {
    let past = pipeline.pad("tracker", "src")?;
    let waiting = cue.clone();
    pipeline.pad("tracker", "sink")?.add_probe(gst::PadProbeType::BUFFER, move |_, info| {
        if lock(&waiting).phase != Phase::Before {
            return gst::PadProbeReturn::Remove;
        }
        if let Some(buffer) = info.take_buffer() {
            info.flow_res = past.push(buffer);
        }
        gst::PadProbeReturn::Handled
    });
    let (coast, last) = (coast_time()?, Mutex::default());
    attach_targets(&pipeline.pad("said", "src")?, cue, move |cue, buffer| {
        let seen = cue.given().or_else(|| region_of_interest(buffer));
        let seen = seen.map(|bounds| normalised(bounds, cue.size));
        translate(cue.phase, seen, buffer.pts(), coast, &mut lock(&last))
    });
    Ok(())
}

pub(super) fn next(pipeline: &gst::Pipeline, cue: &Cue) -> Result<(), PipelineError> {
    let Some(bounds) = cue.given() else { return Ok(()) };
    let tracker = pipeline.element("tracker")?;
    let whole = |number: f64| number.round().max(0.0) as u32;
    tracker.set_property("object-initial-x", whole(bounds.left));
    tracker.set_property("object-initial-y", whole(bounds.top));
    tracker.set_property("object-initial-width", whole(bounds.width).max(1));
    tracker.set_property("object-initial-height", whole(bounds.height).max(1));
    Ok(())
}

fn region_of_interest(buffer: &gst::BufferRef) -> Option<Bounds> {
    let region = buffer.iter_meta::<VideoRegionOfInterestMeta>().find(|region| region.roi_type() == ROI)?;
    let (x, y, width, height) = region.rect();
    // A place left of or above the picture wraps in the meta's unsigned numbers; sizes do not.
    let [left, top] = [x, y].map(|place| f64::from(place.cast_signed()));
    Some(Bounds { left, top, width: f64::from(width), height: f64::from(height) })
}

/// For how long ours holds a target that it does not see for hidden: so do they.
fn coast_time() -> Result<gst::ClockTime, PipelineError> {
    let ours = gst::ElementFactory::make("lkfeaturetrack").build()?;
    Ok(gst::ClockTime::from_nseconds(ours.property("coast-time")))
}

/// What it said when it saw the target last.
struct Seen {
    target: TargetMeta,
    time: Option<gst::ClockTime>,
    /// Whether there were pictures since in which it did not see it.
    hidden: bool,
}

fn translate(
    phase: Phase,
    seen: Option<Rect>,
    time: Option<gst::ClockTime>,
    coast: gst::ClockTime,
    last: &mut Option<Seen>,
) -> TargetMeta {
    let Some(bounds) = seen else {
        let state = if phase == Phase::Before { TargetState::Searching } else { TargetState::Lost };
        let gone = TargetMeta { state, ..TargetMeta::default() };
        return last.as_mut().and_then(|last| coasted(last, time, coast)).unwrap_or(gone);
    };
    let velocity = last.as_ref().map(|before| {
        // What happened while it was hidden is no velocity.
        let place = (before.target.centroid, before.time);
        let rate = rate(place, (bounds.centre(), time)).filter(|_| !before.hidden);
        rate.unwrap_or(before.target.velocity)
    });
    let target = TargetMeta {
        state: TargetState::Tracking,
        id: 1,
        bounds,
        centroid: bounds.centre(),
        velocity: velocity.unwrap_or_default(),
        confidence: 1.0,
        ..TargetMeta::default()
    };
    *last = Some(Seen { target: target.clone(), time, hidden: false });
    target
}

/// The target where it would be by its last velocity; `None` where it was not seen for too long.
fn coasted(last: &mut Seen, time: Option<gst::ClockTime>, coast: gst::ClockTime) -> Option<TargetMeta> {
    last.hidden = true;
    let before = &last.target;
    let unseen = time?.checked_sub(last.time?).filter(|unseen| *unseen <= coast)?;
    let moved = |place: f64, velocity: f64| place + velocity * unseen.seconds_f64();
    let Rect { x, y, .. } = before.bounds;
    Some(TargetMeta {
        state: TargetState::Occluded,
        bounds: Rect { x: moved(x, before.velocity.x), y: moved(y, before.velocity.y), ..before.bounds },
        centroid: Point {
            x: moved(before.centroid.x, before.velocity.x),
            y: moved(before.centroid.y, before.velocity.y),
        },
        confidence: 0.0,
        ..before.clone()
    })
}

#[cfg(test)]
mod tests {
    use ptztrack_contract::Vector;

    use super::*;

    fn at(x: f64) -> Option<Rect> {
        Some(Rect { x, y: 0.2, width: 0.1, height: 0.4 })
    }

    #[test]
    fn boxes_become_a_target_that_moves_is_hidden_and_gets_lost() {
        let mut last = None;
        let mut say = |phase, seen, ms| {
            let coast = gst::ClockTime::from_mseconds(100);
            translate(phase, seen, Some(gst::ClockTime::from_mseconds(ms)), coast, &mut last)
        };
        assert_eq!(say(Phase::Before, None, 0).state, TargetState::Searching);
        let first = say(Phase::FirstBox, at(0.1), 40);
        assert_eq!((first.state, first.velocity), (TargetState::Tracking, Vector::default()));
        let second = say(Phase::After, at(0.14), 80);
        assert!((second.velocity.x - 1.0).abs() < 1e-9 && second.velocity.y == 0.0, "{second:?}");
        assert!((second.centroid.x - 0.19).abs() < 1e-9);
        let hidden = say(Phase::After, None, 180);
        assert_eq!((hidden.state, hidden.velocity), (TargetState::Occluded, second.velocity));
        assert!((hidden.centroid.x - 0.29).abs() < 1e-9 && (hidden.bounds.x - 0.24).abs() < 1e-9);
        assert_eq!(say(Phase::After, None, 181).state, TargetState::Lost);
        let again = say(Phase::After, at(0.5), 220);
        assert_eq!((again.state, again.velocity), (TargetState::Tracking, second.velocity));
    }

    #[test]
    fn a_box_that_sticks_out_is_read_as_meant() {
        gst::init().unwrap();
        let mut buffer = gst::Buffer::new();
        let buffer = buffer.get_mut().unwrap();
        assert_eq!(region_of_interest(buffer), None);
        VideoRegionOfInterestMeta::add(buffer, "motion", (1, 2, 3, 4));
        VideoRegionOfInterestMeta::add(buffer, ROI, ((-7i32).cast_unsigned(), 2, 30, 40));
        let expected = Bounds { left: -7.0, top: 2.0, width: 30.0, height: 40.0 };
        assert_eq!(region_of_interest(buffer), Some(expected));
    }
}
