// SPDX-License-Identifier: MPL-2.0

//! What to say to the camera next, and why.

use std::time::Duration;

use servo::{Actuation, Time};

use super::connection::Connection;
use super::{Fact, Session, Speaker, Steering};
use crate::{Command, Next, Query, Request, SessionEvent};

impl Session {
    /// For as long as so many of them take, a question gives way to moves: a slow camera leaves no time between
    /// them, and is moved all the worse for each answer that is waited for.
    const PATIENCE: u32 = 10;

    /// Takes notice of what has come of the time that has passed.
    pub fn catch_up(&mut self, now: Time) {
        if let Some(owner) = self.arbitration.change(now) {
            self.events.push(owner.map_or(SessionEvent::Resumed, SessionEvent::TakenOver));
        }
        self.repeat_unseen_stop(now);
    }

    /// What to send now, if anything, for the camera to do this.
    pub fn next_request(&self, actuation: Actuation, steering: &Steering, now: Time) -> Next {
        if self.connection.halted() {
            return Next::Wait(None);
        }
        let (command, due) = self.command(actuation, self.settings.min_interval(), now);
        let (query, query_due) = self.question(steering.presets_due, now);
        let query_due = query_due.max(self.connection.retry_at());
        let overdue = query_due.max(self.asked_at) + self.patience(&query) <= now;
        if due.is_some_and(|due| due <= now) && (command.is_stop() || !overdue) {
            return Next::Do(Request::Command(command));
        }
        if query_due <= now {
            return Next::Do(Request::Query(query));
        }
        let operator_until = self.arbitration.operator_until(now);
        let confirmation = self.stop_confirmation.as_ref().filter(|_| self.is_at_rest());
        let unseen_at = confirmation.and_then(|stop| stop.unseen_at(self.unseen_repeats()));
        let open_until = confirmation.and_then(|stop| stop.open_until().filter(|at| *at > now));
        let reasons = [due, Some(query_due), operator_until, unseen_at, open_until, self.last_word_at()];
        Next::Wait(reasons.into_iter().flatten().min())
    }

    /// The words for that, and when to say them.
    fn command(&self, actuation: Actuation, interval: Duration, now: Time) -> (Command, Option<Time>) {
        let retry_at = self.connection.retry_at();
        let stop = Command::Stop(self.stop());
        let stop_due = || {
            let due = self.scheduler.stop_due(now, interval, retry_at).filter(|_| !self.is_deaf());
            let is_soon = |at: &Time| *at <= now + Connection::LONGEST_PAUSE;
            due.max(due.and(self.last_word_at().filter(is_soon)))
        };
        match actuation {
            Actuation::Continue => (stop, None),
            Actuation::Rest => (stop, stop_due()),
            Actuation::Move(_) if self.is_discovering() => (stop, None),
            // What became of the last move nobody knows, and the next one may be as late: over a network that holds them
            // back for seconds no target is followed by moves.
            Actuation::Move(_) if self.scheduler.is_unsure() => (stop, stop_due()),
            Actuation::Move(motion) => {
                let command = Command::of(motion, self.description.wants_free_moves());
                let not_before = retry_at.max(self.modes.not_before(&command));
                (command, Some(self.scheduler.move_due(&command, interval, not_before)))
            }
        }
    }

    /// For how long moves come before a question.
    fn patience(&self, query: &Query) -> Duration {
        match query {
            // Our place in it is lost to who is late.
            Query::Queue(_) => Duration::ZERO,
            _ => self.interval() * Self::PATIENCE,
        }
    }

    /// What to ask next, and when.
    fn question(&self, presets_due: Option<Time>, now: Time) -> (Query, Time) {
        let poll = (Query::Position, self.next_poll);
        // What it tells one it may not tell another.
        let is_owner = self.speaker == Speaker::Owner;
        let presets = presets_due.map(|at| (Query::Presets, at));
        // Of what is due the first; else what will be soonest.
        let questions = self.discovery.next().into_iter().chain(presets).filter(|_| is_owner);
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

    /// Something is being sent.
    pub fn sending(&mut self, request: &Request, now: Time) {
        if let Request::Command(command) = request {
            self.scheduler.attempted(command, now);
        }
    }

    /// The answer is waited for no longer, as something else is more urgent: no fault of the camera's.
    pub fn abandoned(&mut self, request: &Request, now: Time) -> Vec<Fact> {
        match request {
            Request::Command(command) => vec![self.unanswered(command, now)],
            Request::Query(_) => Vec::new(),
        }
    }
}
