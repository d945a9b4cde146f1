//! A camera of another make-up than the one the defaults are made for, with nothing set but where it is and who we are.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::Duration;

use common::{Rig, moves, target};
use ptztrack_contract::{BufferMeta, TargetMeta, TargetState, Vector};
use virtual_camera::{
    Auth, Clock, Fault, Kinematics, Limits, ProportionalRule, ProportionalSpeed, PtzApi, Settings, SpeedMap,
    SyntheticSettings, VirtualCamera, Waypoint, World,
};

const SIZE: (u32, u32) = (320, 240);
const PICTURE: Duration = Duration::from_millis(40);

/// Digest without `qop`, no attributes, lines that end in LF, speed steps in proportion, ends of pan and tilt.
fn camera() -> VirtualCamera {
    // To and fro, 5 s each way and 1 s of rest in between.
    let point = |turn: u64, seconds: u64| Waypoint {
        time: Duration::from_secs(6 * turn + seconds),
        pan_deg: if (turn + seconds / 5).is_multiple_of(2) { -15.0 } else { 15.0 },
        tilt_deg: -2.0,
    };
    let path = (0..10).flat_map(|turn| [point(turn, 0), point(turn, 5)]).collect();
    let camera = VirtualCamera::start(Settings {
        auth: Auth::Digest { qop: false },
        ptz_api: PtzApi::Classic,
        clock: Clock::Stepped,
        world: World::Synthetic(SyntheticSettings { path, stays: true, ..SyntheticSettings::default() }),
        home: Some(virtual_camera::Pose { pan_deg: -15.0, tilt_deg: -2.0, zoom_step: 1.0 }),
        kinematics: Kinematics {
            speed_map: SpeedMap::Linear { max_deg_s: 100.0 },
            proportional_speed: ProportionalSpeed {
                enabled: false,
                max_fields_s: 2.0,
                rule: ProportionalRule::Cap,
            },
            limits: Some(Limits { pan_deg: (-170.0, 170.0), tilt_deg: (-20.0, 90.0) }),
            ..Kinematics::default()
        },
        ..Settings::default()
    })
    .unwrap();
    camera.set_fault(Fault::LineFeeds);
    camera
}

/// Where the person is in the picture of a moment, as seen from where the camera looked at another.
fn place(camera: &VirtualCamera, at: Duration, looking: Duration) -> Option<(f64, f64)> {
    let pose = camera.pose_at(looking);
    let (x, y) = camera.ground_truth_from(&pose, at, SIZE).first()?.centroid;
    Some((x / f64::from(SIZE.0), y / f64::from(SIZE.1)))
}

/// What a tracker would say of the picture, and the one before.
fn tracked(camera: &VirtualCamera, exposure: Duration) -> Option<TargetMeta> {
    let before = exposure.checked_sub(PICTURE)?;
    let (x, y) = place(camera, exposure, exposure)?;
    let (from, turned) = (place(camera, before, before)?, place(camera, before, exposure)?);
    let per_s = |a: (f64, f64), b: (f64, f64)| Vector {
        x: (b.0 - a.0) / PICTURE.as_secs_f64(),
        y: (b.1 - a.1) / PICTURE.as_secs_f64(),
    };
    Some(TargetMeta {
        velocity: per_s(from, (x, y)),
        ego_velocity: Some(per_s(from, turned)),
        ..target(TargetState::Tracking, x, y)
    })
}

#[test]
fn it_is_followed_with_nothing_set_but_location_and_credentials() {
    let camera = camera();
    let mut rig =
        Rig::ready(&camera.url()).with("user", "root").with("password", "pass").with("lockstep", true).play();
    let mut offsets = Vec::new();
    for picture in 0..1000u32 {
        let now = PICTURE * picture;
        camera.advance_to(now);
        let mut buffer = gst::Buffer::with_size(320 * 240).unwrap();
        let content = buffer.get_mut().unwrap();
        content.set_pts(gst::ClockTime::try_from(now).unwrap());
        let exposure = now.saturating_sub(camera.video_delay());
        if let Some(meta) = tracked(&camera, exposure) {
            meta.attach(content).unwrap();
            offsets.push((meta.centroid.x - 0.5).hypot(meta.centroid.y - 0.5));
        }
        assert_eq!(rig.harness().push(buffer), Ok(gst::FlowSuccess::Ok));
    }
    let (beginning, later) = offsets.split_at(250);
    let mean = |offsets: &[f64]| offsets.iter().sum::<f64>() / offsets.len() as f64;
    let farthest = offsets.iter().copied().fold(0.0, f64::max);
    assert!(mean(later) < 0.05, "{} after {}", mean(later), mean(beginning));
    assert!(farthest < 0.5, "out of view: {farthest}");
    assert!(moves(&camera).len() > 20 && !rig.heard().iter().any(common::Heard::is_warning));
}
