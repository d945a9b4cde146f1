// SPDX-License-Identifier: MPL-2.0

//! Whole runs: the same twice, the bounds as good and as bad as they must be.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::time::Duration;

use evaluation::{
    Experiment, Place, Protocol, Scene, Target,
    metrics::Metrics,
    record::{Codec, FirstBox, Run, Suite, TargetState, TrackerName},
};
use virtual_camera::{SyntheticSettings, World};

/// Horizontal field of view of the synthetic world's widest view, degrees.
const FOV_DEG: f64 = 36.0;
const SPEED_DEG_S: f64 = 8.0;
const END_DEG: f64 = 25.0;

/// A walk past both ends of the first view.
fn scene() -> Scene {
    let path =
        SyntheticSettings::walk((-END_DEG, -2.0), (END_DEG, -2.0), SPEED_DEG_S, Duration::from_secs(1));
    let duration = path.last().unwrap().time;
    let world = World::Synthetic(SyntheticSettings {
        path,
        frame_rate: 25.0,
        wide_fov_deg: FOV_DEG,
        ..Default::default()
    });
    Scene {
        suite: Suite::Recording,
        test: None,
        title: "walk".into(),
        path: "walk".into(),
        place: Place::world(world),
        begin: Duration::ZERO,
        lead: Duration::ZERO,
        duration,
        target: Target::Only,
    }
}

fn experiment(tracker: TrackerName) -> Experiment {
    Experiment { size: (480, 360), first_box: FirstBox::Given, ..Experiment::new(scene(), tracker, 1) }
}

#[track_caller]
fn run(experiment: &Experiment) -> Run {
    evaluation::init().unwrap();
    let run = evaluation::run(experiment);
    assert_eq!(run.error, None);
    assert!(run.frames.len() > 10, "{}", run.frames.len());
    run
}

#[test]
fn the_same_experiment_is_the_same_run_to_the_last_bit() {
    for (tracker, codec) in [(TrackerName::Ptztrack, Codec::Mjpeg), (TrackerName::Thesis, Codec::Mpeg4)] {
        let experiment = Experiment { codec, ..experiment(tracker) };
        let runs = [(); 3].map(|()| run(&experiment));
        assert!(runs[0].frames.iter().any(|frame| frame.commands > 0), "{tracker} never moved the camera");
        assert!(runs[0] == runs[1] && runs[1] == runs[2], "{tracker} differs from itself");
    }
}

#[test]
fn who_knows_the_truth_is_always_right_and_keeps_the_person_in_view() {
    let run = run(&experiment(TrackerName::Oracle));
    let metrics = Metrics::of(&run);
    assert_eq!(metrics.precision, Some(1.0));
    assert_eq!(metrics.detection_precision, Some(1.0));
    assert_eq!(metrics.track_fragmentation, Some(0.0));
    let last = run.frames.last().unwrap();
    assert!(last.pan_deg > 20.0, "the camera looks {} degrees right", last.pan_deg);
}

/// Of a camera that tells nothing of its speeds, and whose axes have to be found out, by how the background moves.
#[test]
fn by_onvif_the_person_is_kept_in_view_too() {
    let run = run(&Experiment { protocol: Protocol::Onvif, ..experiment(TrackerName::OracleEgo) });
    assert_eq!(Metrics::of(&run).track_fragmentation, Some(0.0));
    let last = run.frames.last().unwrap();
    assert!(last.pan_deg > 20.0, "the camera looks {} degrees right", last.pan_deg);
}

#[test]
fn followers_with_a_law_of_their_own_command_the_camera_themselves() {
    for tracker in [TrackerName::RelativeMoves, TrackerName::BoxPid] {
        let run = run(&experiment(tracker));
        let last = run.frames.last().unwrap();
        assert!(last.pan_deg > 15.0, "{tracker}: the camera looks {} degrees right", last.pan_deg);
        let commands: u32 = run.frames.iter().map(|frame| frame.commands).sum();
        let seconds = run.frames.len() as f64 / run.frame_rate;
        // A change of speed every 250 ms, or a move every 200 ms, and stops besides.
        assert!(commands > 3 && f64::from(commands) < 8.0 * seconds, "{tracker}: {commands} commands");
        assert_eq!(Metrics::of(&run).precision, Some(1.0), "{tracker} sees the truth");
    }
}

#[test]
fn from_a_camera_that_never_moves_the_person_walks_out_as_geometry_says() {
    let run = run(&experiment(TrackerName::Still));
    assert!(run.frames.iter().all(|frame| frame.pan_deg == 0.0 && frame.commands == 0));
    // The person's middle is outside from half the field of view to the end of the walk.
    let outside = (END_DEG - FOV_DEG / 2.0) / SPEED_DEG_S * run.frame_rate;
    let expected = outside / run.frames.len() as f64;
    let found = Metrics::of(&run).track_fragmentation.unwrap();
    assert!((found - expected).abs() < 1.5 / run.frames.len() as f64, "{found} instead of {expected}");
}

#[test]
fn every_tracker_gets_the_same_first_box_in_the_same_picture() {
    let names = TrackerName::ALL.iter().filter(|name| evaluation::missing(**name).is_none());
    let mut poses = Vec::new();
    for name in names {
        let mut experiment = experiment(*name);
        experiment.scene.duration = Duration::from_secs(3);
        let first = run(&experiment).frames.swap_remove(0);
        let (truth, said) = (first.truth.unwrap(), first.estimate.unwrap());
        assert_eq!(said.state, TargetState::Tracking, "{name}");
        assert!(truth.bounds.contains(said.centroid), "{name}: {said:?} of {truth:?}");
        poses.push((first.time_s, first.pan_deg, truth));
    }
    assert!(poses.len() >= 4);
    poses.dedup();
    assert_eq!(poses.len(), 1, "{poses:?}");
}

#[test]
fn a_detector_finds_the_person_by_itself() {
    let experiment = Experiment { first_box: FirstBox::Detected, ..experiment(TrackerName::Ptztrack) };
    let metrics = Metrics::of(&run(&experiment));
    assert!(metrics.time_to_acquire_s.is_some_and(|time_s| time_s < 3.0), "{metrics:?}");
    assert!(metrics.detection_precision.unwrap() > 0.5, "{metrics:?}");
}

#[test]
fn a_scene_without_anybody_is_an_error_in_words() {
    evaluation::init().unwrap();
    let mut experiment = experiment(TrackerName::Oracle);
    let empty = SyntheticSettings { path: Vec::new(), ..Default::default() };
    experiment.scene.place = Place::world(World::Synthetic(empty));
    let run = evaluation::run(&experiment);
    assert_eq!(run.error.as_deref(), Some("the person is never wholly in the first view"));
    assert!(run.frames.is_empty());
}
