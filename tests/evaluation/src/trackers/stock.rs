//! What a GStreamer user has without us: the trackers of OpenCV in the stock `cvtracker` element.
//!
//! The element takes its box from properties when it sees its first picture, and cannot be told of another one later.
//! So pictures go past it until that of the first box. In that one it says nothing; later it attaches a region of
//! interest while it has the target, and none in pictures in which it has not.

use std::sync::Mutex;

use gst::prelude::*;
use gst_video::VideoRegionOfInterestMeta;
use ptztrack_contract::{Rect, TargetMeta, TargetState};

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
        TrackerName::Kcf => "KCF",
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
    let last = Mutex::default();
    attach_targets(&pipeline.pad("said", "src")?, cue, move |cue, buffer| {
        let seen = cue.given().or_else(|| region_of_interest(buffer));
        let seen = seen.map(|bounds| normalised(bounds, cue.size));
        translate(cue.phase, seen, buffer.pts(), &mut lock(&last))
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

/// Where it saw the target last, and when.
type Last = Option<(Rect, Option<gst::ClockTime>)>;

fn translate(phase: Phase, seen: Option<Rect>, time: Option<gst::ClockTime>, last: &mut Last) -> TargetMeta {
    let known = std::mem::replace(last, seen.map(|bounds| (bounds, time)));
    let Some(bounds) = seen else {
        let state = if phase == Phase::Before { TargetState::Searching } else { TargetState::Lost };
        return TargetMeta { state, ..TargetMeta::default() };
    };
    TargetMeta {
        state: TargetState::Tracking,
        id: 1,
        bounds,
        centroid: bounds.centre(),
        velocity: known
            .and_then(|(before, then)| rate((before.centre(), then), (bounds.centre(), time)))
            .unwrap_or_default(),
        confidence: 1.0,
        ..TargetMeta::default()
    }
}

#[cfg(test)]
mod tests {
    use ptztrack_contract::Vector;

    use super::*;

    fn at(x: f64) -> Option<Rect> {
        Some(Rect { x, y: 0.2, width: 0.1, height: 0.4 })
    }

    #[test]
    fn boxes_become_a_target_that_moves_and_gets_lost() {
        let (mut last, ms) = (None, |n| Some(gst::ClockTime::from_mseconds(n)));
        let none = translate(Phase::Before, None, ms(0), &mut last);
        assert_eq!(none.state, TargetState::Searching);
        let first = translate(Phase::FirstBox, at(0.1), ms(40), &mut last);
        assert_eq!((first.state, first.velocity), (TargetState::Tracking, Vector::default()));
        let second = translate(Phase::After, at(0.14), ms(80), &mut last);
        assert!((second.velocity.x - 1.0).abs() < 1e-9 && second.velocity.y == 0.0, "{second:?}");
        assert!((second.centroid.x - 0.19).abs() < 1e-9);
        assert_eq!(translate(Phase::After, None, ms(120), &mut last).state, TargetState::Lost);
        let again = translate(Phase::After, at(0.5), ms(160), &mut last);
        assert_eq!((again.state, again.velocity), (TargetState::Tracking, Vector::default()));
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
