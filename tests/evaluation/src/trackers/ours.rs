// SPDX-License-Identifier: MPL-2.0

//! Detector and feature point tracker, with their defaults or as the thesis has them.
//!
//! Until the first box the tracker is told to wait for an operator, while the detector learns the background. In place of that box it is
//! told a place where the person is seen, by a click: where somebody stands before them the click would mean that one. What is there the
//! detector has to have seen. From the next picture on the tracker chooses for itself, so that it can find the person again after a
//! loss.

use gst::prelude::*;

use super::{Cue, Phase};
use crate::{
    pipeline::{Elements, PipelineError},
    record::FirstBox,
};

/// Ours as it stands.
pub(super) const DEFAULTS: &str = "bgavgdetect ! lkfeaturetrack name=tracker";

/// Thesis 3.2 to 3.5, no more.
pub(super) const THESIS: &str =
    "bgavgdetect profile=thesis ! lkfeaturetrack name=tracker profile=thesis confirm-frames=1";

/// How the tracker chooses by itself: its default.
const CHOICE: &str = "largest";

pub(super) fn attach(pipeline: &gst::Pipeline, first_box: FirstBox) -> Result<(), PipelineError> {
    if first_box == FirstBox::Given {
        pipeline.element("tracker")?.set_property_from_str("selection", "manual");
    }
    Ok(())
}

pub(super) fn next(pipeline: &gst::Pipeline, first_box: FirstBox, cue: &Cue) -> Result<(), PipelineError> {
    if first_box == FirstBox::Detected {
        return Ok(());
    }
    let tracker = pipeline.element("tracker")?;
    match (cue.phase, cue.click()) {
        (Phase::FirstBox, Some(place)) => {
            tracker.emit_by_name::<()>("select-target", &[&place.x, &place.y]);
        }
        (Phase::After, _) => tracker.set_property_from_str("selection", CHOICE),
        (Phase::Before | Phase::FirstBox, _) => {}
    }
    Ok(())
}
