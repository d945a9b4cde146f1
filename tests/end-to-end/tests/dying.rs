// SPDX-License-Identifier: MPL-2.0

//! However a pipeline ends, the camera ends at rest: it moves until told otherwise.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use end_to_end::scene::{assert_left_at_rest, wait_until_following};
use end_to_end::{GstLaunch, Running, scene};
use gst::prelude::*;
use virtual_camera::VirtualCamera;

/// Starts `gst-launch-1.0`, waits until it follows, ends it as `end` does.
#[track_caller]
fn launch_and_end(options: &[&str], end: impl FnOnce(&GstLaunch)) -> String {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let launch = GstLaunch::start(options, &scene::follow(&camera));
    wait_until_following(&camera);
    end(&launch);
    let (_, output) = launch.finish();
    assert_left_at_rest(&camera);
    output
}

#[test]
fn interrupted_with_eos() {
    let output = launch_and_end(&["-e"], |launch| launch.signal("INT"));
    assert!(output.contains("EOS"), "{output}");
}

#[test]
fn interrupted_without_eos() {
    launch_and_end(&[], |launch| launch.signal("INT"));
}

/// An element upstream fails: `gst-launch-1.0` takes the pipeline down.
#[test]
fn error_upstream() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let description = format!(
        "{} ! bgavgdetect ! lkfeaturetrack ! identity error-after=120 ! {}",
        scene::mjpeg(&camera),
        scene::servo(&camera)
    );
    let launch = GstLaunch::start(&[], &description);
    wait_until_following(&camera);
    let (status, output) = launch.finish();
    assert!(!status.success(), "{output}");
    assert_left_at_rest(&camera);
}

#[track_caller]
fn follow_then(end: impl FnOnce(&Running)) {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let running = Running::start(&scene::follow(&camera));
    wait_until_following(&camera);
    end(&running);
    assert_left_at_rest(&camera);
}

#[test]
fn paused() {
    follow_then(|running| {
        running.pipeline().set_state(gst::State::Paused).unwrap();
    });
}

#[test]
fn ready() {
    follow_then(|running| {
        running.pipeline().set_state(gst::State::Ready).unwrap();
    });
}

#[test]
fn end_of_stream() {
    follow_then(|running| {
        running.pipeline().send_event(gst::event::Eos::new());
    });
}

#[test]
fn flushed() {
    follow_then(|running| {
        running.element("servo").static_pad("sink").unwrap().send_event(gst::event::FlushStart::new());
    });
}

/// The picture simply stops coming, and nobody tells the sink.
#[test]
fn starved() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let description = format!(
        "{} ! bgavgdetect ! lkfeaturetrack ! valve name=valve ! {}",
        scene::mjpeg(&camera),
        scene::servo(&camera)
    );
    let running = Running::start(&description);
    wait_until_following(&camera);
    running.element("valve").set_property("drop", true);
    assert_left_at_rest(&camera);
}

#[test]
fn removed_from_the_pipeline() {
    follow_then(|running| {
        let servo = running.element("servo");
        let sink = servo.static_pad("sink").unwrap();
        let peer = sink.peer().unwrap();
        peer.add_probe(gst::PadProbeType::BLOCK_DOWNSTREAM, |_, _| gst::PadProbeReturn::Ok);
        running.pipeline().remove(&servo).unwrap();
        servo.set_state(gst::State::Null).unwrap();
    });
}

#[test]
fn dropped() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let running = Running::start(&scene::follow(&camera));
    wait_until_following(&camera);
    drop(running);
    assert_left_at_rest(&camera);
}
