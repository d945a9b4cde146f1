// SPDX-License-Identifier: MPL-2.0

//! How well a camera is moved, over real HTTP, in stepped time and with properties as they are by default.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::Duration;

use common::Heard;
use common::stage::{FRAME, Shown, Stage, departing, in_part, seen};
use ptztrack_contract::{CameraChange, TargetMeta, Vector};
use virtual_camera::{Kinematics, Pose, Settings, SyntheticSettings, Waypoint, World};

fn before(path: &[(f64, f64)]) -> Stage {
    let point = |(seconds, pan_deg): &(f64, f64)| Waypoint {
        time: Duration::from_secs_f64(*seconds),
        pan_deg: *pan_deg,
        tilt_deg: -2.0,
    };
    let path = path.iter().map(point).collect();
    let world = SyntheticSettings { path, stays: true, ..SyntheticSettings::default() };
    Stage::new(Settings { world: World::Synthetic(world), ..Settings::default() }, |rig| rig)
}

/// Farthest to the right (1) or the left (-1) of the middle, in half picture widths.
fn farthest(shown: &[Shown], side: f64) -> f64 {
    shown.iter().map(|shown| 2.0 * side * shown.offset.0).fold(0.0, f64::max)
}

#[test]
fn a_standing_person_once_centred_moves_nothing_for_a_minute() {
    let mut stage = before(&[(0.0, 12.0)]);
    let shown = stage.follow(8.0);
    assert!(shown[shown.len() - 1].distance() < 0.05, "{:?}", shown[shown.len() - 1]);
    let before = stage.moves().len();
    assert!(before > 0);
    stage.follow(60.0);
    assert_eq!(stage.moves().len(), before, "{:?}", stage.moves());
}

#[test]
fn a_step_in_the_targets_speed_is_met_without_overshoot() {
    // Stands, walks at once at 5 degrees a second, and stands again.
    let mut stage = before(&[(0.0, -10.0), (6.0, -10.0), (10.0, 10.0)]);
    stage.follow(6.0);
    let walking = stage.follow(4.0);
    let standing = stage.follow(6.0);
    assert!(farthest(&walking, 1.0) > 0.02, "it is seen to start");
    // The camera ahead of who walks to the right, and past who has stopped.
    let overshoots = (farthest(&walking[10..], -1.0), farthest(&standing, -1.0));
    assert!(overshoots.0 < 0.1 && overshoots.1 < 0.1, "{overshoots:?} of the half-width");
    assert!(farthest(&walking, 1.0) < 0.5, "{}", farthest(&walking, 1.0));
}

#[test]
fn somebody_who_walks_away_stays_as_tall_by_auto_zoom() {
    const TARGET_HEIGHT: f64 = 0.5;
    for mode in ["velocity", "absolute", "centre"] {
        let world = SyntheticSettings { wide_fov_deg: 55.2, ..SyntheticSettings::default() };
        let settings = Settings { world: World::Synthetic(world), ..Settings::default() };
        let mut stage = Stage::new(settings, |rig| {
            rig.with_str("mode", mode).with("auto-zoom", true).with("target-height", TARGET_HEIGHT)
        });
        let (mut least, mut most, mut farthest) = (f64::INFINITY, 0.0f64, 0.0f64);
        while stage.now < Duration::from_secs(30) {
            let exposure = (stage.now + FRAME).saturating_sub(stage.camera.video_delay());
            stage.camera.advance_to(stage.now + FRAME);
            let meta = seen(&stage, exposure, departing(exposure));
            let meta = meta.unwrap_or_else(|| panic!("{mode}: lost after {:?}", stage.now));
            stage.picture(Some(&meta));
            if stage.now > Duration::from_secs(6) {
                (least, most) = (least.min(meta.bounds.height), most.max(meta.bounds.height));
                farthest = farthest.max((meta.centroid.x - 0.5).abs());
            }
        }
        let parts = (least / TARGET_HEIGHT, most / TARGET_HEIGHT);
        assert!(parts.0 > 0.8 && parts.1 < 1.2, "{mode}: {parts:?}");
        assert!((0.02..0.45).contains(&farthest), "{mode}: {farthest}");
        assert!(!stage.heard.iter().any(Heard::is_warning), "{mode}: {:?}", stage.heard);
    }
}

#[test]
fn somebody_seen_in_part_for_a_while_is_not_zoomed_in_on() {
    for mode in ["velocity", "absolute", "centre"] {
        let world = SyntheticSettings { wide_fov_deg: 55.2, ..SyntheticSettings::default() };
        let settings = Settings { world: World::Synthetic(world), ..Settings::default() };
        let mut stage = Stage::new(settings, |rig| rig.with_str("mode", mode).with("auto-zoom", true));
        let mut narrowest = 0.0f64;
        while stage.now < Duration::from_secs(12) {
            let exposure = (stage.now + FRAME).saturating_sub(stage.camera.video_delay());
            stage.camera.advance_to(stage.now + FRAME);
            let whole = seen(&stage, exposure, (8.0, 0.0)).unwrap();
            let is_part = stage.now > Duration::from_secs(8);
            stage.picture(Some(&if is_part { in_part(&whole) } else { whole }));
            let zoom_step = stage.camera.status().zoom_step;
            if !is_part {
                narrowest = narrowest.max(zoom_step);
            }
            assert!(zoom_step <= narrowest, "{mode}: {zoom_step} after {narrowest}");
        }
        assert!(narrowest > 100.0, "{mode}: it zoomed to {narrowest}");
    }
}

/// To the right past 180 degrees, and after a rest back again.
fn round_the_back(time: Duration) -> f64 {
    let time_s = time.as_secs_f64();
    160.0 + 5.0 * ((time_s - 3.0).clamp(0.0, 10.0) - (time_s - 16.0).clamp(0.0, 10.0))
}

#[test]
fn who_walks_past_the_end_of_the_circle_is_followed_the_short_way() {
    for mode in ["velocity", "absolute", "centre"] {
        let world = SyntheticSettings { wide_fov_deg: 55.2, ..SyntheticSettings::default() };
        let settings = Settings {
            world: World::Synthetic(world),
            home: Some(Pose { pan_deg: 155.0, ..Pose::default() }),
            kinematics: Kinematics { endless_pan: true, ..Kinematics::default() },
            ..Settings::default()
        };
        let mut stage = Stage::new(settings, |rig| rig.with_str("mode", mode));
        let (mut farthest, mut beyond) = (0.0f64, false);
        while stage.now < Duration::from_secs(30) {
            let exposure = (stage.now + FRAME).saturating_sub(stage.camera.video_delay());
            stage.camera.advance_to(stage.now + FRAME);
            let here = |at| (5.0, round_the_back(at));
            let meta = seen(&stage, exposure, here(exposure));
            let meta = meta.unwrap_or_else(|| panic!("{mode}: lost after {:?}", stage.now));
            // What stood where the person was moved by what the camera turned.
            let before = exposure.saturating_sub(FRAME);
            let was = seen(&stage, before, here(before)).unwrap_or(meta.clone());
            let turned = seen(&stage, exposure, here(before)).unwrap_or(meta.clone());
            let per_s = |to: &TargetMeta| Vector {
                x: (to.centroid.x - was.centroid.x) / FRAME.as_secs_f64(),
                y: (to.centroid.y - was.centroid.y) / FRAME.as_secs_f64(),
            };
            let meta = TargetMeta { velocity: per_s(&meta), ego_velocity: Some(per_s(&turned)), ..meta };
            stage.picture(Some(&meta));
            beyond |= (-155.0..-140.0).contains(&stage.camera.status().pan_deg);
            if stage.now > Duration::from_secs(3) {
                farthest = farthest.max((meta.centroid.x - 0.5).abs());
            }
        }
        assert!(beyond, "{mode}: it never looked there");
        assert!((0.01..0.3).contains(&farthest), "{mode}: {farthest}");
        let pan = stage.camera.status().pan_deg;
        assert!((pan - 160.0).abs() < 2.5, "{mode}: {pan}");
        assert!(!stage.heard.iter().any(Heard::is_warning), "{mode}: {:?}", stage.heard);
        assert_eq!(stage.times(&Heard::Camera(CameraChange::AtLimit)), 0, "{mode}");
    }
}
