// SPDX-License-Identifier: MPL-2.0

//! The scene that most tests play: a virtual camera, a person who crosses its world, a pipeline that follows.

use std::time::{Duration, Instant};

use virtual_camera::{
    Kinematics, OnvifSettings, ProportionalSpeed, ReceivedCommand, Settings, SpeedMap, Status,
    SyntheticSettings, Video, VirtualCamera, Waypoint, World,
};

use crate::PATIENCE;

/// Name and password that the cameras of these tests ask for.
pub const USER: &str = "operator";
/// A word that appears nowhere else, so that a leak of it can be found.
pub const PASSWORD: &str = "xyzzy-plugh-42";

/// A camera before a person who walks up and down for minutes: there is always somebody to follow.
pub fn walking_person() -> Settings {
    walking_person_for(Duration::from_secs(360))
}

/// A camera before a person who walks up and down for so long.
pub fn walking_person_for(time: Duration) -> Settings {
    let turn = |seconds: u64| Duration::from_secs(seconds);
    let mut path = Vec::new();
    for lap in 0..time.as_secs().div_ceil(18) {
        path.extend(SyntheticSettings::walk((-22.0, -2.0), (22.0, -2.0), 5.0, turn(1 + lap * 18)));
        path.extend(SyntheticSettings::walk((22.0, -2.0), (-22.0, -2.0), 5.0, turn(10 + lap * 18)));
    }
    path.dedup_by_key(|point| point.time);
    world(path)
}

/// The same by so many pictures a second, and for so long that it is not over before what is measured is.
pub fn walking_person_at(frame_rate: f64, time: Duration) -> Settings {
    let settings = walking_person_for(time + Duration::from_secs(600));
    Settings { video: Video { frame_rate: Some(frame_rate), ..settings.video }, ..settings }
}

/// A camera of any make before the same person: it speaks ONVIF, and is as fast as it is told to be.
pub fn any_make(onvif: OnvifSettings) -> Settings {
    let proportional_speed = ProportionalSpeed { enabled: false, ..Kinematics::default().proportional_speed };
    let speed_map = SpeedMap::Linear { max_deg_s: 120.0 };
    let kinematics = Kinematics { speed_map, proportional_speed, ..Kinematics::default() };
    Settings { kinematics, onvif: Some(onvif), ..walking_person() }
}

/// A camera before a person who walks up and down in its first view.
pub fn near_person() -> Settings {
    let ends = [(0, -12.0), (5, 12.0)];
    let lap = |lap: u64| ends.map(|(seconds, pan_deg)| (10 * lap + seconds, pan_deg));
    let point = |(seconds, pan_deg)| Waypoint { time: Duration::from_secs(seconds), pan_deg, tilt_deg: -2.0 };
    world((0..60).flat_map(lap).map(point).collect())
}

/// How far to either side they walk who leave the view, wherever a camera stands still, degrees.
const FAR_DEG: f64 = 30.0;
/// From one side to the other.
const CROSSED: Duration = Duration::from_secs(12);

/// A camera before a person who walks so far to and fro that a camera which does not turn sees nothing of them for 4.8 s and more, once
/// within [`FAR_LAP`].
pub fn far_person() -> Settings {
    let point = |crossing: u32| {
        let pan_deg = if crossing.is_multiple_of(2) { -FAR_DEG } else { FAR_DEG };
        Waypoint { time: CROSSED * crossing, pan_deg, tilt_deg: -2.0 }
    };
    world((0..60).map(point).collect())
}

/// There and back again.
pub const FAR_LAP: Duration = Duration::from_secs(24);

/// A camera before a person who stands still, whom nobody notices who looks for what moves.
pub fn standing_person() -> Settings {
    world(vec![Waypoint { time: Duration::ZERO, pan_deg: 0.0, tilt_deg: -2.0 }])
}

/// A camera before an empty wall.
pub fn nobody() -> Settings {
    world(Vec::new())
}

fn world(path: Vec<Waypoint>) -> Settings {
    Settings {
        user: USER.into(),
        password: PASSWORD.into(),
        auth: virtual_camera::Auth::Digest { qop: true },
        world: World::Synthetic(SyntheticSettings { path, ..Default::default() }),
        video: Video { size: Some((320, 240)), frame_rate: Some(15.0), ..Default::default() },
        ..Default::default()
    }
}

/// The source part of a pipeline: MJPEG as a camera's user receives it.
pub fn mjpeg(camera: &VirtualCamera) -> String {
    format!(
        "souphttpsrc location={}/axis-cgi/mjpg/video.cgi user-id={USER} user-pw={PASSWORD} is-live=true \
         do-timestamp=true ! multipartdemux ! jpegdec ! queue leaky=downstream max-size-buffers=1",
        camera.url()
    )
}

/// The same by RTSP, in MPEG-4 or H.264.
pub fn rtsp(camera: &VirtualCamera, codec: &str) -> String {
    let decoder = match codec {
        "mpeg4" => "rtpmp4vdepay ! avdec_mpeg4",
        _ => "rtph264depay ! avdec_h264",
    };
    format!(
        "rtspsrc location={}/axis-media/media.amp?videocodec={codec} user-id={USER} user-pw={PASSWORD} latency=0 \
         ! {decoder} ! queue leaky=downstream max-size-buffers=1",
        camera.rtsp_url()
    )
}

/// The sink part.
pub fn servo(camera: &VirtualCamera) -> String {
    format!("vapixptzsink name=servo location={} user={USER} password={PASSWORD}", camera.url())
}

/// The whole: source, detector, tracker, servo.
pub fn follow(camera: &VirtualCamera) -> String {
    format!("{} ! bgavgdetect ! lkfeaturetrack ! {}", mjpeg(camera), servo(camera))
}

/// The same by ONVIF, with these properties of the servo besides.
pub fn follow_onvif(camera: &VirtualCamera, properties: &str) -> String {
    let location = camera.onvif_url().unwrap_or_else(|| camera.url());
    let servo = format!("onvifptzsink location={location} user={USER} password={PASSWORD} {properties}");
    format!("{} ! bgavgdetect ! lkfeaturetrack ! {servo}", mjpeg(camera))
}

/// Between two looks at the camera.
const MOMENT: Duration = Duration::from_millis(100);

/// The camera is moving because the pipeline follows somebody.
#[track_caller]
pub fn wait_until_following(camera: &VirtualCamera) {
    assert!(camera.wait_for(PATIENCE, |status| status.moving), "the camera never moved");
}

/// Its next move that it accepts, after so many commands: one that moves may have been told to before.
#[track_caller]
pub fn wait_for_move(camera: &VirtualCamera, commands: u64) -> ReceivedCommand {
    let is_move = |command: &ReceivedCommand| {
        command.status == 204 && command.query.contains("move=") && !command.query.contains("move=0,0")
    };
    let (until, mut seen) = (Instant::now() + PATIENCE, commands);
    loop {
        if let Some(first) = camera.commands_after(commands).into_iter().find(is_move) {
            return first;
        }
        let left = until.saturating_duration_since(Instant::now());
        assert!(camera.wait_for(left, |status| status.commands > seen), "it is not moved any more");
        seen = camera.status().commands;
    }
}

/// The camera stops, and its last order is the reason; for a moment it may rest between two others.
#[track_caller]
pub fn assert_left_at_rest(camera: &VirtualCamera) {
    assert!(left_at_rest(camera, PATIENCE), "left turning, or not by a stop: {:?}", camera.commands().last());
}

/// Whether that comes about within so long.
pub fn left_at_rest(camera: &VirtualCamera, patience: Duration) -> bool {
    let end = Instant::now() + patience;
    let moves = |command: &ReceivedCommand| command.query.contains("move");
    loop {
        let rests = camera.wait_for(MOMENT, |status| !status.moving);
        let last = camera.commands().into_iter().rfind(moves);
        if rests && last.is_some_and(|last| last.query.contains("continuouspantiltmove=0,0")) {
            return true;
        }
        if Instant::now() >= end {
            return false;
        }
    }
}

/// A camera that rested for so long rests: longer than a lease lasts.
const SETTLED: Duration = Duration::from_secs(3);
/// A camera that still turns after this is not stopped.
const LIMIT: Duration = Duration::from_secs(10);

/// How long after this moment the camera came to rest, and stayed so; `None` where it did not.
pub fn rests(camera: &VirtualCamera, since: Duration) -> Option<Duration> {
    let moving = |status: &Status| status.moving;
    loop {
        if !camera.wait_for(LIMIT, |status| !moving(status)) {
            return None;
        }
        let rested = camera.now();
        if !camera.wait_for(SETTLED, moving) {
            return Some(rested.saturating_sub(since));
        }
        if rested > since + LIMIT {
            return None;
        }
    }
}
