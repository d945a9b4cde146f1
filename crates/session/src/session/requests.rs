// SPDX-License-Identifier: MPL-2.0

//! What to say to the camera next, and why.

use std::time::Duration;

use servo::{Actuation, Servo};

use super::{Session, StopConfirmation};
use crate::{Command, Next, Query, Request, SessionEvent};

impl Session {
    /// For as long as so many of them take, a question gives way to moves: a slow camera leaves no time between
    /// them, and is moved all the worse for each answer that is waited for.
    const PATIENCE: u32 = 10;

    /// What to send now, if anything, for the camera to do what the servo wants.
    pub fn next_request(&mut self, servo: &mut Servo, now: Duration) -> Next {
        if self.connection.halted() {
            return Next::Wait(None);
        }
        if let Some(owner) = self.arbitration.change(now) {
            self.events.push(owner.map_or(SessionEvent::Resumed, SessionEvent::TakenOver));
        }
        self.repeat_unseen_stop(now);
        let actuation = servo.control(&self.actuator(servo, now), now);
        let (command, due) = self.command(actuation, self.settings.min_interval(), now);
        let (query, query_due) = self.question(servo, now);
        let query_due = query_due.max(self.connection.retry_at());
        let patience = self.patience(&query, servo, now);
        let overdue = query_due.max(self.asked_at) + patience <= now;
        if due.is_some_and(|due| due <= now) && (command.is_stop() || !overdue) {
            return Next::Do(Request::Command(command));
        }
        if query_due <= now {
            return Next::Do(Request::Query(query));
        }
        if cfg!(debug_assertions) {
            self.check_invariants();
            servo.check_invariants();
        }
        let operator_until = self.arbitration.operator_until(now);
        let unseen_at = self.stop_confirmation.as_ref().and_then(StopConfirmation::unseen_at);
        let unseen_at = unseen_at.filter(|_| self.is_at_rest());
        let reasons =
            [due, Some(query_due), servo.stale_at(), operator_until, servo.undecided_until(now), unseen_at];
        Next::Wait(reasons.into_iter().flatten().min())
    }

    /// The words for that, and when to say them.
    fn command(
        &self,
        actuation: Actuation,
        interval: Duration,
        now: Duration,
    ) -> (Command, Option<Duration>) {
        let retry_at = self.connection.retry_at();
        match Command::of(&actuation, self.description.wants_free_moves()) {
            None if actuation == Actuation::Continue || self.arbitration.queue.is_deaf() => {
                (self.stop(), None)
            }
            None => (self.stop(), self.scheduler.stop_due(now, interval, retry_at)),
            Some(_) if self.is_discovering() => (self.stop(), None),
            Some(command) => {
                let not_before = retry_at.max(self.modes.not_before(&command));
                (command, Some(self.scheduler.move_due(&command, interval, not_before)))
            }
        }
    }

    /// For how long moves come before a question.
    fn patience(&self, query: &Query, servo: &Servo, now: Duration) -> Duration {
        match query {
            // Our place in it is lost to who is late.
            Query::Queue(_) => Duration::ZERO,
            _ => self.actuator(servo, now).interval * Self::PATIENCE,
        }
    }

    /// What to ask next, and when.
    fn question(&self, servo: &mut Servo, now: Duration) -> (Query, Duration) {
        let poll = (Query::Position, self.next_poll);
        let presets = servo.home().presets_due().map(|at| (Query::Presets, at));
        // Of what is due the first; else what will be soonest.
        let questions = self.discovery.next().into_iter().chain(presets);
        let (query, at) = questions.chain([poll]).min_by_key(|(_, at)| (*at).max(now)).unwrap_or(poll);
        match self.arbitration.queue.next(self.stays_at_rest()) {
            Some((request, due)) if due <= at.max(now) => (Query::Queue(request), due),
            _ => (query, at),
        }
    }

    /// Before its first answers the camera is asked, not moved; but not for ever where it does not tell.
    fn is_discovering(&self) -> bool {
        self.discovery.comes_first() && !self.connection.faulty()
    }

    /// Whether there is something to do that a stop need not hurry for.
    pub fn has_errand(&self, servo: &Servo, now: Duration) -> bool {
        if self.arbitration.queue.is_deaf() {
            // A stop would not be heard; the answer under way may make it so.
            return true;
        }
        let homeward = || servo.is_homeward(&self.actuator(servo, now), now);
        self.arbitration.owner(now).is_none() && (servo.has_target(now) || homeward())
    }

    /// Something is being sent.
    pub fn sending(&mut self, request: &Request, now: Duration) {
        if let Request::Command(command) = request {
            self.scheduler.attempted(command, now);
        }
    }

    /// The answer is waited for no longer, as something else is more urgent: no fault of the camera's.
    pub fn abandoned(&mut self, request: &Request, servo: &mut Servo, now: Duration) {
        if let Request::Command(command) = request {
            self.unanswered(command, servo, now);
        }
    }
}
