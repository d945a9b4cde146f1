// SPDX-License-Identifier: MPL-2.0

//! Whatever goes wrong with the camera: video goes on, one warning, and control is back when the camera is.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;
mod surviving;

use std::net::Ipv4Addr;
use std::time::Duration;

use common::{Heard, PATIENCE, Rig, camera, target};
use gst::prelude::*;
use ptztrack_contract::TargetState;
use surviving::front::{certificates::certificate, pass_on_from, tls_front};
use surviving::names::Lookup;
use surviving::scene::{Jump, Scene, Trouble};
use surviving::{cases, survive, wrong_password};
use virtual_camera::{Auth, Fault};

/// Shorter than by default, to see several attempts fail.
const TIMEOUT: Duration = Duration::from_secs(1);

/// Long enough that a busy machine is not taken for a fault.
const PATIENT: Duration = Duration::from_secs(10);

/// Long enough for several more failures after the first.
const LASTS: Duration = Duration::from_secs(2);

macro_rules! survives {
    ($($test:ident: $name:literal;)+) => {
        $(#[test]
        fn $test() {
            let case = cases().into_iter().find(|case| case.name == $name).unwrap();
            let outcome = survive(&case, if case.noticed { TIMEOUT } else { PATIENT }, LASTS);
            assert_eq!(outcome.warning.is_some(), case.noticed);
        })+

        #[test]
        fn each_case_has_its_test() {
            assert_eq!(cases().iter().map(|case| case.name).collect::<Vec<_>>(), [$($name),+]);
        }
    };
}

survives! {
    refused: "connection refused";
    reset: "connection reset";
    black_hole: "black hole: no packet comes back";
    no_answer: "connected, and never an answer";
    late_answers: "answers after 5 s";
    name_unknown: "the camera's name is unknown for a while";
    name_server_silent: "the name server does not answer";
    reboot: "camera reboots: refuses, then other realm and nonce";
    refused_unseen: "connection refused, and no picture";
    reset_unseen: "connection reset, and no picture";
    black_hole_unseen: "black hole, and no picture";
    reboot_unseen: "camera reboots, and no picture";
    redirect_301: "301 to another host";
    redirect_302: "302 to another host";
    redirect_307: "307 to another host";
    redirect_308: "308 to another host";
    forbidden: "403";
    not_found: "404";
    unavailable: "503";
    error_text: "200 with `Error:`";
    empty: "empty 200";
    garbage: "garbage instead of HTTP";
    endless_body: "a body without end";
    drip: "a byte every 100 ms, without end";
    slow_answers: "answers after 400 ms";
    closed_keep_alive: "keep-alive closed without a word";
    clock_jump: "clock of the camera jumps by an hour: stale nonce";
    line_feeds: "lines that end in LF";
    pipeline_clock: "the pipeline's clock jumps by an hour, and back";
    timestamps: "timestamps jump by an hour, and back";
    clock_and_timestamps: "clock and timestamps jump by an hour, and back";
    segment: "the stream's segment jumps by an hour, and back";
}

/// Long enough for pauses that doubled without end to be longer than what control may take to be back: attempts 7.9 s
/// and 15.9 s after the first.
#[test]
fn after_a_longer_fault_too_control_is_back_at_once() {
    let longer = Duration::from_millis(8500);
    let cases = cases();
    let lasting = ["connection refused", "403", "503", "200 with `Error:`"];
    std::thread::scope(|scope| {
        for case in cases.iter().filter(|case| lasting.contains(&case.name)) {
            scope.spawn(move || survive(case, TIMEOUT, longer));
        }
    });
}

#[test]
fn a_name_that_nobody_has_can_be_corrected() {
    surviving::unknown_name(TIMEOUT);
}

#[test]
fn a_name_that_is_known_later_is_found_without_a_hand() {
    surviving::name_not_yet_known(TIMEOUT);
}

/// Neither the address is kept nor the connection, which nobody has closed.
#[test]
fn a_camera_that_has_another_address_since_is_found_again() {
    let mut scene = Scene::new("another address", Lookup::LOOPBACK, TIMEOUT);
    scene.rig.set_going(&scene.camera);
    scene.rig.heard();
    let moved = camera(Auth::Digest { qop: true });
    let elsewhere = Ipv4Addr::new(127, 0, 0, 2);
    pass_on_from((elsewhere, scene.camera.http_address().port()), moved.http_address());
    scene.camera.set_fault(Fault::BlackHole);
    let here = target(TargetState::Tracking, 0.9, 0.4);
    scene.rig.push_until_message(&here, Heard::is_warning);
    scene.name.set(Lookup::Address(elsewhere));
    scene.rig.set_going(&moved);
    scene.rig.push_until(&target(TargetState::Lost, 0.5, 0.5), &moved, |status| !status.moving);
    assert!(!scene.rig.heard().iter().any(Heard::is_warning));
}

/// Neither with pictures, which the other tests have, nor without.
#[test]
fn a_jump_of_time_leaves_no_camera_turning() {
    for jump in Jump::ALL {
        let mut scene = Scene::new("jump", Lookup::LOOPBACK, PATIENT);
        scene.rig.set_going(&scene.camera);
        scene.begin(&Trouble::Jump(jump));
        assert!(scene.camera.wait_for(PATIENCE, |status| !status.moving), "{jump:?}");
        assert!(!scene.rig.heard().iter().any(Heard::is_warning));
    }
}

/// The camera's own HTTPS, which its redirect leads to, and nothing but that.
#[test]
fn a_redirect_to_the_cameras_https_is_followed_without_a_word() {
    for status in [301, 302, 307, 308] {
        let plain = camera(Auth::Digest { qop: true });
        let secure = camera(Auth::Digest { qop: true });
        let location = tls_front(secure.http_address(), "camera");
        plain.set_fault(Fault::Redirect { status, location });
        let mut rig = Rig::ready(&plain.url())
            .with("user", "root")
            .with("password", "pass")
            .with("ca-file", certificate("authority.pem").to_str().unwrap())
            .play();
        rig.set_going(&secure);
        rig.push_until(&target(TargetState::Lost, 0.5, 0.5), &secure, |status| !status.moving);
        assert!(!rig.heard().iter().any(Heard::is_warning));
        assert_eq!(plain.status().requests, 1, "HTTPS is remembered");
        assert_eq!(secure.status().refused, 1, "one challenge");
    }
}

/// As it is in every camera out of the box: signed by itself, for a name that is not its address.
#[test]
fn a_cameras_own_certificate_is_believed_where_it_is_given() {
    let camera = camera(Auth::Digest { qop: true });
    let location = tls_front(camera.http_address(), "self-signed");
    let mut rig = Rig::ready(&location)
        .with("user", "root")
        .with("password", "pass")
        .with("ca-file", certificate("self-signed.pem").to_str().unwrap())
        .play();
    rig.set_going(&camera);
    rig.push_until(&target(TargetState::Lost, 0.5, 0.5), &camera, |status| !status.moving);
    assert!(!rig.heard().iter().any(Heard::is_warning));
}

#[test]
fn another_certificate_is_not_believed_and_gets_nothing() {
    let camera = camera(Auth::Basic);
    let location = tls_front(camera.http_address(), "self-signed");
    let mut rig = Rig::ready(&location)
        .with("user", "root")
        .with("password", "pass")
        .with("ca-file", certificate("authority.pem").to_str().unwrap())
        .play();
    let here = target(TargetState::Tracking, 0.9, 0.5);
    let mut heard = rig.push_until_message(&here, Heard::is_warning);
    let Some(Heard::Warning(text)) = heard.last().cloned() else { panic!("{heard:?}") };
    assert!(text.contains("certificate") && text.contains("`ca-file`"), "{text}");
    for _ in 0..100 {
        rig.push(&here);
        heard.extend(rig.hear(Duration::from_millis(20)));
    }
    assert_eq!(heard.iter().filter(|heard| heard.is_warning()).count(), 1, "{heard:?}");
    assert_eq!(camera.status().requests, 0);
}

#[test]
fn a_wrong_password_locks_nobody_out() {
    wrong_password();
}

#[test]
fn at_rest_a_silent_camera_is_left_without_complaint() {
    let camera = camera(Auth::None);
    camera.set_fault(Fault::Hang);
    let rig = Rig::ready(&camera.url()).with("timeout", 60_000_000_000u64).play();
    assert!(camera.wait_for(PATIENCE, |status| status.requests > 0));
    rig.sink.set_state(gst::State::Paused).unwrap();
    rig.sink.set_state(gst::State::Null).unwrap();
    assert_eq!(rig.heard(), []);
}

#[test]
fn a_dead_network_ends_with_a_warning_within_bounds() {
    let camera = camera(Auth::None);
    let mut rig = Rig::ready(&camera.url()).with("timeout", 60_000_000_000u64).play();
    rig.set_going(&camera);
    camera.set_fault(Fault::Hang);
    rig.sink.set_state(gst::State::Null).unwrap();
    let gave_up =
        |heard: &Heard| matches!(heard, Heard::Warning(text) if text.contains("may still be moving"));
    // On a busy machine it is said after the wait for it is over.
    let mut heard = Vec::new();
    while !heard.iter().any(gave_up) {
        heard.push(rig.hear(PATIENCE).expect("it is never said"));
    }
    heard.extend(rig.heard());
    assert_eq!(heard.iter().filter(|heard| gave_up(heard)).count(), 1, "{heard:?}");
}
