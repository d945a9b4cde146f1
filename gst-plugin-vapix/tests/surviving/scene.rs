// SPDX-License-Identifier: MPL-2.0

//! What comes between a sink and its camera, or into its stream, while the camera is steered.

use std::time::{Duration, Instant};

use gst::prelude::*;
use ptztrack_contract::{CameraChange, TargetMeta, TargetState};
use virtual_camera::{Auth, Fault, ReceivedCommand, VirtualCamera};

use super::names::{Lookup, Name};
use super::{BURST, Case, FRAME, Outcome};
use crate::common::{Heard, PATIENCE, Rig, Stamps, camera, target};

/// Requests that back-off lets through at once and in each further second, with the repetitions that
/// challenges and closed connections cost.
const REQUESTS_AT_ONCE: u64 = 16;
const REQUESTS_EACH_SECOND: u64 = 5;

/// How long control may take to be back when the camera is.
const BACK_WITHIN: Duration = Duration::from_secs(2);

/// What a busy machine needs more, which cannot hide pauses that went on to double.
const SLACK: Duration = Duration::from_secs(4);

/// By how much clocks and timestamps jump.
const JUMP: Duration = Duration::from_secs(3600);

const CONNECTED: Heard = Heard::Camera(CameraChange::Connected);

/// Something that goes wrong.
#[derive(Debug, Clone, PartialEq)]
pub enum Trouble {
    /// In the camera, or on the way to it.
    Camera(Fault),
    /// No connection is left, and this is what becomes of the camera's name.
    Name(Lookup),
    /// Time jumps by an hour, and back as it is over.
    Jump(Jump),
}

/// What of the time jumps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Jump {
    /// The pipeline's clock, as one does that follows a network's.
    Clock,
    /// The pictures' timestamps.
    Stamps,
    /// Both: a live source stamps by the pipeline's clock.
    Both,
    /// Where the stream's segment lies in the running time.
    Segment,
}

/// A sink that steers a camera, which it knows by name.
pub struct Scene {
    /// Before the camera, which it has to stop when it is dropped.
    pub rig: Rig,
    pub camera: VirtualCamera,
    pub name: Name,
    clock: gst::Clock,
    title: &'static str,
}

impl Jump {
    pub const ALL: [Self; 4] = [Self::Clock, Self::Stamps, Self::Both, Self::Segment];
}

impl Scene {
    /// The camera's name is known, or not. The sink waits `timeout` for answers.
    pub fn new(title: &'static str, lookup: Lookup, timeout: Duration) -> Self {
        let (camera, name) = (camera(Auth::Digest { qop: true }), Name::new(lookup));
        let rig = Rig::ready(&name.url(camera.http_address().port()))
            .with("user", "root")
            .with("password", "pass")
            .with("timeout", timeout.as_nanos() as u64);
        Self::before(title, camera, rig, name)
    }

    /// With a sink not yet playing.
    pub fn before(title: &'static str, camera: VirtualCamera, rig: Rig, name: Name) -> Self {
        let mut rig = rig.play();
        // One of its own, which it does no harm to set.
        let clock: gst::Clock = glib::Object::new::<gst::SystemClock>().upcast();
        rig.sink.set_clock(Some(&clock)).unwrap();
        rig.sink.set_base_time(clock.time());
        rig.stamps = Some(Stamps::default());
        Self { rig, camera, name, clock, title }
    }

    /// Lets it last for a while after it was noticed, where it is to be noticed at all.
    #[track_caller]
    pub fn survive(mut self, case: &Case, lasts: Duration) -> Outcome {
        let Case { trouble, noticed, .. } = case;
        let noticed = *noticed;
        self.rig.set_going(&self.camera);
        self.rig.heard();
        let before = self.camera.status().requests;
        let begin = Instant::now();
        self.begin(trouble);
        let (mut heard, pictures) =
            if case.video_lost { (self.misbehave_unseen(lasts), 0) } else { self.misbehave(noticed, lasts) };
        let requests = self.camera.status().requests - before;
        if noticed {
            bounded(requests.max(self.name.asked()), begin.elapsed(), self.title);
            assert!(self.rig.stats().get::<&str>("last-error").is_ok());
        }
        let over = self.camera.status().time;
        self.end(trouble);
        let back_after = self.steered_again(over).saturating_sub(over);
        assert!(!noticed || back_after < BACK_WITHIN + SLACK, "{}: back after {back_after:?}", self.title);
        if noticed && !heard.contains(&CONNECTED) {
            heard.extend(self.rig.push_until_message(&sides()[0], |heard| *heard == CONNECTED));
        }
        heard.extend(self.stand());
        let times = usize::from(noticed);
        let count = |wanted: fn(&Heard) -> bool| heard.iter().filter(|heard| wanted(heard)).count();
        assert_eq!(count(Heard::is_warning), times, "{}: {heard:?}", self.title);
        assert_eq!(count(|heard| *heard == CONNECTED), times, "{}: {heard:?}", self.title);
        assert_eq!(count(|heard| matches!(heard, Heard::Error(_))), 0, "{}: {heard:?}", self.title);
        let warning = heard.into_iter().find_map(Heard::into_warning);
        Outcome { warning, back_after, pictures, requests }
    }

    pub fn begin(&mut self, trouble: &Trouble) {
        match trouble {
            Trouble::Camera(fault) => self.camera.set_fault(fault.clone()),
            Trouble::Name(lookup) => {
                self.name.set(*lookup);
                self.camera.set_fault(Fault::Refuse);
            }
            Trouble::Jump(jump) => self.jump(*jump, JUMP),
        }
    }

    fn end(&mut self, trouble: &Trouble) {
        match trouble {
            Trouble::Camera(_) => self.camera.set_fault(Fault::None),
            Trouble::Name(_) => {
                self.camera.set_fault(Fault::None);
                self.name.set(Lookup::LOOPBACK);
            }
            Trouble::Jump(jump) => self.jump(*jump, Duration::ZERO),
        }
    }

    /// Puts time ahead by so much.
    fn jump(&mut self, jump: Jump, ahead: Duration) {
        let time = gst::ClockTime::try_from(ahead).unwrap();
        if matches!(jump, Jump::Clock | Jump::Both) {
            let internal = self.clock.internal_time();
            self.clock.set_calibration(internal, internal + time, 1, 1);
            // As all clocks of GStreamer it stands rather than goes back.
            assert!(self.clock.time() >= internal + time);
        }
        if matches!(jump, Jump::Stamps | Jump::Both) {
            self.rig.stamps.as_mut().unwrap().ahead = ahead;
        }
        if jump == Jump::Segment {
            let mut segment = gst::FormattedSegment::<gst::ClockTime>::new();
            segment.set_base(time);
            assert!(self.rig.harness().push_event(gst::event::Segment::new(&segment)));
        }
    }

    /// Pictures go on being pushed all the time: a sink that waited for the network would take fewer than
    /// the network answers.
    #[track_caller]
    fn misbehave(&mut self, noticed: bool, lasts: Duration) -> (Vec<Heard>, usize) {
        // Left and right by turns, so that there is always something new to say.
        let sides = sides();
        let (before, last) = (self.camera.status().requests, self.last_command());
        for side in sides.iter().cycle().take(BURST) {
            self.rig.push(side);
        }
        let answered = self.camera.status().requests - before;
        assert!(answered < BURST as u64 / 2, "{}: {answered} requests for {BURST} pictures", self.title);
        let (mut pictures, mut sides) = (BURST, sides.iter().cycle());
        let push = |scene: &mut Self| {
            sides.by_ref().take(1).for_each(|side| scene.rig.push(side));
            pictures += 1;
        };
        // What is not to be noticed must not keep the camera from being steered.
        let begun = |scene: &Self, heard: &[Heard]| {
            if noticed { heard.iter().any(Heard::is_warning) } else { scene.was_moved_after(last).is_some() }
        };
        (self.hear_for(lasts, push, begun), pictures)
    }

    /// The same without pictures: the camera is to be stopped, and cannot be.
    #[track_caller]
    fn misbehave_unseen(&mut self, lasts: Duration) -> Vec<Heard> {
        self.hear_for(lasts, |_| (), |_, heard| heard.iter().any(Heard::is_warning))
    }

    /// What is heard until so much time has passed since it has begun.
    #[track_caller]
    fn hear_for(
        &mut self,
        lasts: Duration,
        mut push: impl FnMut(&mut Self),
        begun: impl Fn(&Self, &[Heard]) -> bool,
    ) -> Vec<Heard> {
        let (begin, mut heard) = (Instant::now(), Vec::new());
        let mut since = None;
        while since.is_none_or(|since: Instant| since.elapsed() < lasts) {
            push(self);
            heard.extend(self.rig.hear(FRAME));
            if begun(self, &heard) {
                since.get_or_insert_with(Instant::now);
            }
            assert!(begin.elapsed() < PATIENCE + lasts, "{}: heard only {heard:?}", self.title);
        }
        assert!(!heard.contains(&CONNECTED), "{}: {heard:?}", self.title);
        heard
    }

    /// When the camera accepted a move again.
    #[track_caller]
    pub fn steered_again(&mut self, over: Duration) -> Duration {
        let last = self.last_command();
        let begin = Instant::now();
        for side in sides().iter().cycle() {
            self.rig.push(side);
            if let Some(command) = self.was_moved_after(last) {
                return command.time.max(over);
            }
            assert!(begin.elapsed() < PATIENCE, "{}: never back in control", self.title);
            self.camera.wait_for(FRAME, |_| false);
        }
        unreachable!("the sides are taken by turns without end")
    }

    /// Nobody is there any more: the camera is stopped.
    #[track_caller]
    fn stand(&mut self) -> Vec<Heard> {
        self.rig.push_until(&target(TargetState::Lost, 0.1, 0.5), &self.camera, |status| !status.moving);
        self.rig.heard()
    }

    fn last_command(&self) -> u64 {
        self.camera.commands().last().map_or(0, |command| command.number)
    }

    /// The first move that the camera accepted after a command.
    fn was_moved_after(&self, last: u64) -> Option<ReceivedCommand> {
        self.camera.commands_after(last).into_iter().find(is_move)
    }
}

fn sides() -> [TargetMeta; 2] {
    [0.1, 0.9].map(|x| target(TargetState::Tracking, x, 0.5))
}

/// Back-off: there are not more of them than it lets through in this time.
#[track_caller]
pub fn bounded(requests: u64, time: Duration, title: &str) {
    let most = REQUESTS_AT_ONCE + REQUESTS_EACH_SECOND * (time.as_secs() + 1);
    assert!(requests <= most, "{title}: {requests} requests");
}

fn is_move(command: &ReceivedCommand) -> bool {
    command.status == 204 && !command.query.contains("query=") && !command.query.ends_with("move=0,0")
}
