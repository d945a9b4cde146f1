//! A camera that misbehaves: video goes on, one warning, and control is back when the camera is.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::Duration;

use common::{Heard, PATIENCE, Rig, camera, moves, target};
use gst::prelude::*;
use ptztrack_contract::{CameraChange, TargetState};
use virtual_camera::{Auth, Fault, Settings, VirtualCamera};

/// Before a camera that misbehaves while it is steered. The pictures go on being pushed all the time:
/// a sink that waited for the network would stop the test.
#[track_caller]
fn survives(fault: Fault) {
    let camera = camera(Auth::Digest { qop: true });
    let mut rig = Rig::ready(&camera.url())
        .with("user", "root")
        .with("password", "pass")
        .with("timeout", 500u32)
        .play();
    rig.set_going(&camera);
    rig.heard();
    camera.set_fault(fault.clone());
    // Left and right by turns, so that there is always something new to say.
    let sides = [0.1, 0.9].map(|x| target(TargetState::Tracking, x, 0.5));
    let mut heard = Vec::new();
    for side in sides.iter().cycle().take(6) {
        heard.extend(rig.heard());
        if heard.iter().any(Heard::is_warning) {
            break;
        }
        heard.extend(rig.push_until_message(side, Heard::is_warning));
    }
    // Long enough for several more failures.
    let end = std::time::Instant::now() + Duration::from_secs(2);
    while std::time::Instant::now() < end {
        for side in &sides {
            rig.push(side);
            heard.extend(rig.hear(Duration::from_millis(20)));
        }
    }
    let warnings = heard.iter().filter(|heard| heard.is_warning()).count();
    assert_eq!(warnings, 1, "{fault:?}: {heard:?}");
    assert!(!heard.contains(&Heard::Camera(CameraChange::Connected)), "{fault:?}: {heard:?}");
    assert!(rig.stats().get::<&str>("last-error").is_ok());

    camera.set_fault(Fault::None);
    let heard = rig.push_until_message(&sides[0], |heard| *heard == Heard::Camera(CameraChange::Connected));
    assert!(!heard.iter().any(Heard::is_warning), "{fault:?}: {heard:?}");
    rig.push_until(&sides[0], &camera, |status| status.pan_rate_deg_s < 0.0);
    rig.push_until(&target(TargetState::Lost, 0.1, 0.5), &camera, |status| !status.moving);
}

#[test]
fn late_answers() {
    survives(Fault::Delay(Duration::from_secs(5)));
}

#[test]
fn refused_connections() {
    survives(Fault::Refuse);
}

#[test]
fn reset_connections() {
    survives(Fault::Reset);
}

#[test]
fn garbage() {
    survives(Fault::Garbage(b"\x00\xffnot HTTP at all\r\n\r\n".to_vec()));
}

#[test]
fn no_answer_ever() {
    survives(Fault::Hang);
}

#[test]
fn unavailable() {
    survives(Fault::Status(503));
}

#[test]
fn an_error_text() {
    survives(Fault::ErrorBody("Error:somebody else\r\nis in control".to_owned()));
}

#[test]
fn an_empty_answer() {
    survives(Fault::EmptyOk);
}

#[test]
fn connections_closed_after_each_answer_are_no_fault() {
    let camera = camera(Auth::Digest { qop: false });
    camera.set_fault(Fault::CloseAfterResponse);
    let mut rig = Rig::ready(&camera.url()).with("user", "root").with("password", "pass").play();
    rig.set_going(&camera);
    rig.push_until(&target(TargetState::Tracking, 0.05, 0.5), &camera, |status| status.pan_rate_deg_s < 0.0);
    rig.push_until(&target(TargetState::Lost, 0.0, 0.0), &camera, |status| !status.moving);
    let heard = rig.heard();
    assert!(!heard.iter().any(Heard::is_warning), "{heard:?}");
}

#[test]
fn at_rest_a_silent_camera_is_left_without_complaint() {
    let camera = camera(Auth::None);
    camera.set_fault(Fault::Hang);
    let rig = Rig::ready(&camera.url()).with("timeout", 60_000u32).play();
    assert!(camera.wait_for(PATIENCE, |status| status.requests > 0));
    rig.sink.set_state(gst::State::Paused).unwrap();
    rig.sink.set_state(gst::State::Null).unwrap();
    assert_eq!(rig.heard(), []);
}

#[test]
fn a_dead_network_ends_with_a_warning_within_bounds() {
    let camera = camera(Auth::None);
    let mut rig = Rig::ready(&camera.url()).with("timeout", 60_000u32).play();
    rig.set_going(&camera);
    camera.set_fault(Fault::Hang);
    rig.sink.set_state(gst::State::Null).unwrap();
    let heard = rig.heard();
    let gave_up =
        |heard: &Heard| matches!(heard, Heard::Warning(text) if text.contains("may still be moving"));
    assert_eq!(heard.iter().filter(|heard| gave_up(heard)).count(), 1, "{heard:?}");
}

#[test]
fn every_kind_of_authentication() {
    for auth in [Auth::Basic, Auth::Digest { qop: true }, Auth::Digest { qop: false }, Auth::Both] {
        let camera = camera(auth);
        let mut rig = Rig::ready(&camera.url()).with("user", "root").with("password", "pass").play();
        rig.set_going(&camera);
        rig.push_until(&target(TargetState::Lost, 0.0, 0.0), &camera, |status| !status.moving);
        assert_eq!(camera.status().refused, 1, "{auth:?}: one challenge serves all requests");
    }
}

#[test]
fn a_nonce_that_expires_is_no_fault() {
    let settings = Settings {
        auth: Auth::Digest { qop: true },
        nonce_lifetime: Duration::from_millis(50),
        ..Settings::default()
    };
    let camera = VirtualCamera::start(settings).unwrap();
    let mut rig = Rig::ready(&camera.url()).with("user", "root").with("password", "pass").play();
    rig.set_going(&camera);
    rig.push_until(&target(TargetState::Tracking, 0.05, 0.5), &camera, |status| {
        status.pan_rate_deg_s < 0.0 && status.refused > 2
    });
    let heard = rig.heard();
    assert!(!heard.iter().any(Heard::is_warning), "{heard:?}");
}

#[test]
fn a_wrong_password_is_said_once_and_not_tried_again_until_it_changes() {
    let camera = camera(Auth::Digest { qop: true });
    let mut rig = Rig::ready(&camera.url()).with("user", "root").with("password", "falsch").play();
    let here = target(TargetState::Tracking, 0.9, 0.5);
    let heard = rig.push_until_message(&here, Heard::is_warning);
    let Some(Heard::Warning(text)) = heard.last() else { panic!("{heard:?}") };
    assert!(text.contains("root") && !text.contains("falsch"), "{text}");
    assert_eq!(camera.status().refused, 2, "the challenge, and the wrong answer");
    for _ in 0..100 {
        rig.push(&here);
        assert_eq!(rig.hear(Duration::from_millis(5)), None);
    }
    assert_eq!(camera.status().refused, 2);
    assert_eq!(rig.stats().get::<&str>("state").unwrap(), "refused");

    let mut rig = rig.with("password", "pass");
    rig.set_going(&camera);
    assert_eq!(camera.status().refused, 3);
    assert!(!moves(&camera).is_empty());
}

#[test]
fn a_camera_that_wants_credentials_gets_none() {
    let camera = camera(Auth::Basic);
    let mut rig = Rig::playing(&camera.url());
    let here = target(TargetState::Tracking, 0.9, 0.5);
    let heard = rig.push_until_message(&here, Heard::is_warning);
    let Some(Heard::Warning(text)) = heard.last() else { panic!("{heard:?}") };
    assert!(text.contains("`user` and `password`"), "{text}");
    assert_eq!(camera.status().refused, 1);
}
