// SPDX-License-Identifier: MPL-2.0

//! The main job, closed loop: a person walks, the camera turns after them; nobody walks, it stays.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use end_to_end::{PATIENCE, Running, scene};
use gst::prelude::*;
use ptztrack_contract::{TargetChange, TargetMessage};
use virtual_camera::{Settings, VirtualCamera, World};

/// Once the person is this far from where the camera looked first, only a camera that turned still sees them well.
const FAR_DEG: f64 = 12.0;
/// A tenth of the picture's width.
const NEAR_CENTRE_DEG: f64 = 3.6;

#[track_caller]
fn follows(settings: Settings, source: impl Fn(&VirtualCamera) -> String) {
    let World::Synthetic(world) = settings.world.clone() else { panic!("the scene is synthetic") };
    let camera = VirtualCamera::start(settings).unwrap();
    let description =
        format!("{} ! bgavgdetect ! lkfeaturetrack ! {}", source(&camera), scene::servo(&camera));
    let mut running = Running::start(&description);
    running.wait_for_message("a target", TargetMessage::from_structure, |message| {
        message.change == TargetChange::Acquired
    });
    for side in [1.0, -1.0] {
        let centred = camera.wait_for(PATIENCE, |status| {
            world.person_at(status.time).is_some_and(|(pan_deg, _)| {
                pan_deg * side > FAR_DEG && (pan_deg - status.pan_deg).abs() < NEAR_CENTRE_DEG
            })
        });
        assert!(centred, "the person was never near the centre on side {side}: {:?}", camera.status());
    }
    running.pipeline().send_event(gst::event::Eos::new());
    running.wait_for("the end", |message| (message.type_() == gst::MessageType::Eos).then_some(()));
    assert!(camera.wait_for(PATIENCE, |status| !status.moving), "the camera was left moving");
    assert_eq!(running.complaints(), [] as [String; 0]);
}

#[test]
fn over_mjpeg() {
    follows(scene::walking_person(), scene::mjpeg);
}

#[test]
fn over_mpeg4_and_rtsp() {
    follows(scene::walking_person(), |camera| {
        format!(
            "rtspsrc location={}/axis-media/media.amp?videocodec=mpeg4 user-id={} user-pw={} latency=0 \
             protocols=tcp ! rtpmp4vdepay ! avdec_mpeg4 ! queue leaky=downstream max-size-buffers=1",
            camera.rtsp_url(),
            scene::USER,
            scene::PASSWORD
        )
    });
}

#[test]
fn an_empty_world_moves_nothing() {
    let camera = VirtualCamera::start(scene::nobody()).unwrap();
    let description = format!(
        "{} ! bgavgdetect ! lkfeaturetrack ! identity name=counted ! {}",
        scene::mjpeg(&camera),
        scene::servo(&camera)
    );
    let mut running = Running::start(&description);
    let pad = running.element("counted").static_pad("src").unwrap();
    let (sender, frames) = std::sync::mpsc::channel();
    pad.add_probe(gst::PadProbeType::BUFFER, move |_, _| match sender.send(()) {
        Ok(()) => gst::PadProbeReturn::Ok,
        Err(_) => gst::PadProbeReturn::Remove,
    });
    for _ in 0..90 {
        frames.recv_timeout(PATIENCE).expect("the video stands still");
    }
    let is_move = |query: &str| !query.contains("query=") && !query.contains("move=0,0");
    let moves: Vec<_> = camera.commands().into_iter().filter(|command| is_move(&command.query)).collect();
    assert!(moves.is_empty(), "{moves:?}");
    assert_eq!(camera.status().pan_deg, 0.0);
    assert_eq!(running.warnings(), [] as [String; 0]);
}
