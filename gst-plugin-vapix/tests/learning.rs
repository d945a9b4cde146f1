// SPDX-License-Identifier: MPL-2.0

//! What the sink learns, over HTTP, of a camera that is otherwise than it was told.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::Duration;

use common::Rig;
use common::stage::{Stage, pacing};
use gst::prelude::*;
use virtual_camera::{Kinematics, PtzApi, Settings, SpeedMap, VirtualCamera};

/// What the synthetic camera's widest view covers.
const FOV_DEG: f64 = 36.0;
const CUBIC: SpeedMap = SpeedMap::Cubic { max_deg_s: 450.0, floor_deg_s: 0.05 };
const LINEAR: SpeedMap = SpeedMap::Linear { max_deg_s: 200.0 };
/// As long as learning may take.
const SECONDS: f64 = 20.0;

/// One that does not tell its speeds.
fn settings(speed_map: SpeedMap, command_delay: Duration) -> Settings {
    let kinematics = Kinematics { speed_map, command_delay, ..Kinematics::default() };
    Settings { ptz_api: PtzApi::Classic, ..pacing(0, 5, FOV_DEG, kinematics) }
}

/// A sink that is told the truth about a camera; of that, tests make lies.
fn told(rig: Rig, speed_map: &SpeedMap, latency: Duration) -> Rig {
    let curve = if matches!(speed_map, SpeedMap::Linear { .. }) { "linear" } else { "cubic" };
    rig.with("latency", latency.as_nanos() as u64)
        .with("field-of-view", FOV_DEG)
        .with("camera-speed", speed_map.deg_s(100.0))
        .with_str("speed-curve", curve)
}

/// What the sink takes the camera for: latency in seconds, field of view, and the speeds of the steps from 1 on.
fn known(rig: &Rig) -> (f64, f64, Vec<f64>) {
    let stats = rig.stats();
    let speeds = stats.get::<gst::Array>("speeds").unwrap();
    (
        Duration::from_nanos(stats.get("latency").unwrap()).as_secs_f64(),
        stats.get("field-of-view").unwrap(),
        speeds.iter().map(|speed| speed.get().unwrap()).collect(),
    )
}

/// Follows for 20 s with a lie in the settings, and expects the truth in the statistics.
#[track_caller]
fn assert_learned(speed_map: SpeedMap, command_delay_ms: u64, lie: impl Fn(Rig, Duration) -> Rig) {
    let command_delay = Duration::from_millis(command_delay_ms);
    let settings = settings(speed_map.clone(), command_delay);
    let latency = settings.video.delay + command_delay;
    let mut stage = Stage::new(settings, |rig| lie(told(rig, &speed_map, latency), latency));
    stage.follow(SECONDS);
    let (latency_s, fov_deg, speeds) = known(&stage.rig);
    let right = 0.9..1.1;
    let late = latency_s / latency.as_secs_f64();
    assert!(right.contains(&late), "latency {late}");
    assert!(right.contains(&(fov_deg / FOV_DEG)), "field of view {fov_deg}");
    // The person walks at 6 degrees per second: these are the steps that were used.
    let used = (1..=100u8).filter(|step| (4.5..7.5).contains(&speed_map.deg_s((*step).into())));
    let parts: Vec<_> =
        used.map(|step| speeds[usize::from(step) - 1] / speed_map.deg_s(step.into())).collect();
    assert!(!parts.is_empty() && parts.iter().all(|part| right.contains(part)), "speeds {parts:?}");
}

#[test]
fn a_narrower_field_of_view_is_found() {
    assert_learned(CUBIC, 60, |rig, _| rig.with("field-of-view", 1.3 * FOV_DEG));
}

#[test]
fn a_wider_field_of_view_is_found() {
    assert_learned(CUBIC, 60, |rig, _| rig.with("field-of-view", 0.7 * FOV_DEG));
}

#[test]
fn a_cubic_camera_taken_for_a_linear_one_is_found_out() {
    assert_learned(CUBIC, 60, |rig, _| rig.with_str("speed-curve", "linear"));
}

#[test]
fn a_linear_camera_taken_for_a_cubic_one_is_found_out() {
    assert_learned(LINEAR, 60, |rig, _| rig.with_str("speed-curve", "cubic"));
}

#[test]
fn a_shorter_latency_is_found() {
    assert_learned(CUBIC, 60, |rig, latency| rig.with("latency", latency.as_nanos() as u64 + 300_000_000));
}

#[test]
fn a_longer_latency_is_found() {
    assert_learned(CUBIC, 300, |rig, latency| rig.with("latency", latency.as_nanos() as u64 - 300_000_000));
}

/// Whatever is told of it, here what most cameras need.
#[test]
fn cameras_that_act_at_once_and_very_late_are_found_out() {
    for command_delay_ms in [5, 800] {
        assert_learned(CUBIC, command_delay_ms, |rig, _| rig.with("latency", 200_000_000_u64));
    }
}

/// Newer firmware tells both.
#[test]
fn a_camera_that_tells_its_field_of_view_and_speeds_is_believed() {
    let kinematics = Kinematics { speed_map: CUBIC, ..Kinematics::default() };
    let settings = Settings { ptz_api: PtzApi::Extended, ..pacing(0, 5, FOV_DEG, kinematics) };
    let mut stage =
        Stage::new(settings, |rig| rig.with("camera-speed", 100.0).with_str("speed-curve", "linear"));
    stage.follow(0.1);
    let stats = stage.rig.stats();
    let (left, right): (f64, f64) =
        (stats.get("camera-pan-min").unwrap(), stats.get("camera-pan-max").unwrap());
    assert!((left + right).abs() < 0.01 && (15.0..60.0).contains(&right), "{left} to {right}");
    assert_eq!((stats.get("camera-endless-pan"), stats.get("camera-zoom-max")), (Ok(false), Ok(9999.0)));
    let (_, fov_deg, speeds) = known(&stage.rig);
    assert!((fov_deg - FOV_DEG).abs() < 0.2, "{fov_deg}");
    for step in [10u8, 24, 60, 100] {
        let part = speeds[usize::from(step) - 1] / CUBIC.deg_s(step.into());
        assert!((0.9..1.1).contains(&part), "step {step}: {part}");
    }
    stage.follow(SECONDS);
    let (_, fov_deg, speeds) = known(&stage.rig);
    assert!((fov_deg / FOV_DEG - 1.0).abs() < 0.05, "{fov_deg}");
    assert!((speeds[23] / CUBIC.deg_s(24.0) - 1.0).abs() < 0.05);
}

#[test]
fn nothing_is_learned_where_nothing_is_to_be() {
    let mut stage = Stage::new(settings(CUBIC, Duration::from_millis(60)), |rig| {
        told(rig, &CUBIC, Duration::from_millis(460))
            .with("learn", false)
            .with("field-of-view", 1.3 * FOV_DEG)
            .with_str("speed-curve", "linear")
    });
    stage.follow(SECONDS);
    let (latency_s, fov_deg, speeds) = known(&stage.rig);
    assert_eq!((latency_s, (fov_deg * 10.0).round()), (0.46, (13.0 * FOV_DEG).round()));
    // Too slow for proportional speed to bound it.
    assert!((speeds[9] - 450.0 * 0.1).abs() < 1e-9, "{}", speeds[9]);
}

/// What one camera taught says nothing of another.
#[test]
fn another_location_begins_anew() {
    let settings = settings(CUBIC, Duration::from_millis(60));
    let mut stage = Stage::new(settings.clone(), |rig| told(rig, &CUBIC, Duration::from_millis(460)));
    stage.follow(SECONDS);
    assert!(known(&stage.rig).0 < 0.2, "{}", known(&stage.rig).0);
    let sink = &stage.rig.sink;
    sink.set_state(gst::State::Ready).unwrap();
    let other = VirtualCamera::start(settings).unwrap();
    sink.set_property("location", other.url());
    sink.set_state(gst::State::Paused).unwrap();
    assert_eq!(known(&stage.rig).0, 0.46);
}
