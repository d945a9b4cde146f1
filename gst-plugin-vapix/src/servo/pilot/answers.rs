//! What the camera's answers mean to the pilot.

use std::mem;
use std::time::Duration;

use super::Pilot;
use crate::servo::{
    Answer, Commands, Finding, Job, Link, Mode, PanTilt, Query, Refusal, Report, Scheduler, SpeedMap, Steps,
};
use crate::vapix::{Command, Error, Position, QueueRequest};

impl Pilot {
    /// The camera answered what was sent then, or did not.
    pub fn answered(&mut self, job: &Job, answer: Result<Answer, Error>, sent: Duration, now: Duration) {
        if matches!(job, Job::Query(_)) {
            self.asked_at = now;
        }
        match (job, answer) {
            (Job::Command(command), Ok(_)) => self.command_accepted(command, sent, now),
            (Job::Command(command), Err(err)) => self.command_failed(command, &err, now),
            (Job::Query(query), Ok(answer)) => self.told(*query, answer, sent, now),
            (Job::Query(query), Err(err)) => self.not_told(*query, &err, now),
        }
    }

    fn command_failed(&mut self, command: &Command, err: &Error, now: Duration) {
        if err.may_have_acted() {
            self.unanswered(command, now);
        } else {
            self.scheduler.failed(command, false, now);
        }
        if !matches!(err, Error::Camera(_)) || !self.is_understood(command, err, now) {
            self.failed(err, true, now);
        }
    }

    /// Whether it is known why the camera refuses a command, so that it is no fault.
    fn is_understood(&mut self, command: &Command, err: &Error, now: Duration) -> bool {
        let queue = &mut self.authority.queue;
        if queue.refused_command() || queue.refused(now) {
            return true;
        }
        if matches!(command, Command::Velocity { .. }) && self.refused_freedom(command) {
            return true;
        }
        if self.homing.leads(command) {
            self.homing.settled();
            self.reports.push(Report::HomeRefused(err.clone()));
            return true;
        }
        self.refused_a_mode(command, err, now)
    }

    /// Whether the refusal of a move may be only of its freedom from proportional speed: then it is sent again
    /// without. Where it is refused even so, it was not for that.
    fn refused_freedom(&mut self, command: &Command) -> bool {
        let free = matches!(command, Command::Velocity { free: true, .. });
        self.camera.refuses_free_moves = free;
        self.revise();
        free
    }

    /// Whether a refusal is, or may be, only of the words of a mode.
    fn refused_a_mode(&mut self, command: &Command, err: &Error, now: Duration) -> bool {
        match self.ways.refused(command, err, now) {
            Refusal::Other => false,
            Refusal::Doubtful => {
                let tells_position = self.camera.pan_tilt().is_some();
                let witness = if tells_position { Query::Position } else { Query::Parameters };
                self.introduction.ask_first(witness);
                true
            }
            // There is none left to turn to: the wanted one is tried on, with the pauses of a fault.
            Refusal::OfMode(_) if self.ways.lacks(self.mode(now), now) => false,
            Refusal::OfMode(mode) => {
                if mode == Mode::Velocity {
                    self.stop = Command::Stop;
                }
                true
            }
        }
    }

    /// What the camera does from here on is unknown.
    pub(super) fn unanswered(&mut self, command: &Command, now: Duration) {
        self.scheduler.failed(command, true, now);
        self.authority.excuse(now + Scheduler::DOUBT);
        if let Command::Velocity { zoom: Some(zoom), .. } = command
            && *zoom != 0
        {
            self.zoom.commanded(now, *zoom);
        }
    }

    fn command_accepted(&mut self, command: &Command, sent: Duration, now: Duration) {
        let was_moving = self.scheduler.may_move();
        self.scheduler.accepted(command, now);
        self.authority.commanded();
        self.authority.queue.obeyed();
        self.exchange = now.saturating_sub(sent);
        // Counted from its sending on: that is when it can begin to act, however late the answer is.
        match command {
            Command::Velocity { pan, tilt, zoom, .. } => {
                self.history.push_steps(sent, (*pan, *tilt), &self.map);
                if let Some(zoom) = zoom {
                    self.zoom.commanded(sent, *zoom);
                }
                if *zoom == Some(0) && self.stop == Command::REST && !self.scheduler.in_doubt() {
                    self.stop = Command::Halt;
                }
            }
            _ => self.history.push(sent, PanTilt::default()),
        }
        match command {
            Command::Absolute { .. } | Command::Centre { .. } | Command::Preset { .. } => {
                self.steps.begin(sent);
                self.authority.excuse(now);
                self.next_poll = now + Steps::POLL;
            }
            _ if command.is_stop() => {
                self.speed_steps = (0, 0);
                self.steps.rest(now);
                // Where it came to rest.
                self.next_poll = now + Self::POLL_MOVING;
            }
            _ => {
                // A step under way, from before the mode was changed, is over.
                self.steps.rest(now);
                if !was_moving {
                    self.next_poll = now + Self::POLL_MOVING;
                }
            }
        }
        if self.homing.leads(command) {
            self.homing.settled();
        } else if !command.is_stop() {
            self.homing.strayed();
            self.tell_mode(now);
        }
        self.ways.accepted(command);
        self.succeeded(true);
        match (was_moving, self.scheduler.may_move()) {
            (false, true) => self.reports.push(Report::Moving),
            (true, false) => self.reports.push(Report::Stopped),
            _ => {}
        }
    }

    /// The camera accepted a move towards the target.
    fn tell_mode(&mut self, now: Duration) {
        let mode = self.mode(now);
        if mem::replace(&mut self.mode_told, mode) != mode {
            self.reports.push(Report::Mode(mode));
        }
    }

    fn told(&mut self, query: Query, answer: Answer, sent: Duration, now: Duration) {
        let assumed = self.assumptions();
        match answer {
            Answer::Position(position) => {
                let before = mem::replace(&mut self.camera.position, position);
                self.homing.positioned(position);
                if position.zoom_steps != before.zoom_steps {
                    self.calibration.zoomed();
                }
                if let Some(position) = self.camera.pan_tilt() {
                    self.look_for_others(position, sent, now);
                    if self.authority.is_ours(now) {
                        self.calibration.positioned((sent + now) / 2, position);
                    }
                } else {
                    self.authority.undecided();
                }
                self.positioned(Some(position), (sent + now) / 2, now);
            }
            Answer::Limits(limits) => self.camera.limits = limits,
            Answer::Parameters(parameters) => {
                self.camera.parameters = parameters;
                self.ways.told(&parameters);
                self.authority.queue.told(parameters.control_queue);
            }
            Answer::Presets(presets) => {
                self.reports.extend(self.homing.told_presets(&presets).map(Report::NoSuchPreset));
            }
            Answer::Place(place) => {
                if let Query::Queue(request) = query {
                    self.authority.queue.answered(request, place, now);
                }
            }
            Answer::Attributes(attributes) => self.camera.attributes = attributes,
            Answer::MoveSpeed(step) => {
                self.camera.move_speed = Some(step);
                self.homing.told_move_speed(step);
            }
            Answer::Accepted => {}
        }
        self.assumed_before(assumed);
        self.revise();
        self.succeeded(false);
        self.asked(query, now);
    }

    /// What is assumed of speeds and field of view before anything is learned.
    fn assumptions(&self) -> (Option<SpeedMap>, f64) {
        (self.camera.told_speeds(), self.camera.fov_zoomed_out_deg(self.settings.fov_deg))
    }

    /// What was learned by other assumptions is void; what is told once more is no other.
    fn assumed_before(&mut self, before: (Option<SpeedMap>, f64)) {
        let (speeds, wide_deg) = self.assumptions();
        if speeds != before.0 {
            self.assume_speeds();
        }
        if wide_deg != before.1 {
            self.calibration.assume_field();
        }
    }

    fn not_told(&mut self, query: Query, err: &Error, now: Duration) {
        if query == Query::Position {
            self.authority.undecided();
        }
        if let Some(refusal) = self.ways.failed().filter(|_| err.is_refusal() && !err.is_final()) {
            self.asked(query, now);
            return self.failed(&refusal, true, now);
        }
        if query != Query::Position {
            // Optional; a camera that is gone will be missed by the next position. One that lets anybody move it may
            // want a user for this.
            let anonymous = self.link.connected() && matches!(err, Error::CredentialsMissing);
            if err.is_answer() || anonymous {
                return self.will_not_tell(query, err, now);
            } else if !matches!(err, Error::Unreachable(_)) && !err.is_final() {
                return self.may_tell_later(query, now);
            }
        } else if matches!(err, Error::NotPermitted { .. }) {
            self.next_poll = now + Link::RARELY;
        } else if matches!(err, Error::Camera(_)) && self.authority.queue.refused(now) {
            return;
        } else if self.will_not_tell_position(err) {
            self.positioned(None, now, now);
            // One that told it before is well again soon.
            if !self.steps.under_way() && self.camera.pan_tilt().is_none() {
                self.next_poll = now + Self::POLL_REFUSED;
            }
            return self.asked(query, now);
        }
        self.failed(err, false, now);
    }

    fn will_not_tell(&mut self, query: Query, err: &Error, now: Duration) {
        let forbidden = matches!(err, Error::NotPermitted { .. } | Error::CredentialsMissing);
        match query {
            Query::Queue(_) if forbidden => self.authority.queue.forbidden(),
            Query::Queue(QueueRequest::Request) => self.authority.queue.turned_away(now),
            Query::Queue(_) => self.authority.queue.failed(now),
            Query::Presets => self.reports.extend(self.homing.no_presets().map(Report::NoSuchPreset)),
            _ => self.asked(query, now),
        }
    }

    /// Whether this is no fault: of a camera just met, which may answer the other questions, or of one that is well.
    fn will_not_tell_position(&self, err: &Error) -> bool {
        match err {
            Error::Camera(_) if self.introduction.holds(Query::Position) => true,
            Error::Camera(_) | Error::NoPtz | Error::Unexpected(_) => self.link.connected(),
            _ => false,
        }
    }

    fn may_tell_later(&mut self, query: Query, now: Duration) {
        // Whether the camera is there at all.
        self.next_poll = now;
        match query {
            Query::Queue(_) => self.authority.queue.failed(now),
            Query::Presets => self.homing.ask_presets_at(now + Self::POLL_RESTING),
            _ => {
                if self.introduction.unanswered(query, !self.link.faulty(), now) {
                    self.met(now);
                }
            }
        }
    }

    /// This need not be asked again.
    fn asked(&mut self, query: Query, now: Duration) {
        if self.introduction.done(query) {
            self.met(now);
        }
    }

    /// After the last question it is known whom we met; if it is the same as before, that is no news.
    fn met(&mut self, now: Duration) {
        let met = Some(self.camera.to_string());
        if self.met_as != met {
            self.reports.extend(met.clone().map(Report::Met));
            self.met_as = met;
        }
        self.judge_limits();
        if !self.link.connected() {
            // It told nothing: that is a fault after all.
            self.next_poll = now;
        }
    }

    /// Whether the limits can be kept is known after the last question.
    pub(super) fn judge_limits(&mut self) {
        if self.introduction.next().is_some() {
            return;
        }
        let unkept = self.camera.pan_tilt().is_none() && self.settings.limits.bound_turns();
        let known = mem::replace(&mut self.limits_unkept, unkept);
        if unkept && !known {
            self.reports.push(Report::LimitsUnkept);
        }
    }

    /// What the position tells of others who move the camera.
    fn look_for_others(&mut self, position: PanTilt, asked: Duration, now: Duration) {
        if self.steps.under_way() {
            self.authority.excuse(now);
        }
        let place = (position, self.camera.position.zoom_steps);
        let give_way = self.settings.override_timeout;
        // Who does not zoom cannot be contradicted: an operator may, and is followed for all the same.
        let zoom = self.settings.target_height.map(|_| self.zoom.commands());
        let commands = Commands { pan_tilt: &self.history, zoom };
        match self.authority.positioned(place, (asked, now), commands, give_way) {
            Finding::Nothing => {}
            Finding::Orphan => {
                // That its zoom was not seen to move is no proof that it does not.
                let lacks_speed = self.ways.lacks(Mode::Velocity, now);
                self.stop = if lacks_speed { Command::Stop } else { Command::REST };
                self.scheduler.found_moving();
                self.reports.push(Report::Orphan);
            }
            Finding::Operator => self.homing.strayed(),
        }
    }

    /// The camera told its position as of a time, or does not tell.
    fn positioned(&mut self, position: Option<Position>, at: Duration, now: Duration) {
        if let Some(place) = position.and(self.camera.pan_tilt()) {
            self.guard.told(at, place);
        }
        let latency = self.calibration.latency();
        let arrived = self.steps.position(position, now, latency);
        if !self.steps.under_way() {
            self.zoom.told(at, position.and_then(|position| position.zoom_steps), latency);
        }
        if arrived {
            self.scheduler.arrived();
            self.reports.push(Report::Stopped);
            // It came before this was known.
            if let Some(sight) = self.target.as_ref().map(|target| target.sight) {
                self.measure(&sight, now);
            }
        }
        self.next_poll = now
            + match (self.steps.under_way(), self.scheduler.may_move()) {
                (true, _) => Steps::POLL,
                (false, _) if self.authority.asks() => Duration::ZERO,
                (false, true) if self.zoom.is_moving(now) => Self::POLL_ZOOMING,
                (false, true) => Self::POLL_MOVING,
                (false, false) if self.is_wanted(now) => Self::POLL_MOVING,
                (false, false) => Self::POLL_RESTING,
            };
    }

    fn succeeded(&mut self, of_command: bool) {
        self.ways.obeyed();
        let idle = self.target.is_none() && !self.scheduler.may_move();
        let was_faulty = self.link.faulty();
        let Some(change) = self.link.succeeded(of_command, idle) else { return };
        if was_faulty {
            // It may not have told all as it started, or be another.
            self.introduction.renew();
        }
        self.reports.push(Report::Link(change));
    }

    /// A camera that somebody may be about to move, or that may be, is asked more often.
    fn is_wanted(&self, now: Duration) -> bool {
        self.target.is_some() || self.authority.holder(now).is_some() || self.authority.looks(now)
    }

    fn failed(&mut self, err: &Error, of_command: bool, now: Duration) {
        if !err.is_refusal() {
            self.authority.forget();
            self.ways.forget_refusals();
        }
        self.reports.extend(self.link.failed(err, of_command, now).map(Report::Link));
    }
}
