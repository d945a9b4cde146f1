// SPDX-License-Identifier: MPL-2.0

//! The whole loop but the network: measurement, estimation, control, session.

use servo::{
    Access, Actuation, AxisFinding, Estimates, HardLimits, Measurement, Mode, PanTilt, Position, Servo, Time,
};

use crate::session::{CommandedMotion, Fact, Session, Steering};
use crate::{Command, Error, LoopSettings, Next, Protocol, Request, Response, SessionEvent, Stop};

/// A servo and the session it speaks by. Has no clock and sends nothing itself: both are the caller's.
#[derive(Debug)]
pub struct ControlLoop {
    servo: Servo,
    session: Session,
    /// Measurements that came while a request was in flight, and were followed by newer ones in that time.
    overtaken: u64,
    at_limit: bool,
    /// It was told that the limits of pan and tilt cannot be kept.
    limits_unkept: bool,
    /// It was told that the camera cannot zoom.
    lacks_zoom: bool,
    /// It was told that the limits of the zoom cannot be kept.
    zoom_limits_unkept: bool,
    events: Vec<LoopEvent>,
}

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
pub enum LoopEvent {
    /// Between us and the camera.
    Session(SessionEvent),
    /// The target lies beyond the camera's range.
    AtLimit,
    /// The camera does not tell where it looks: the limits of pan and tilt that are set cannot be kept.
    LimitsUnkept,
    /// The camera is to zoom, and cannot, by its own word or as the picture shows.
    NoZoom,
    /// The camera tells nothing of its lens: the limits of the zoom that are set cannot be kept.
    ZoomLimitsUnkept,
    /// The camera has no preset of the name that is to be its home.
    NoSuchPreset(String),
    /// An axis turns the picture otherwise than was set: it is steered accordingly from now on.
    Axes(AxisFinding),
    /// The picture stays the same though the camera was told to turn: it is stopped, and nobody is followed.
    PictureFrozen,
    /// The picture changes again.
    PictureLive,
    /// The camera swung to and fro about the target: from now on only this part of the gain is used.
    Oscillating(f64),
}

/// The camera as it is known.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Status {
    /// It answers and does as it is told.
    pub connected: bool,
    /// It may be moving on our behalf.
    pub moving: bool,
    /// Somebody else moves it.
    pub taken_over: bool,
    /// Where it last said it looks.
    pub position: Position,
    /// What it was last told, degrees per second.
    pub rate: PanTilt,
    /// Horizontal field of view in degrees, where it is set, told or learned.
    pub fov_deg: Option<f64>,
    /// How far it can look and zoom, by its own word.
    pub limits: HardLimits,
    /// How it is moved, where it is.
    pub mode: Option<Mode>,
}

impl ControlLoop {
    /// Knows nothing of the camera yet.
    pub fn new(settings: impl Into<LoopSettings>, protocol: &Protocol) -> Self {
        let LoopSettings { servo, session } = settings.into();
        let session = Session::new(servo.mode, session, protocol);
        let events = Vec::new();
        Self {
            servo: Servo::new(servo),
            session,
            overtaken: 0,
            at_limit: false,
            limits_unkept: false,
            lacks_zoom: false,
            zoom_limits_unkept: false,
            events,
        }
    }

    /// Takes new settings.
    pub fn configure(&mut self, settings: impl Into<LoopSettings>) {
        let LoopSettings { servo, session } = settings.into();
        self.session.configure(session, servo.mode);
        self.servo.configure(servo);
        self.judge_limits();
    }

    /// Takes the newest picture of the target.
    pub fn measure(&mut self, measurement: Measurement, now: Time) {
        self.session.see_background(measurement.background_fields_s(), measurement.taken_at, now);
        let actuator = self.session.actuator(now);
        let overtakes = self.servo.is_behind();
        if !self.session.is_connected() {
            self.servo.out_of_touch(now);
        }
        let was_frozen = self.servo.is_picture_frozen();
        let gain_scale = self.servo.measure(measurement, &actuator, now);
        match (was_frozen, self.servo.is_picture_frozen()) {
            (false, true) => self.events.push(LoopEvent::PictureFrozen),
            (true, false) => self.events.push(LoopEvent::PictureLive),
            _ => {}
        }
        self.overtaken += u64::from(overtakes && self.servo.holds_target());
        self.events.extend(gain_scale.map(LoopEvent::Oscillating));
        if let Some(finding) = self.servo.take_axis_finding() {
            self.session.reorient();
            self.events.push(LoopEvent::Axes(finding));
        }
        self.judge_zoom();
    }

    /// Forgets the target; the camera is to be stopped, whatever it does.
    pub fn release(&mut self) {
        self.servo.release();
    }

    /// Neither pictures nor answers come: where the target is, nobody knows.
    pub fn lose_target(&mut self) {
        self.servo.lose();
    }

    /// What to send now, if anything.
    pub fn next_request(&mut self, now: Time) -> Next {
        if self.session.halted() {
            return Next::Wait(None);
        }
        self.session.catch_up(now);
        let actuation = self.servo.control(&self.session.actuator(now), now);
        self.tell_limit();
        match self.session.next_request(actuation, &steering(&self.servo, None, now), now) {
            Next::Wait(until) => {
                self.check_invariants();
                let reasons = [until, self.servo.stale_at(), self.servo.undecided_until(now)];
                Next::Wait(reasons.into_iter().flatten().min())
            }
            next => next,
        }
    }

    fn tell_limit(&mut self) {
        if begins(&mut self.at_limit, self.servo.at_limit()) {
            self.events.push(LoopEvent::AtLimit);
        }
    }

    /// Something is being sent.
    pub fn sending(&mut self, request: &Request, now: Time) {
        self.session.sending(request, now);
    }

    /// The camera answered what was sent then, or did not.
    pub fn on_response(
        &mut self,
        request: &Request,
        response: Result<Response, Error>,
        sent: Time,
        now: Time,
    ) {
        let response = match response {
            Ok(Response::Position(position)) => Ok(Response::Position(self.servo.along_picture(position))),
            other => other,
        };
        let steering = steering(&self.servo, Some(request), now);
        for fact in self.session.on_response(request, response, &steering, (sent, now)) {
            self.take(fact, now);
        }
        self.judge_limits();
        self.check_invariants();
    }

    /// The answer is waited for no longer.
    pub fn abandoned(&mut self, request: &Request, now: Time) {
        for fact in self.session.abandoned(request, now) {
            self.take(fact, now);
        }
    }

    /// Has the servo take notice.
    fn take(&mut self, fact: Fact, now: Time) {
        match fact {
            Fact::Accepted { actuation, sent } => self.servo.accepted(&actuation, sent, now),
            Fact::Unanswered(actuation) => self.servo.unanswered(&actuation, now),
            Fact::Position { position, at } => {
                self.take_position(Some(position), at, now);
                self.session.positioned(&steering(&self.servo, None, now), now);
            }
            Fact::NoPosition => {
                self.take_position(None, now, now);
                self.session.not_positioned(&steering(&self.servo, None, now), now);
            }
            Fact::Superseded => self.servo.accepted(&Actuation::Rest, now, now),
            Fact::Operator => self.servo.home().strayed(),
            Fact::Capabilities(capabilities) => self.servo.told_capabilities(capabilities),
            Fact::Presets(presets) => {
                let missing = self.servo.home().told_presets(&presets);
                self.events.extend(missing.map(LoopEvent::NoSuchPreset));
            }
            Fact::PresetsNotBefore(at) => self.servo.home().ask_presets_at(at),
            Fact::HomeRefused => self.servo.home().settled(),
        }
    }

    fn take_position(&mut self, position: Option<Position>, at: Time, now: Time) {
        let actuator = self.session.actuator(now);
        if self.servo.told_position(position, at, &actuator, now) {
            self.session.arrived();
        }
    }

    /// Whether the limits can be kept is known after the last question.
    fn judge_limits(&mut self) {
        if !self.session.is_discovered() {
            return;
        }
        let unkept = !self.session.tells_position() && self.servo.settings().limits.bound_turns();
        if begins(&mut self.limits_unkept, unkept) {
            self.events.push(LoopEvent::LimitsUnkept);
        }
    }

    fn judge_zoom(&mut self) {
        if begins(&mut self.lacks_zoom, self.servo.lacks_zoom()) {
            self.events.push(LoopEvent::NoZoom);
        }
        let unkept = self.servo.zooms_by_picture() && self.servo.settings().limits.bound_zoom();
        if begins(&mut self.zoom_limits_unkept, unkept) {
            self.events.push(LoopEvent::ZoomLimitsUnkept);
        }
    }

    /// What holds whatever is seen, said and answered; asked after every step where debug assertions are on.
    fn check_invariants(&self) {
        if cfg!(debug_assertions) {
            self.session.check_invariants();
            self.servo.check_invariants();
        }
    }

    /// Whether there is something to do that a stop need not hurry for.
    pub fn has_errand(&self, now: Time) -> bool {
        if self.session.withholds_stop() {
            return true;
        }
        let actuator = self.session.actuator(now);
        let has_errand = || self.servo.has_target(now) || self.servo.is_homeward(&actuator, now);
        actuator.access != Access::Others && has_errand()
    }

    /// When the target will not have been seen for too long, where there is one.
    pub fn stale_at(&self) -> Option<Time> {
        self.servo.stale_at()
    }

    /// Measurements that were overtaken before they could be steered by.
    pub fn overtaken(&self) -> u64 {
        self.overtaken
    }

    /// The servo, for what concerns it alone.
    pub fn servo(&self) -> &Servo {
        &self.servo
    }

    /// The session, for what concerns it alone.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// The session, for what concerns it alone.
    pub fn session_mut(&mut self) -> &mut Session {
        &mut self.session
    }

    /// What ends the last move.
    pub fn stop(&self) -> Stop {
        self.session.stop()
    }

    /// What happened since the last call.
    pub fn take_events(&mut self) -> Vec<LoopEvent> {
        self.events.extend(self.session.take_events().into_iter().map(LoopEvent::Session));
        std::mem::take(&mut self.events)
    }

    /// The camera as it was learned.
    pub fn estimates(&self) -> Estimates {
        self.servo.estimates()
    }

    /// The camera as it is known.
    pub fn status(&self, now: Time) -> Status {
        let (servo, session) = (&self.servo, &self.session);
        let camera = servo.camera();
        Status {
            connected: session.is_connected(),
            moving: !session.is_at_rest(),
            taken_over: session.is_taken_over(now),
            position: camera.position,
            limits: camera.capabilities.limits,
            rate: camera.history.rate_at(now),
            fov_deg: servo.known_fov_deg(),
            mode: Some(session.actuator(now).mode),
        }
    }
}

/// How the camera is being steered, as it answers this.
fn steering<'a>(servo: &'a Servo, answered: Option<&Request>, now: Time) -> Steering<'a> {
    Steering {
        // Who does not zoom cannot be contradicted: an operator may, and is followed for all the same.
        commands: CommandedMotion { pan_tilt: &servo.camera().history, zoom: servo.zoom_commands() },
        holds_target: servo.holds_target(),
        is_under_way: servo.is_under_way(),
        is_zooming: servo.is_zooming(now),
        leads_home: answered.is_some_and(|request| match request {
            Request::Command(Command::Move { motion, .. }) => servo.leads_home(motion),
            Request::Command(Command::Stop(_)) | Request::Query(_) => false,
        }),
        presets_due: servo.presets_due(),
    }
}

/// Takes note of whether something is so now; returns whether it was not before.
fn begins(known: &mut bool, now: bool) -> bool {
    !std::mem::replace(known, now) && now
}
