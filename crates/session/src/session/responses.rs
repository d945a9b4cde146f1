// SPDX-License-Identifier: MPL-2.0

//! What the camera's answers mean.

use std::time::Duration;

use servo::{Actuation, Mode, Motion, PanTilt, Position, Presets, Time};

use super::arbitration::Finding;
use super::mode_support::Refusal;
use super::scheduler::Scheduler;
use super::{Fact, Forbidden, Session, Speaker, Steering};
use crate::{Command, Error, Query, QueueRequest, Request, Response, SessionEvent, Stop};

impl Session {
    /// A position is asked for this often while the zoom moves, by which the picture changes most, ...
    const POLL_ZOOMING: Duration = Duration::from_millis(400);
    /// ... and otherwise, at rest too: a move made while none of ours is under way can be told from ours only by being seen before our next.
    const POLL: Duration = Duration::from_secs(1);
    /// At rest once in so many times that it takes to answer where that is longer, as the first command waits for the answer, but at least
    /// this often.
    const ANSWERS: u32 = 4;
    const POLL_SLOW: Duration = Duration::from_secs(5);
    /// While it may go on at an operator's word or at ours: in this time his shows if it is of 3 degrees per second.
    const POLL_CONTESTED: Duration = Duration::from_millis(500);
    /// While it goes to a position.
    const POLL_UNDER_WAY: Duration = Duration::from_millis(150);
    /// A camera that does not answer which presets it has is asked again this much later, ...
    const PRESETS_LATER: Duration = Duration::from_secs(5);
    /// ... and one that does not tell its position.
    const POLL_REFUSED: Duration = Duration::from_secs(30);

    /// The camera answered what was sent then, or did not. Returns what that says of it, in order.
    pub fn on_response(
        &mut self,
        request: &Request,
        response: Result<Response, Error>,
        steering: &Steering,
        (sent, now): (Time, Time),
    ) -> Vec<Fact> {
        if matches!(request, Request::Query(_)) {
            self.asked_at = now;
        }
        if response.is_ok() {
            self.scheduler.answered(sent, now);
        }
        match (request, response) {
            (Request::Command(command), Ok(_)) => {
                let facts = self.command_accepted(command, steering, (sent, now));
                self.was_obeyed();
                facts
            }
            (Request::Command(command), Err(err)) => {
                let facts = self.command_failed(command, &err, steering, now);
                self.pass_turn(now);
                facts
            }
            (Request::Query(query), Ok(response)) => self.told(*query, response, steering, (sent, now)),
            (Request::Query(query), Err(err)) => {
                let facts = self.not_told(*query, &err, now);
                if self.connection.halted() {
                    self.pass_turn(now);
                }
                facts
            }
        }
    }

    fn command_failed(
        &mut self,
        command: &Command,
        err: &Error,
        steering: &Steering,
        now: Time,
    ) -> Vec<Fact> {
        let mut facts = Vec::new();
        if err.may_have_acted() {
            facts.push(self.unanswered(command, now));
        } else {
            self.scheduler.failed(command, false, now);
        }
        let understood = matches!(err, Error::Camera(_))
            && self.is_understood(command, err, steering.leads_home, &mut facts, now);
        if !understood {
            self.failed(err, true, now);
        }
        facts
    }

    /// Whether it is known why the camera refuses a command, so that it is no fault.
    fn is_understood(
        &mut self,
        command: &Command,
        err: &Error,
        leads_home: bool,
        facts: &mut Vec<Fact>,
        now: Time,
    ) -> bool {
        let queue = &mut self.arbitration.queue;
        if queue.refused_command() || queue.refused(now) {
            return true;
        }
        if self.speaker != Speaker::Owner {
            // Perhaps only to him: the owner's words stay as they are.
            return false;
        }
        if let Command::Move { motion: Motion::Velocity { .. }, free } = command {
            // It may be refused only for being free of proportional speed: then it is sent again without. Where it is refused
            // even so, it was not for that.
            self.description.refuses_free_moves = *free;
            facts.push(Fact::Capabilities(self.description.capabilities()));
            if *free {
                return true;
            }
        }
        if leads_home {
            facts.push(Fact::HomeRefused);
            self.events.push(SessionEvent::HomeRefused(err.clone()));
            return true;
        }
        self.refused_a_mode(command, err, now)
    }

    /// Whether a refusal is, or may be, only of the words of a mode.
    fn refused_a_mode(&mut self, command: &Command, err: &Error, now: Time) -> bool {
        match self.modes.refused(command, err, now) {
            Refusal::Other => false,
            Refusal::Doubtful => {
                let witness = if self.tells_position() { Query::Position } else { Query::Parameters };
                self.discovery.ask_first(witness);
                true
            }
            // There is none left to turn to: the wanted one is retried, with the pauses of a fault.
            Refusal::OfMode(_) if self.modes.lacks(self.mode(now), now) => false,
            Refusal::OfMode(mode) => {
                if mode == Mode::Velocity {
                    self.scheduler.stop_by(Stop::Position);
                }
                true
            }
        }
    }

    /// What the camera does from here on is unknown.
    pub(super) fn unanswered(&mut self, command: &Command, now: Time) -> Fact {
        self.scheduler.failed(command, true, now);
        if let Some(confirmation) = self.stop_confirmation.as_mut().filter(|_| !command.is_stop()) {
            confirmation.moved();
        }
        self.arbitration.excuse(now + Scheduler::DOUBT);
        Fact::Unanswered(command.actuation())
    }

    fn command_accepted(
        &mut self,
        command: &Command,
        steering: &Steering,
        (sent, now): (Time, Time),
    ) -> Vec<Fact> {
        let was_moving = self.scheduler.may_move();
        self.scheduler.accepted(command, now);
        if let Some(confirmation) = &mut self.stop_confirmation {
            if command.is_stop() { confirmation.stopped(now) } else { confirmation.moved() }
        }
        self.repeat_unseen_stop(now);
        self.arbitration.commanded();
        self.arbitration.queue.obeyed();
        let actuation = command.actuation();
        if matches!(actuation, Actuation::Move(motion) if motion.is_point_to_point()) {
            self.arbitration.excuse(now);
            self.next_poll = now + Self::POLL_UNDER_WAY;
        } else if command.is_stop() || !was_moving {
            self.next_poll = now + Self::POLL;
        }
        if !steering.leads_home && !command.is_stop() {
            let mode = self.mode(now);
            self.events.extend(self.modes.changed(mode).map(SessionEvent::Mode));
        }
        self.modes.accepted(command);
        self.succeeded(true, steering);
        match (was_moving, self.scheduler.may_move()) {
            (false, true) => self.events.push(SessionEvent::Moving),
            (true, false) => self.events.push(SessionEvent::Stopped),
            _ => {}
        }
        vec![Fact::Accepted { actuation, sent }]
    }

    fn told(
        &mut self,
        query: Query,
        response: Response,
        steering: &Steering,
        (sent, now): (Time, Time),
    ) -> Vec<Fact> {
        let mut facts = Vec::new();
        match response {
            Response::Position(position) => return self.told_position(position, steering, (sent, now)),
            Response::Limits(limits) => self.description.limits = limits,
            Response::Parameters(parameters) => {
                self.description.parameters = parameters;
                self.modes.told(&parameters);
                self.arbitration.queue.told(parameters.control_queue);
            }
            Response::Presets(presets) => facts.push(Fact::Presets(presets)),
            Response::Place(place) => {
                if let Query::Queue(request) = query {
                    self.arbitration.queue.answered(request, place, now);
                }
            }
            Response::Attributes(attributes) => self.description.attributes = attributes,
            Response::MoveSpeed(part) => self.description.move_speed = Some(part),
            Response::Accepted => {}
        }
        if matches!(query, Query::Limits | Query::Parameters | Query::Attributes | Query::MoveSpeed) {
            facts.push(Fact::Capabilities(self.description.capabilities()));
        }
        self.succeeded(false, steering);
        self.asked(query, now);
        facts
    }

    fn told_position(
        &mut self,
        position: Position,
        steering: &Steering,
        (sent, now): (Time, Time),
    ) -> Vec<Fact> {
        self.position = position;
        let mut facts = match position.pan_tilt() {
            Some(place) => self.look_for_others((place, position.zoom), steering, (sent, now)),
            None => {
                self.undecided();
                Vec::new()
            }
        };
        facts.push(Fact::Position { position, at: sent.middle(now) });
        facts
    }

    /// Whose move the camera is in was to be told by a position that did not come.
    fn undecided(&mut self) {
        self.arbitration.undecided();
        self.scheduler.settle(true);
    }

    fn not_told(&mut self, query: Query, err: &Error, now: Time) -> Vec<Fact> {
        if query == Query::Position {
            self.undecided();
        }
        if let Some(refusal) = self.modes.failed().filter(|_| err.is_refusal() && !err.is_final()) {
            self.asked(query, now);
            self.failed(&refusal, true, now);
            return Vec::new();
        }
        if query != Query::Position {
            // Optional; a camera that is gone will be missed by the next position. One that lets anybody move it may
            // want a user for this.
            let anonymous = self.connection.connected() && matches!(err, Error::CredentialsMissing);
            if err.is_answer() || anonymous {
                return self.will_not_tell(query, err, now);
            } else if !matches!(err, Error::Unreachable(_)) && !err.is_final() {
                return self.may_tell_later(query, now);
            }
        } else if matches!(err, Error::NotPermitted { .. }) {
            self.next_poll = now + Forbidden::RARELY;
        } else if matches!(err, Error::Camera(_)) && self.arbitration.queue.refused(now) {
            return Vec::new();
        } else if self.will_not_tell_position(err) {
            return vec![Fact::NoPosition];
        }
        self.failed(err, false, now);
        Vec::new()
    }

    fn will_not_tell(&mut self, query: Query, err: &Error, now: Time) -> Vec<Fact> {
        let forbidden = matches!(err, Error::NotPermitted { .. } | Error::CredentialsMissing);
        match query {
            Query::Queue(_) if forbidden => self.arbitration.queue.forbidden(),
            Query::Queue(QueueRequest::Request) => self.arbitration.queue.turned_away(now),
            Query::Queue(_) => self.arbitration.queue.failed(now),
            Query::Presets => return vec![Fact::Presets(Presets::default())],
            _ => self.asked(query, now),
        }
        Vec::new()
    }

    /// Whether this is no fault: of a camera just met, which may answer the other questions, or of one that is well.
    fn will_not_tell_position(&self, err: &Error) -> bool {
        match err {
            Error::Camera(_) if self.discovery.holds(Query::Position) => true,
            Error::Camera(_) | Error::NoPtz | Error::Unexpected(_) => self.connection.connected(),
            _ => false,
        }
    }

    fn may_tell_later(&mut self, query: Query, now: Time) -> Vec<Fact> {
        // Whether the camera is there at all.
        self.next_poll = now;
        match query {
            Query::Queue(_) => self.arbitration.queue.failed(now),
            Query::Presets => return vec![Fact::PresetsNotBefore(now + Self::PRESETS_LATER)],
            _ => {
                if self.discovery.unanswered(query, !self.connection.faulty(), now) {
                    self.discovered(now);
                }
            }
        }
        Vec::new()
    }

    /// This need not be asked again.
    fn asked(&mut self, query: Query, now: Time) {
        if self.discovery.done(query) {
            self.discovered(now);
        }
    }

    /// After the last question it is known whom we met.
    fn discovered(&mut self, now: Time) {
        let changed = self.discovery.changed(self.description.to_string());
        self.events.extend(changed.map(SessionEvent::Discovered));
        if !self.connection.connected() {
            // It told nothing: that is a fault after all.
            self.next_poll = now;
        }
    }

    /// What the position tells of others who move the camera.
    fn look_for_others(
        &mut self,
        place: (PanTilt, Option<f64>),
        steering: &Steering,
        (asked, now): (Time, Time),
    ) -> Vec<Fact> {
        let mut facts = Vec::new();
        if steering.is_under_way {
            self.arbitration.excuse(now);
        }
        let give_way = self.settings.override_timeout;
        let finding = self.arbitration.positioned(place, (asked, now), steering.commands, give_way);
        if self.scheduler.is_contested() {
            let is_ours = !self.arbitration.turns_otherwise();
            self.scheduler.settle(is_ours);
            if !is_ours {
                facts.push(Fact::Superseded);
                self.events.push(SessionEvent::Stopped);
            }
        }
        match finding {
            Finding::Nothing => {}
            Finding::Orphan => {
                // That its zoom was not seen to move is no proof that it does not.
                let lacks_speed = self.modes.lacks(Mode::Velocity, now);
                self.scheduler.found_moving(if lacks_speed { Stop::Position } else { Stop::AllAxes });
                self.events.push(SessionEvent::Orphan);
            }
            Finding::Operator => {
                facts.push(Fact::Operator);
                self.scheduler.contest();
            }
        }
        facts
    }

    /// A move to a position has ended by itself, as the last position shows or as time has passed.
    pub fn arrived(&mut self) {
        self.scheduler.arrived();
        self.events.push(SessionEvent::Stopped);
    }

    /// What the last position says was taken notice of: goes on to the next question.
    pub fn positioned(&mut self, steering: &Steering, now: Time) {
        self.poll_later(steering, now);
        self.succeeded(false, steering);
        self.asked(Query::Position, now);
    }

    /// The same, of a camera that does not tell it.
    pub fn not_positioned(&mut self, steering: &Steering, now: Time) {
        self.poll_later(steering, now);
        // One that told it before is well again soon.
        if !steering.is_under_way && !self.tells_position() {
            self.next_poll = now + Self::POLL_REFUSED;
        }
        self.asked(Query::Position, now);
    }

    fn poll_later(&mut self, steering: &Steering, now: Time) {
        self.next_poll = now
            + match (steering.is_under_way, self.scheduler.may_move()) {
                (true, _) => Self::POLL_UNDER_WAY,
                (false, true) if self.scheduler.is_contested() => Self::POLL_CONTESTED,
                (false, _) if self.arbitration.asks() => Duration::ZERO,
                (false, true) if steering.is_zooming => Self::POLL_ZOOMING,
                (false, true) => Self::POLL,
                (false, false) => {
                    (Self::ANSWERS * self.scheduler.round_trip()).clamp(Self::POLL, Self::POLL_SLOW)
                }
            };
    }

    fn succeeded(&mut self, of_command: bool, steering: &Steering) {
        self.modes.obeyed();
        let idle = !steering.holds_target && !self.scheduler.may_move();
        let was_faulty = self.connection.faulty();
        let Some(change) = self.connection.succeeded(of_command, idle) else { return };
        if was_faulty {
            // It may not have told all as it started, or be another.
            self.discovery.renew();
        }
        self.events.push(SessionEvent::Connection(change));
    }

    fn failed(&mut self, err: &Error, of_command: bool, now: Time) {
        if !err.is_refusal() {
            self.arbitration.forget();
            self.modes.forget_refusals();
        }
        self.events.extend(self.connection.failed(err, of_command, now).map(SessionEvent::Connection));
    }
}
