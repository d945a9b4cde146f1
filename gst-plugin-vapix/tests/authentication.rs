// SPDX-License-Identifier: MPL-2.0

//! Who the sink is to the camera.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::Duration;

use common::{FRAME, Heard, Rig, camera, target};
use gst::prelude::*;
use ptztrack_contract::TargetState;
use virtual_camera::{Auth, Fault, Settings, VirtualCamera};

#[test]
fn every_kind_of_authentication() {
    for auth in [Auth::Basic, Auth::Digest { qop: true }, Auth::Digest { qop: false }, Auth::Both] {
        let camera = camera(auth);
        let allowed = if auth == Auth::Basic { "basic" } else { "auto" };
        let rig = Rig::ready(&camera.url()).with("user", "root").with("password", "pass");
        let mut rig = rig.with_str("auth", allowed).play();
        rig.set_going(&camera);
        rig.push_until(&target(TargetState::Lost, 0.0, 0.0), &camera, |status| !status.moving);
        assert_eq!(camera.status().refused, 1, "{auth:?}: one challenge serves all requests");
    }
}

/// Nor is it told by a camera whose answers somebody else gives.
#[test]
fn nobody_is_told_the_password_in_clear() {
    let camera = camera(Auth::Basic);
    let mut rig = Rig::ready(&camera.url()).with("user", "root").with("password", "pass").play();
    let here = target(TargetState::Tracking, 0.9, 0.5);
    let heard = rig.push_until_message(&here, Heard::is_warning);
    let Some(Heard::Warning(text)) = heard.last() else { panic!("{heard:?}") };
    assert!(text.contains("Basic") && text.contains("`auth=basic`"), "{text}");
    assert_eq!(camera.status().commands, 0);
}

#[test]
fn a_nonce_that_expires_is_no_fault() {
    let settings = Settings {
        auth: Auth::Digest { qop: true },
        nonce_lifetime: Duration::from_millis(300),
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

/// Where nobody is told by 403 what he may not.
#[test]
fn an_account_that_may_only_move_the_camera_does() {
    for auth in [Auth::Basic, Auth::Digest { qop: true }] {
        let camera = VirtualCamera::start(Settings { auth, ptz_only: true, ..Settings::default() }).unwrap();
        let allowed = if auth == Auth::Basic { "basic" } else { "auto" };
        let rig = Rig::ready(&camera.url()).with("user", "root").with("password", "pass");
        let mut rig = rig.with_str("auth", allowed).play();
        rig.set_going(&camera);
        rig.push_until(&target(TargetState::Lost, 0.0, 0.0), &camera, |status| !status.moving);
        let heard = rig.heard();
        assert!(!heard.iter().any(Heard::is_warning), "{auth:?}: {heard:?}");
        assert!((2..=3).contains(&camera.status().refused), "{auth:?}: asked for once");
    }
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

/// With a wrong one nobody can.
#[test]
fn a_camera_that_turns_is_stopped_before_the_password_changes() {
    let camera = camera(Auth::Digest { qop: true });
    let mut rig = Rig::ready(&camera.url()).with("user", "root").with("password", "pass").play();
    rig.set_going(&camera);
    rig.sink.set_property("password", "falsch");
    rig.push_until(&target(TargetState::Tracking, 0.9, 0.4), &camera, |status| !status.moving);
    let here = target(TargetState::Tracking, 0.9, 0.4);
    let heard = rig.push_until_message(&here, Heard::is_warning);
    assert!(matches!(heard.last(), Some(Heard::Warning(text)) if text.contains("refuses user")), "{heard:?}");
    assert!(!camera.status().moving);
    rig.sink.set_property("password", "pass");
    rig.set_going(&camera);
}

/// The camera did not hear the stop before; by a wrong password nobody could tell it another time.
#[test]
fn a_camera_that_still_turns_is_stopped_by_whom_it_knows() {
    let camera = camera(Auth::Digest { qop: true });
    let rig = Rig::ready(&camera.url()).with("user", "root").with("password", "pass");
    let mut rig = rig.with("timeout", 200_000_000u64).play();
    rig.set_going(&camera);
    camera.set_fault(Fault::Hang);
    let failed = |rig: &Rig| rig.stats().get::<u64>("commands-failed").unwrap();
    let before = failed(&rig);
    rig.sink.set_property("password", "falsch");
    while failed(&rig) < before + 2 {
        rig.push(&target(TargetState::Tracking, 0.9, 0.4));
        rig.hear(FRAME);
    }
    camera.set_fault(Fault::None);
    let lost = target(TargetState::Lost, 0.0, 0.0);
    rig.push_until(&lost, &camera, |status| !status.moving);
}
