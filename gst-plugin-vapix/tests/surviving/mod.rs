//! A sink steers a camera, something goes wrong between them, and is over again.
#![allow(missing_docs, dead_code, clippy::unwrap_used, clippy::expect_used)]

pub mod front;

use std::time::{Duration, Instant};

use gst::prelude::*;
use ptztrack_contract::{CameraChange, TargetState};
use virtual_camera::{Auth, Fault, ReceivedCommand, VirtualCamera};

use crate::common::{Heard, PATIENCE, Rig, camera, target};

/// Pictures pushed without a pause as the fault begins: 20 s of video.
const BURST: usize = 500;

/// What elapses between two pictures afterwards; no test depends on it.
const FRAME: Duration = Duration::from_millis(20);

/// Requests that back-off lets through at once and in each further second, with the repetitions that
/// challenges and closed connections cost.
const REQUESTS_AT_ONCE: u64 = 16;
const REQUESTS_EACH_SECOND: u64 = 5;

/// Something that goes wrong.
pub struct Case {
    pub name: &'static str,
    pub fault: Fault,
    /// Whether it keeps the camera from being steered.
    pub noticed: bool,
}

fn case(name: &'static str, fault: Fault) -> Case {
    Case { name, fault, noticed: true }
}

fn unnoticed(name: &'static str, fault: Fault) -> Case {
    Case { name, fault, noticed: false }
}

fn redirect(status: u16) -> Fault {
    Fault::Redirect { status, location: "https://elsewhere.example/axis-cgi/com/ptz.cgi".to_owned() }
}

/// All that can be put between a sink and its camera.
pub fn cases() -> Vec<Case> {
    let error = "Error:somebody else\r\nis in control".to_owned();
    vec![
        case("connection refused", Fault::Refuse),
        case("connection reset", Fault::Reset),
        case("black hole: no packet comes back", Fault::BlackHole),
        case("connected, and never an answer", Fault::Hang),
        case("answers after 5 s", Fault::Delay(Duration::from_secs(5))),
        case("camera reboots: refuses, then other realm and nonce", Fault::Reboot),
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

/// Lets a fault last for a while after it was noticed. The sink waits `timeout` for answers.
#[track_caller]
pub fn survive(case: &Case, timeout: Duration, lasts: Duration) -> Outcome {
    let camera = camera(Auth::Digest { qop: true });
    let mut rig = Rig::ready(&camera.url())
        .with("user", "root")
        .with("password", "pass")
        .with("timeout", timeout.as_millis() as u32)
        .play();
    rig.set_going(&camera);
    rig.heard();
    let trouble = Trouble { camera: &camera, rig: &mut rig, name: case.name };
    trouble.run(case.fault.clone(), case.noticed, lasts)
}

struct Trouble<'a> {
    camera: &'a VirtualCamera,
    rig: &'a mut Rig,
    name: &'a str,
}

impl Trouble<'_> {
    #[track_caller]
    fn run(mut self, fault: Fault, noticed: bool, lasts: Duration) -> Outcome {
        let before = self.camera.status().requests;
        let begin = Instant::now();
        self.camera.set_fault(fault);
        let (mut heard, pictures) = self.misbehave(noticed, lasts);
        let requests = self.camera.status().requests - before;
        let most = REQUESTS_AT_ONCE + REQUESTS_EACH_SECOND * (begin.elapsed().as_secs() + 1);
        assert!(!noticed || requests <= most, "{}: {requests} requests", self.name);

        let over = self.camera.status().time;
        self.camera.set_fault(Fault::None);
        let back_after = self.steered_again(over).saturating_sub(over);
        if noticed && !heard.contains(&CONNECTED) {
            let side = target(TargetState::Tracking, 0.1, 0.5);
            heard.extend(self.rig.push_until_message(&side, |heard| *heard == CONNECTED));
        }
        let nobody = target(TargetState::Lost, 0.1, 0.5);
        self.rig.push_until(&nobody, self.camera, |status| !status.moving);
        heard.extend(self.rig.heard());
        let times = usize::from(noticed);
        assert_eq!(
            heard.iter().filter(|heard| heard.is_warning()).count(),
            times,
            "{}: {heard:?}",
            self.name
        );
        assert_eq!(
            heard.iter().filter(|heard| **heard == CONNECTED).count(),
            times,
            "{}: {heard:?}",
            self.name
        );
        assert!(!heard.iter().any(|heard| matches!(heard, Heard::Error(_))), "{}: {heard:?}", self.name);
        let warning = heard.into_iter().find_map(|heard| match heard {
            Heard::Warning(text) => Some(text),
            _ => None,
        });
        Outcome { warning, back_after, pictures, requests }
    }

    /// Pictures go on being pushed all the time: a sink that waited for the network would take fewer than
    /// the network answers.
    #[track_caller]
    fn misbehave(&mut self, noticed: bool, lasts: Duration) -> (Vec<Heard>, usize) {
        // Left and right by turns, so that there is always something new to say.
        let sides = [0.1, 0.9].map(|x| target(TargetState::Tracking, x, 0.5));
        let before = self.camera.status().requests;
        for side in sides.iter().cycle().take(BURST) {
            self.rig.push(side);
        }
        let answered = self.camera.status().requests - before;
        assert!(answered < BURST as u64 / 2, "{}: {answered} requests for {BURST} pictures", self.name);
        let (begin, mut heard, mut pictures) = (Instant::now(), Vec::new(), BURST);
        let mut since = None;
        for side in sides.iter().cycle() {
            self.rig.push(side);
            pictures += 1;
            heard.extend(self.rig.hear(FRAME));
            if !noticed || heard.iter().any(Heard::is_warning) {
                since.get_or_insert_with(Instant::now);
            }
            if since.is_some_and(|since| since.elapsed() >= lasts) {
                break;
            }
            assert!(begin.elapsed() < PATIENCE + lasts, "{}: heard only {heard:?}", self.name);
        }
        assert!(!heard.contains(&CONNECTED), "{}: {heard:?}", self.name);
        (heard, pictures)
    }

    /// When the camera accepted a move again.
    #[track_caller]
    fn steered_again(&mut self, over: Duration) -> Duration {
        let last = self.camera.commands().last().map_or(0, |command| command.number);
        let sides = [0.1, 0.9].map(|x| target(TargetState::Tracking, x, 0.5));
        let begin = Instant::now();
        for side in sides.iter().cycle() {
            self.rig.push(side);
            if let Some(command) = self.camera.commands_after(last).iter().find(|command| is_move(command)) {
                return command.time.max(over);
            }
            assert!(begin.elapsed() < PATIENCE, "{}: never back in control", self.name);
            self.camera.wait_for(FRAME, |_| false);
        }
        unreachable!("the sides are taken by turns without end")
    }
}

pub const CONNECTED: Heard = Heard::Camera(CameraChange::Connected);

fn is_move(command: &ReceivedCommand) -> bool {
    command.status == 204 && !command.query.contains("query=") && !command.query.ends_with("move=0,0")
}

/// A name that nobody has: there is no camera to come back, but the address can be corrected.
pub fn unknown_host(timeout: Duration) -> Outcome {
    let camera = camera(Auth::Digest { qop: true });
    let mut rig = Rig::ready("http://camera.invalid")
        .with("user", "root")
        .with("password", "pass")
        .with("timeout", timeout.as_millis() as u32)
        .play();
    let here = target(TargetState::Tracking, 0.9, 0.5);
    let begin = Instant::now();
    for _ in 0..BURST {
        rig.push(&here);
    }
    let mut heard = rig.push_until_message(&here, Heard::is_warning);
    let mut pictures = BURST;
    while begin.elapsed() < Duration::from_secs(4) {
        rig.push(&here);
        pictures += 1;
        heard.extend(rig.hear(FRAME));
    }
    let warnings: Vec<&Heard> = heard.iter().filter(|heard| heard.is_warning()).collect();
    let [Heard::Warning(warning)] = warnings[..] else { panic!("{heard:?}") };
    let warning = Some(warning.clone());
    rig.sink.set_state(gst::State::Ready).unwrap();
    rig.sink.set_property("location", camera.url());
    let corrected = camera.status().time;
    rig.sink.set_state(gst::State::Playing).unwrap();
    let mut trouble = Trouble { camera: &camera, rig: &mut rig, name: "unknown host" };
    let back_after = trouble.steered_again(corrected).saturating_sub(corrected);
    let heard = rig.heard();
    assert!(!heard.iter().any(Heard::is_warning), "{heard:?}");
    Outcome { warning, back_after, pictures, requests: 0 }
}

/// One wrong login, and silence until the password is another.
pub fn wrong_password() -> Outcome {
    let camera = camera(Auth::Digest { qop: true });
    camera.set_fault(Fault::LockOut(2));
    let mut rig = Rig::ready(&camera.url()).with("user", "root").with("password", "falsch").play();
    let here = target(TargetState::Tracking, 0.9, 0.5);
    let heard = rig.push_until_message(&here, Heard::is_warning);
    let Some(Heard::Warning(text)) = heard.last().cloned() else { panic!("{heard:?}") };
    let mut pictures = 0;
    while pictures < 100 {
        rig.push(&here);
        pictures += 1;
        assert_eq!(rig.hear(FRAME), None);
    }
    let requests = camera.status().requests;
    assert_eq!(requests, 2, "the challenge, and the wrong answer");
    let corrected = camera.status().time;
    rig.sink.set_property("password", "pass");
    let mut trouble = Trouble { camera: &camera, rig: &mut rig, name: "wrong password" };
    let back_after = trouble.steered_again(corrected).saturating_sub(corrected);
    Outcome { warning: Some(text), back_after, pictures, requests }
}
