// SPDX-License-Identifier: MPL-2.0

//! What everybody else says: who writes the file of cameras, who is at the page, brokers, other processes, other elements.

use std::sync::Once;

use ptztrack::parsers;
use ptztrack_contract::{
    BufferMeta, CameraEvent, CameraMessage, MotionMessage, MotionMeta, SceneMeta, TargetMessage, TargetMeta,
    TrackMessage, TrackerEvent, TracksMeta,
};
use session::watchdog::{Answer, Message};

use super::structure::structure_of;
use super::text;

fn with_gstreamer() {
    static BEGIN: Once = Once::new();
    BEGIN.call_once(|| gst::init().expect("GStreamer"));
}

pub fn configuration(bytes: &[u8]) -> bool {
    with_gstreamer();
    parsers::configuration(&text(bytes))
}

pub fn page(bytes: &[u8]) -> bool {
    parsers::page(bytes)
}

pub fn log_in(bytes: &[u8]) -> bool {
    parsers::log_in(bytes)
}

pub fn broker(bytes: &[u8]) -> bool {
    parsers::broker(bytes)
}

pub fn tracks(bytes: &[u8]) -> bool {
    parsers::tracks(bytes)
}

pub fn word(bytes: &[u8]) -> bool {
    with_gstreamer();
    parsers::word(bytes)
}

/// A line between an application and its watchdog is the same once it was said again.
pub fn watchdog(bytes: &[u8]) -> bool {
    let message = Message::of_line(bytes).inspect(|message| {
        let line = message.to_line().expect("a message has a line");
        assert_eq!(Message::of_line(&line).expect("a line"), *message);
    });
    message.is_ok() || Answer::of_line(bytes).is_ok()
}

/// Metas, events and messages, as any other element may write them.
pub fn structure(bytes: &[u8]) -> bool {
    with_gstreamer();
    let Some(structure) = structure_of(&mut text(bytes).lines()) else { return false };
    let event = gst::event::CustomUpstream::new(structure.clone());
    TargetMeta::read(&structure).is_ok()
        || MotionMeta::read(&structure).is_ok()
        || SceneMeta::read(&structure).is_ok()
        || TracksMeta::read(&structure).is_ok()
        || matches!(TrackerEvent::of(&event), Some(Ok(_)))
        || matches!(CameraEvent::of(&event).map(|event| event.map(|event| event.view())), Some(Ok(_)))
        || MotionMessage::from_structure(&structure).is_ok()
        || TargetMessage::from_structure(&structure).is_ok()
        || TrackMessage::from_structure(&structure).is_ok()
        || CameraMessage::from_structure(&structure).is_ok()
}
