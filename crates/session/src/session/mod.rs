// SPDX-License-Identifier: MPL-2.0

//! The session with one camera: who may move it, what to ask and say next, what its answers mean. Sees no picture and knows
//! no servo: it takes an [`Actuation`](servo::Actuation), and returns [`Fact`]s.
//!
//! ```text
//! Actuation ─ next_request ─▶ Request ─▶ (client) ─▶ Response ─ on_response ─▶ Facts
//! ```

mod arbitration;
mod connection;
mod control_queue;
mod description;
mod discovery;
mod facts;
mod forbidden;
mod mode_support;
mod operator;
mod requests;
mod responses;
mod scheduler;
mod speaker;
mod stop_confirmation;

pub use arbitration::ControlOwner;
pub use connection::ConnectionChange;
pub use facts::{Fact, Steering};
pub use forbidden::Forbidden;
pub use operator::CommandedMotion;
pub use speaker::Speaker;

use std::mem;
use std::time::Duration;

use arbitration::Arbitration;
use connection::Connection;
use description::Description;
use discovery::Discovery;
use mode_support::ModeSupport;
use scheduler::Scheduler;
use servo::{Access, ActuatorStatus, Mode, Position, Time};
use speaker::Standing;
pub(crate) use stop_confirmation::StopConfirmation;
use stop_confirmation::StopFinding;

use crate::{Command, Protocol, SessionEvent, SessionSettings, Stop};

/// A camera that did not answer a move is not expected to act on it later than this.
pub(crate) const DOUBT: Duration = Scheduler::DOUBT;

/// Speaks with one camera: says what to send, hears what is answered. Sends nothing itself, and has no clock: both are the
/// caller's.
#[derive(Debug)]
pub struct Session {
    settings: SessionSettings,
    /// As whom the camera is spoken to.
    speaker: Speaker,
    connection: Connection,
    /// Of whoever else may have to speak.
    other: Option<Standing>,
    discovery: Discovery,
    description: Description,
    scheduler: Scheduler,
    arbitration: Arbitration,
    modes: ModeSupport,
    /// Of a camera whose yes to a stop is not to be trusted.
    stop_confirmation: Option<StopConfirmation>,
    /// Where the camera last said it looks.
    position: Position,
    /// When to ask next where the camera looks.
    next_poll: Time,
    /// When the camera last answered a question, or did not.
    asked_at: Time,
    events: Vec<SessionEvent>,
}

impl Session {
    /// Knows nothing of the camera yet, which is to be moved like this and speaks this protocol.
    pub fn new(mode: Mode, settings: SessionSettings, protocol: &Protocol) -> Self {
        Self {
            settings,
            speaker: Speaker::Owner,
            connection: Connection::default(),
            other: None,
            discovery: Discovery::new(protocol.questions),
            description: Description::default(),
            scheduler: Scheduler::new(protocol.keep_alive),
            arbitration: Arbitration::new(protocol.has_control_queue),
            modes: ModeSupport::new(mode),
            stop_confirmation: protocol.confirms_stops.then(StopConfirmation::default),
            position: Position::default(),
            next_poll: Time::ZERO,
            asked_at: Time::ZERO,
            events: Vec::new(),
        }
    }

    /// Takes new settings, and how the camera is to be moved.
    pub fn configure(&mut self, settings: SessionSettings, mode: Mode) {
        self.settings = settings;
        self.modes.want(mode);
    }

    /// The axes are known to be otherwise: where the camera was before says nothing of who moved it since.
    pub fn reorient(&mut self) {
        self.arbitration.reorient();
    }

    /// What to send before we are somebody else to the camera: whom it does not know it does not stop for.
    pub fn parting_stop(&self, now: Time) -> Option<Stop> {
        let may_ask = !self.connection.halted() && self.connection.retry_at() <= now;
        let is_heard = may_ask && !self.arbitration.queue.is_deaf();
        (is_heard && !self.is_at_rest()).then_some(self.stop())
    }

    /// A predecessor left the camera in a move that this ends.
    pub fn inherit(&mut self, stop: Stop, now: Time) {
        self.scheduler.inherited(stop, now);
        self.connection.note_obeyed();
    }

    /// He was refused when he tried to, as the same user, and was to wait so long before he tried again.
    pub fn inherit_refusal(&mut self, refusal: (Forbidden, Duration), now: Time) {
        if !refusal.1.is_zero() {
            self.scheduler.attempted(&Command::Stop(self.stop()), now);
        }
        self.events.extend(self.connection.inherit(refusal, now).map(SessionEvent::Connection));
    }

    /// What ends the last move.
    pub fn stop(&self) -> Stop {
        self.scheduler.stop()
    }

    /// It is the end: with the stop, what is ours is given back.
    pub fn leave(&mut self, now: Time) {
        self.arbitration.queue.leave();
        if let Some(other) = &mut self.other {
            other.leave();
        }
        if let Some(confirmation) = &mut self.stop_confirmation {
            confirmation.leave();
        }
        self.repeat_unseen_stop(now);
    }

    /// A picture shows the background to move so many fields of view a second, or does not tell: whether a camera that said
    /// yes to a stop has stopped. Nothing else of a picture matters here.
    pub fn see_background(&mut self, fields_s: Option<f64>, taken_at: Time, now: Time) {
        let (is_at_rest, is_taken_over) = (self.is_at_rest(), self.is_taken_over(now));
        // It may be somebody else who turns it, but nobody else who stops it.
        let fields_s = fields_s.filter(|fields_s| !is_taken_over || StopConfirmation::is_rest(*fields_s));
        let Some(confirmation) = self.stop_confirmation.as_mut().filter(|_| is_at_rest) else { return };
        let finding = confirmation.see(fields_s, taken_at);
        if finding == StopFinding::RepeatInVain {
            self.events.push(SessionEvent::StopInVain);
        }
        match finding {
            StopFinding::Unknown => {}
            StopFinding::Rests => self.had_effect(),
            StopFinding::Repeat | StopFinding::RepeatInVain => {
                self.scheduler.found_moving(self.scheduler.stop());
                self.was_told_in_vain();
            }
        }
    }

    /// A stop that no picture tells of is repeated.
    fn repeat_unseen_stop(&mut self, now: Time) {
        // Even where somebody else seems to have the camera: one that turns on looks as if somebody moved it.
        let (is_at_rest, most) = (self.is_at_rest(), self.unseen_repeats());
        let confirmation = self.stop_confirmation.as_mut().filter(|_| is_at_rest);
        if confirmation.is_some_and(|confirmation| confirmation.repeats_unseen(most, now)) {
            self.scheduler.found_moving(self.scheduler.stop());
            if self.speaker == Speaker::Newcomer {
                // Who moved the camera need not have it said by somebody else.
                self.was_told_in_vain();
            }
        }
    }

    /// How often a stop that no picture tells of is repeated. The mover's own may fail in between, and he is to have the last word.
    fn unseen_repeats(&self) -> u32 {
        if self.speaker == Speaker::Newcomer { StopConfirmation::IN_VAIN } else { 1 }
    }

    /// What is to be known of the camera to decide what it is to do.
    pub fn actuator(&self, now: Time) -> ActuatorStatus {
        ActuatorStatus {
            access: self.access(now),
            mode: self.mode(now),
            may_move: self.scheduler.may_move(),
            in_doubt: self.scheduler.in_doubt(),
            interval: self.interval(),
        }
    }

    /// From one command to the next.
    fn interval(&self) -> Duration {
        self.settings.min_interval().max(self.scheduler.round_trip())
    }

    fn access(&self, now: Time) -> Access {
        if self.speaker != Speaker::Owner || self.is_taken_over(now) {
            Access::Others
        } else if self.arbitration.is_ours(now) {
            Access::Ours
        } else {
            Access::Undecided
        }
    }

    /// How to move the camera: as is set, if it takes that.
    fn mode(&self, now: Time) -> Mode {
        self.modes.choose(self.tells_position(), now)
    }

    /// Whether the camera told which way it looks.
    pub fn tells_position(&self) -> bool {
        self.position.pan_tilt().is_some()
    }

    /// Whether the camera was asked all there is to ask of one just met.
    pub fn is_discovered(&self) -> bool {
        self.discovery.next().is_none()
    }

    /// Whether a stop would not be heard; the answer under way may make it so.
    pub fn is_deaf(&self) -> bool {
        self.arbitration.queue.is_deaf()
    }

    /// Whether no stop is to be said for the time being: it would not be heard, or could end somebody else's move.
    pub fn withholds_stop(&self) -> bool {
        self.is_deaf() || self.scheduler.is_contested()
    }

    /// Whether the camera does not move on our behalf, as far as can be known.
    pub fn is_at_rest(&self) -> bool {
        !self.scheduler.may_move()
    }

    /// Whether it rests for good: nothing that went unanswered can set it going any more.
    pub fn stays_at_rest(&self) -> bool {
        self.is_at_rest() && !self.scheduler.in_doubt()
    }

    /// Whether it may yet act on a move that went unanswered.
    pub fn in_doubt(&self) -> bool {
        self.scheduler.in_doubt()
    }

    /// Whether the camera counts on hearing from us.
    pub fn is_queued(&self) -> bool {
        self.arbitration.queue.is_in()
    }

    /// Whether the camera answers and does as it is told.
    pub fn is_connected(&self) -> bool {
        self.connection.connected()
    }

    /// Whether somebody else moves the camera.
    pub fn is_taken_over(&self, now: Time) -> bool {
        self.arbitration.owner(now).is_some()
    }

    /// Whether a stop is ours to send: the camera may be moving at our word, and would hear it. Who has taken the camera has not
    /// ended what it still does for us; but for what it may yet do, from rest, his move is not to be stopped.
    pub fn is_ours_to_stop(&self, now: Time) -> bool {
        let may_yet_move = (self.in_doubt() || self.awaits_mover()) && !self.is_taken_over(now);
        !self.halted() && (!self.is_at_rest() || may_yet_move)
    }

    /// Whether nothing may be sent until a setting changes.
    pub fn halted(&self) -> bool {
        self.connection.halted()
    }

    /// What holds whatever the camera and its users do; asked after every step where debug assertions are on.
    pub fn check_invariants(&self) {
        self.connection.check_invariants();
        self.discovery.check_invariants();
        self.scheduler.check_invariants();
        self.arbitration.check_invariants();
        self.modes.check_invariants();
    }

    /// What happened since the last call.
    pub fn take_events(&mut self) -> Vec<SessionEvent> {
        mem::take(&mut self.events)
    }
}
