// SPDX-License-Identifier: MPL-2.0

//! The one task that talks to the camera: takes what the streaming thread left, asks the control loop, sends.

mod account;
mod clock;
mod dead_man;
mod mailbox;
mod outbox;
mod predecessor;
mod state;
mod statistics;

use std::cell::Cell;
use std::pin::pin;
use std::sync::mpsc::{Receiver, SyncSender};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use once_cell::sync::OnceCell;
use tokio::runtime::{Builder, Runtime};

pub use self::clock::Clock;
pub use self::dead_man::DeadManState;
pub use self::mailbox::Mailbox;
pub use self::outbox::Outbox;
pub use self::statistics::Statistics;

use self::account::Account;
use self::dead_man::DeadMan;
use self::predecessor::{Address, Predecessor, UnconfirmedStop};
use self::state::TaskState;

use servo::Time;

use crate::http::{ClientSettings, Identity};
use crate::session::{Session, Speaker};
use crate::watchdog::{StopOrder, Unavailable, Watchdog};
use crate::{Client, Command, ControlLoop, Error, LoopEvent, LoopSettings, Next, Request, Status};
use ptztrack_contract::lock::lock;

/// A request is not abandoned before this for a stop that is due.
pub const STOP_GRACE: Duration = Duration::from_millis(500);

/// At the end the camera's yes to its stop is waited for this long.
pub const FINISH_BUDGET: Duration = Duration::from_secs(2);

/// A stop that was not confirmed by then goes on being tried for this long, with nobody waiting: the network may
/// come back.
pub const LAST_RETRIES: Duration = Duration::from_secs(60);

/// Something the element tells the world.
#[derive(Debug)]
pub enum Event {
    /// An exchange is over.
    Exchanged {
        /// What was sent.
        request: Request,
        /// Why it was in vain, where it was.
        failure: Option<Error>,
        /// From sending it to the answer, or to its end.
        round_trip: Duration,
    },
    /// The control loop has something to say.
    Loop(LoopEvent),
    /// The camera is known to be otherwise than before.
    Status(Status),
    /// The end has come, and the camera has not confirmed its stop in time.
    GaveUp {
        /// Whether nothing more may be sent either.
        halted: bool,
    },
    /// A camera that moves goes on where this process dies: there is no watchdog.
    NoWatchdog(Unavailable),
    /// The camera cannot be spoken to as others can, and what that means.
    Warning(String),
    /// The camera task itself broke.
    Died(String),
    /// Nothing is left to be done at this time; this one waits until that, and all before it, is told.
    Settled(Arc<SyncSender<()>>),
}

thread_local! {
    static IS_OURS: Cell<bool> = const { Cell::new(false) };
}

/// Waits for the camera task to answer; but not in the plugin's own thread, where nobody would: what is
/// posted from there may make an application change the state, or drop the last reference, right there.
pub fn wait_for(answer: &Receiver<()>, longest: Duration) -> bool {
    !IS_OURS.get() && answer.recv_timeout(longest).is_ok()
}

/// Threads that talk to cameras.
const WORKERS: usize = 2;

/// A running camera task; dropping it stops the camera and ends the camera task, and waits for that within bounds.
#[derive(Debug)]
pub struct CameraTask {
    camera: Address,
    /// As whom the camera is to be stopped.
    identity: Arc<Mutex<Identity>>,
    mailbox: Arc<Mailbox>,
    statistics: Arc<Mutex<Statistics>>,
    /// When the camera was last asked to rest, while it is to.
    paused_at: Mutex<Option<Instant>>,
}

impl CameraTask {
    /// Starts, and sees to the camera in place of those who were dropped before they had stopped it; connecting happens
    /// in the background. `observer` is called from the camera task's thread.
    ///
    /// # Errors
    /// What keeps the client or the runtime from being made, in words.
    pub fn start<C: Client>(
        client: ClientSettings,
        settings: impl Into<LoopSettings>,
        clock: Clock,
        watchdog: Option<Arc<Watchdog>>,
        observer: impl Fn(Event) + Clone + Send + Sync + 'static,
    ) -> Result<Self, String> {
        let camera = (client.location.clone(), client.channel.clone());
        let client = C::new(client).map_err(|err| format!("{err}. {}", err.advice()))?;
        let mut account = Account::new(client);
        let runtime = runtime().map_err(|err| format!("no thread for the camera's connection: {err}"))?;
        let mailbox = Arc::new(Mailbox::new(clock));
        let mut control = ControlLoop::new(settings, &C::PROTOCOL);
        if let Some(left) = Predecessor::succeed(&camera) {
            inherit(left, &mut account, control.session_mut(), mailbox.now());
        }
        let identity = Arc::new(Mutex::new(account.identity()));
        let statistics = Arc::new(Mutex::default());
        let state = TaskState::new(control, mailbox.clone(), statistics.clone(), observer.clone());
        // Whoever comes next may come before the task begins.
        state.note_statistics();
        let task = Task {
            account,
            identity: identity.clone(),
            dead_man: DeadMan::new(watchdog),
            state,
            move_waits: false,
        };
        let running = runtime.spawn(task.run());
        let task = Self { camera, identity, mailbox, statistics, paused_at: Mutex::default() };
        let predecessor = task.predecessor();
        let mailbox = task.mailbox.clone();
        runtime.spawn(async move {
            if let Err(err) = running.await {
                mailbox.close();
                observer(Event::Died(err.to_string()));
                predecessor.stop::<C>(&mailbox).await;
            }
        });
        Ok(task)
    }

    /// Where to leave things for it.
    pub fn mailbox(&self) -> &Mailbox {
        &self.mailbox
    }

    /// Has the camera stopped, and moved no more; waits for nothing.
    pub fn pause(&self) {
        self.mailbox.accept_measurements(false);
        *lock(&self.paused_at) = Some(Instant::now());
        // Waited for when the task is dropped.
        drop(self.mailbox.rest());
    }

    /// The camera may be moved.
    pub fn play(&self) {
        *lock(&self.paused_at) = None;
        self.mailbox.accept_measurements(true);
    }

    /// What will be left of it.
    fn predecessor(&self) -> Predecessor {
        Predecessor::new(self.camera.clone(), self.identity.clone(), &self.mailbox, self.statistics.clone())
    }

    /// The numbers so far.
    pub fn statistics(&self) -> Statistics {
        lock(&self.statistics).clone()
    }
}

impl Drop for CameraTask {
    fn drop(&mut self) {
        self.predecessor().leave();
        // Of many that were paused together each has waited while the first one was waited for.
        let waited = lock(&self.paused_at).map_or(Duration::ZERO, |since| since.elapsed());
        let left = FINISH_BUDGET.saturating_sub(waited);
        // Whether the camera came to rest the camera task itself reports, and when that time is over.
        wait_for(&self.mailbox.finish(left), left + STOP_GRACE);
        Predecessor::forget_void();
    }
}

/// The plugin's own threads, for all elements, made when first needed; several, so that one that is kept busy delays no
/// other camera's stop. Never waited for with
/// `block_on`: the caller may be inside an application's own runtime.
pub fn runtime() -> Result<&'static Runtime, std::io::Error> {
    static RUNTIME: OnceCell<Runtime> = OnceCell::new();
    RUNTIME.get_or_try_init(|| {
        let mut builder = Builder::new_multi_thread();
        builder.worker_threads(WORKERS).thread_name("ptz-camera").on_thread_start(|| IS_OURS.set(true));
        builder.enable_all().build()
    })
}

/// Goes on where whoever steered the camera before has left off.
fn inherit<C: Client>(left: UnconfirmedStop, account: &mut Account<C>, session: &mut Session, now: Time) {
    session.inherit(left.stop, now);
    let speaks_as_him = account.succeed(left.identity);
    if let Some(refusal) = left.refusal.filter(|_| speaks_as_him) {
        session.inherit_refusal(refusal, now);
    }
    if account.stands_in() {
        session.stand_in(now);
    }
}

struct Task<C, O> {
    account: Account<C>,
    /// For whoever must finish what the task has begun.
    identity: Arc<Mutex<Identity>>,
    dead_man: DeadMan,
    state: TaskState<O>,
    /// A move waits until it is known whether the watchdog would end it.
    move_waits: bool,
}

impl<C: Client, O: Fn(Event) + Send + Sync> Task<C, O> {
    async fn run(mut self) {
        let missing = self.dead_man.check();
        self.state.tell_dead_man(self.dead_man.state(), missing);
        loop {
            self.state.take_mail();
            self.state.check_deadline();
            if self.state.credentials.is_some() {
                self.change_credentials().await;
            }
            self.take_turns();
            self.keep_lease();
            self.state.publish();
            if self.state.is_over() {
                break;
            }
            let now = self.state.mailbox.now();
            match self.state.control.next_request(now) {
                Next::Do(request) if self.awaits_lease(&request) => {
                    self.wait(self.state.control.stale_at()).await;
                }
                Next::Do(request) => {
                    self.perform(request).await;
                    self.state.warn(self.account.client().take_warning());
                }
                Next::Wait(until) => {
                    self.state.tell_settled();
                    self.wait(until).await;
                }
            }
        }
        self.state.give_up();
        if self.state.is_succeeded {
            // Or the watchdog would stop his camera.
            self.dead_man.release();
        }
    }

    /// Until something comes up, or this time.
    async fn wait(&self, until: Option<Time>) {
        let until = until.into_iter().chain(self.state.deadline).min();
        tokio::select! {
            () = self.state.mailbox.arrived() => {}
            () = self.state.mailbox.sleep_until(until) => {}
            () = self.dead_man.due() => {}
        }
    }

    /// For as long as the camera may move on our behalf, or is to, the watchdog is to stop it where we cannot.
    fn keep_lease(&mut self) {
        let Self { account, dead_man, state, move_waits, .. } = self;
        let in_doubt = state.control.session().in_doubt();
        if !std::mem::take(move_waits) {
            if !state.control.session().is_ours_to_stop(state.mailbox.now()) {
                dead_man.release();
            } else if dead_man.is_outdated(in_doubt) {
                let (identity, words) = (account.identity(), state.control.stop());
                dead_man.hold(StopOrder { identity, words, in_doubt });
            }
        }
        state.keep_dead_man(dead_man);
    }

    /// Whether this would set a camera going that nobody is known to stop yet. One that moves is not left to itself for that.
    fn awaits_lease(&mut self, request: &Request) -> bool {
        let Self { account, dead_man, state, move_waits, .. } = self;
        if is_move(request) && state.control.session().is_at_rest() {
            if dead_man.is_outdated(true) {
                let (identity, words) = (account.identity(), state.control.stop());
                dead_man.hold(StopOrder { identity, words, in_doubt: true });
            }
            state.keep_dead_man(dead_man);
            *move_waits = dead_man.is_awaited();
        }
        *move_waits
    }

    /// Before, a camera that moves is stopped by whom it knows: if the new ones are wrong, nobody can. Where it does not answer,
    /// they wait until it does.
    async fn change_credentials(&mut self) {
        self.take_turns();
        if let Some(stop) = self.state.control.session().parting_stop(self.state.mailbox.now()) {
            self.perform(Request::Command(Command::Stop(stop))).await;
            self.take_turns();
            // A password often follows on the user's heels.
            self.state.take_mail();
        }
        if let Some(credentials) = self.state.credentials.take() {
            let now = self.state.mailbox.now();
            let session = self.state.control.session_mut();
            let is_free = session.has_stopped(now) || session.halted();
            let mut is_another = self.account.change(credentials.clone(), is_free);
            match (self.account.stands_in(), session.speaker()) {
                (true, Speaker::Owner) => session.stand_in(now),
                (false, Speaker::Mover | Speaker::Newcomer) => session.mover_stays(),
                _ => {}
            }
            if session.halted() && !is_another {
                // Whoever stays is asked anew all the same.
                is_another = self.account.change(credentials, true);
            }
            if is_another {
                session.owner_changed(now);
            }
            self.account.follow(session.speaker());
            *lock(&self.identity) = self.account.identity();
            self.dead_man.outdate();
        }
    }

    /// The session decides whose turn it is to speak.
    fn take_turns(&mut self) {
        let now = self.state.mailbox.now();
        let session = self.state.control.session_mut();
        session.settle_speaker(now);
        if self.account.follow(session.speaker()) {
            *lock(&self.identity) = self.account.identity();
            self.dead_man.outdate();
        }
    }

    /// One exchange, while mail goes on being taken: the newest target when it ends is the one steered by.
    async fn perform(&mut self, request: Request) {
        let Self { account, identity, dead_man, state, .. } = self;
        let mailbox = state.mailbox.clone();
        let sent = mailbox.now();
        state.control.sending(&request, sent);
        let stop = state.control.stop();
        {
            let mut statistics = lock(&state.statistics);
            statistics.stop = Some(stop);
            // Whoever comes next while it is under way must know of it.
            statistics.may_yet_move |= is_move(&request);
        }
        if matches!(request, Request::Command(_)) {
            // By now it may have been let in.
            let known_as = account.identity();
            lock(identity).clone_from(&known_as);
            if is_move(&request) {
                dead_man.hold(StopOrder { identity: known_as, words: stop, in_doubt: true });
                state.keep_dead_man(dead_man);
            }
        }
        let mut exchange = pin!(account.client().exchange(&request));
        loop {
            let now = mailbox.now();
            let silent_at = state.silent_at(&request, sent);
            if silent_at.is_some_and(|at| at <= now) {
                state.control.lose_target();
            }
            let give_up_at = state.give_up_at(&request, sent, now);
            if state.is_in_vain(&request, now) || give_up_at.is_some_and(|at| at <= now) {
                return state.abandoned(&request, sent);
            }
            let stale_at = state.control.stale_at().filter(|at| *at > now);
            let until = [give_up_at, silent_at, stale_at, state.deadline].into_iter().flatten().min();
            tokio::select! {
                biased;
                answer = &mut exchange => return state.answered(&request, answer, sent),
                () = mailbox.arrived() => state.take_mail(),
                () = mailbox.sleep_until(until) => {}
                () = dead_man.due() => state.keep_dead_man(dead_man),
            }
        }
    }
}

fn is_move(request: &Request) -> bool {
    matches!(request, Request::Command(command) if !command.is_stop())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{Locked, client_settings, credentials};
    use servo::{Measurement, ServoSettings};

    /// Only a failure takes this long.
    const PATIENCE: Duration = Duration::from_secs(60);

    fn start(location: &str, password: &str) -> CameraTask {
        let client = ClientSettings { credentials: credentials(password), ..client_settings(location) };
        let observer = |event| {
            if let Event::Settled(waiting) = event {
                let _ = waiting.try_send(());
            }
        };
        CameraTask::start::<Locked>(client, ServoSettings::default(), Clock::running(), None, observer)
            .unwrap()
    }

    fn wait_until(mut done: impl FnMut() -> bool) {
        let begin = Instant::now();
        while !done() {
            assert!(begin.elapsed() < PATIENCE);
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// One after the other at a camera that has locked the account while it moved; returns the second, who has this password.
    fn restarted(location: &str, password: &str) -> CameraTask {
        let first = start(location, "pass");
        wait_until(|| {
            first.mailbox().see(Measurement::at(0.9, 0.5, first.mailbox().now()));
            first.statistics().sent > 0
        });
        drop(first);
        wait_until(|| Locked::refused(location, "pass") == 2);
        let next = start(location, password);
        next.mailbox().settled().0.recv_timeout(PATIENCE).unwrap();
        next
    }

    /// Else whoever builds the pipeline again and again would keep it locked.
    #[test]
    fn an_account_that_is_locked_is_not_tried_anew_at_each_restart() {
        let location = "http://restarted.test";
        let _next = restarted(location, "pass");
        assert_eq!(Locked::refused(location, "pass"), 2);
    }

    #[test]
    fn nor_where_the_next_one_has_another_password_which_is_tried_at_once() {
        let location = "http://restarted-otherwise.test";
        let next = restarted(location, "falsch");
        wait_until(|| Locked::refused(location, "falsch") == 1);
        next.mailbox().settled().0.recv_timeout(PATIENCE).unwrap();
        assert_eq!(["pass", "falsch"].map(|password| Locked::refused(location, password)), [2, 1]);
    }
}
