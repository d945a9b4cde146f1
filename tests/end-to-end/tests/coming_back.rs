// SPDX-License-Identifier: MPL-2.0

//! Video and PTZ are lost together, and both come back when the camera does.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::time::{Duration, Instant};

use end_to_end::following::{Following, MJPEG, RTSP, Video, python, rust, script};
use end_to_end::{GstLaunch, PATIENCE, Way, scene, scratch};
use virtual_camera::VirtualCamera;

/// Everything that can become of a camera, one after the other.
fn comes_back_from_everything(mut following: Following, video: Video, end: &str) {
    following.starts_anew(video, |following| {
        following.network.set(Way::Refused);
        following.is_lost();
        following.network.set(Way::Open);
    });

    following.starts_anew(video, |following| following.network.reset());
    following.starts_anew(video, |following| following.network.close());

    // It gives up by itself: nobody closes.
    following.starts_anew(video, |following| {
        let before = video(&following.network).video_requests();
        following.network.set(Way::Stalled);
        video(&following.network).wait_for_video_request(before);
        following.network.set(Way::Open);
    });

    following.launch.signal(end);
    let (_, output) = following.launch.finish();
    assert!(following.camera.wait_for(PATIENCE, |status| !status.moving), "left moving:\n{output}");
}

#[test]
fn mjpeg_over_http() {
    let following = Following::start(|_| script("headless.sh"));
    comes_back_from_everything(following, MJPEG, "TERM");
}

#[test]
fn h264_over_rtsp() {
    let following = Following::start(|_| script("h264-rtsp.sh"));
    comes_back_from_everything(following, RTSP, "TERM");
}

/// The connection stays, and nothing comes.
#[test]
fn an_rtsp_session_that_the_camera_forgot() {
    let mut following = Following::start(|_| script("mpeg4-rtsp.sh"));
    following.starts_anew(RTSP, |following| following.camera.forget_rtsp_sessions());
}

#[test]
fn embedded_in_python() {
    comes_back_from_everything(Following::start(python), MJPEG, "TERM");
}

#[test]
fn embedded_in_rust() {
    comes_back_from_everything(Following::start(rust), MJPEG, "HUP");
}

/// A camera that refuses a password may lock the account, and does not change its mind.
#[test]
fn a_wrong_password_is_not_tried_for_ever() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut command = script("headless.sh");
    command.env("CAMERA", camera.url()).env("CAMERA_USER", scene::USER).env("CAMERA_PASSWORD", "falsch");
    let (status, output) = GstLaunch::spawn(command).finish();
    assert!(!status.success() && output.contains("Not restarted"), "{output}");
}

/// Each part of a recording stays.
#[test]
fn a_recording_goes_on_in_another_file() {
    let folder = scratch("recordings");
    std::fs::create_dir_all(&folder).unwrap();
    let out = folder.join("a.mkv");
    let mut following = Following::start(|_| {
        let mut command = script("record-overlay.sh");
        command.env("OUT", &out);
        command
    });
    following.starts_anew(MJPEG, |following| following.network.http.reset());
    let is_filled = |file: &str| folder.join(file).metadata().is_ok_and(|file| file.len() > 1000);
    let begin = Instant::now();
    while !is_filled("a-2.mkv") {
        assert!(begin.elapsed() < PATIENCE, "the second part stays empty");
        std::thread::sleep(Duration::from_millis(50));
    }
    following.launch.signal("TERM");
    following.launch.finish();
    for file in ["a.mkv", "a-2.mkv"] {
        assert!(is_filled(file), "{file}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}
