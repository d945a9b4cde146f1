// SPDX-License-Identifier: MPL-2.0

//! The watchdog process, over real HTTP: what it does when whoever moves a camera is not there any more.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::os::fd::AsRawFd;
use std::os::unix::fs::FileTypeExt;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Command as Process, ExitStatus};
use std::sync::Arc;
use std::time::{Duration, Instant};

use servo::Motion;
use session::http::{Authentication, ClientSettings, Credentials, Identity, Location, Secret, Trust};
use session::watchdog::{Lease, Standing, StopOrder, Watchdog, WatchdogAddress};
use session::{Client as _, Command, Request, Stop};
use vapix::Client;
use virtual_camera::{Auth, Fault, Settings, VirtualCamera};

/// Only a failure takes this long.
const PATIENCE: Duration = Duration::from_secs(60);

/// Between two looks.
const MOMENT: Duration = Duration::from_millis(20);

const RIGHT: Command =
    Command::Move { motion: Motion::Velocity { pan: 0.4, tilt: 0.0, zoom: None }, free: false };
const PASSWORD: &str = "xyzzy-plugh-43";

/// An application that moves a camera, with a watchdog of its own.
struct Application {
    camera: VirtualCamera,
    client: Client,
    program: PathBuf,
    watchdog: Arc<Watchdog>,
    lease: Lease,
}

impl Application {
    fn new(test: &str) -> Self {
        let auth = Auth::Digest { qop: true };
        let settings = Settings { auth, password: PASSWORD.to_owned(), ..Settings::default() };
        Self::before(test, VirtualCamera::start(settings).unwrap())
    }

    /// The program has a name of its own, by which its process is found.
    fn before(test: &str, camera: VirtualCamera) -> Self {
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
        let program = folder.join(format!("watchdog-{test}-{}", std::process::id()));
        // What a test that was killed left behind.
        let _ = fs::remove_file(&program);
        fs::hard_link(env!("CARGO_BIN_EXE_vapix-watchdog"), &program).unwrap();
        let watchdog = Watchdog::new(WatchdogAddress::Program(program.clone()));
        let lease = Lease::new(watchdog.clone());
        let client = client(&camera);
        Self { camera, client, program, watchdog, lease }
    }

    async fn hold(&mut self, in_doubt: bool) {
        let standing = self.ask_to_hold(in_doubt).await;
        assert!(matches!(standing, Standing::Held), "{standing:?}");
    }

    async fn ask_to_hold(&mut self, in_doubt: bool) -> Standing {
        self.lease.hold(order(self.client.identity(), in_doubt));
        self.lease.settled().await;
        self.lease.standing().unwrap()
    }

    /// Moves, as an application does that plays by the rules.
    async fn moving(mut self) -> Self {
        self.hold(true).await;
        self.client.exchange(&Request::Command(RIGHT)).await.unwrap();
        self.hold(false).await;
        assert!(self.camera.wait_for(PATIENCE, |status| status.moving));
        self
    }

    /// Dies, as far as the watchdog can tell.
    fn die(self) -> (VirtualCamera, PathBuf) {
        (self.camera, self.program)
    }

    /// Another application takes the place of this one, with the same camera.
    fn restarted(self, test: &str) -> (Self, PathBuf) {
        let (camera, program) = self.die();
        (Self::before(test, camera), program)
    }

    fn process(&self) -> u32 {
        process(&self.program).expect("the watchdog runs")
    }
}

fn client(camera: &VirtualCamera) -> Client {
    let credentials = Credentials { user: "root".to_owned(), password: Secret::new(PASSWORD) };
    Client::new(ClientSettings {
        location: Location::parse(&camera.url()).unwrap().0,
        channel: "1".to_owned(),
        credentials: Some(credentials),
        authentication: Authentication::default(),
        timeout: Duration::from_millis(500),
        trust: Trust::System,
    })
    .unwrap()
}

fn process(program: &PathBuf) -> Option<u32> {
    let processes =
        fs::read_dir("/proc").unwrap().filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    processes
        .filter_map(|name| name.parse().ok())
        .find(|pid: &u32| fs::read_link(format!("/proc/{pid}/exe")).is_ok_and(|exe| exe == *program))
}

#[track_caller]
fn wait_until(what: &str, mut done: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !done() {
        assert!(begin.elapsed() < PATIENCE, "{what}");
        std::thread::sleep(MOMENT);
    }
}

fn order(identity: Identity, in_doubt: bool) -> StopOrder {
    StopOrder { identity, words: Stop::PanTilt, in_doubt }
}

/// The socket that is the lock of a camera, as a number, where anybody has it.
fn lock_of(camera: &VirtualCamera) -> Option<u64> {
    let sockets = fs::read_to_string("/proc/net/unix").unwrap();
    let camera = camera.http_address().to_string();
    // Num: RefCount Protocol Flags Type St Inode Path; one that listens accepts connections (__SO_ACCEPTCON).
    let is_lock = |line: &&str| line.contains("@ptztrack-watchdog ") && line.contains(&camera);
    let listens = |line: &&str| line.split_whitespace().nth(3) == Some("00010000");
    let line = sockets.lines().filter(is_lock).find(listens)?;
    line.split_whitespace().nth(6)?.parse().ok()
}

#[track_caller]
fn ends(program: &PathBuf) {
    wait_until("the watchdog goes on", || process(program).is_none());
    let _ = fs::remove_file(program);
}

fn moves(camera: &VirtualCamera) -> Vec<String> {
    camera
        .commands()
        .into_iter()
        .map(|command| command.query)
        .filter(|query| query.contains("move="))
        .collect()
}

#[track_caller]
fn rests(camera: &VirtualCamera) {
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
    assert!(moves(camera).last().unwrap().ends_with("continuouspantiltmove=0,0"));
}

fn signal(pid: u32, signal: i32) {
    // SAFETY: takes numbers only.
    assert_eq!(unsafe { libc::kill(pid.cast_signed(), signal) }, 0);
}

#[tokio::test]
async fn an_application_that_dies_has_its_camera_stopped_by_one_command() {
    let (camera, program) = Application::new("dies").moving().await.die();
    rests(&camera);
    ends(&program);
    assert_eq!(moves(&camera).len(), 2, "a move and a stop: {:?}", moves(&camera));
}

/// The camera may act on it after the stop.
#[tokio::test]
async fn a_move_that_was_not_answered_is_stopped_twice() {
    let mut application = Application::new("unanswered").moving().await;
    application.hold(true).await;
    let (camera, program) = application.die();
    rests(&camera);
    ends(&program);
    let stops = moves(&camera).iter().filter(|query| query.ends_with("=0,0")).count();
    assert_eq!(stops, 2, "{:?}", moves(&camera));
}

#[tokio::test]
async fn an_application_that_hangs_has_its_camera_stopped() {
    let application = Application::new("hangs").moving().await;
    rests(&application.camera);
    assert!(process(&application.program).is_some(), "it may go on");
    ends(&application.die().1);
}

#[tokio::test]
async fn one_that_was_only_late_goes_on() {
    let mut application = Application::new("late").moving().await;
    rests(&application.camera);
    application = application.moving().await;
    let (camera, program) = application.die();
    rests(&camera);
    ends(&program);
    assert_eq!(moves(&camera).len(), 4, "{:?}", moves(&camera));
}

#[tokio::test]
async fn a_camera_at_rest_or_not_ours_any_more_is_left_alone() {
    let mut application = Application::new("released").moving().await;
    application.lease.release();
    let (camera, program) = application.die();
    ends(&program);
    assert_eq!(moves(&camera).len(), 1);
    assert!(camera.status().moving, "an operator may be moving it");
}

#[tokio::test]
async fn a_camera_that_is_not_there_is_stopped_when_it_is_back() {
    let application = Application::new("outage").moving().await;
    application.camera.set_fault(Fault::Refuse);
    let pid = application.process();
    let (camera, program) = application.die();
    signal(pid, libc::SIGTERM);
    // It tries.
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(process(&program), Some(pid), "it ignores SIGTERM while a camera is to be stopped");
    camera.set_fault(Fault::None);
    rests(&camera);
    ends(&program);
}

/// Somebody has tried passwords until the camera locked the account, and the application dies then.
#[tokio::test]
async fn a_camera_that_locked_an_account_that_worked_is_stopped_once_it_lets_it_in() {
    let application = Application::new("locked").moving().await;
    application.camera.set_fault(Fault::Locked);
    let refused = application.camera.status().refused;
    let (camera, program) = application.die();
    assert!(camera.wait_for(PATIENCE, |status| status.refused > refused + 1), "it does not try");
    camera.set_fault(Fault::None);
    rests(&camera);
    ends(&program);
}

#[tokio::test]
async fn a_wrong_password_is_tried_once() {
    let mut application = Application::new("password").moving().await;
    application
        .client
        .set_credentials(Some(Credentials { user: "root".to_owned(), password: Secret::new("falsch") }));
    application.hold(false).await;
    let refused = application.camera.status().refused;
    let (camera, program) = application.die();
    ends(&program);
    assert_eq!(camera.status().refused - refused, 2, "the challenge, and the wrong answer");
}

#[tokio::test]
async fn a_restarted_application_takes_over_from_the_old_watchdog() {
    let application = Application::new("old").moving().await;
    application.camera.set_fault(Fault::Refuse);
    let (mut restarted, old) = application.restarted("new");
    assert!(process(&old).is_some(), "it goes on trying to stop the camera");
    // The lease is renewed all the while, or the new one would stop the camera too.
    restarted.hold(true).await;
    let begin = Instant::now();
    while process(&old).is_some() {
        assert!(begin.elapsed() < PATIENCE, "the old one never ends");
        restarted.hold(true).await;
        tokio::time::sleep(MOMENT).await;
    }
    ends(&old);
    // A stop that the old one sent in its last moment may still be on its way. The camera takes what comes in turn.
    assert!(restarted.client.exchange(&Request::Command(RIGHT)).await.is_err());
    restarted.camera.set_fault(Fault::None);
    restarted.hold(true).await;
    while restarted.client.exchange(&Request::Command(RIGHT)).await.is_err() {
        restarted.hold(true).await;
    }
    restarted.hold(false).await;
    let moves = moves(&restarted.camera);
    assert!(moves.last().unwrap().ends_with("=40,0"), "{moves:?}");
    let (camera, program) = restarted.die();
    rests(&camera);
    ends(&program);
}

/// The other's watchdog has the camera, and knows nothing of this one's move.
#[tokio::test]
async fn of_two_applications_with_one_camera_each_has_its_move_stopped() {
    let mut application = Application::new("one-of-two").moving().await;
    let other = Application::before("two-of-two", VirtualCamera::start(Settings::default()).unwrap());
    let mut lease = Lease::new(other.watchdog.clone());
    let order = order(application.client.identity(), false);
    wait_until("the first has the camera's lock", || lock_of(&application.camera).is_some());
    let (first, begin) = (lock_of(&application.camera), Instant::now());
    // Until the other has taken the lock; and both go on.
    while lock_of(&application.camera).is_none_or(|lock| Some(lock) == first) {
        assert!(begin.elapsed() < PATIENCE, "the lock is never taken");
        lease.hold(order.clone());
        lease.settled().await;
        application.hold(false).await;
        tokio::time::sleep(MOMENT).await;
    }
    let (camera, program) = application.die();
    let begin = Instant::now();
    while process(&program).is_some() {
        assert!(begin.elapsed() < PATIENCE, "it never ends");
        lease.hold(order.clone());
        tokio::time::sleep(MOMENT).await;
    }
    // Not by the other's lease, which is not over by then.
    assert!(camera.wait_for(Duration::from_secs(1), |status| !status.moving), "{:?}", moves(&camera));
    lease.release();
    let (_, others) = other.die();
    drop(lease);
    ends(&program);
    ends(&others);
}

#[tokio::test]
async fn without_a_camera_to_stop_it_can_be_ended_and_is_started_anew() {
    let mut application = Application::new("ended").moving().await;
    application.lease.release();
    let pid = application.process();
    // It heard of the release when it no longer ignores this.
    wait_until("it never ends", || {
        if process(&application.program) == Some(pid) {
            signal(pid, libc::SIGTERM);
        }
        process(&application.program).is_none()
    });
    // Not more often than once a second.
    let begin = Instant::now();
    while !matches!(application.ask_to_hold(false).await, Standing::Held) {
        assert!(begin.elapsed() < PATIENCE);
        tokio::time::sleep(MOMENT).await;
    }
    let (_camera, program) = application.die();
    ends(&program);
}

/// It is there, and does nothing: whoever counted on it would leave a camera turning.
#[tokio::test]
async fn one_that_hangs_is_noticed() {
    let mut application = Application::new("stopped").moving().await;
    let pid = application.process();
    signal(pid, libc::SIGSTOP);
    let begin = Instant::now();
    loop {
        assert!(begin.elapsed() < PATIENCE, "nobody notices");
        match application.ask_to_hold(false).await {
            Standing::Failed(failure) => break assert!(failure.to_string().contains("no answer for 2 s")),
            _ => tokio::time::sleep(MOMENT).await,
        }
    }
    signal(pid, libc::SIGCONT);
    while !matches!(application.ask_to_hold(false).await, Standing::Held) {
        assert!(begin.elapsed() < PATIENCE, "it does not go on");
        tokio::time::sleep(MOMENT).await;
    }
    let (camera, program) = application.die();
    rests(&camera);
    ends(&program);
}

#[tokio::test]
async fn nobody_can_read_what_it_knows() {
    let application = Application::new("secrets").moving().await;
    let pid = application.process();
    let read = |file: &str| fs::read(format!("/proc/{pid}/{file}")).unwrap_or_default();
    let text = |file: &str| String::from_utf8_lossy(&read(file)).into_owned();
    assert!(!text("cmdline").contains(PASSWORD) && !text("environ").contains(PASSWORD));
    let limits = fs::read_to_string(format!("/proc/{pid}/limits")).unwrap();
    let core = limits.lines().find(|line| line.starts_with("Max core file size")).unwrap();
    assert_eq!(core.split_whitespace().nth(4), Some("0"), "{core}");
    let (_camera, program) = application.die();
    ends(&program);
}

/// Of a host's pipes, sockets and devices it would hold every one open for as long as it lives.
#[tokio::test]
async fn it_keeps_nothing_open_that_it_inherited() {
    let file = fs::File::open("/dev/zero").unwrap();
    // SAFETY: takes a number only. The copy is not closed when another program is executed.
    let inherited = unsafe { libc::dup(file.as_raw_fd()) };
    let application = Application::new("inherits").moving().await;
    let pid = application.process();
    let open: Vec<_> = fs::read_dir(format!("/proc/{pid}/fd"))
        .unwrap()
        .filter_map(|entry| fs::read_link(entry.unwrap().path()).ok())
        .collect();
    assert!(!open.is_empty() && !open.contains(&"/dev/zero".into()), "{open:?}");
    let (_camera, program) = application.die();
    ends(&program);
    // SAFETY: it is ours, and nobody else uses it.
    unsafe { libc::close(inherited) };
}

/// `waitpid(-1)` waits for all children, and there are hosts that wait until there is none.
#[tokio::test]
async fn it_is_nobodys_child_and_has_a_session_of_its_own() {
    let application = Application::new("orphan").moving().await;
    let pid = application.process();
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap();
    let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
    let (parent, session) = (fields[1], fields[3]);
    assert_ne!(parent, std::process::id().to_string());
    // SAFETY: takes and gives numbers only.
    let own = unsafe { libc::getsid(0) };
    assert_ne!(session, own.to_string());
    let (_camera, program) = application.die();
    ends(&program);
}

#[tokio::test]
async fn one_that_runs_elsewhere_serves_whoever_connects() {
    let socket =
        PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("watchdog-{}.sock", std::process::id()));
    let listen =
        || Process::new(env!("CARGO_BIN_EXE_vapix-watchdog")).arg("--listen").arg(&socket).spawn().unwrap();
    let mut service = listen();
    wait_until("it does not listen", || socket.metadata().is_ok_and(|found| found.file_type().is_socket()));
    let mut application = Application::new("elsewhere");
    application.watchdog = Watchdog::new(WatchdogAddress::Socket(socket.clone()));
    application.lease = Lease::new(application.watchdog.clone());
    let (camera, program) = application.moving().await.die();
    assert!(process(&program).is_none(), "none was started");
    rests(&camera);
    fs::remove_file(program).unwrap();
    let ended: ExitStatus = {
        wait_until("it cannot be ended", || {
            signal(service.id(), libc::SIGTERM);
            service.try_wait().unwrap().is_some()
        });
        service.wait().unwrap()
    };
    assert_eq!(ended.signal(), Some(libc::SIGTERM));
    // What it left behind hinders nobody.
    let mut service = listen();
    wait_until("it does not listen", || std::os::unix::net::UnixStream::connect(&socket).is_ok());
    service.kill().unwrap();
    service.wait().unwrap();
    fs::remove_file(socket).unwrap();
}

/// Many connect, and it has a descriptor left for none of them, nor for the stop that a camera needs just then.
#[tokio::test]
async fn one_without_descriptors_stops_its_camera_once_it_has_some() {
    let socket =
        PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("watchdog-{}-few.sock", std::process::id()));
    let mut service = Process::new("sh")
        .args(["-c", "ulimit -n 16; exec \"$@\"", "sh", env!("CARGO_BIN_EXE_vapix-watchdog"), "--listen"])
        .arg(&socket)
        .spawn()
        .unwrap();
    wait_until("it does not listen", || socket.metadata().is_ok_and(|found| found.file_type().is_socket()));
    let mut application = Application::new("few");
    application.watchdog = Watchdog::new(WatchdogAddress::Socket(socket.clone()));
    application.lease = Lease::new(application.watchdog.clone());
    application = application.moving().await;
    let many: Vec<_> = (0..32).map_while(|_| std::os::unix::net::UnixStream::connect(&socket).ok()).collect();
    assert!(many.len() > 16, "{}", many.len());
    let last = format!("/proc/{}/fd/15", service.id());
    wait_until("it has descriptors left", || fs::symlink_metadata(&last).is_ok());
    let (camera, program) = application.die();
    assert!(!camera.wait_for(Duration::from_secs(1), |status| !status.moving), "it had a descriptor left");
    drop(many);
    rests(&camera);
    for file in [program, socket] {
        fs::remove_file(file).unwrap();
    }
    service.kill().unwrap();
    service.wait().unwrap();
}

#[test]
fn by_hand_it_says_what_it_is() {
    let output = Process::new(env!("CARGO_BIN_EXE_vapix-watchdog"))
        .stdin(std::process::Stdio::null())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("--listen"));
}
