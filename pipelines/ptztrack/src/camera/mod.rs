// SPDX-License-Identifier: MPL-2.0

//! One camera: a thread in which its pipeline runs, is watched, and comes back, in this process or in one of its own.

mod bounds;
mod by_hand;
mod known;
mod messages;
mod packets;
mod pipeline;
pub mod process;
pub mod recording;
mod refusals;
mod running;
mod servo_stats;
mod sight;
mod sightings;
mod stopwatch;
#[cfg(test)]
pub mod told;
mod video;
mod view;

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::io;
use std::rc::Rc;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

pub use bounds::picture_size;
pub use by_hand::Turn;
pub use known::{Control, Gaze, Known, Origin, Pointed, Steering};
use messages::Listener;
pub use packets::{Content, Packet, next as next_packet};
use pipeline::NotBuilt;
use pipeline_supervisor::Supervisor;
use pipeline_supervisor::video::Failure;
use process::Processes;
use ptztrack_contract::Point;
use ptztrack_contract::lock::lock;
use recording::Recorder;
use refusals::Refusals;
pub use running::Abilities;
use running::Running;
pub use sight::{Person, Pose, Sight};
pub use stopwatch::Stopwatch;
use tokio::sync::oneshot;
pub use view::{Look, Shown};

use crate::config::{CameraSettings, Isolation};
use crate::event::{Event, Level};
use crate::log::Log;

/// A pipeline that gives no picture for so long is built anew.
const LONGEST_SILENCE: Duration = Duration::from_secs(10);

/// A camera that was sent home is not asked before whether it is there: it may not have set out yet.
const SETS_OUT: Duration = Duration::from_secs(2);
/// It follows again after this, wherever it is.
const LONGEST_WAY_HOME: Duration = Duration::from_secs(30);

/// A camera that is followed with.
#[derive(Debug)]
pub struct Camera {
    pub settings: CameraSettings,
    pub known: Arc<Known>,
    runner: Runner,
    log: Arc<Log>,
    thread: Option<JoinHandle<()>>,
    /// Has the camera until it ends; the thread waits for that.
    predecessor: Arc<Mutex<Option<JoinHandle<()>>>>,
}

/// Who runs it, in the camera's thread.
#[derive(Debug, Clone)]
enum Runner {
    Pipelines(glib::MainContext, Supervisor),
    Processes(Arc<Processes>),
}

impl Runner {
    /// Pipelines of this process.
    fn here() -> Self {
        let context = glib::MainContext::new();
        let supervisor = Supervisor::new(&context);
        Self::Pipelines(context, supervisor)
    }

    fn of(isolation: Isolation) -> Self {
        match isolation {
            Isolation::None => Self::here(),
            Isolation::Process => Self::Processes(Arc::default()),
        }
    }

    /// Until it is told to end, or the camera is given up.
    fn run(&self, settings: &CameraSettings, known: &Arc<Known>, log: &Arc<Log>) {
        match self {
            Self::Pipelines(context, supervisor) => {
                // The context is the thread's own, so nobody else has it.
                let _ = context.with_thread_default(|| run(settings, known, supervisor, log));
            }
            Self::Processes(processes) => processes.run(settings, known, log),
        }
    }
}

impl Camera {
    /// One that can be started, with who had it before, and whether the account has worked.
    pub fn new(
        settings: CameraSettings,
        control: Control,
        worked: bool,
        log: Arc<Log>,
        predecessor: Option<Self>,
    ) -> Self {
        let runner = Runner::of(settings.isolation);
        Self::with(runner, settings, control, worked, log, predecessor)
    }

    /// The same, in this process in any case, and nobody's successor.
    pub fn here(settings: CameraSettings, control: Control, worked: bool, log: Arc<Log>) -> Self {
        Self::with(Runner::here(), settings, control, worked, log, None)
    }

    fn with(
        runner: Runner,
        settings: CameraSettings,
        control: Control,
        worked: bool,
        log: Arc<Log>,
        predecessor: Option<Self>,
    ) -> Self {
        let known = Arc::new(Known::new(&settings.name));
        known.take_control(control);
        // User and password that were right are tried again, where the camera refuses them for a while.
        let worked = predecessor.as_ref().map_or(worked, |before| {
            let (was, is) = (&before.settings, &settings);
            if (was.protocol, &was.address, &was.rtsp, &was.credentials)
                == (is.protocol, &is.address, &is.rtsp, &is.credentials)
            {
                return before.known.worked.load(Ordering::Relaxed);
            }
            // Another password than one that is known has not worked.
            was.no_password.is_some() && worked
        });
        known.worked.store(worked, Ordering::Relaxed);
        let predecessor = Arc::new(Mutex::new(predecessor.and_then(Self::into_thread)));
        Self { settings, known, runner, log, thread: None, predecessor }
    }

    /// Starts it, once its predecessor has ended. Waits for nothing.
    ///
    /// # Errors
    /// Where the system has no thread left. It can be tried again.
    pub fn start(&mut self) -> io::Result<()> {
        let (settings, known, log) = (self.settings.clone(), self.known.clone(), self.log.clone());
        let (runner, predecessor) = (self.runner.clone(), self.predecessor.clone());
        let in_thread = move || {
            let predecessor = lock(&predecessor).take();
            if let Some(predecessor) = predecessor {
                // One that panicked has said so.
                let _ = predecessor.join();
            }
            runner.run(&settings, &known, &log);
        };
        let builder = std::thread::Builder::new().name(self.settings.name.clone());
        self.thread = Some(builder.spawn(in_thread)?);
        Ok(())
    }

    pub fn is_started(&self) -> bool {
        self.thread.is_some()
    }

    /// Ends it, without waiting.
    pub fn end(&self) {
        match &self.runner {
            Runner::Pipelines(_, supervisor) => supervisor.end(),
            Runner::Processes(processes) => {
                processes.end();
                self.thread.iter().for_each(|thread| thread.thread().unpark());
            }
        }
    }

    /// What ends once the camera rests, after [`Self::end`].
    pub fn into_thread(self) -> Option<JoinHandle<()>> {
        self.thread.or_else(|| lock(&self.predecessor).take())
    }

    /// It was given up, or has ended.
    pub fn is_over(&self) -> bool {
        self.thread.as_ref().is_some_and(JoinHandle::is_finished)
    }
}

fn run(settings: &CameraSettings, known: &Arc<Known>, supervisor: &Supervisor, log: &Arc<Log>) {
    let tell =
        |level, event: &str, detail: String| log.tell(&Event::new(level, Some(&known.name), event, detail));
    tell(Level::Info, "started", format!("starts with {}", settings.address));
    let listener = Rc::new(RefCell::new(Listener::new(known.clone(), log.clone())));
    let timer = glib::MainContext::ref_thread_default().spawn_local({
        let (known, supervisor, log) = (known.clone(), supervisor.clone(), log.clone());
        let listener = listener.clone();
        async move {
            loop {
                glib::timeout_future_seconds(1).await;
                listener.borrow_mut().look_for_picture();
                look_after(&known, &supervisor, &log);
            }
        }
    });
    let (recorder, recordings) =
        settings.recording.as_ref().map(|recording| Recorder::new(recording, settings, log.clone())).unzip();
    // Where only a recording lacks something, the recorder says so.
    let unrecorded = CameraSettings { recording: None, ..settings.clone() };
    let waits = listener.clone();
    let mut refusals = Refusals::default();
    let build = || {
        // The one before may have gone without a word.
        waits.borrow().ends();
        if let Some(reason) = unrecorded.lacks() {
            return Err(reason.into());
        }
        // What ended the last one counts here, too.
        let ended = lock(&known.ended).take();
        let built = match (&settings.no_password, ended.filter(|ended| ended.refused)) {
            (Some(reason), _) => Err(NotBuilt::Video(Failure::new(reason))),
            (_, Some(refused)) => Err(NotBuilt::Video(refused)),
            _ if refusals.are_waited_for() => return Ok(None),
            _ => pipeline::build(settings, known, recorder.clone(), log),
        };
        match built {
            Ok(pipeline) => {
                known.begins();
                known.rebuilt.fetch_add(1, Ordering::Relaxed);
                return Ok(Some(pipeline));
            }
            Err(NotBuilt::Pipeline(err)) => return Err(err),
            Err(NotBuilt::Video(failure)) => {
                lock(&known.running).take();
                if failure.refused {
                    refusals.wait(known.processed.load(Ordering::Relaxed));
                    // One that never worked is wrong, and to try it again could lock the account.
                    if !known.worked.load(Ordering::Relaxed) {
                        return Err(failure.reason.into());
                    }
                }
                waits.borrow_mut().out_of_reach(failure.reason);
            }
        }
        Ok(None)
    };
    let result = supervisor.run(build, move |message| listener.borrow_mut().hear(message));
    drop(recorder);
    if let Some(recordings) = recordings {
        recordings.wait();
    }
    timer.abort();
    lock(&known.running).take();
    let mut state = lock(&known.state);
    state.picture = false;
    if let Err(err) = result {
        let reason = match err.downcast_ref::<glib::Error>() {
            Some(err) if err.matches(gst::ResourceError::NotAuthorized) => {
                "the camera refuses user and password".to_owned()
            }
            _ => err.to_string(),
        };
        state.given_up = true;
        state.trouble = Some(reason.clone());
        drop(state);
        let reason = reason.trim_end_matches('.');
        let what_now = "not tried again until the configuration is read again (SIGHUP); a password from `password-credential` or \
            `password-environment` that has changed is read at a restart";
        tell(Level::Error, "given-up", format!("given up: {reason}; {what_now}"));
    } else {
        drop(state);
        tell(Level::Info, "stopped", "has stopped".to_owned());
    }
}

/// Once a second.
fn look_after(known: &Arc<Known>, supervisor: &Supervisor, log: &Log) {
    known.beat();
    let running = lock(&known.running).clone();
    let Some(running) = running else { return };
    running.look(known.looking.load(Ordering::Relaxed) > 0);
    let steering = *lock(&known.steering);
    let over = match steering {
        Steering::GoHome(since) | Steering::TurnBack(_, since) => {
            let there = since.elapsed() > SETS_OUT && known.is_at_rest();
            there || since.elapsed() > LONGEST_WAY_HOME
        }
        Steering::LookAt(_, since) => since.elapsed() > LONGEST_WAY_HOME,
        Steering::Operator(until) | Steering::Turned(_, until) => until <= Instant::now(),
        Steering::Follow | Steering::HandedOver => false,
    };
    if over {
        // Whoever has taken it meanwhile keeps it.
        known.steer_if(|now| now == steering, Steering::Follow);
    }
    if known.since_picture() > LONGEST_SILENCE {
        let detail = format!("no picture for {} s: the pipeline is built anew", LONGEST_SILENCE.as_secs());
        log.tell(&Event::new(Level::Warning, Some(&known.name), "no-picture", detail));
        known.reset_silence();
        supervisor.restart();
    }
}

/// What somebody at the page can ask for.
impl Known {
    /// Follows whom the tracker knows by this number.
    pub fn select_track(&self, id: u64) {
        self.with(|running| running.select_track(id));
    }

    /// Does not follow whom the tracker knows by these numbers, and all others again, until they are selected.
    pub fn ignore(&self, ids: BTreeSet<u64>) {
        if *lock(&self.ignored) != ids {
            self.with(|running| running.ignore(&ids));
            *lock(&self.ignored) = ids;
        }
    }

    /// Follows who is at this place of the picture, 0 to 1.
    pub fn select(&self, x: f64, y: f64) {
        lock(&self.origin).take();
        *lock(&self.selected) = self.sight.borrow().1.person_at(Point { x, y }).map(|person| person.id);
        self.with(|running| running.select(x, y));
    }

    /// Its picture shows here what that of another camera shows there. Whether that can be is answered by who hands people over.
    pub fn point(
        &self,
        from: String,
        there: Point,
        here: Point,
    ) -> oneshot::Receiver<Result<String, String>> {
        const MOST: usize = 16;
        let (answer, answered) = oneshot::channel();
        let mut points = lock(&self.points);
        // Where nobody takes notice.
        points.truncate(MOST - 1);
        points.push(Pointed { from, there, here, answer });
        answered
    }

    pub fn release(&self) {
        lock(&self.origin).take();
        lock(&self.selected).take();
        self.with(|running| running.release());
    }

    /// Sends the camera home, and lets the target go; `false`: it is handed over.
    pub fn go_home(&self) -> bool {
        let goes = self.steer_if(|now| now != Steering::HandedOver, Steering::GoHome(Instant::now()));
        if goes {
            self.release();
        }
        goes
    }

    /// Turns it by hand; `false`: it is handed over.
    pub fn turn(&self, turn: Turn) -> bool {
        let running = lock(&self.running).clone();
        running.map_or_else(|| !self.is_handed_over(), |running| running.turn(self, turn))
    }

    /// What can be done with the camera.
    pub fn abilities(&self) -> Abilities {
        let running = lock(&self.running).clone();
        running.map(|running| running.abilities(self)).unwrap_or_default()
    }

    fn with(&self, what: impl FnOnce(&dyn Running)) {
        let running = lock(&self.running).clone();
        if let Some(running) = running {
            what(&*running);
        }
    }
}
