//! A camera of another make-up than the one the defaults are made for, with nothing set but where it is and who we are.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use common::{Rig, moves, walking};
use virtual_camera::{
    Auth, Fault, Kinematics, Limits, ProportionalRule, ProportionalSpeed, PtzApi, Settings, SpeedMap,
    VirtualCamera,
};

/// Digest without `qop`, no attributes, lines that end in LF, speed steps in proportion, ends of pan and tilt.
fn camera() -> VirtualCamera {
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
    let camera = VirtualCamera::start(Settings {
        auth: Auth::Digest { qop: false },
        ptz_api: PtzApi::Classic,
        ..walking::settings(kinematics)
    })
    .unwrap();
    camera.set_fault(Fault::LineFeeds);
    camera
}

#[test]
fn it_is_followed_with_nothing_set_but_location_and_credentials() {
    let camera = camera();
    let mut rig =
        Rig::ready(&camera.url()).with("user", "root").with("password", "pass").with("lockstep", true).play();
    let offsets = walking::follow(&mut rig, &camera, 1000);
    let (beginning, later) = offsets.split_at(250);
    let mean = |offsets: &[f64]| offsets.iter().sum::<f64>() / offsets.len() as f64;
    let farthest = offsets.iter().copied().fold(0.0, f64::max);
    assert!(mean(later) < 0.05, "{} after {}", mean(later), mean(beginning));
    assert!(farthest < 0.5, "out of view: {farthest}");
    assert!(moves(&camera).len() > 20 && !rig.heard().iter().any(common::Heard::is_warning));
}
