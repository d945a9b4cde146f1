// SPDX-License-Identifier: MPL-2.0

//! The task that talks to a camera, over real HTTP.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

use std::io::{BufRead, BufReader, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use ptztrack_contract::lock::lock;
use servo::{Measurement, ServoSettings};
use session::http::{Authentication, ClientSettings, Credentials, Location, Secret, Trust};
use session::session::ConnectionChange;
use session::task::{CameraTask, Clock, DeadManState, Event, FINISH_BUDGET};
use session::watchdog::{Armed, Watchdog, WatchdogAddress, serve};
use session::{Error, LoopEvent, SessionEvent};
use tokio::runtime::Builder;
use vapix::Client;
use virtual_camera::{Auth, Fault, Settings, VirtualCamera};

/// Only a failure takes this long.
const PATIENCE: Duration = Duration::from_secs(60);

/// Between two pictures; no test depends on it.
const PICTURE: Duration = Duration::from_millis(20);

fn start(camera: &VirtualCamera, observer: impl Fn(Event) + Clone + Send + Sync + 'static) -> CameraTask {
    start_with(camera, None, observer)
}

fn start_with(
    camera: &VirtualCamera,
    watchdog: Option<Arc<Watchdog>>,
    observer: impl Fn(Event) + Clone + Send + Sync + 'static,
) -> CameraTask {
    start_as(None, camera, watchdog, observer)
}

fn start_as(
    password: Option<&str>,
    camera: &VirtualCamera,
    watchdog: Option<Arc<Watchdog>>,
    observer: impl Fn(Event) + Clone + Send + Sync + 'static,
) -> CameraTask {
    let (location, _) = Location::parse(&camera.url()).unwrap();
    let client = ClientSettings {
        location,
        channel: "1".to_owned(),
        credentials: password.map(root),
        authentication: Authentication::default(),
        timeout: Duration::from_secs(2),
        trust: Trust::System,
    };
    CameraTask::start::<Client>(client, ServoSettings::default(), Clock::running(), watchdog, observer)
        .unwrap()
}

fn see(task: &CameraTask) {
    task.mailbox().see(Measurement::at(0.9, 0.5, task.mailbox().now()));
}

/// Shows the target until something comes of it: a picture is old after a second, which a busy machine may take to connect.
fn see_until(task: &CameraTask, mut done: impl FnMut(Duration) -> bool) {
    let begin = Instant::now();
    loop {
        see(task);
        if done(PICTURE) {
            return;
        }
        assert!(begin.elapsed() < PATIENCE, "the camera was not moved");
    }
}

fn camera() -> VirtualCamera {
    VirtualCamera::start(Settings::default()).unwrap()
}

/// `pass`.
fn camera_with_a_password() -> VirtualCamera {
    let auth = Auth::Digest { qop: true };
    VirtualCamera::start(Settings { auth, ptz_only: true, ..Settings::default() }).unwrap()
}

fn root(password: &str) -> Credentials {
    Credentials { user: "root".to_owned(), password: Secret::new(password) }
}

/// As an element does that is disposed of without having been brought to NULL.
#[test]
fn dropped_it_stops_the_camera() {
    let camera = camera();
    let task = start(&camera, |_| {});
    see_until(&task, |wait| camera.wait_for(wait, |status| status.moving));
    drop(task);
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
}

#[test]
fn it_can_be_dropped_in_its_own_thread() {
    let camera = camera();
    let task = Arc::new(Mutex::new(None));
    let (events, seen) = channel();
    let held = task.clone();
    let started = start(&camera, move |event| {
        if matches!(event, Event::Loop(LoopEvent::Session(SessionEvent::Moving))) {
            drop(lock(&held).take());
        }
        let _ = events.send(format!("{event:?}"));
    });
    *lock(&task) = Some(started);
    while lock(&task).as_ref().map(see).is_some() {
        std::thread::sleep(PICTURE);
    }
    // Until the task, and with it the observer, is gone.
    let seen: Vec<_> = std::iter::from_fn(|| seen.recv_timeout(PATIENCE).ok()).collect();
    assert!(seen.iter().any(|event| event.contains("Stopped")), "{seen:?}");
    assert!(!seen.iter().any(|event| event.contains("GaveUp") || event.contains("Died")), "{seen:?}");
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
}

/// A watchdog in this process: to the camera's task it makes no difference. It says when it is asked for, and answers nothing as long
/// as it is held back.
fn watchdog(test: &str, asked: Sender<()>, held_back: Receiver<()>) -> (Arc<Watchdog>, std::path::PathBuf) {
    static ARMED: Armed = Armed::new(|_| {});
    let socket = std::env::temp_dir().join(format!("vapix-watchdog-{test}-{}", std::process::id()));
    let _ = std::fs::remove_file(&socket);
    let listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
    std::thread::spawn(move || {
        let runtime = Builder::new_current_thread().enable_all().build().unwrap();
        let (application, _) = listener.accept().unwrap();
        application.set_nonblocking(true).unwrap();
        let _ = (asked.send(()), held_back.recv());
        runtime.block_on(async {
            serve::<Client>(tokio::net::UnixStream::from_std(application).unwrap(), &ARMED).await;
        });
    });
    (Watchdog::new(WatchdogAddress::Socket(socket.clone())), socket)
}

/// A camera that is moved before the watchdog has its lease turns on where this process dies in that moment.
#[test]
fn no_move_is_sent_before_the_watchdog_has_the_lease() {
    let camera = camera();
    let ((ask, asked), (hold_back, held_back)) = (channel(), channel());
    let (watchdog, socket) = watchdog("lease", ask, held_back);
    let task = start_with(&camera, Some(watchdog), |_| {});
    // Not before there is something to move.
    see_until(&task, |wait| asked.recv_timeout(wait).is_ok());
    for _ in 0..15 {
        see(&task);
        assert!(!camera.wait_for(PICTURE, |status| status.moving), "{:?}", camera.commands());
    }
    drop(hold_back);
    see_until(&task, |wait| camera.wait_for(wait, |status| status.moving));
    assert_eq!(task.statistics().dead_man, DeadManState::Armed);
    drop(task);
    std::fs::remove_file(socket).unwrap();
}

/// The process lives, and the socket with it: only the lease runs out.
#[test]
fn one_that_hangs_has_its_camera_stopped_by_the_watchdog() {
    let camera = camera();
    let (watchdog, socket) = watchdog("hangs", channel().0, channel().1);
    let (release, hold) = std::sync::mpsc::sync_channel::<()>(0);
    let hold = Arc::new(Mutex::new(hold));
    let task = start_with(&camera, Some(watchdog), move |event| {
        if matches!(event, Event::Loop(LoopEvent::Session(SessionEvent::Moving))) {
            let _ = lock(&hold).recv();
        }
    });
    see_until(&task, |wait| camera.wait_for(wait, |status| status.moving));
    assert_eq!(task.statistics().dead_man, DeadManState::Armed);
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
    drop(release);
    drop(task);
    std::fs::remove_file(socket).unwrap();
}

/// As [`watchdog`], and what it is told.
fn heard_watchdog(test: &str) -> (Arc<Watchdog>, std::path::PathBuf, Receiver<String>) {
    let (serving, socket) = watchdog(&format!("{test}-serving"), channel().0, channel().1);
    drop(serving);
    let heard_at = socket.with_extension("heard");
    let _ = std::fs::remove_file(&heard_at);
    let listener = std::os::unix::net::UnixListener::bind(&heard_at).unwrap();
    let (hears, heard) = channel();
    std::thread::spawn(move || {
        let (mut application, _) = listener.accept().unwrap();
        let mut serving = std::os::unix::net::UnixStream::connect(&socket).unwrap();
        std::fs::remove_file(&socket).unwrap();
        let (mut answers, mut answered) = (serving.try_clone().unwrap(), application.try_clone().unwrap());
        std::thread::spawn(move || std::io::copy(&mut answers, &mut answered));
        for line in BufReader::new(&mut application).lines().map_while(Result::ok) {
            serving.write_all(format!("{line}\n").as_bytes()).unwrap();
            let _ = hears.send(line);
        }
    });
    (Watchdog::new(WatchdogAddress::Socket(heard_at.clone())), heard_at, heard)
}

/// Its own lease would have the watchdog stop the camera of the next one.
#[test]
fn one_that_makes_way_for_the_next_gives_its_lease_back() {
    let camera = camera();
    let (watchdog, socket, heard) = heard_watchdog("makes-way");
    let first = start_with(&camera, Some(watchdog.clone()), |_| {});
    see_until(&first, |wait| camera.wait_for(wait, |status| status.moving));
    camera.set_fault(Fault::Status(503));
    drop(first);
    let said: Vec<_> = heard.try_iter().collect();
    let lease = said[0].strip_prefix(r#"{"hold":{"lease":"#).and_then(|rest| rest.split(',').next()).unwrap();
    let release = format!(r#"{{"release":{{"lease":{lease}}}}}"#);
    assert!(!said.contains(&release), "it goes on trying to stop the camera: {said:?}");
    let next = start_with(&camera, Some(watchdog), |_| {});
    // The next one renews its own all the time.
    let begin = Instant::now();
    while heard.recv_timeout(PATIENCE).unwrap() != release {
        assert!(begin.elapsed() < PATIENCE, "the lease is not given back");
    }
    camera.set_fault(Fault::None);
    assert!(camera.wait_for(PATIENCE, |status| !status.moving), "the next one has inherited the stop");
    drop(next);
    std::fs::remove_file(socket).unwrap();
}

/// Whoever comes next takes the lease and the retries of the one before: with a wrong password he could stop nothing.
fn next_with_a_wrong_password(meanwhile: impl Fn(&VirtualCamera, &dyn Fn() -> usize)) {
    let camera = camera_with_a_password();
    let first = start_as(Some("pass"), &camera, None, |_| {});
    see_until(&first, |wait| camera.wait_for(wait, |status| status.moving));
    camera.set_fault(Fault::Status(503));
    drop(first);
    let refusals = Arc::new(Mutex::new(0));
    let counted = refusals.clone();
    let next = start_as(Some("falsch"), &camera, None, move |event| {
        let why = Error::BadCredentials { user: "root".to_owned() };
        let change = SessionEvent::Connection(ConnectionChange::Refused(why));
        if matches!(event, Event::Loop(LoopEvent::Session(event)) if event == change) {
            *lock(&counted) += 1;
        }
    });
    let moves = |camera: &VirtualCamera| {
        let is_move = |query: &str| query.contains("continuouspantiltmove=") && !query.ends_with("=0,0");
        camera.commands().iter().filter(|command| is_move(&command.query)).count()
    };
    let moved = moves(&camera);
    meanwhile(&camera, &|| *lock(&refusals));
    camera.set_fault(Fault::None);
    see_until(&next, |wait| camera.wait_for(wait, |status| !status.moving));
    // Once it rests for good he speaks for himself.
    see_until(&next, |wait| {
        std::thread::sleep(wait);
        next.statistics().halted && !next.statistics().may_yet_move
    });
    assert_eq!(moves(&camera), moved, "{:?}", camera.commands());
    drop(next);
    assert_eq!(*lock(&refusals), 1);
}

#[test]
fn one_with_a_wrong_password_stops_the_camera_as_the_one_before_and_moves_nothing() {
    next_with_a_wrong_password(|_, _| {});
}

/// As somebody has tried passwords: then ours is tried, too, and the right one again.
#[test]
fn one_with_a_wrong_password_stops_a_camera_that_lets_nobody_in_for_a_while() {
    next_with_a_wrong_password(|camera, refusals| {
        camera.set_fault(Fault::Locked);
        let begin = Instant::now();
        while refusals() == 0 {
            assert!(begin.elapsed() < PATIENCE, "the password is never tried");
            std::thread::sleep(PICTURE);
        }
    });
}

/// The camera answers nobody as they come, and moves at the word of the first one.
#[test]
fn two_wrong_passwords_one_after_the_other_leave_the_right_one_to_stop_the_camera() {
    let camera = camera_with_a_password();
    let (fail, failed) = channel();
    let task = start_as(Some("pass"), &camera, None, move |event| {
        if matches!(event, Event::Exchanged { failure: Some(_), .. }) {
            let _ = fail.send(());
        }
    });
    see_until(&task, |wait| camera.wait_for(wait, |status| status.moving));
    camera.set_fault(Fault::Status(503));
    for password in ["falsch", "verkehrt"] {
        task.mailbox().set_credentials(Some(root(password)));
        // As the one whose turn it is, and as the other.
        for _ in 0..3 {
            failed.recv_timeout(PATIENCE).unwrap();
        }
    }
    camera.set_fault(Fault::None);
    assert!(camera.wait_for(PATIENCE, |status| !status.moving), "{:?}", camera.commands());
}

/// A camera that has locked the account says of any password that it is wrong.
#[test]
fn back_at_the_right_password_while_everybody_is_locked_out_the_camera_is_stopped_and_moved_again() {
    let camera = camera_with_a_password();
    let (refuse, refused) = channel();
    let task = start_as(Some("pass"), &camera, None, move |event| {
        if matches!(event, Event::Exchanged { failure: Some(Error::BadCredentials { .. }), .. }) {
            let _ = refuse.send(());
        }
    });
    see_until(&task, |wait| camera.wait_for(wait, |status| status.moving));
    camera.set_fault(Fault::Locked);
    task.mailbox().set_credentials(Some(root("falsch")));
    refused.recv_timeout(PATIENCE).unwrap();
    task.mailbox().set_credentials(Some(root("pass")));
    // The right one would be refused as well.
    assert!(refused.recv_timeout(Duration::from_millis(100)).is_err(), "it was asked in vain");
    camera.set_fault(Fault::None);
    assert!(camera.wait_for(PATIENCE, |status| !status.moving), "{:?}", camera.commands());
    // By now it may be at its limit: the other way.
    let begin = Instant::now();
    while !camera.wait_for(PICTURE, |status| status.moving) {
        assert!(begin.elapsed() < PATIENCE, "the camera was not moved");
        task.mailbox().see(Measurement::at(0.1, 0.5, task.mailbox().now()));
    }
    assert!(refused.try_recv().is_err(), "it was asked in vain once more");
}

/// Neither the camera goes on, nor does anybody wait for ever.
#[test]
fn one_that_breaks_stops_the_camera_and_keeps_nobody_waiting() {
    let camera = camera();
    let (died, death) = channel();
    let task = start(&camera, move |event| match event {
        Event::Loop(LoopEvent::Session(SessionEvent::Moving)) => panic!("provoked"),
        Event::Died(_) => died.send(()).unwrap(),
        _ => {}
    });
    let (settled, _waker) = task.mailbox().settled();
    see_until(&task, |wait| death.recv_timeout(wait).is_ok());
    let is_stop = |query: &str| query.ends_with("continuouspantiltmove=0,0");
    let mut seen = 0;
    while !camera.commands().iter().any(|command| is_stop(&command.query)) {
        assert!(camera.wait_for(PATIENCE, |status| status.commands > seen));
        seen = camera.status().commands;
    }
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
    assert_ne!(settled.recv_timeout(PATIENCE), Err(RecvTimeoutError::Timeout));
    assert_eq!(task.mailbox().settled().0.recv_timeout(PATIENCE), Err(RecvTimeoutError::Disconnected));
    assert_eq!(
        task.mailbox().finish(FINISH_BUDGET).recv_timeout(PATIENCE),
        Err(RecvTimeoutError::Disconnected)
    );
}
