// SPDX-License-Identifier: MPL-2.0

//! What the camera's answers mean.

use std::time::Duration;

use servo::{Actuation, Mode, PanTilt, Position, Servo};

use super::Session;
use super::arbitration::Finding;
use super::connection::Connection;
use super::mode_support::Refusal;
use super::operator::CommandedMotion;
use super::scheduler::Scheduler;
use crate::{Command, Error, Query, QueueRequest, Request, Response, SessionEvent};

impl Session {
    /// A position is asked for this often while the zoom moves, by which the picture changes most, ...
    const POLL_ZOOMING: Duration = Duration::from_millis(400);
    /// ... while the camera only turns, and ...
    const POLL_MOVING: Duration = Duration::from_secs(1);
    /// ... while it rests, so that an operator's zoom or a lost connection is noticed.
    const POLL_RESTING: Duration = Duration::from_secs(5);
    /// While it may go on at an operator's word or at ours: in this time his shows if it is of 3 degrees per second.
    const POLL_CONTESTED: Duration = Duration::from_millis(500);
    /// While it goes to a position.
    const POLL_UNDER_WAY: Duration = Duration::from_millis(150);
    /// A camera that does not tell its position is asked again this much later.
    const POLL_REFUSED: Duration = Duration::from_secs(30);

    /// The camera answered what was sent then, or did not.
    pub fn on_response(
        &mut self,
        request: &Request,
        response: Result<Response, Error>,
        servo: &mut Servo,
        (sent, now): (Duration, Duration),
    ) {
        if matches!(request, Request::Query(_)) {
            self.asked_at = now;
        }
        if response.is_ok() {
            self.scheduler.answered(sent, now);
        }
        match (request, response) {
            (Request::Command(command), Ok(_)) => self.command_accepted(command, servo, (sent, now)),
            (Request::Command(command), Err(err)) => self.command_failed(command, &err, servo, now),
            (Request::Query(query), Ok(response)) => self.told(*query, response, servo, (sent, now)),
            (Request::Query(query), Err(err)) => self.not_told(*query, &err, servo, now),
        }
        if cfg!(debug_assertions) {
            self.check_invariants();
            servo.check_invariants();
        }
    }

    fn command_failed(&mut self, command: &Command, err: &Error, servo: &mut Servo, now: Duration) {
        if err.may_have_acted() {
            self.unanswered(command, servo, now);
        } else {
            self.scheduler.failed(command, false, now);
        }
        if !matches!(err, Error::Camera(_)) || !self.is_understood(command, err, servo, now) {
            self.failed(err, true, now);
        }
    }

    /// Whether it is known why the camera refuses a command, so that it is no fault.
    fn is_understood(&mut self, command: &Command, err: &Error, servo: &mut Servo, now: Duration) -> bool {
        let queue = &mut self.arbitration.queue;
        if queue.refused_command() || queue.refused(now) {
            return true;
        }
        if matches!(command, Command::Velocity { .. }) && self.refused_freedom(command, servo) {
            return true;
        }
        if servo.leads_home(&command.actuation()) {
            servo.home().settled();
            self.events.push(SessionEvent::HomeRefused(err.clone()));
            return true;
        }
        self.refused_a_mode(command, err, servo, now)
    }

    /// Whether the refusal of a move may be only of its freedom from proportional speed: then it is sent again
    /// without. Where it is refused even so, it was not for that.
    fn refused_freedom(&mut self, command: &Command, servo: &mut Servo) -> bool {
        let free = matches!(command, Command::Velocity { free: true, .. });
        self.description.refuses_free_moves = free;
        servo.told_capabilities(self.description.capabilities());
        free
    }

    /// Whether a refusal is, or may be, only of the words of a mode.
    fn refused_a_mode(&mut self, command: &Command, err: &Error, servo: &Servo, now: Duration) -> bool {
        match self.modes.refused(command, err, now) {
            Refusal::Other => false,
            Refusal::Doubtful => {
                let tells_position = servo.camera().pan_tilt().is_some();
                let witness = if tells_position { Query::Position } else { Query::Parameters };
                self.discovery.ask_first(witness);
                true
            }
            // There is none left to turn to: the wanted one is retried, with the pauses of a fault.
            Refusal::OfMode(_) if self.modes.lacks(self.mode(servo, now), now) => false,
            Refusal::OfMode(mode) => {
                if mode == Mode::Velocity {
                    self.scheduler.stop_by(Command::Stop);
                }
                true
            }
        }
    }

    /// What the camera does from here on is unknown.
    pub(super) fn unanswered(&mut self, command: &Command, servo: &mut Servo, now: Duration) {
        self.scheduler.failed(command, true, now);
        self.arbitration.excuse(now + Scheduler::DOUBT);
        servo.unanswered(&command.actuation(), now);
    }

    fn command_accepted(&mut self, command: &Command, servo: &mut Servo, (sent, now): (Duration, Duration)) {
        let was_moving = self.scheduler.may_move();
        self.scheduler.accepted(command, now);
        if let Some(confirmation) = &mut self.stop_confirmation {
            if command.is_stop() { confirmation.stopped(now) } else { confirmation.moved() }
        }
        self.arbitration.commanded();
        self.arbitration.queue.obeyed();
        let actuation = command.actuation();
        let homeward = servo.leads_home(&actuation);
        servo.accepted(&actuation, sent, now);
        if actuation.is_point_to_point() {
            self.arbitration.excuse(now);
            self.next_poll = now + Self::POLL_UNDER_WAY;
        } else if command.is_stop() || !was_moving {
            self.next_poll = now + Self::POLL_MOVING;
        }
        if !homeward && !command.is_stop() {
            let mode = self.mode(servo, now);
            self.events.extend(self.modes.changed(mode).map(SessionEvent::Mode));
        }
        self.modes.accepted(command);
        self.succeeded(true, servo);
        match (was_moving, self.scheduler.may_move()) {
            (false, true) => self.events.push(SessionEvent::Moving),
            (true, false) => self.events.push(SessionEvent::Stopped),
            _ => {}
        }
    }

    fn told(
        &mut self,
        query: Query,
        response: Response,
        servo: &mut Servo,
        (sent, now): (Duration, Duration),
    ) {
        match response {
            Response::Position(position) => self.told_position(position, servo, (sent, now)),
            Response::Limits(limits) => self.description.limits = limits,
            Response::Parameters(parameters) => {
                self.description.parameters = parameters;
                self.modes.told(&parameters);
                self.arbitration.queue.told(parameters.control_queue);
            }
            Response::Presets(presets) => {
                self.events.extend(servo.home().told_presets(&presets).map(SessionEvent::NoSuchPreset));
            }
            Response::Place(place) => {
                if let Query::Queue(request) = query {
                    self.arbitration.queue.answered(request, place, now);
                }
            }
            Response::Attributes(attributes) => self.description.attributes = attributes,
            Response::MoveSpeed(step) => self.description.move_speed = Some(step),
            Response::Accepted => {}
        }
        if matches!(query, Query::Limits | Query::Parameters | Query::Attributes | Query::MoveSpeed) {
            servo.told_capabilities(self.description.capabilities());
        }
        self.succeeded(false, servo);
        self.asked(query, servo, now);
    }

    fn told_position(&mut self, position: Position, servo: &mut Servo, (sent, now): (Duration, Duration)) {
        match position.pan_tilt() {
            Some(place) => self.look_for_others((place, position.zoom_steps), servo, (sent, now)),
            None => {
                self.arbitration.undecided();
                self.scheduler.settle(true);
            }
        }
        self.positioned(Some(position), servo, (sent + now) / 2, now);
    }

    fn not_told(&mut self, query: Query, err: &Error, servo: &mut Servo, now: Duration) {
        if query == Query::Position {
            self.arbitration.undecided();
            self.scheduler.settle(true);
        }
        if let Some(refusal) = self.modes.failed().filter(|_| err.is_refusal() && !err.is_final()) {
            self.asked(query, servo, now);
            return self.failed(&refusal, true, now);
        }
        if query != Query::Position {
            // Optional; a camera that is gone will be missed by the next position. One that lets anybody move it may
            // want a user for this.
            let anonymous = self.connection.connected() && matches!(err, Error::CredentialsMissing);
            if err.is_answer() || anonymous {
                return self.will_not_tell(query, err, servo, now);
            } else if !matches!(err, Error::Unreachable(_)) && !err.is_final() {
                return self.may_tell_later(query, servo, now);
            }
        } else if matches!(err, Error::NotPermitted { .. }) {
            self.next_poll = now + Connection::RARELY;
        } else if matches!(err, Error::Camera(_)) && self.arbitration.queue.refused(now) {
            return;
        } else if self.will_not_tell_position(err) {
            self.positioned(None, servo, now, now);
            // One that told it before is well again soon.
            if !servo.is_under_way() && servo.camera().pan_tilt().is_none() {
                self.next_poll = now + Self::POLL_REFUSED;
            }
            return self.asked(query, servo, now);
        }
        self.failed(err, false, now);
    }

    fn will_not_tell(&mut self, query: Query, err: &Error, servo: &mut Servo, now: Duration) {
        let forbidden = matches!(err, Error::NotPermitted { .. } | Error::CredentialsMissing);
        match query {
            Query::Queue(_) if forbidden => self.arbitration.queue.forbidden(),
            Query::Queue(QueueRequest::Request) => self.arbitration.queue.turned_away(now),
            Query::Queue(_) => self.arbitration.queue.failed(now),
            Query::Presets => {
                self.events.extend(servo.home().no_presets().map(SessionEvent::NoSuchPreset));
            }
            _ => self.asked(query, servo, now),
        }
    }

    /// Whether this is no fault: of a camera just met, which may answer the other questions, or of one that is well.
    fn will_not_tell_position(&self, err: &Error) -> bool {
        match err {
            Error::Camera(_) if self.discovery.holds(Query::Position) => true,
            Error::Camera(_) | Error::NoPtz | Error::Unexpected(_) => self.connection.connected(),
            _ => false,
        }
    }

    fn may_tell_later(&mut self, query: Query, servo: &mut Servo, now: Duration) {
        // Whether the camera is there at all.
        self.next_poll = now;
        match query {
            Query::Queue(_) => self.arbitration.queue.failed(now),
            Query::Presets => servo.home().ask_presets_at(now + Self::POLL_RESTING),
            _ => {
                if self.discovery.unanswered(query, !self.connection.faulty(), now) {
                    self.discovered(servo, now);
                }
            }
        }
    }

    /// This need not be asked again.
    fn asked(&mut self, query: Query, servo: &Servo, now: Duration) {
        if self.discovery.done(query) {
            self.discovered(servo, now);
        }
    }

    /// After the last question it is known whom we met.
    fn discovered(&mut self, servo: &Servo, now: Duration) {
        let changed = self.discovery.changed(self.description.to_string());
        self.events.extend(changed.map(SessionEvent::Discovered));
        self.judge_limits(servo);
        if !self.connection.connected() {
            // It told nothing: that is a fault after all.
            self.next_poll = now;
        }
    }

    /// Whether the limits can be kept is known after the last question.
    pub(super) fn judge_limits(&mut self, servo: &Servo) {
        if self.discovery.next().is_some() {
            return;
        }
        let unkept = servo.camera().pan_tilt().is_none() && servo.settings().limits.bound_turns();
        let known = std::mem::replace(&mut self.limits_unkept, unkept);
        if unkept && !known {
            self.events.push(SessionEvent::LimitsUnkept);
        }
    }

    /// What the position tells of others who move the camera.
    fn look_for_others(
        &mut self,
        place: (PanTilt, Option<f64>),
        servo: &mut Servo,
        (asked, now): (Duration, Duration),
    ) {
        if servo.is_under_way() {
            self.arbitration.excuse(now);
        }
        let give_way = self.settings.override_timeout;
        // Who does not zoom cannot be contradicted: an operator may, and is followed for all the same.
        let commands = CommandedMotion { pan_tilt: &servo.camera().history, zoom: servo.zoom_commands() };
        let finding = self.arbitration.positioned(place, (asked, now), commands, give_way);
        if self.scheduler.is_contested() {
            let is_ours = !self.arbitration.turns_otherwise();
            self.scheduler.settle(is_ours);
            if !is_ours {
                servo.accepted(&Actuation::Rest, now, now);
                self.events.push(SessionEvent::Stopped);
            }
        }
        match finding {
            Finding::Nothing => {}
            Finding::Orphan => {
                // That its zoom was not seen to move is no proof that it does not.
                let lacks_speed = self.modes.lacks(Mode::Velocity, now);
                self.scheduler.found_moving(if lacks_speed { Command::Stop } else { Command::REST });
                self.events.push(SessionEvent::Orphan);
            }
            Finding::Operator => {
                servo.home().strayed();
                self.scheduler.contest();
            }
        }
    }

    /// The camera told its position as of a time, or does not tell.
    fn positioned(&mut self, position: Option<Position>, servo: &mut Servo, at: Duration, now: Duration) {
        // By the mode that the new position allows.
        let actuator = self.actuator(servo, now);
        if servo.told_position(position, at, &actuator, now) {
            self.scheduler.arrived();
            self.events.push(SessionEvent::Stopped);
        }
        self.next_poll = now
            + match (servo.is_under_way(), self.scheduler.may_move()) {
                (true, _) => Self::POLL_UNDER_WAY,
                (false, true) if self.scheduler.is_contested() => Self::POLL_CONTESTED,
                (false, _) if self.arbitration.asks() => Duration::ZERO,
                (false, true) if servo.is_zooming(now) => Self::POLL_ZOOMING,
                (false, true) => Self::POLL_MOVING,
                (false, false) if self.is_wanted(servo, now) => Self::POLL_MOVING,
                (false, false) => Self::POLL_RESTING,
            };
    }

    fn succeeded(&mut self, of_command: bool, servo: &Servo) {
        self.modes.obeyed();
        let idle = !servo.holds_target() && !self.scheduler.may_move();
        let was_faulty = self.connection.faulty();
        let Some(change) = self.connection.succeeded(of_command, idle) else { return };
        if was_faulty {
            // It may not have told all as it started, or be another.
            self.discovery.renew();
        }
        self.events.push(SessionEvent::Connection(change));
    }

    /// A camera that somebody may be about to move, or that may be, is asked more often.
    fn is_wanted(&self, servo: &Servo, now: Duration) -> bool {
        servo.holds_target() || self.arbitration.owner(now).is_some() || self.arbitration.looks(now)
    }

    fn failed(&mut self, err: &Error, of_command: bool, now: Duration) {
        if !err.is_refusal() {
            self.arbitration.forget();
            self.modes.forget_refusals();
        }
        self.events.extend(self.connection.failed(err, of_command, now).map(SessionEvent::Connection));
    }
}
