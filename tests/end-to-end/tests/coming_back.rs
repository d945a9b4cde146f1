// SPDX-License-Identifier: MPL-2.0

//! Video and PTZ are lost together, and both come back when the camera does.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::HashSet;
use std::time::{Duration, Instant};

use end_to_end::following::{Following, MJPEG, Network, RTSP, Video, python, rust, script};
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
    for file in ["headless.sh", "h264-rtsp.sh"] {
        let mut command = script(file);
        command.env("CAMERA", camera.url()).env("RTSP", camera.rtsp_url());
        command.env("CAMERA_USER", scene::USER).env("CAMERA_PASSWORD", "falsch");
        let (status, output) = GstLaunch::spawn(command).finish();
        assert!(!status.success() && output.contains("Not restarted"), "{output}");
        assert_eq!(output.matches("refuses user").count(), 1, "{output}");
        assert!(!output.contains("tried again"), "{output}");
    }
}

/// Each reason once, however often it is tried again, and that the picture is there.
#[test]
fn an_outage_is_told_once_and_so_is_its_end() {
    for (file, video) in [("headless.sh", MJPEG), ("h264-rtsp.sh", RTSP)] {
        let mut following = Following::start(|_| script(file));
        following.starts_anew(video, |following| {
            following.network.set(Way::Refused);
            following.is_lost();
            following.network.set(Way::Open);
        });
        following.launch.wait_for_line("the picture is there");
        following.launch.signal("TERM");
        let (status, output) = following.launch.finish();
        assert!(status.success() && output.matches("the picture is there").count() == 1, "{output}");
        let told: Vec<_> =
            output.lines().filter(|line| line.contains("tried again until it is back")).collect();
        let different: HashSet<_> = told.iter().collect();
        assert!(!told.is_empty() && told.len() == different.len(), "{output}");
    }
}

#[test]
fn a_wrong_address_of_the_stream_is_told_once_and_by_its_name() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let network = Network::before(&camera);
    let mut command = script("onvif-rtsp.sh");
    network.surround(&mut command);
    let stream = format!("rtsp://{}/none", network.rtsp.address());
    let launch = GstLaunch::spawn(command.env("STREAM", &stream));
    (0..4).for_each(|before| network.rtsp.wait_for_video_request(before));
    launch.signal("TERM");
    let (_, output) = launch.finish();
    let told: Vec<_> = output.lines().filter(|line| line.contains("tried again until it is back")).collect();
    assert!(told.len() == 1 && told[0].contains(&format!("{stream}: Not found")), "{output}");
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
