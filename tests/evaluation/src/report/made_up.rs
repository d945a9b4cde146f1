// SPDX-License-Identifier: MPL-2.0

//! Runs that nobody ran.

use crate::record::{
    Bounds, Codec, Coverage, Delays, Estimate, FirstBox, FrameRecord, GroundTruth, Provenance, Run, Sighting,
    Suite, TargetState, TestId, TrackerName,
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
        snapshots: Vec::new(),
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
        best_region: None,
        size,
        focal_px: f64::from(size.0),
        pan_deg: 0.0,
        tilt_deg: 0.0,
        zoom: 1.0,
        commands: 0,
    }
}

/// A picture of that size in whose middle somebody is whom the tracker is right about.
pub(crate) fn tracked(size: (u32, u32)) -> FrameRecord {
    let (width, height) = (f64::from(size.0), f64::from(size.1));
    let bounds = Bounds { left: 0.4 * width, top: 0.25 * height, width: 0.2 * width, height: 0.5 * height };
    let truth = GroundTruth {
        id: 1,
        bounds,
        centroid: bounds.centre(),
        visible: 1.0,
        unhidden: 1.0,
        in_view: 1.0,
        position_m: None,
        direction_deg: None,
    };
    let estimate =
        Estimate { state: TargetState::Tracking, centroid: bounds.centre(), bounds, id: 1, features: 0 };
    let coverage = vec![Coverage { id: 1, hit: true, covered: 1.0 }];
    FrameRecord { truth: Some(truth), estimate: Some(estimate), coverage, ..frame(size) }
}

/// As if everybody in it were as wide and high as their box all over.
pub(crate) fn judged_by_boxes(frame: FrameRecord) -> FrameRecord {
    let sighting = |truth: &GroundTruth| Sighting::of_box(truth.clone(), frame.size);
    let people: Vec<_> = frame.truth.iter().chain(&frame.others).map(sighting).collect();
    let estimate = frame.estimate.clone();
    frame.judged(estimate, &people)
}
