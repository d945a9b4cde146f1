// SPDX-License-Identifier: MPL-2.0

//! A few of the 72 tests, small and from seeds of their own: what must hold whatever the tracker is worth.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use evaluation::{
    Experiment, Scene,
    metrics::Metrics,
    record::{Run, TestId, TrackerName},
};

/// Horizontal field of view of the room's widest view, degrees.
const FOV_DEG: f64 = 55.0;

fn run(test: u32, tracker: TrackerName, seed: u64) -> Run {
    evaluation::init().unwrap();
    let scene = Scene::room(TestId(test), seed).unwrap();
    let run = evaluation::run(&Experiment { size: (320, 240), ..Experiment::new(scene, tracker, seed) });
    assert_eq!(run.error, None, "test {test}, {tracker}");
    run
}

#[test]
fn one_seed_is_one_run_and_another_seed_another() {
    let [once, again, elsewhere] = [5, 5, 6].map(|seed| run(7, TrackerName::Ptztrack, seed));
    assert!(once.frames.iter().any(|frame| frame.commands > 0), "the camera was never moved");
    assert!(once == again, "the same seed gave something else");
    assert_ne!(Metrics::of(&once), Metrics::of(&elsewhere));
    let places = |run: &Run| run.frames[0].truth.as_ref().unwrap().position_m;
    assert_ne!(places(&once), places(&elsewhere), "the same way in another room");
}

#[test]
fn who_knows_the_truth_loses_nobody_who_is_to_be_seen() {
    // Plain, behind furniture in dim light, and fast, slow and back again.
    for test in [2, 12, 55] {
        let metrics = Metrics::of(&run(test, TrackerName::Oracle, 5));
        assert_eq!(metrics.precision, Some(1.0), "test {test}");
        assert_eq!(metrics.detection_precision, Some(1.0), "test {test}");
        assert_eq!(metrics.track_fragmentation, Some(0.0), "test {test}");
    }
}

#[test]
fn from_a_camera_at_rest_the_person_walks_out_where_geometry_says() {
    let run = run(1, TrackerName::Still, 5);
    let pan_deg = run.frames[0].pan_deg;
    assert!(run.frames.iter().all(|frame| frame.pan_deg == pan_deg));
    // By where the feet are in the room, without any picture: off the axis by more than half the field of view. A little
    // more or less where the view is not level, and where the middle of the body is not above the feet.
    let outside = run.frames.iter().filter(|frame| {
        let [right, _, ahead] = frame.truth.as_ref().unwrap().position_m.unwrap();
        (right.atan2(ahead).to_degrees() - pan_deg).abs() > FOV_DEG / 2.0
    });
    let expected = outside.count() as f64 / run.frames.len() as f64;
    let found = Metrics::of(&run).track_fragmentation.unwrap();
    assert!(expected > 0.2 && (found - expected).abs() < 0.03, "{found} instead of {expected}");
}
