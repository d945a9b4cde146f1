//! What the worker's task does between two exchanges: takes the mail, keeps count, tells the news.

use std::mem;
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::inbox::{Inbox, Mail};
use super::statistics::Statistics;
use super::worker::{Event, FINISH_BUDGET, LAST_WILL};
use crate::lock::lock;
use crate::servo::{Answer, Job, Pilot, Status};
use crate::vapix::{Credentials, Error};

/// Everything but the client, which is lent out while a request is in flight.
pub struct Desk<O> {
    pub pilot: Pilot,
    pub inbox: Arc<Inbox>,
    pub statistics: Arc<Mutex<Statistics>>,
    observer: O,
    last_status: Status,
    pub credentials: Option<Option<Credentials>>,
    waiting: Vec<SyncSender<()>>,
    settling: Vec<SyncSender<()>>,
    /// The end, once it has been asked for.
    pub deadline: Option<Duration>,
    /// Nobody waits any more.
    gave_up: bool,
}

impl<O: Fn(Event)> Desk<O> {
    /// Nothing has come in yet.
    pub fn new(pilot: Pilot, inbox: Arc<Inbox>, statistics: Arc<Mutex<Statistics>>, observer: O) -> Self {
        Self {
            pilot,
            inbox,
            statistics,
            observer,
            last_status: Status::default(),
            credentials: None,
            waiting: Vec::new(),
            settling: Vec::new(),
            deadline: None,
            gave_up: false,
        }
    }

    /// Whether the end has come: at rest, out of time, or with no right to speak.
    pub fn is_over(&self) -> bool {
        self.deadline.is_some_and(|deadline| {
            let done = self.pilot.is_at_rest() && !self.pilot.is_queued();
            done || self.pilot.halted() || deadline <= self.inbox.now()
        })
    }

    /// When the time for a confirmed stop is over, nobody waits for it any more; it is tried on for a while.
    pub fn check_deadline(&mut self) {
        let now = self.inbox.now();
        if !self.gave_up && self.deadline.is_some_and(|deadline| deadline <= now) {
            self.give_up();
            self.deadline = Some(now + LAST_WILL);
        }
    }

    pub fn give_up(&mut self) {
        if !self.pilot.is_at_rest() && !mem::replace(&mut self.gave_up, true) {
            (self.observer)(Event::GaveUp { halted: self.pilot.halted() });
        }
        self.waiting.clear();
    }

    pub fn take_mail(&mut self) {
        let Mail { credentials, servo, orphan, rest, sight, waiting, settling, finish, quit } =
            self.inbox.take();
        let now = self.inbox.now();
        self.credentials = credentials.or(self.credentials.take());
        if let Some(servo) = servo {
            self.pilot.configure(servo);
        }
        if let Some(stop) = orphan {
            self.pilot.inherit(stop);
        }
        if rest {
            self.pilot.rest();
        }
        if finish {
            self.deadline.get_or_insert(now + FINISH_BUDGET);
            self.pilot.leave();
        }
        if quit {
            (self.deadline, self.gave_up) = (Some(now), true);
        }
        if let Some(sight) = sight.filter(|_| self.deadline.is_none()) {
            self.pilot.see(sight, now);
        }
        self.waiting.extend(waiting);
        self.settling.extend(settling);
    }

    /// Whether nobody needs the answer: the end has come, and nothing in flight can move the camera.
    pub fn is_in_vain(&mut self, job: &Job, now: Duration) -> bool {
        match job {
            Job::Command(_) => self.deadline.is_some_and(|deadline| deadline <= now),
            Job::Query(_) => {
                self.tell_rest();
                self.is_over()
            }
        }
    }

    /// Whether something else than a stop is in flight while a stop is what the camera needs.
    pub fn stop_waits_behind(&self, job: &Job, now: Duration) -> bool {
        let may_move = match job {
            Job::Command(command) => !command.is_stop(),
            Job::Query(_) => !self.pilot.is_at_rest(),
        };
        may_move && !self.pilot.has_errand(now)
    }

    pub fn answered(&mut self, job: &Job, answer: Result<Answer, Error>, sent: Duration) {
        let now = self.inbox.now();
        self.count(job, answer.as_ref().err().cloned(), now.saturating_sub(sent));
        self.pilot.answered(job, answer, sent, now);
    }

    pub fn abandoned(&mut self, job: &Job, sent: Duration) {
        let now = self.inbox.now();
        let waited = now.saturating_sub(sent);
        self.count(job, Some(Error::Timeout(waited)), waited);
        self.pilot.abandoned(job, now);
    }

    fn count(&self, job: &Job, failure: Option<Error>, round_trip: Duration) {
        {
            let mut statistics = lock(&self.statistics);
            if let Some(err) = &failure {
                statistics.last_error = Some(err.to_string());
            }
            match (job, &failure) {
                (Job::Query(_), _) => {}
                (Job::Command(_), Some(_)) => statistics.failed += 1,
                (Job::Command(_), None) => statistics.succeeded(round_trip),
            }
        }
        (self.observer)(Event::Exchanged { job: *job, failure, round_trip });
    }

    /// Tells what has changed: reports and status; and those who wait for rest.
    pub fn publish(&mut self) {
        let status = self.pilot.status(self.inbox.now());
        {
            let mut statistics = lock(&self.statistics);
            statistics.status = status;
            statistics.belief = Some(self.pilot.belief());
            statistics.stop = Some(self.pilot.stop());
            statistics.halted = self.pilot.halted();
            statistics.coalesced = self.pilot.overtaken() + self.inbox.overtaken();
        }
        for report in self.pilot.take_reports() {
            (self.observer)(Event::Report(report));
        }
        if status != self.last_status {
            self.last_status = status;
            (self.observer)(Event::Status(status));
        }
        self.tell_rest();
    }

    /// Nothing is to be done at this time that has not been done.
    pub fn tell_settled(&mut self) {
        for settling in self.settling.drain(..) {
            let _ = settling.try_send(());
        }
    }

    fn tell_rest(&mut self) {
        if self.pilot.is_at_rest() {
            // Who waits no longer is not there to be told.
            for waiting in self.waiting.drain(..) {
                let _ = waiting.try_send(());
            }
        }
    }
}
