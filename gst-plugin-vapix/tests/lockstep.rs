// SPDX-License-Identifier: MPL-2.0

//! Time that goes by the stream's.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use common::stage::PATIENT_NS;
use common::{PATIENCE, Rig, camera, moves, target};
use gst::prelude::*;
use ptztrack_contract::{BufferMeta, TargetMeta, TargetState};
use virtual_camera::{Auth, Fault, VirtualCamera};

fn rig(camera: &VirtualCamera, set: impl FnOnce(Rig) -> Rig) -> Rig {
    set(Rig::ready(&camera.url()).with("lockstep", true).with("timeout", PATIENT_NS)).play()
}

fn push_at(rig: &mut Rig, milliseconds: u64, meta: Option<&TargetMeta>) {
    let mut buffer = gst::Buffer::with_size(320 * 240).unwrap();
    let content = buffer.get_mut().unwrap();
    content.set_pts(gst::ClockTime::from_mseconds(milliseconds));
    if let Some(meta) = meta {
        meta.attach(content).unwrap();
    }
    assert_eq!(rig.harness().push(buffer), Ok(gst::FlowSuccess::Ok));
}

/// A target that moves to the left; the moves that the camera has got when each buffer has passed.
fn walk(camera: &VirtualCamera) -> Vec<Vec<String>> {
    let mut rig = rig(camera, |rig| rig);
    let pictures = 0..12u32;
    pictures
        .map(|picture| {
            let meta = target(TargetState::Tracking, 0.9 - 0.02 * f64::from(picture), 0.5);
            push_at(&mut rig, 40 * u64::from(picture), Some(&meta));
            moves(camera)
        })
        .collect()
}

#[test]
fn a_buffer_has_passed_when_the_camera_has_answered() {
    let counts: Vec<_> = walk(&camera(Auth::None)).iter().map(Vec::len).collect();
    let sending =
        |picture: &usize| counts[*picture] > picture.checked_sub(1).map_or(0, |before| counts[before]);
    let sent: Vec<_> = (0..counts.len()).filter(sending).collect();
    // At most ten a second, by the stream's time: every third picture at the most.
    assert!(sent.starts_with(&[0, 3]) && sent.windows(2).all(|pair| pair[1] - pair[0] >= 3), "{counts:?}");
}

#[test]
fn the_same_stream_gives_the_same_commands() {
    let first = walk(&camera(Auth::None));
    // Often enough to see the first picture race the first questions to the camera, if it could.
    for _ in 0..15 {
        assert_eq!(walk(&camera(Auth::None)), first);
    }
}

#[test]
fn a_target_becomes_stale_by_the_streams_time() {
    let camera = camera(Auth::None);
    // Too slow to have arrived by then, as far as is known: that would be a reason to stop as well.
    let mut rig = rig(&camera, |rig| rig.with("max-speed", 5.0));
    push_at(&mut rig, 0, Some(&target(TargetState::Tracking, 0.9, 0.5)));
    push_at(&mut rig, 960, None);
    assert_ne!(moves(&camera).last().unwrap(), "camera=1&continuouspantiltmove=0,0");
    push_at(&mut rig, 1000, None);
    assert_eq!(moves(&camera).last().unwrap(), "camera=1&continuouspantiltmove=0,0");
}

#[test]
fn the_end_comes_though_the_stream_stands() {
    let camera = camera(Auth::None);
    let mut rig = rig(&camera, |rig| rig);
    push_at(&mut rig, 0, Some(&target(TargetState::Tracking, 0.9, 0.5)));
    drop(rig);
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
    assert_eq!(moves(&camera).last().unwrap(), "camera=1&continuouspantiltmove=0,0");
}

#[test]
fn a_camera_that_is_gone_holds_no_stream_for_ever() {
    // Rather than one that is dropped: its port could be another's at once.
    let camera = camera(Auth::None);
    camera.set_fault(Fault::Refuse);
    let mut rig = rig(&camera, |rig| rig);
    for picture in 0..5 {
        push_at(&mut rig, 40 * picture, Some(&target(TargetState::Tracking, 0.9, 0.5)));
    }
    assert!(rig.stats().get::<Option<String>>("last-error").unwrap().is_some());
    rig.sink.set_state(gst::State::Null).unwrap();
}

/// An hour ahead and back again, by timestamps or by a seek: what is timed goes on from where it stood.
#[test]
fn a_stream_whose_time_jumps_is_steered_by_on() {
    const HOUR: u64 = 3_600_000;
    let camera = camera(Auth::None);
    let mut rig = rig(&camera, |rig| rig);
    let mut last = 0;
    // Long enough on each side not to be taken for a camera that swings about its target.
    for (begin, x, turn) in [
        (0, 0.9, "move="),
        (HOUR, 0.1, "move=-"),
        (2000, 0.9, "move="),
        (0, 0.1, "move=-"),
        (HOUR, 0.9, "move="),
    ] {
        let before = moves(&camera).len();
        for picture in 0..60 {
            last = begin + 40 * picture;
            push_at(&mut rig, last, Some(&target(TargetState::Tracking, x, 0.5)));
            let sent = moves(&camera);
            assert!(sent.len() - before <= 1 + picture as usize / 3 + 1, "as often as ever: {sent:?}");
            let turned = sent.last().is_some_and(|query| turns(query, turn));
            assert!(picture < 25 || turned, "from {begin} on {picture} pictures: {sent:?}");
        }
    }
    // Nobody is seen any more, and the time of the pictures that show it is another still.
    for picture in 0..26 {
        push_at(&mut rig, last / 2 + 40 * picture, None);
    }
    assert_eq!(moves(&camera).last().unwrap(), "camera=1&continuouspantiltmove=0,0");
    assert!(!rig.heard().iter().any(common::Heard::is_warning));
}

/// By this sign, and at all.
fn turns(query: &str, turn: &str) -> bool {
    let pan = query.split_once(turn).and_then(|(_, speeds)| speeds.split(',').next()?.parse::<u8>().ok());
    pan.is_some_and(|pan| pan > 0)
}
