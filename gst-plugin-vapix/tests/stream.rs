// SPDX-License-Identifier: MPL-2.0

//! Streams that are not what they seem: late, cropped, without a target, stalled.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use common::stage::PATIENT_NS;
use common::{FRAME, Heard, PATIENCE, Rig, Stamps, camera, moves, target};
use gst::prelude::*;
use ptztrack_contract::{BufferMeta, CameraEvent, TargetMeta, TargetState};
use virtual_camera::{Auth, Fault};

/// So many seconds of such buffers without a target meta, by the stream's time; what is heard of that.
fn without_target(seconds: u64, first_has_one: bool, flags: gst::BufferFlags) -> Vec<Heard> {
    let camera = camera(Auth::None);
    let mut rig = Rig::ready(&camera.url()).with("lockstep", true).with("timeout", PATIENT_NS).play();
    for picture in 0..=25 * seconds {
        let mut buffer = gst::Buffer::with_size(320 * 240).unwrap();
        let content = buffer.get_mut().unwrap();
        content.set_pts(gst::ClockTime::from_mseconds(40 * picture));
        content.set_flags(flags);
        if first_has_one && picture == 0 {
            target(TargetState::Searching, 0.5, 0.5).attach(content).unwrap();
        }
        assert_eq!(rig.harness().push(buffer), Ok(gst::FlowSuccess::Ok));
    }
    rig.heard().into_iter().filter(Heard::is_warning).collect()
}

#[test]
fn a_stream_without_target_metas_is_warned_of_once() {
    let whole = gst::BufferFlags::empty();
    let warnings = without_target(5, false, whole);
    assert!(
        matches!(warnings.as_slice(), [Heard::Warning(text)] if text.contains("lkfeaturetrack")),
        "{warnings:?}"
    );
    assert_eq!(without_target(5, true, whole), []);
    // `lkfeaturetrack` is there, and lets these pass.
    for flags in [gst::BufferFlags::CORRUPTED, gst::BufferFlags::GAP] {
        assert_eq!(without_target(5, false, flags), []);
    }
}

/// The target is in every picture, but those come later and later.
#[test]
fn pictures_that_are_too_old_are_not_steered_by() {
    let camera = camera(Auth::None);
    let mut rig = Rig::ready(&camera.url()).with("stale-timeout", 500_000_000u64).play();
    let clock = gst::SystemClock::obtain();
    rig.sink.set_clock(Some(&clock)).unwrap();
    rig.sink.set_base_time(clock.time());
    // As behind a decoder that is too slow, with a queue that drops nothing.
    rig.stamps = Some(Stamps::default());
    rig.stamps.as_mut().unwrap().pace = 0.5;
    let aside = target(TargetState::Tracking, 0.9, 0.4);
    let heard = rig.push_until_message(&aside, Heard::is_warning);
    let warning = heard.into_iter().find_map(Heard::into_warning).unwrap();
    assert!(warning.contains("stale-timeout"), "{warning}");
    rig.push_until(&aside, &camera, |status| !status.moving);
    rig.stamps.as_mut().unwrap().pace = 1.0;
    rig.set_going(&camera);
    assert!(!rig.heard().iter().any(Heard::is_warning), "once is enough");
}

/// As where a full queue in the network holds them back, and all that follow.
#[test]
fn pictures_that_do_not_come_for_long_are_told_of() {
    let camera = camera(Auth::None);
    let mut rig = Rig::ready(&camera.url()).with("stale-timeout", 500_000_000u64).play();
    rig.set_going(&camera);
    assert!(camera.wait_for(PATIENCE, |status| !status.moving), "nobody was seen for longer than that");
    let aside = target(TargetState::Tracking, 0.9, 0.4);
    let is_told = |heard: &Heard| matches!(heard, Heard::Info(text) if text.contains("no picture came for"));
    let heard = rig.push_until_message(&aside, is_told);
    assert!(!heard.iter().any(Heard::is_warning), "{heard:?}");
}

#[test]
fn a_picture_of_another_shape_is_not_steered_by() {
    let camera = camera(Auth::None);
    let mut rig = Rig::playing(&camera.url());
    rig.set_going(&camera);
    // The rig's pictures are 4:3; this was found in a wider one.
    let cropped = TargetMeta { aspect: Some(16.0 / 9.0), ..target(TargetState::Tracking, 0.9, 0.4) };
    let heard = rig.push_until_message(&cropped, Heard::is_warning);
    let warning = heard.into_iter().find_map(Heard::into_warning).unwrap();
    assert!(warning.contains("cropped"), "{warning}");
    rig.push_until(&cropped, &camera, |status| !status.moving);
    let before = moves(&camera).len();
    for _ in 0..20 {
        rig.push(&cropped);
    }
    assert_eq!(moves(&camera).len(), before);
}

/// Upstream is not told that cropping may be left to the sink; who does that all the same is not steered by.
#[test]
fn a_picture_that_is_still_to_be_cropped_is_not_steered_by() {
    let camera = camera(Auth::None);
    let mut rig = Rig::playing(&camera.url());
    let caps = rig.sink.static_pad("sink").unwrap().current_caps().unwrap();
    let mut query = gst::query::Allocation::new(Some(&caps), false);
    assert!(rig.harness().srcpad().unwrap().peer_query(&mut query));
    assert!(query.find_allocation_meta::<gst_video::VideoMeta>().is_some());
    assert_eq!(query.find_allocation_meta::<gst_video::VideoCropMeta>(), None);

    let mut buffer = gst::Buffer::with_size(320 * 240).unwrap();
    let content = buffer.get_mut().unwrap();
    target(TargetState::Tracking, 0.9, 0.4).attach(content).unwrap();
    gst_video::VideoCropMeta::add(content, (0, 0, 160, 120));
    assert_eq!(rig.harness().push(buffer), Ok(gst::FlowSuccess::Ok));
    let warning = rig.heard().into_iter().find_map(Heard::into_warning).unwrap();
    assert!(warning.contains("cropped"), "{warning}");
}

/// The sink's branch gets nothing any more, the detector's does: it is blind for as long as it believes that the camera
/// moves.
#[test]
fn upstream_hears_that_the_camera_rests_without_a_buffer() {
    for pauses in [false, true] {
        let camera = camera(Auth::None);
        let mut rig = Rig::playing(&camera.url());
        rig.set_going(&camera);
        // Once it is told that the camera moves.
        let searching = target(TargetState::Tracking, 0.9, 0.4);
        while last_told(&mut rig) != Some(true) {
            rig.push(&searching);
        }
        if pauses {
            rig.sink.set_state(gst::State::Paused).unwrap();
        }
        let begin = std::time::Instant::now();
        while last_told(&mut rig) != Some(false) {
            rig.hear(FRAME);
            assert!(begin.elapsed() < PATIENCE, "never told");
        }
        rig.sink.set_state(gst::State::Playing).unwrap();
    }
}

/// What upstream was last told since the last call: whether the camera moves.
fn last_told(rig: &mut Rig) -> Option<bool> {
    let events = std::iter::from_fn(|| rig.harness().try_pull_upstream_event());
    events.filter_map(|event| CameraEvent::of(&event)?.ok()).map(|event| event.moving).last()
}

#[test]
fn no_buffer_is_kept() {
    let camera = camera(Auth::None);
    let mut rig = Rig::playing(&camera.url());
    rig.push(&target(TargetState::Searching, 0.5, 0.5));
    assert!(rig.sink.property::<Option<gst::Sample>>("last-sample").is_none());
}

/// In lockstep each buffer waits for the camera; but a flush does not.
#[test]
fn a_flush_does_not_wait_for_the_camera() {
    let camera = camera(Auth::None);
    let mut rig = Rig::ready(&camera.url()).with("lockstep", true).with("timeout", PATIENT_NS).play();
    rig.push(&target(TargetState::Searching, 0.5, 0.5));
    camera.set_fault(Fault::Hang);
    let pad = rig.sink.static_pad("sink").unwrap();
    let pushing = pad.peer().unwrap();
    let seen = camera.status().commands;
    let stuck = std::thread::spawn(move || {
        for picture in 1..100 {
            let mut buffer = gst::Buffer::with_size(320 * 240).unwrap();
            let content = buffer.get_mut().unwrap();
            content.set_pts(gst::ClockTime::from_mseconds(40 * picture));
            target(TargetState::Tracking, 0.9, 0.4).attach(content).unwrap();
            if pushing.push(buffer).is_err() {
                break;
            }
        }
    });
    assert!(camera.wait_for(PATIENCE, |status| status.commands > seen));
    assert!(pad.send_event(gst::event::FlushStart::new()));
    stuck.join().unwrap();
    assert!(pad.send_event(gst::event::FlushStop::new(true)));
    // It would wait for the client to give up what is not answered.
    std::mem::forget(camera);
}
