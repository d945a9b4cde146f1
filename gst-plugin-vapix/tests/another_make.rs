// SPDX-License-Identifier: MPL-2.0

//! A camera of another make-up than the one the defaults are made for, with nothing set but where it is and who we are.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::Duration;

use common::Heard;
use common::stage::{Shown, Stage, mean_distance, pacing};
use ptztrack_contract::CameraChange;
use virtual_camera::{
    Auth, Fault, Kinematics, Limits, ProportionalRule, ProportionalSpeed, PtzApi, Settings, SpeedMap,
    VirtualCamera,
};

/// How late the slow camera's answers are.
const LATE: Duration = Duration::from_millis(900);

/// Digest without `qop`, no attributes, lines that end in LF, speed steps in proportion, ends of pan and tilt; before
/// somebody who paces.
fn settings(stands_s: u64, stretch_s: u64, wide_fov_deg: f64) -> Settings {
    let kinematics = Kinematics {
        speed_map: SpeedMap::Linear { max_deg_s: 100.0 },
        proportional_speed: ProportionalSpeed {
            enabled: false,
            max_fields_s: 2.0,
            rule: ProportionalRule::Cap,
        },
        limits: Some(Limits { pan_deg: (-170.0, 170.0), tilt_deg: (-20.0, 90.0) }),
        ..Kinematics::default()
    };
    Settings {
        auth: Auth::Digest { qop: false },
        ptz_api: PtzApi::Classic,
        ..pacing(stands_s, stretch_s, wide_fov_deg, kinematics)
    }
}

fn as_user(rig: common::Rig) -> common::Rig {
    rig.with("user", "root").with("password", "pass")
}

#[track_caller]
fn assert_followed(stage: &Stage, shown: &[Shown], settled: usize, most: f64) {
    let farthest = shown.iter().map(Shown::distance).fold(0.0, f64::max);
    assert!(farthest < 0.5, "out of view: {farthest}");
    let mean = mean_distance(&shown[settled..]);
    assert!(mean < most, "{mean} after {}", mean_distance(&shown[..settled]));
    assert!(stage.moves().len() > 15);
}

#[test]
fn it_is_followed_with_nothing_set_but_location_and_credentials() {
    let mut stage = Stage::new(settings(0, 5, 36.0), as_user);
    stage.camera.set_fault(Fault::LineFeeds);
    let shown = stage.follow(40.0);
    assert_followed(&stage, &shown, 250, 0.05);
    assert!(!stage.heard.iter().any(Heard::is_warning), "{:?}", stage.heard);
}

/// The same camera answers nearly a second late, whatever it is told or asked; not more, as what a busy machine adds must
/// not make it later than the sink waits. By the clock: in stepped time nobody would step on before the answer has come.
#[test]
fn so_it_is_when_it_takes_one_command_a_second() {
    let camera = VirtualCamera::start(settings(8, 8, 55.2)).unwrap();
    camera.set_fault(Fault::Delay(LATE));
    let mut stage = Stage::by_the_clock(camera, as_user);
    let shown = stage.follow(36.0);
    let settled = shown.partition_point(|shown| shown.at < Duration::from_secs(15));
    assert_followed(&stage, &shown, settled, 0.1);
    // Until it is known how slow the camera is the loop may swing, and then says so; nothing else is amiss.
    let warnings = stage.heard.iter().filter(|heard| heard.is_warning()).count();
    assert!(
        warnings <= 1 && stage.times(&Heard::Camera(CameraChange::Disconnected)) == 0,
        "{:?}",
        stage.heard
    );
    let requests = stage.camera.status().requests as f64;
    let (now, late) = (stage.camera.now().as_secs_f64(), LATE.as_secs_f64());
    assert!(requests <= 1.0 + now / late, "{requests} in {now} s");
    assert_eq!(stage.camera.status().most_in_flight, 1);
}
