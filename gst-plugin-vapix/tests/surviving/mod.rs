// SPDX-License-Identifier: MPL-2.0

//! A sink steers a camera, something goes wrong, and is over again.
#![allow(missing_docs, dead_code, clippy::unwrap_used, clippy::expect_used)]

pub mod front;
pub mod names;
pub mod scene;

use std::time::{Duration, Instant};

use gst::prelude::*;
use ptztrack_contract::TargetState;
use virtual_camera::{Auth, Fault};

use crate::common::{Heard, Rig, camera, target};
use names::{Lookup, Name};
use scene::{Jump, Scene, Trouble, bounded};

/// Pictures pushed without a pause as something begins: 20 s of video.
const BURST: usize = 500;

/// What elapses between two pictures afterwards; no test depends on it.
const FRAME: Duration = Duration::from_millis(20);

/// Something that goes wrong, and by what name.
pub struct Case {
    pub name: &'static str,
    pub trouble: Trouble,
    /// Whether it keeps the camera from being steered.
    pub noticed: bool,
    /// Whether the pictures stay away too: as a rule they come from the same camera.
    pub video_lost: bool,
}

fn case(name: &'static str, fault: Fault) -> Case {
    Case { name, trouble: Trouble::Camera(fault), noticed: true, video_lost: false }
}

fn video_too(name: &'static str, fault: Fault) -> Case {
    Case { video_lost: true, ..case(name, fault) }
}

fn unnoticed(name: &'static str, fault: Fault) -> Case {
    Case { noticed: false, ..case(name, fault) }
}

fn name(name: &'static str, lookup: Lookup) -> Case {
    Case { trouble: Trouble::Name(lookup), ..case(name, Fault::None) }
}

fn jump(name: &'static str, jump: Jump) -> Case {
    Case { trouble: Trouble::Jump(jump), ..unnoticed(name, Fault::None) }
}

fn redirect(status: u16) -> Fault {
    Fault::Redirect { status, location: "https://elsewhere.example/axis-cgi/com/ptz.cgi".to_owned() }
}

/// All that can come between a sink and its camera.
pub fn cases() -> Vec<Case> {
    let error = "Error:somebody else\r\nis in control".to_owned();
    vec![
        case("connection refused", Fault::Refuse),
        case("connection reset", Fault::Reset),
        case("black hole: no packet comes back", Fault::BlackHole),
        case("connected, and never an answer", Fault::Hang),
        case("answers after 5 s", Fault::Delay(Duration::from_secs(5))),
        name("the camera's name is unknown for a while", Lookup::Unknown),
        name("the name server does not answer", Lookup::Silent),
        case("camera reboots: refuses, then other realm and nonce", Fault::Reboot),
        video_too("connection refused, and no picture", Fault::Refuse),
        video_too("connection reset, and no picture", Fault::Reset),
        video_too("black hole, and no picture", Fault::BlackHole),
        video_too("camera reboots, and no picture", Fault::Reboot),
        case("301 to another host", redirect(301)),
        case("302 to another host", redirect(302)),
        case("307 to another host", redirect(307)),
        case("308 to another host", redirect(308)),
        case("403", Fault::Status(403)),
        case("404", Fault::Status(404)),
        case("503", Fault::Status(503)),
        case("200 with `Error:`", Fault::ErrorBody(error)),
        case("empty 200", Fault::EmptyOk),
        case("garbage instead of HTTP", Fault::Garbage(b"\x00\xffnot HTTP at all\r\n\r\n".to_vec())),
        case("a body without end", Fault::EndlessBody),
        case("a byte every 100 ms, without end", Fault::Drip(Duration::from_millis(100))),
        unnoticed("answers after 400 ms", Fault::Delay(Duration::from_millis(400))),
        unnoticed("keep-alive closed without a word", Fault::CloseAfterResponse),
        unnoticed(
            "clock of the camera jumps by an hour: stale nonce",
            Fault::ClockAhead(Duration::from_secs(3600)),
        ),
        unnoticed("lines that end in LF", Fault::LineFeeds),
        jump("the pipeline's clock jumps by an hour, and back", Jump::Clock),
        jump("timestamps jump by an hour, and back", Jump::Stamps),
        jump("clock and timestamps jump by an hour, and back", Jump::Both),
        jump("the stream's segment jumps by an hour, and back", Jump::Segment),
    ]
}

/// How it went.
pub struct Outcome {
    /// What the user was told, where anything.
    pub warning: Option<String>,
    /// From the end of the fault until the camera accepted a move.
    pub back_after: Duration,
    /// Pictures taken while the fault lasted.
    pub pictures: usize,
    /// Requests that came to the camera meanwhile.
    pub requests: u64,
}

/// Lets a trouble last for a while after it was noticed. The sink waits `timeout` for answers.
#[track_caller]
pub fn survive(case: &Case, timeout: Duration, lasts: Duration) -> Outcome {
    Scene::new(case.name, Lookup::LOOPBACK, timeout).survive(case, lasts)
}

/// From the start on nobody knows the name: there is no camera to come back, but the address can be corrected.
pub fn unknown_name(timeout: Duration) -> Outcome {
    unknown_until(timeout, |scene| {
        scene.rig.sink.set_state(gst::State::Ready).unwrap();
        scene.rig.sink.set_property("location", scene.camera.url());
        scene.rig.sink.set_state(gst::State::Playing).unwrap();
    })
}

/// From the start on nobody knows the name; then somebody does.
pub fn name_not_yet_known(timeout: Duration) -> Outcome {
    unknown_until(timeout, |scene| scene.name.set(Lookup::LOOPBACK))
}

fn unknown_until(timeout: Duration, mend: impl FnOnce(&Scene)) -> Outcome {
    let mut scene = Scene::new("unknown name", Lookup::Unknown, timeout);
    let here = target(TargetState::Tracking, 0.9, 0.5);
    let begin = Instant::now();
    for _ in 0..BURST {
        scene.rig.push(&here);
    }
    let mut heard = scene.rig.push_until_message(&here, Heard::is_warning);
    let mut pictures = BURST;
    while begin.elapsed() < Duration::from_secs(4) {
        scene.rig.push(&here);
        pictures += 1;
        heard.extend(scene.rig.hear(FRAME));
    }
    bounded(scene.name.asked(), begin.elapsed(), "unknown name");
    let mut warnings: Vec<_> = heard.into_iter().filter_map(Heard::into_warning).collect();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    let mended = scene.camera.status().time;
    mend(&scene);
    let back_after = scene.steered_again(mended).saturating_sub(mended);
    let heard = scene.rig.heard();
    assert!(!heard.iter().any(Heard::is_warning), "{heard:?}");
    Outcome { warning: warnings.pop(), back_after, pictures, requests: 0 }
}

/// One wrong login, and silence until the password is another.
pub fn wrong_password() -> Outcome {
    let camera = camera(Auth::Digest { qop: true });
    camera.set_fault(Fault::LockOut(2));
    let rig = Rig::ready(&camera.url()).with("user", "root").with("password", "falsch");
    let mut scene = Scene::before("wrong password", camera, rig, Name::new(Lookup::Unknown));
    let here = target(TargetState::Tracking, 0.9, 0.5);
    let warning = scene.rig.push_until_message(&here, Heard::is_warning).pop().and_then(Heard::into_warning);
    let text = warning.as_deref().unwrap();
    assert!(text.contains("root") && !text.contains("falsch"), "{text}");
    let mut pictures = 0;
    while pictures < 100 {
        scene.rig.push(&here);
        pictures += 1;
        assert_eq!(scene.rig.hear(FRAME), None);
    }
    let requests = scene.camera.status().requests;
    assert_eq!(requests, 2, "the challenge, and the wrong answer");
    assert_eq!(scene.rig.stats().get::<&str>("state").unwrap(), "refused");
    let corrected = scene.camera.status().time;
    scene.rig.sink.set_property("password", "pass");
    let back_after = scene.steered_again(corrected).saturating_sub(corrected);
    Outcome { warning, back_after, pictures, requests }
}
