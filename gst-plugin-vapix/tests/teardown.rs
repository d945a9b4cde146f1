// SPDX-License-Identifier: MPL-2.0

//! An application may drop its pipeline whenever it likes.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::sync::Mutex;
use std::sync::mpsc::channel;

use common::{PATIENCE, camera};
use gst::prelude::*;
use virtual_camera::Auth;

/// The camera's messages come from a thread of its own, and GStreamer does not hold the bin that it hands them to.
#[test]
fn a_pipeline_is_there_as_long_as_a_message_of_the_camera_is_handled() {
    common::init();
    let camera = camera(Auth::None);
    let sink = gst::ElementFactory::make("vapixptzsink")
        .property("location", camera.url())
        .property("dead-man", false)
        .build()
        .unwrap();
    let (inner, pipeline) = (gst::Bin::new(), gst::Pipeline::new());
    inner.add(&sink).unwrap();
    pipeline.add(&inner).unwrap();

    let ((posted, handled), (hold, held)) = (channel(), channel::<()>());
    let held = Mutex::new(held);
    pipeline.bus().unwrap().set_sync_handler(move |_, message| {
        if message.structure().is_some_and(|structure| structure.name() == "ptztrack-camera")
            && posted.send(()).is_ok()
        {
            let _ = held.lock().unwrap().recv_timeout(PATIENCE);
        }
        gst::BusSyncReply::Drop
    });
    let (freed, is_freed) = channel();
    pipeline.add_weak_ref_notify(move || {
        let _ = freed.send(());
    });

    drop((sink, inner));
    pipeline.set_state(gst::State::Paused).unwrap();
    handled.recv_timeout(PATIENCE).unwrap();
    drop(handled);
    pipeline.set_state(gst::State::Null).unwrap();
    drop(pipeline);
    assert!(is_freed.try_recv().is_err(), "freed while its message is handled");
    drop(hold);
    is_freed.recv_timeout(PATIENCE).unwrap();
}
