// SPDX-License-Identifier: MPL-2.0

//! Runs that nobody ran.

use crate::record::{
    Codec, Delays, FirstBox, FrameRecord, Provenance, Run, Sighting, Suite, TestId, TrackerName,
};

/// Test 7 with ours, at ten pictures a second.
pub(crate) fn run(frames: Vec<FrameRecord>) -> Run {
    Run {
        suite: Suite::Room,
        test: Some(TestId(7)),
        path: "1".into(),
        title: "test 7".into(),
        tracker: TrackerName::Ptztrack,
        provenance: Provenance { tracker: "t".into(), servo: "s".into(), laboratory: "l".into() },
        codec: Codec::Mjpeg,
        size: (80, 60),
        seed: 1,
        delays: Delays::default(),
        first_box: FirstBox::Given,
        frame_rate: 10.0,
        sweep: false,
        snapshots: Vec::new(),
        dropped: None,
        frames,
        error: None,
    }
}

/// A picture of that size with nobody in it, of which nothing was said.
pub(crate) fn frame(size: (u32, u32)) -> FrameRecord {
    FrameRecord {
        time_s: 0.0,
        truth: None,
        others: Vec::new(),
        estimate: None,
        coverage: Vec::new(),
        size,
        focal_px: f64::from(size.0),
        pan_deg: 0.0,
        tilt_deg: 0.0,
        zoom: 1.0,
        commands: 0,
    }
}

/// As if everybody in it were as wide and high as their box all over.
pub(crate) fn judged_by_boxes(frame: FrameRecord) -> FrameRecord {
    let sighting = |truth: &crate::record::GroundTruth| Sighting::of_box(truth.clone(), frame.size);
    let people: Vec<_> = frame.truth.iter().chain(&frame.others).map(sighting).collect();
    let estimate = frame.estimate.clone();
    frame.judged(estimate, &people)
}
