//! The one task that talks to the camera: takes what the streaming thread left, asks the pilot, sends.

use std::pin::pin;
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use once_cell::sync::OnceCell;
use tokio::runtime::{Builder, Runtime};
use tokio::time::sleep;

use super::inbox::{Inbox, Mail};
use crate::servo::{Answer, Job, Next, Pilot, Query, Report, ServoSettings, Status};
use crate::vapix::{Client, ClientSettings, Credentials, Error};

/// A request in flight when a stop is due gets this much longer before it is given up for the stop.
const STOP_GRACE: Duration = Duration::from_millis(500);

/// At the end the camera is tried to be stopped for this long.
pub const FINISH_BUDGET: Duration = Duration::from_secs(2);

/// Something the element tells the world.
#[derive(Debug)]
pub enum Event {
    /// An exchange is over.
    Exchanged { job: Job, failure: Option<Error>, round_trip: Duration },
    /// The pilot has something to say.
    Report(Report),
    /// The camera is known to be otherwise than before.
    Status(Status),
    /// The end has come, and the camera has not confirmed its stop.
    GaveUp,
    /// The worker itself broke.
    Died(String),
}

/// Numbers for the `stats` property.
#[derive(Debug, Clone, Default)]
pub struct Statistics {
    pub status: Status,
    pub sent: u64,
    pub failed: u64,
    /// Pictures of the target that were overtaken by newer ones before they could be steered by.
    pub coalesced: u64,
    pub round_trip: Duration,
    pub round_trip_average: Duration,
    pub last_error: Option<String>,
    pub halted: bool,
}

/// A running worker; dropping it stops camera and worker without waiting.
#[derive(Debug)]
pub struct Worker {
    inbox: Arc<Inbox>,
    statistics: Arc<Mutex<Statistics>>,
}

impl Worker {
    /// Starts; connecting happens in the background. `observer` is called from the worker's thread.
    ///
    /// # Errors
    /// What keeps the client or the runtime from being made, in words.
    pub fn start(
        client: ClientSettings,
        servo: ServoSettings,
        observer: impl Fn(Event) + Clone + Send + Sync + 'static,
    ) -> Result<Self, String> {
        let client = Client::new(client).map_err(|err| format!("{err}. {}", err.advice()))?;
        let runtime = runtime().map_err(|err| format!("no thread for the camera's connection: {err}"))?;
        let inbox = Arc::new(Inbox::new());
        let statistics = Arc::new(Mutex::new(Statistics::default()));
        let desk = Desk {
            pilot: Pilot::new(servo),
            inbox: inbox.clone(),
            statistics: statistics.clone(),
            observer: observer.clone(),
            last_status: Status::default(),
            credentials: None,
            waiting: Vec::new(),
            deadline: None,
        };
        let task = Task { client, desk };
        let running = runtime.spawn(task.run());
        runtime.spawn(async move {
            if let Err(err) = running.await {
                observer(Event::Died(err.to_string()));
            }
        });
        Ok(Self { inbox, statistics })
    }

    /// Where to leave things for it.
    pub fn inbox(&self) -> &Inbox {
        &self.inbox
    }

    /// The numbers so far.
    pub fn statistics(&self) -> Statistics {
        lock(&self.statistics).clone()
    }

    /// Stops the camera for good, with all the time there is for it.
    pub fn finish(self) -> bool {
        self.inbox.finish().recv_timeout(FINISH_BUDGET + STOP_GRACE).is_ok()
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        drop(self.inbox.finish());
    }
}

/// The plugin's own threads: one for all elements, made when first needed. Never waited for with
/// `block_on`: the caller may be inside an application's own runtime.
fn runtime() -> Result<&'static Runtime, std::io::Error> {
    static RUNTIME: OnceCell<Runtime> = OnceCell::new();
    RUNTIME.get_or_try_init(|| {
        Builder::new_multi_thread().worker_threads(1).thread_name("vapix").enable_all().build()
    })
}

struct Task<O> {
    client: Client,
    desk: Desk<O>,
}

/// Everything but the client, which is lent out while a request is in flight.
struct Desk<O> {
    pilot: Pilot,
    inbox: Arc<Inbox>,
    statistics: Arc<Mutex<Statistics>>,
    observer: O,
    last_status: Status,
    credentials: Option<Option<Credentials>>,
    waiting: Vec<SyncSender<()>>,
    /// The end, once it has been asked for.
    deadline: Option<Duration>,
}

impl<O: Fn(Event) + Send + Sync> Task<O> {
    async fn run(mut self) {
        loop {
            self.desk.take_mail();
            if let Some(credentials) = self.desk.credentials.take() {
                self.client.set_credentials(credentials);
                self.desk.pilot.credentials_changed();
            }
            self.desk.publish();
            if self.desk.is_over() {
                break;
            }
            let now = self.desk.inbox.now();
            match self.desk.pilot.next(now) {
                Next::Do(job) => self.perform(job).await,
                Next::Wait(until) => {
                    let until = until.into_iter().chain(self.desk.deadline).min();
                    tokio::select! {
                        () = self.desk.inbox.arrived() => {}
                        () = sleep_until(until, now) => {}
                    }
                }
            }
        }
        if !self.desk.pilot.is_at_rest() {
            (self.desk.observer)(Event::GaveUp);
        }
    }

    /// One exchange, while mail goes on being taken: the newest target when it ends is the one steered by.
    async fn perform(&mut self, job: Job) {
        let Self { client, desk } = self;
        let inbox = desk.inbox.clone();
        let sent = inbox.now();
        desk.pilot.sending(&job, sent);
        let mut exchange = pin!(exchange(client, &job));
        let mut give_up_at = None;
        let answer = loop {
            if desk.stop_waits_behind(&job) {
                give_up_at.get_or_insert(inbox.now() + STOP_GRACE);
            }
            let until = give_up_at.into_iter().chain(desk.deadline).min();
            tokio::select! {
                biased;
                answer = &mut exchange => break answer,
                () = inbox.arrived() => desk.take_mail(),
                () = sleep_until(until, inbox.now()) => {
                    break Err(Error::Timeout(inbox.now().saturating_sub(sent)));
                }
            }
        };
        desk.answered(&job, answer, sent);
    }
}

impl<O: Fn(Event)> Desk<O> {
    /// Whether the end has come: at rest, out of time, or with no right to speak.
    fn is_over(&self) -> bool {
        self.deadline.is_some_and(|deadline| {
            self.pilot.is_at_rest() || self.pilot.halted() || deadline <= self.inbox.now()
        })
    }

    fn take_mail(&mut self) {
        let Mail { credentials, servo, rest, sight, waiting, finish } = self.inbox.take();
        let now = self.inbox.now();
        self.credentials = credentials.or(self.credentials.take());
        if let Some(servo) = servo {
            self.pilot.configure(servo);
        }
        if rest {
            self.pilot.rest();
        }
        if finish {
            self.deadline.get_or_insert(now + FINISH_BUDGET);
        }
        if let Some(sight) = sight.filter(|_| self.deadline.is_none()) {
            self.pilot.see(sight, now);
        }
        self.waiting.extend(waiting);
    }

    /// Whether something else than a stop is in flight while a stop is what the camera needs.
    fn stop_waits_behind(&self, job: &Job) -> bool {
        let may_move = match job {
            Job::Command(command) => !command.is_stop(),
            Job::Query(_) => !self.pilot.is_at_rest(),
        };
        may_move && !self.pilot.has_target()
    }

    fn answered(&mut self, job: &Job, answer: Result<Answer, Error>, sent: Duration) {
        let now = self.inbox.now();
        let round_trip = now.saturating_sub(sent);
        let failure = answer.as_ref().err().cloned();
        self.count(job, failure.as_ref(), round_trip);
        (self.observer)(Event::Exchanged { job: *job, failure, round_trip });
        self.pilot.answered(job, answer, sent, now);
    }

    fn count(&self, job: &Job, failure: Option<&Error>, round_trip: Duration) {
        let mut statistics = lock(&self.statistics);
        if let Some(err) = failure {
            statistics.last_error = Some(err.to_string());
        }
        match (job, failure) {
            (Job::Query(_), _) => {}
            (Job::Command(_), Some(_)) => statistics.failed += 1,
            (Job::Command(_), None) => {
                statistics.sent += 1;
                statistics.round_trip = round_trip;
                // Over about the last eight.
                let average = if statistics.sent == 1 { round_trip } else { statistics.round_trip_average };
                statistics.round_trip_average = (average * 7 + round_trip) / 8;
            }
        }
    }

    /// Tells what has changed: reports, status, and those who wait for rest.
    fn publish(&mut self) {
        let status = self.pilot.status(self.inbox.now());
        {
            let mut statistics = lock(&self.statistics);
            statistics.status = status;
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
        if self.pilot.is_at_rest() {
            // Who waits no longer is not there to be told.
            for waiting in self.waiting.drain(..) {
                let _ = waiting.try_send(());
            }
        }
    }
}

async fn exchange(client: &mut Client, job: &Job) -> Result<Answer, Error> {
    match job {
        Job::Command(command) => client.send(command).await.map(|()| Answer::Accepted),
        Job::Query(Query::Position) => client.position().await.map(Answer::Position),
        Job::Query(Query::Limits) => client.limits().await.map(Answer::Limits),
        Job::Query(Query::Parameters) => client.parameters().await.map(Answer::Parameters),
    }
}

/// Sleeps until a time on the inbox's clock; for ever where there is none.
async fn sleep_until(until: Option<Duration>, now: Duration) {
    match until {
        Some(until) => sleep(until.saturating_sub(now)).await,
        None => std::future::pending().await,
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
