// SPDX-License-Identifier: MPL-2.0

//! Recordings are made once, and what is shown from them is the same every time.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::{fs, path::PathBuf, time::Duration};

use evaluation::{
    Experiment, Place, Scene, Target,
    record::{Codec, FirstBox, Run, Suite, TrackerName},
    strata::{Endpoints, SceneId, Stratum},
};
use virtual_camera::{SyntheticSettings, World};

/// A walk past both ends of the first view.
fn experiment(codec: Codec, recordings: PathBuf) -> Experiment {
    let path = SyntheticSettings::walk((-25.0, -2.0), (25.0, -2.0), 8.0, Duration::from_secs(1));
    let duration = path.last().unwrap().time;
    let world = World::Synthetic(SyntheticSettings { path, frame_rate: 25.0, ..Default::default() });
    let scene = Scene {
        suite: Suite::OpenLoop,
        test: None,
        title: "walk".into(),
        path: "walk".into(),
        place: Place::world(world),
        begin: Duration::ZERO,
        lead: Duration::ZERO,
        duration,
        target: Target::Only,
    };
    Experiment {
        size: (480, 360),
        codec,
        first_box: FirstBox::Detected,
        recordings: Some(recordings),
        ..Experiment::new(scene, TrackerName::Ptztrack, 1)
    }
}

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("ptztrack-open-loop-{name}-{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    folder
}

#[track_caller]
fn run(experiment: &Experiment) -> Run {
    evaluation::init().unwrap();
    let run = evaluation::run(experiment);
    assert_eq!(run.error, None);
    run
}

#[test]
fn a_scene_is_recorded_once_and_shown_the_same_again() {
    for codec in [Codec::Mjpeg, Codec::Mpeg4, Codec::H264] {
        let folder = folder(codec.name());
        let experiment = experiment(codec, folder.clone());
        let first = run(&experiment);
        let kept = || {
            let file = fs::read_dir(&folder).unwrap().next().unwrap().unwrap();
            (file.file_name(), file.metadata().unwrap().modified().unwrap())
        };
        let made = kept();
        assert!(run(&experiment) == first, "{codec}: the same pictures, another run");
        assert_eq!(kept(), made, "{codec}: it was made again");
        let other = Experiment { size: (320, 240), ..experiment };
        assert_ne!(run(&other).size, first.size);
        assert_ne!(kept().1, made.1, "{codec}: an older recording was shown");
        fs::remove_dir_all(&folder).unwrap();
    }
}

#[test]
fn who_is_followed_by_the_truth_stays_in_view_and_is_followed_by_us() {
    let folder = folder("held");
    let run = run(&experiment(Codec::Mjpeg, folder.clone()));
    let out = run.frames.iter().filter(|frame| frame.truth.as_ref().is_some_and(|truth| truth.in_view < 0.5));
    assert!(out.count() * 20 < run.frames.len());
    assert!(run.frames.last().unwrap().pan_deg > 15.0);
    let endpoints = Endpoints::of(&run);
    assert!(endpoints.held.unwrap() > 0.6 && endpoints.distance.unwrap() < 0.3, "{endpoints:?}");
    fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_camera_turns_already_when_a_scene_with_a_lead_begins() {
    let folder = folder("lead");
    let mut experiment = experiment(Codec::Mjpeg, folder.clone());
    experiment.scene.begin = Duration::from_secs(4);
    experiment.scene.lead = Duration::from_secs(1);
    let run = run(&experiment);
    let [first, second] = [&run.frames[0], &run.frames[5]];
    assert!(first.truth.as_ref().unwrap().in_view > 0.5, "{first:?}");
    assert!((second.pan_deg - first.pan_deg).abs() > 0.2, "{} to {}", first.pan_deg, second.pan_deg);
    fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn everybody_is_told_of_as_motchallenge_text() {
    let folder = folder("texts");
    let texts = folder.join("texts");
    let id = SceneId { stratum: Stratum::Crossing, seed: 1, number: 1 };
    let experiment = Experiment {
        size: (160, 120),
        recordings: Some(folder.join("recordings")),
        motchallenge: Some(texts.clone()),
        ..id.experiment(Suite::OpenLoop, TrackerName::Ptztrack)
    };
    let run = run(&experiment);
    let sequence = texts.join("gt/crossing-1-1");
    let truth = fs::read_to_string(sequence.join("gt/gt.txt")).unwrap();
    let rows: Vec<Vec<f64>> =
        truth.lines().map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    assert!(rows.iter().all(|row| row.len() == 9 && (0.0..=1.0).contains(&row[8])), "{rows:?}");
    let ids: std::collections::BTreeSet<u64> = rows.iter().map(|row| row[1] as u64).collect();
    assert_eq!(ids.into_iter().collect::<Vec<_>>(), [1, 2]);
    let info = fs::read_to_string(sequence.join("seqinfo.ini")).unwrap();
    let length = info.lines().find_map(|line| line.strip_prefix("seqLength=")).unwrap();
    assert!(length.parse::<usize>().unwrap() >= run.frames.len(), "{info}");
    let tracked = fs::read_to_string(texts.join("ptztrack/data/crossing-1-1.txt")).unwrap();
    let placed = run.frames.iter().filter(|frame| frame.estimate.as_ref().is_some_and(|one| one.has_place()));
    assert!(placed.count() > 0 && tracked.lines().count() > 0, "{tracked}");
    fs::remove_dir_all(&folder).unwrap();
}
