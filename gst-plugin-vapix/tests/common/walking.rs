//! A person who paces before a camera of stepped time, and what a tracker would say of the pictures.

use std::time::Duration;

use ptztrack_contract::{BufferMeta, TargetMeta, TargetState, Vector};
use virtual_camera::{Clock, Kinematics, Pose, Settings, SyntheticSettings, VirtualCamera, Waypoint, World};

use super::{Rig, target};

const SIZE: (u32, u32) = (320, 240);
const PICTURE: Duration = Duration::from_millis(40);

/// A minute to and fro, 5 s each way at 6 degrees per second and 1 s of rest in between; the camera looks at the begin.
pub fn settings(kinematics: Kinematics) -> Settings {
    let point = |turn: u64, seconds: u64| Waypoint {
        time: Duration::from_secs(6 * turn + seconds),
        pan_deg: if (turn + seconds / 5).is_multiple_of(2) { -15.0 } else { 15.0 },
        tilt_deg: -2.0,
    };
    let path = (0..10).flat_map(|turn| [point(turn, 0), point(turn, 5)]).collect();
    Settings {
        clock: Clock::Stepped,
        world: World::Synthetic(SyntheticSettings { path, stays: true, ..SyntheticSettings::default() }),
        home: Some(Pose { pan_deg: -15.0, tilt_deg: -2.0, zoom_step: 1.0 }),
        kinematics,
        ..Settings::default()
    }
}

/// Lets the sink, in lockstep, follow for so many pictures; the distances from the middle in parts of the picture.
#[track_caller]
pub fn follow(rig: &mut Rig, camera: &VirtualCamera, pictures: u32) -> Vec<f64> {
    let mut offsets = Vec::new();
    for picture in 0..pictures {
        let now = PICTURE * picture;
        camera.advance_to(now);
        let mut buffer = gst::Buffer::with_size(320 * 240).unwrap();
        let content = buffer.get_mut().unwrap();
        content.set_pts(gst::ClockTime::try_from(now).unwrap());
        let exposure = now.saturating_sub(camera.video_delay());
        if let Some(meta) = tracked(camera, exposure) {
            meta.attach(content).unwrap();
            offsets.push((meta.centroid.x - 0.5).hypot(meta.centroid.y - 0.5));
        }
        assert_eq!(rig.harness().push(buffer), Ok(gst::FlowSuccess::Ok));
    }
    offsets
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
