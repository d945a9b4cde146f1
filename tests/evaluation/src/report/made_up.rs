//! Runs that nobody ran.

use crate::record::{Codec, Delays, FirstBox, FrameRecord, Run, TestId, TrackerName};

/// Test 7 with ours, at ten pictures a second.
pub(crate) fn run(frames: Vec<FrameRecord>) -> Run {
    Run {
        test: Some(TestId(7)),
        title: "test 7".into(),
        tracker: TrackerName::Ptztrack,
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
