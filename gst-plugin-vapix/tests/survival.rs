//! Whatever goes wrong with the camera: video goes on, one warning, and control is back when the camera is.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;
mod surviving;

use std::time::Duration;

use common::{Heard, Rig, camera, target};
use ptztrack_contract::TargetState;
use surviving::front::{certificates::certificate, tls_front};
use surviving::{cases, survive, unknown_host, wrong_password};
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
    reboot: "camera reboots: refuses, then other realm and nonce";
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
}

#[test]
fn unknown_name() {
    unknown_host(TIMEOUT);
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
