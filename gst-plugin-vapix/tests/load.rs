// SPDX-License-Identifier: MPL-2.0

//! More pictures than a slow camera can follow: what is sent is of the newest, and nothing waits in between.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::{Duration, Instant};

use common::{Heard, Rig, target};
use ptztrack_contract::{CameraChange, TargetMeta, TargetState, Vector};
use virtual_camera::{ReceivedCommand, Settings, VirtualCamera};

/// What the camera takes for a request.
const SERVICE: Duration = Duration::from_millis(400);

/// From one picture to the next, on a machine that has nothing else to do.
const FRAME: Duration = Duration::from_micros(16_667);

/// For so many pictures the target stays on one side: for some requests, and never the same part of them; and too
/// long to be taken for a camera that swings about its target.
const STAYS: u64 = 151;

const SIDES: u64 = 7;

/// A picture that was taken by the sink, by the camera's clock.
struct Picture {
    taken: Duration,
    right: bool,
}

/// Every other target is on the right, each time a little elsewhere, so that there is always something new to say. None
/// has a past that would be carried forward: each is another, and nothing in the picture moves.
fn side(picture: u64) -> TargetMeta {
    let (id, aside) = (picture / STAYS + 1, 0.15 + 0.05 * (picture % 7) as f64);
    let x = if id.is_multiple_of(2) { 0.5 + aside } else { 0.5 - aside };
    TargetMeta { id, ego_velocity: Some(Vector::default()), ..target(TargetState::Tracking, x, 0.5) }
}

/// Whether a command turns the camera to the right; `None`: no move.
fn turns_right(command: &ReceivedCommand) -> Option<bool> {
    let (_, speeds) = command.query.split_once("continuouspantiltmove=")?;
    let pan: i32 = speeds.split(',').next()?.parse().unwrap();
    (pan != 0).then_some(pan > 0)
}

/// With no delay to look beyond, whoever is on the left is turned to by going left: a command tells which pictures it
/// can be of. It was sent after the answer to the request before, and must be of the picture that had been taken by
/// then, or of one still newer. None of that depends on how fast the machine is.
#[test]
fn under_load_there_is_one_request_and_each_is_of_the_newest_picture() {
    let camera = VirtualCamera::start(Settings { service_time: SERVICE, ..Settings::default() }).unwrap();
    let (begin, mut pictures) = (Instant::now(), Vec::new());
    // So slow that it never comes to the end of its range.
    let mut rig =
        Rig::ready(&camera.url()).with("latency", 0u64).with("learn", false).with("gain", 0.3).play();
    for picture in 0..SIDES * STAYS {
        let meta = side(picture);
        rig.push(&meta);
        pictures.push(Picture { taken: camera.now(), right: meta.centroid.x > 0.5 });
        camera.wait_for(FRAME, |_| false);
    }
    let (status, elapsed, heard, commands) =
        (camera.status(), begin.elapsed(), rig.heard(), camera.commands());
    assert_eq!(status.most_in_flight, 1);
    // Never more than the camera has time for: nothing is left over for later.
    assert!(u128::from(status.requests) <= elapsed.as_millis() / SERVICE.as_millis() + 1, "{status:?}");
    assert!(!heard.iter().any(Heard::is_warning), "{heard:?}");
    assert!(!heard.contains(&Heard::Camera(CameraChange::TakenOver)), "{heard:?}");
    let (moves, switches) = each_is_of_the_newest(&commands, &pictures);
    assert!(moves >= 12 && switches >= 3, "else nothing is tested: {moves}, {switches} of {commands:?}");
}

/// Returns how many moves told which side they are of, and how many of these were of another than the one before.
#[track_caller]
fn each_is_of_the_newest(commands: &[ReceivedCommand], pictures: &[Picture]) -> (usize, usize) {
    let taken_by = |time: Duration| pictures.partition_point(|picture| picture.taken <= time);
    let (mut moves, mut switches, mut last) = (0, 0, None);
    for pair in commands.windows(2) {
        let (before, command) = (&pair[0], &pair[1]);
        let Some(right) = turns_right(command) else { continue };
        // The one after them all had been taken, too, and was not yet noted as such.
        let end = (taken_by(command.time) + 1).min(pictures.len());
        let newest = &pictures[taken_by(before.time).saturating_sub(1)..end];
        let of_side = newest.iter().filter(|picture| picture.right == right).count();
        assert!(of_side > 0, "{command:?} is of an older picture than the newest at {:?}", before.time);
        if of_side == newest.len() {
            moves += 1;
            switches += usize::from(last.is_some_and(|last| last != right));
        }
        last = Some(right);
    }
    (moves, switches)
}
