//! What the pilot does next, and why.

use std::time::Duration;

use super::Pilot;
use crate::servo::{Job, Mode, Next, Query, Report};
use crate::vapix::Command;

/// What the camera should do.
pub(super) enum Wish {
    Rest,
    Move(Command),
    /// Whatever it does: a move to a position is under way.
    AsIs,
}

impl Pilot {
    /// For as long as so many of them take, a question gives way to moves: a slow camera leaves no time between
    /// them, and is moved all the worse for each answer that is waited for.
    const PATIENCE: u32 = 10;

    /// For so long the camera may go on as it was last told, while it is found out whether it is ours.
    const UNSTEERED: Duration = Duration::from_secs(1);

    /// What to send now, if anything.
    pub fn next(&mut self, now: Duration) -> Next {
        if self.link.halted() {
            return Next::Wait(None);
        }
        if let Some(holder) = self.authority.change(now) {
            self.reports.push(holder.map_or(Report::Resumed, Report::TakenOver));
        }
        let interval = Duration::from_secs_f64(1.0 / self.settings.max_rate_hz);
        let retry_at = self.link.retry_at();
        let (command, due) = match self.wish(now) {
            Wish::Rest if self.authority.queue.is_deaf() => (self.stop, None),
            Wish::Rest => (self.stop, self.scheduler.stop_due(now, interval, retry_at)),
            Wish::Move(_) if self.meeting() => (self.stop, None),
            Wish::Move(command) => {
                let not_before = retry_at.max(self.ways.not_before(&command));
                (command, Some(self.scheduler.move_due(&command, interval, not_before)))
            }
            Wish::AsIs => (self.stop, None),
        };
        let (query, query_due) = self.question(now);
        let query_due = query_due.max(retry_at);
        let overdue = query_due.max(self.asked_at) + self.patience(&query) <= now;
        if due.is_some_and(|due| due <= now) && (command.is_stop() || !overdue) {
            return Next::Do(Job::Command(command));
        }
        if query_due <= now {
            return Next::Do(Job::Query(query));
        }
        let operator_until = self.authority.operator_until(now);
        let unsteered_until = self.unsteered_since.map(|since| since + Self::UNSTEERED);
        let unsteered_until = unsteered_until.filter(|until| now < *until);
        let reasons = [due, Some(query_due), self.stale_at(), operator_until, unsteered_until];
        Next::Wait(reasons.into_iter().flatten().min())
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
    fn question(&self, now: Duration) -> (Query, Duration) {
        let poll = (Query::Position, self.next_poll);
        let presets = self.homing.presets_due().map(|at| (Query::Presets, at));
        // Of what is due the first; else what will be soonest.
        let questions = self.introduction.next().into_iter().chain(presets);
        let (query, at) = questions.chain([poll]).min_by_key(|(_, at)| (*at).max(now)).unwrap_or(poll);
        match self.authority.queue.next(self.stays_at_rest()) {
            Some((request, due)) if due <= at.max(now) => (Query::Queue(request), due),
            _ => (query, at),
        }
    }

    /// Whether there is something to do that a stop need not hurry for.
    pub fn has_errand(&self, now: Duration) -> bool {
        if self.authority.queue.is_deaf() {
            // A stop would not be heard; the answer under way may make it so.
            return true;
        }
        let going_home = self.steps.under_way() && self.homing.is_settled() || self.way_home(now).is_some();
        self.authority.holder(now).is_none() && (self.has_target(now) || going_home)
    }

    pub(super) fn has_target(&self, now: Duration) -> bool {
        self.stale_at().is_some_and(|at| now < at)
    }

    /// When the target will not have been seen for too long, where there is one.
    pub fn stale_at(&self) -> Option<Duration> {
        self.target.as_ref().map(|target| target.last_seen + self.settings.stale_timeout)
    }

    /// Before its first answers the camera is asked, not moved; but not for ever where it does not tell.
    fn meeting(&self) -> bool {
        self.introduction.comes_first() && !self.link.faulty()
    }

    fn wish(&mut self, now: Duration) -> Wish {
        if self.authority.holder(now).is_some() {
            // What moves it is his; what we last said must not outlive our hold on it.
            return Wish::Rest;
        }
        if !self.has_target(now) {
            self.lose();
        }
        let Some(target) = &mut self.target else { return self.wait(now) };
        if !self.authority.is_ours(now) {
            let since = *self.unsteered_since.get_or_insert(now);
            return if now < since + Self::UNSTEERED { Wish::AsIs } else { Wish::Rest };
        }
        self.unsteered_since = None;
        target.considered = true;
        let sight = target.sight;
        match self.mode(now) {
            Mode::Velocity => self.velocity(&sight, now),
            mode => self.step(mode, &sight, now),
        }
    }

    /// How to move the camera: as is set, if it takes that.
    pub(super) fn mode(&self, now: Duration) -> Mode {
        self.ways.choose(self.settings.mode, self.camera.pan_tilt().is_some(), now)
    }

    /// Without a target.
    fn wait(&self, now: Duration) -> Wish {
        if self.steps.under_way() && self.homing.is_settled() {
            return Wish::AsIs;
        }
        self.way_home(now).map_or(Wish::Rest, Wish::Move)
    }

    /// The move home, where it is time. A zoom that goes on at its own speed, or may yet begin to, is no part of that
    /// move, and has to be ended first.
    fn way_home(&self, now: Duration) -> Option<Command> {
        let zooms = self.zoom.is_moving(now) || self.scheduler.in_doubt();
        self.homing.due(now).filter(|_| self.authority.is_ours(now) && !zooms)
    }
}
