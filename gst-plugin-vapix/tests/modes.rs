// SPDX-License-Identifier: MPL-2.0

//! Cameras that can be moved in some ways only, with `mode` as it is by default.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::Duration;

use common::stage::{Shown, Stage, mean_distance};
use common::{Heard, Rig};
use gst::prelude::*;
use ptztrack_contract::CameraChange;
use virtual_camera::{Moves, Settings, Status, SyntheticSettings, Waypoint, World};

const CONTINUOUS: Moves = Moves { continuous: true, ..Moves::NONE };
const ABSOLUTE: Moves = Moves { absolute: true, ..Moves::NONE };
const CENTRE: Moves = Moves { centre: true, ..Moves::NONE };

/// Somebody who stands at the left, walks to the right at 3 degrees a second and stands there.
fn before_a_walk(moves: Moves, to_deg: f64) -> Settings {
    before_a_climb(moves, to_deg, (-2.0, -2.0))
}

/// The same from one tilt to another.
fn before_a_climb(moves: Moves, to_deg: f64, tilts: (f64, f64)) -> Settings {
    let point = |seconds: f64, pan_deg, tilt_deg| Waypoint {
        time: Duration::from_secs_f64(seconds),
        pan_deg,
        tilt_deg,
    };
    let (start, end) = ((-8.0, tilts.0), (to_deg, tilts.1));
    let arrives = 5.0 + (to_deg + 8.0) / 3.0;
    let path = vec![point(0.0, start.0, start.1), point(5.0, start.0, start.1), point(arrives, end.0, end.1)];
    let world = SyntheticSettings { path, stays: true, ..SyntheticSettings::default() };
    Settings { moves, world: World::Synthetic(world), ..Settings::default() }
}

fn as_it_is(rig: Rig) -> Rig {
    rig
}

/// The word of the last move that was no stop.
fn way(stage: &Stage) -> &'static str {
    let moves = stage.moves();
    let last =
        moves.iter().rev().find(|query| !query.contains("=0,0") && !query.contains("move=stop")).unwrap();
    ["continuouspantiltmove", "pan", "center"]
        .into_iter()
        .find(|word| last.contains(&format!("&{word}=")))
        .unwrap()
}

#[track_caller]
fn assert_followed(stage: &mut Stage, mode: &str, infos: usize) -> Vec<Shown> {
    let shown = stage.follow(20.0);
    let farthest = shown[100..].iter().map(Shown::distance).fold(0.0, f64::max);
    assert!(farthest < 0.3, "{mode}: {farthest}");
    let mean = mean_distance(&shown[375..]);
    assert!(mean < 0.04, "{mode}: {mean} at rest");
    assert!(!stage.heard.iter().any(Heard::is_warning), "{mode}: {:?}", stage.heard);
    let told = stage.heard.iter().filter(|heard| matches!(heard, Heard::Info(_)));
    assert_eq!(told.count(), infos, "{mode}: {:?}", stage.heard);
    assert_eq!(stage.rig.stats().get::<String>("mode").unwrap(), mode);
    shown
}

#[test]
fn a_camera_with_one_way_only_is_followed_by_that() {
    for (moves, mode, word, infos) in [
        (CONTINUOUS, "velocity", "continuouspantiltmove", 0),
        (ABSOLUTE, "absolute", "pan", 1),
        (CENTRE, "centre", "center", 1),
    ] {
        // Whether it says so, or it turns out.
        for told in [true, false] {
            let mut stage = Stage::new(before_a_walk(Moves { told, ..moves }, 8.0), as_it_is);
            assert_followed(&mut stage, mode, infos);
            assert_eq!(way(&stage), word);
            let commands = stage.camera.commands();
            let refused = commands.iter().filter(|command| command.status == 200);
            let refused = refused.filter(|command| !command.query.contains("query=")).count();
            assert!(
                if told && mode != "centre" { refused == 0 } else { refused <= 6 },
                "{mode}, {told}: {refused}"
            );
            let set = stage.rig.sink.property_value("mode").serialize().unwrap();
            assert_eq!(set, "velocity", "the property stays");
        }
    }
}

#[test]
fn a_wished_mode_that_it_has_not_gives_way_too() {
    let mut stage = Stage::new(before_a_walk(CONTINUOUS, 8.0), |rig| rig.with_str("mode", "centre"));
    assert_followed(&mut stage, "velocity", 1);
    let mut stage = Stage::new(before_a_walk(CONTINUOUS, 8.0), |rig| rig.with_str("mode", "absolute"));
    assert_followed(&mut stage, "velocity", 1);
}

#[test]
fn a_camera_that_cannot_be_moved_at_all_is_one_warning() {
    let mut stage = Stage::new(before_a_walk(Moves { told: false, ..Moves::NONE }, 8.0), as_it_is);
    stage.follow(10.0);
    let before = stage.camera.status().requests;
    stage.follow(30.0);
    let per_s = (stage.camera.status().requests - before) as f64 / 30.0;
    // A move with the longest pause, and where it looks.
    assert!((0.5..=2.5).contains(&per_s), "{per_s} requests a second");
    let warnings = stage.heard.iter().filter(|heard| heard.is_warning()).count();
    assert_eq!(warnings, 1, "{:?}", stage.heard);
    assert!(stage.times(&Heard::Camera(CameraChange::Refused)) == 1);
}

#[test]
fn limits_hold_in_every_mode() {
    for mode in ["velocity", "absolute", "centre"] {
        let limited = |rig: Rig| {
            let rig = rig.with_str("mode", mode).with("pan-max", 5.0).with("pan-min", -6.0);
            rig.with("tilt-max", 2.0).with("tilt-min", -3.0)
        };
        let mut stage = Stage::new(before_a_climb(Moves::default(), 14.0, (-6.0, 5.0)), limited);
        let (mut least, mut most) = ((0.0f64, 0.0f64), (0.0f64, 0.0f64));
        for _ in 0..500 {
            stage.follow(0.04);
            let Status { pan_deg, tilt_deg, .. } = stage.camera.status();
            least = (least.0.min(pan_deg), least.1.min(tilt_deg));
            most = (most.0.max(pan_deg), most.1.max(tilt_deg));
        }
        // Half a degree for what the head does after it was told to stop.
        assert!(
            (-6.5..-5.5).contains(&least.0) && (4.5..5.5).contains(&most.0),
            "{mode}: {least:?} to {most:?}"
        );
        assert!(
            (-3.5..-2.5).contains(&least.1) && (1.5..2.5).contains(&most.1),
            "{mode}: {least:?} to {most:?}"
        );
        assert!(stage.times(&Heard::Camera(CameraChange::AtLimit)) >= 1, "{mode}");
        // With nothing more to do it does nothing.
        let before = stage.moves().len();
        stage.follow(10.0);
        assert_eq!(stage.moves().len(), before, "{mode}: {:?}", stage.moves());
    }
}
