// SPDX-License-Identifier: MPL-2.0

//! Many cameras in one application: none waits for another.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::sync::mpsc::sync_channel;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use common::{FRAME, PATIENCE, Rig, camera, init, target};
use gst::prelude::*;
use ptztrack_contract::{BufferMeta, TargetState};
use virtual_camera::{Auth, Fault, Settings, VirtualCamera};

const MANY: usize = 100;

/// One after the other they would take 250 s; together one takes 2.5 s, and a busy machine takes longer.
const TOGETHER: Duration = Duration::from_secs(30);

/// Steers on after one picture, at little cost to the test; and so slowly that it is not where it is to be, and at rest, before
/// all of them steer.
fn sink(camera: &VirtualCamera) -> gst::Element {
    gst::ElementFactory::make("vapixptzsink")
        .property("location", camera.url())
        .property("dead-man", false)
        .property("max-rate", 1.0)
        .property("max-speed", 0.5)
        .property("stale-timeout", 60_000_000_000u64)
        .property("override-timeout", 0u64)
        .build()
        .unwrap()
}

fn source() -> gst_app::AppSrc {
    let caps = gst::Caps::builder("video/x-raw").field("format", "GRAY8").field("width", 320);
    let caps = caps.field("height", 240).field("framerate", gst::Fraction::new(25, 1)).build();
    gst_app::AppSrc::builder().caps(&caps).is_live(true).format(gst::Format::Time).build()
}

fn state(sink: &gst::Element) -> String {
    sink.property::<gst::Structure>("stats").get("state").unwrap()
}

#[test]
fn cameras_that_cannot_be_reached_are_given_up_together() {
    init();
    let settings = Settings { service_time: Duration::ZERO, ..Settings::default() };
    let camera = VirtualCamera::start(settings).unwrap();
    let pipeline = gst::Pipeline::new();
    let branches: Vec<_> = (0..MANY).map(|_| (source(), sink(&camera))).collect();
    for (source, sink) in &branches {
        pipeline.add_many([source.upcast_ref(), sink]).unwrap();
        source.link(sink).unwrap();
    }
    pipeline.set_state(gst::State::Playing).unwrap();
    let begin = Instant::now();
    for (source, sink) in &branches {
        while state(sink) != "moving" {
            assert!(begin.elapsed() < PATIENCE, "it is {}", state(sink));
            let mut buffer = gst::Buffer::with_size(320 * 240).unwrap();
            target(TargetState::Tracking, 0.9, 0.4).attach(buffer.get_mut().unwrap()).unwrap();
            source.push_buffer(buffer).unwrap();
            std::thread::sleep(FRAME);
        }
    }
    camera.set_fault(Fault::BlackHole);
    let begin = Instant::now();
    pipeline.set_state(gst::State::Null).unwrap();
    let taken = begin.elapsed();
    assert!(camera.status().moving);
    assert!(taken < TOGETHER, "{taken:?}");
    println!("{MANY} sinks were in NULL after {taken:?}");
    camera.set_fault(Fault::None);
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
}

/// The handlers run in the thread that posts; more of them hang here than there are threads for cameras.
#[test]
fn a_handler_that_hangs_delays_no_stop() {
    let cameras: Vec<_> = (0..6).map(|_| camera(Auth::None)).collect();
    let (release, hold) = sync_channel::<()>(0);
    let hold = Arc::new(Mutex::new(hold));
    let mut rigs: Vec<Rig> = cameras.iter().map(|camera| Rig::ready(&camera.url()).play()).collect();
    for rig in &rigs {
        let hold = hold.clone();
        rig.bus.set_sync_handler(move |_, message| {
            // Those that tell of the camera, until the test is over.
            if message.type_() == gst::MessageType::Element {
                let _ = hold.lock().unwrap().recv();
            }
            gst::BusSyncReply::Drop
        });
    }
    for (rig, camera) in rigs.iter_mut().zip(&cameras) {
        rig.set_going(camera);
    }
    for (rig, camera) in rigs.iter_mut().zip(&cameras) {
        rig.push_until(&target(TargetState::Lost, 0.5, 0.5), camera, |status| !status.moving);
    }
    drop(release);
}
