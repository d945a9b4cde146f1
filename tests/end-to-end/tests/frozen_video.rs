// SPDX-License-Identifier: MPL-2.0

//! A camera whose video freezes while it turns: it is stopped, the user hears of it once, and it follows again.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::time::Duration;

use end_to_end::{Running, scene};
use gst::prelude::*;
use ptztrack_contract::{TargetMessage, TargetState};
use virtual_camera::VirtualCamera;

/// For so long it has to stay at rest: a picture that froze anew would have turned it meanwhile.
const SETTLED: Duration = Duration::from_secs(3);

/// Whoever is so far off the middle, in parts of the picture, has the camera turn for long.
const FAR: f64 = 0.25;

#[track_caller]
fn is_stopped(source: fn(&VirtualCamera) -> String) {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut running = Running::start(&format!(
        "{} ! bgavgdetect ! lkfeaturetrack message-interval=100000000 ! {} steering=off max-speed=10",
        source(&camera),
        scene::servo(&camera)
    ));
    running.wait_for_message("somebody far off the middle", TargetMessage::from_structure, |target| {
        target.state == TargetState::Tracking && (target.centroid.x - 0.5).abs() > FAR
    });
    running.element("servo").set_property_from_str("steering", "follow");
    scene::wait_until_following(&camera);
    camera.freeze_video(true);
    running.wait_for("a warning of the picture", |message| match message.view() {
        gst::MessageView::Warning(warning) => {
            warning.error().message().contains("the picture stays the same").then_some(())
        }
        _ => None,
    });
    scene::assert_left_at_rest(&camera);
    let told = camera.status().commands;
    let moved = camera.wait_for(SETTLED, |status| status.moving);
    assert!(!moved, "steered by a frozen picture: {:?}", camera.commands_after(told));
    assert_eq!(running.complaints().len(), 1, "it is told once");
    camera.freeze_video(false);
    scene::wait_until_following(&camera);
}

#[test]
fn by_mjpeg() {
    is_stopped(scene::mjpeg);
}

#[test]
fn by_rtsp() {
    is_stopped(|camera| scene::rtsp(camera, "mpeg4"));
}

#[test]
fn by_h264() {
    is_stopped(|camera| scene::rtsp(camera, "h264"));
}
