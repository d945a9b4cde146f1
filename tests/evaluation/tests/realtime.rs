// SPDX-License-Identifier: MPL-2.0

//! Runs by the clock: streams as a user has them, and pictures known again behind the leaky queue.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::time::Duration;

use evaluation::{
    Experiment, Place, Scene, Target,
    metrics::Metrics,
    record::{Codec, Run, Suite, TrackerName},
};
use virtual_camera::{SyntheticSettings, World};

fn run(codec: Codec) -> Run {
    evaluation::init().unwrap();
    let path = SyntheticSettings::walk((-14.0, -2.0), (10.0, -2.0), 8.0, Duration::from_secs(1));
    // Whoever has walked stays there, off the middle: until the streams have come about, on a busy machine, the walk may
    // be over.
    let duration = path.last().unwrap().time + Duration::from_secs(6);
    let settings =
        SyntheticSettings { path, stays: true, frame_rate: 25.0, wide_fov_deg: 36.0, ..Default::default() };
    let place = Place::world(World::Synthetic(settings));
    let scene = Scene {
        suite: Suite::Recording,
        test: None,
        title: "walk".into(),
        path: "walk".into(),
        place,
        begin: Duration::ZERO,
        lead: Duration::ZERO,
        duration,
        target: Target::Only,
    };
    let experiment = Experiment::new(scene, TrackerName::Oracle, 1);
    evaluation::run(&Experiment { size: (320, 240), real_time: true, codec, ..experiment })
}

#[test]
fn over_http_and_rtsp_each_picture_is_judged_by_its_own_truth() {
    for codec in [Codec::Mjpeg, Codec::Mpeg4] {
        let run = run(codec);
        assert_eq!(run.error, None, "{codec}");
        assert!(run.frames.len() > 5 && run.dropped.is_some(), "{codec}: {} pictures", run.frames.len());
        assert!(run.frames.is_sorted_by(|one, next| one.time_s <= next.time_s), "{codec}");
        assert!(run.frames.iter().any(|frame| frame.commands > 0), "{codec}: the camera was never moved");
        // Whoever tells the truth of the picture at hand is right in it, however late it came.
        assert_eq!(Metrics::of(&run).precision, Some(1.0), "{codec}");
        assert!(!run.snapshots.is_empty(), "{codec}");
    }
}

#[test]
fn no_camera_sends_pictures_as_they_are() {
    let run = run(Codec::Raw);
    assert_eq!(run.error.as_deref(), Some("in real time pictures come as mjpeg or mpeg4, not as they are"));
}
