// SPDX-License-Identifier: MPL-2.0

//! A camera that answers late, never or nonsense: the video goes on, the user hears of it once, control comes back.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::sync::mpsc;
use std::time::Duration;

use end_to_end::{PATIENCE, Running, scene};
use gst::prelude::*;
use ptztrack_contract::{CameraChange, CameraMessage};
use virtual_camera::{Fault, VirtualCamera};

/// Frames that must come while the fault lasts: four seconds of video.
const FRAMES: usize = 60;

#[track_caller]
fn camera_message(running: &mut Running, change: CameraChange) -> CameraMessage {
    running.wait_for_message(change.name(), CameraMessage::from_structure, |message| message.change == change)
}

/// The person is followed; the camera gets the fault; `told` is what the user must hear; then all is well again.
#[track_caller]
fn survives(fault: Fault, told: CameraChange) {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    // On a machine that does much else pictures are late, of which there would be a warning too.
    let description = format!(
        "{} ! bgavgdetect ! lkfeaturetrack ! tee name=t t. ! queue leaky=downstream ! {} stale-timeout=60000000000 \
         t. ! queue ! fakesink name=display sync=false",
        scene::mjpeg(&camera),
        scene::servo(&camera)
    );
    let mut running = Running::parse(&description);
    let shown = frames(&running.element("display").static_pad("sink").unwrap());
    running.pipeline().set_state(gst::State::Playing).unwrap();
    camera_message(&mut running, CameraChange::Connected);
    assert!(camera.wait_for(PATIENCE, |status| status.moving), "never followed");
    assert_eq!(running.complaints(), [] as [String; 0]);

    camera.set_fault(fault);
    let message = camera_message(&mut running, told);
    assert!(!message.detail.is_empty());
    shown.try_iter().count();
    for _ in 0..FRAMES {
        shown.recv_timeout(PATIENCE).expect("the video stands still");
    }
    let told = running.complaints();
    assert_eq!(told.len(), 1, "one fault is one warning: {told:?}");

    camera.set_fault(Fault::None);
    camera_message(&mut running, CameraChange::Connected);
    scene::wait_for_move(&camera, camera.status().commands);
    let told = running.complaints();
    assert_eq!(told.len(), 1, "recovery is no warning: {told:?}");
}

/// Something for each frame that passes the pad.
fn frames(pad: &gst::Pad) -> mpsc::Receiver<()> {
    let (sender, receiver) = mpsc::channel();
    pad.add_probe(gst::PadProbeType::BUFFER, move |_, _| match sender.send(()) {
        Ok(()) => gst::PadProbeReturn::Ok,
        Err(_) => gst::PadProbeReturn::Remove,
    });
    receiver
}

#[test]
fn answers_after_five_seconds() {
    survives(Fault::Delay(Duration::from_secs(5)), CameraChange::Disconnected);
}

#[test]
fn refuses_connections() {
    survives(Fault::Refuse, CameraChange::Disconnected);
}

#[test]
fn resets_connections() {
    survives(Fault::Reset, CameraChange::Disconnected);
}

#[test]
fn answers_garbage() {
    survives(Fault::Garbage(b"\x15\x03\x01 this is no HTTP\r\n\r\n".to_vec()), CameraChange::Disconnected);
}
