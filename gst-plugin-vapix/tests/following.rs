//! How well a camera is moved, over real HTTP, in stepped time and with properties as they are by default.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::Duration;

use common::stage::{FRAME, Shown, Stage};
use common::{Heard, target};
use ptztrack_contract::{Rect, TargetMeta, TargetState};
use virtual_camera::{Settings, SyntheticSettings, Waypoint, World};

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

/// Somebody 1.75 m tall who stands 4 m away, walks off to 15 m at 1.2 m/s and stands there: the distance at a time.
fn distance_m(time: Duration) -> f64 {
    4.0 + 1.2 * (time.as_secs_f64() - 8.0).clamp(0.0, 11.0 / 1.2)
}

/// What a tracker says of them; they walk along the middle of the camera's view.
fn departing(stage: &Stage, exposure: Duration) -> TargetMeta {
    let pose = stage.camera.pose_at(exposure);
    let fov_deg = stage.camera.optics().fov_deg(pose.zoom_step);
    let tall = 2.0 * (fov_deg / 2.0).to_radians().tan() * 240.0 / 320.0;
    let height = (1.75 / distance_m(exposure) / tall).min(1.0);
    let bounds = Rect { x: 0.5 - height / 8.0, y: 0.5 - height / 2.0, width: height / 4.0, height };
    TargetMeta { bounds, ..target(TargetState::Tracking, 0.5, 0.5) }
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
        let (mut least, mut most) = (f64::INFINITY, 0.0f64);
        while stage.now < Duration::from_secs(30) {
            let exposure = (stage.now + FRAME).saturating_sub(stage.camera.video_delay());
            stage.camera.advance_to(stage.now + FRAME);
            let meta = departing(&stage, exposure);
            stage.picture(Some(&meta));
            if stage.now > Duration::from_secs(6) {
                (least, most) = (least.min(meta.bounds.height), most.max(meta.bounds.height));
            }
        }
        let parts = (least / TARGET_HEIGHT, most / TARGET_HEIGHT);
        assert!(parts.0 > 0.8 && parts.1 < 1.2, "{mode}: {parts:?}");
        assert!(!stage.heard.iter().any(Heard::is_warning), "{mode}: {:?}", stage.heard);
    }
}
