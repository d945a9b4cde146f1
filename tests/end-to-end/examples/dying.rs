// SPDX-License-Identifier: MPL-2.0

//! Lets applications die in every way while they turn a camera, and prints a table in Markdown of what stops the camera
//! and how soon:
//!
//! ```sh
//! cargo build --workspace --lib --bins && cargo run --example dying [WAY] > docs/dying.md
//! ```
//! With a part of its name, one way only.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs::File;
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use end_to_end::following::script;
use end_to_end::{
    GstLaunch, Held, PATIENCE, Program, plugin_folder, process_of, scene, scratch, signal, tool,
};
use virtual_camera::{Fault, OnvifSettings, Quirk, Settings, Status, VirtualCamera};

const HEADER: &str = "# Ways to die

What happens to a camera whose application dies while the camera turns. Measured by `cargo run --example dying`, after
`cargo build --workspace --lib --bins`, over HTTP with the default properties; the worst of three runs, from the death (where the camera cannot be reached or refuses to stop: from the
end of that) until the camera is at rest. In the last column the watchdog could not be started.

| Way to die | What stops the camera | It rests after | Without `vapix-watchdog` |
|---|---|---|---|";

const FOOTER: &str = "
`vapix-watchdog` notices at once that a process has ended; that a process is stopped or hangs, it notices when the lease runs out,
after 2 s. A camera at rest is not moved while its watchdog starts, so that there is nothing to stop if the application dies then. One that
takes 10 s, or ends, is given up in words, and the camera is moved without until the next one answers. In an outage it retries twice a
second, for a minute.

What is not covered: loss of power or of the network for longer than that minute, and everything that ends the watchdog together with
the application, such as the end of PID 1 of a container. Run the watchdog outside that container, with `vapix-watchdog --listen` and
`dead-man-socket`. `mode=absolute` gives the camera a position to go to, not a speed: it comes to rest by itself.";

/// It must turn as fast as this to be left turning, °/s.
const TURNS: f64 = 3.0;
/// In the place of a watchdog that cannot be started.
const NO_WATCHDOG: &str = "/nonexistent/watchdog";
/// The program's name for its camera.
const CAMERA: &str = "door";
/// A process that asks for memory without end gets no more.
const MEMORY: u64 = 400 << 20;
/// So long a slow watchdog takes to start. Who takes 10 s is given up.
const SLOW_START_S: u32 = 8;
/// So long it is then seen that nothing moves the camera, of the 6 s that are left.
const HELD: Duration = Duration::from_secs(2);
/// What is said of it after 2 s.
const STARTS: &str = "a camera that rests is not moved before it does";
/// Stops that a camera refuses before it takes one.
const REFUSED_STOPS: u64 = 3;
/// A camera that nobody tried to stop for so long is left alone.
const LEFT_ALONE: Duration = Duration::from_secs(5);
/// Between two looks.
const LOOK: Duration = Duration::from_millis(20);

/// What it is that dies.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Application {
    /// `pipelines/headless.sh`
    Script,
    /// `gst-launch-1.0` with these properties of `vapixptzsink`.
    Launch(&'static str),
    /// The program `application`, told to do this.
    Program(&'static str),
    /// The same in a cgroup that gives it no more than [`MEMORY`].
    Confined(&'static str),
    /// PID 1 of a container, with the watchdog in it.
    Container,
    /// The same with the watchdog outside.
    ContainerOnly,
    /// `ptztrack run`, with this in the camera's entry.
    Run(&'static str),
    /// `gst-launch-1.0`, with a camera by ONVIF that ignores `Timeout`.
    Onvif,
}

/// What becomes of it.
#[derive(Clone, Copy)]
enum Death {
    /// It gets this signal, ...
    Signal(&'static str),
    /// ... while its watchdog takes long to start, and the camera is held at rest for that, ...
    SlowWatchdog(&'static str),
    /// ... while nobody can reach the camera, which answers again when the process has ended, ...
    Outage(&'static str),
    /// ... and the camera answers like this to the first stops.
    Refused(fn() -> Fault, &'static str),
    /// It hangs by itself when the camera first moves, and says `dying` just before.
    Hang,
    /// The threads of this name hang, as in a driver that never returns, and all others go on.
    ThreadsHang(&'static str),
    /// It is killed for what it does when the camera first moves.
    Killed,
    /// The process that the program has for the camera is killed; the program is held, as it would start another.
    OwnProcessKilled,
}

/// A way to die.
struct Case {
    name: &'static str,
    application: Application,
    death: Death,
}

const fn case(name: &'static str, application: Application, death: Death) -> Case {
    Case { name, application, death }
}

use Death::Signal;

const PLAIN: Application = Application::Launch("");
/// What talks to cameras is done in threads of this name.
const CAMERA_TASK: Death = Death::ThreadsHang("ptz-camera");
/// It has a child that holds what it had open.
const FORKED: Application = Application::Program("fork");
/// The camera has a process of its own.
const ISOLATED: Application = Application::Run("isolation = \"process\"\n");
const UNAVAILABLE: fn() -> Fault = || Fault::Status(503);
const ERROR: fn() -> Fault = || Fault::ErrorBody("Error: busy".to_owned());

const CASES: &[Case] = &[
    case("Ctrl-C", Application::Script, Signal("INT")),
    case(
        "Ctrl-C, the first stops are answered by 503",
        Application::Script,
        Death::Refused(UNAVAILABLE, "INT"),
    ),
    case("SIGTERM, caught as in `pipelines/` and the examples", Application::Script, Signal("TERM")),
    case("SIGHUP, caught as in `pipelines/` and the examples", Application::Script, Signal("HUP")),
    case("SIGTERM, not caught", PLAIN, Signal("TERM")),
    // Not of `gst-launch-1.0`, which takes it for a wish to see a graph.
    case("SIGHUP, not caught", Application::Program("reap"), Signal("HUP")),
    case("SIGKILL", PLAIN, Signal("KILL")),
    case(OUT_OF_MEMORY, Application::Confined("hoard"), Death::Killed),
    case("SIGKILL, the first stops are answered by 503", PLAIN, Death::Refused(UNAVAILABLE, "KILL")),
    case("SIGKILL, the first stops are answered by `Error:`", PLAIN, Death::Refused(ERROR, "KILL")),
    case("SIGKILL while a watchdog starts that takes 8 s", PLAIN, Death::SlowWatchdog("KILL")),
    case("SIGSTOP while a watchdog starts that takes 8 s", PLAIN, Death::SlowWatchdog("STOP")),
    case("SIGSEGV", PLAIN, Signal("SEGV")),
    case("SIGABRT", PLAIN, Signal("ABRT")),
    case("SIGSTOP", PLAIN, Signal("STOP")),
    case("its streaming thread hangs", Application::Program("hang"), Death::Hang),
    case("its camera task hangs", PLAIN, CAMERA_TASK),
    case("`exit()` right after NULL in an outage", PLAIN, Death::Outage("INT")),
    case("SIGKILL, a forked child holds its descriptors", FORKED, Signal("KILL")),
    case("SIGKILL of PID 1 of a container, the watchdog in it", Application::Container, Signal("KILL")),
    case(
        "SIGKILL of PID 1 of a container, `dead-man-socket` out of it",
        Application::ContainerOnly,
        Signal("KILL"),
    ),
    case("`ptztrack run`: SIGKILL", Application::Run(""), Signal("KILL")),
    case("`ptztrack run`: SIGSTOP", Application::Run(""), Signal("STOP")),
    case("`ptztrack run`, `isolation = \"process\"`: SIGKILL", ISOLATED, Signal("KILL")),
    case(
        "`ptztrack run`, `isolation = \"process\"`: SIGKILL of the camera's process",
        ISOLATED,
        Death::OwnProcessKilled,
    ),
    case("SIGKILL, the camera speaks ONVIF and ignores `Timeout`", Application::Onvif, Signal("KILL")),
    case("SIGSTOP, the camera speaks ONVIF and ignores `Timeout`", Application::Onvif, Signal("STOP")),
    case("SIGKILL, `mode=absolute`", Application::Launch("mode=absolute"), Signal("KILL")),
];

const OUT_OF_MEMORY: &str = "the out-of-memory killer, in a cgroup";

fn main() {
    println!("{HEADER}");
    let only = std::env::args().nth(1).unwrap_or_default();
    for case in CASES.iter().filter(|case| case.name.contains(&only)) {
        if case.application.is_confined() && Confinement::new("probe").is_none() {
            println!("| {} | | not run: memory cgroups cannot be made here | |", case.name);
            continue;
        }
        let (with, without) = thread::scope(|scope| {
            let with = [0, 1, 2].map(|run| scope.spawn(move || case.run(run, true)));
            let without = scope.spawn(|| case.run(3, false));
            (with.map(|run| run.join().unwrap()), without.join().unwrap())
        });
        // `None` is the worst.
        let worst = with.into_iter().reduce(|a, b| Some(a?.max(b?))).flatten();
        println!(
            "| {} | {} | {} | {} |",
            case.name,
            case.stopped_by(worst, without),
            text(worst),
            text(without)
        );
    }
    println!("{FOOTER}");
}

fn text(rests: Option<Duration>) -> String {
    rests.map_or_else(|| "it turns on".to_owned(), |after| format!("{:.1} s", after.as_secs_f64()))
}

impl Case {
    /// What only happens with the watchdog is its doing.
    fn stopped_by(&self, with: Option<Duration>, without: Option<Duration>) -> &'static str {
        match (with, without, self.application) {
            (None, ..) => "nothing",
            (Some(_), None, _) if matches!(self.death, Death::SlowWatchdog(_)) => {
                "nothing: it is not moved yet"
            }
            (Some(_), None, Application::Onvif) => "`onvif-watchdog`",
            (Some(_), None, _) => "`vapix-watchdog`",
            (Some(_), Some(_), Application::Launch("mode=absolute")) => {
                "`vapix-watchdog`; without it the camera itself, as it arrives"
            }
            (Some(_), Some(_), _) => "`vapixptzsink`",
        }
    }

    /// How long the camera takes to rest, where it does.
    fn run(&self, run: usize, watchdog: bool) -> Option<Duration> {
        let is_slow = matches!(self.death, Death::SlowWatchdog(_));
        // Whoever is in view all the time is somebody to turn to all the time.
        let scene = if is_slow { scene::near_person() } else { scene::walking_person() };
        let onvif =
            (self.application == Application::Onvif).then(|| OnvifSettings::with(&[Quirk::TimeoutIgnored]));
        let camera = VirtualCamera::start(Settings { onvif, ..scene }).unwrap();
        let id = format!("{}-{run}", std::process::id());
        let socket = std::env::temp_dir().join(format!("ptztrack-dying-{id}"));
        let elsewhere = self.application == Application::ContainerOnly && watchdog;
        let _elsewhere = elsewhere.then(|| listen(&socket));
        let confinement = self.application.is_confined().then(|| Confinement::new(&id).unwrap());
        let folder = scratch(&format!("dying-{id}"));
        let mut command = self.application.command(&camera, &socket, confinement.as_ref(), &folder);
        let slow = (is_slow && watchdog).then(|| SlowWatchdog::new(&id));
        if !watchdog {
            command.env("VAPIX_WATCHDOG", NO_WATCHDOG).env("ONVIF_WATCHDOG", NO_WATCHDOG);
        } else if let Some(slow) = &slow {
            command.env("VAPIX_WATCHDOG", &slow.script);
        }
        let mut launch = GstLaunch::spawn(command);
        let child = (self.application == FORKED)
            .then(|| launch.wait_for_line("child ").trim_start_matches("child ").parse().unwrap());
        if let Some(slow) = &slow {
            slow.is_awaited(&camera, &mut launch);
        } else {
            let turns = camera.wait_for(PATIENCE, |status| status.pan_rate_deg_s.abs() > TURNS);
            assert!(turns, "{}: the camera never turned", self.name);
        }
        let (since, _alive) = self.die(&camera, launch);
        let rests = scene::rests(&camera, since);
        if let Some(slow) = &slow {
            slow.runs(&camera);
        }
        if let Some(child) = child {
            signal(child, "KILL");
        }
        let _ = (std::fs::remove_file(socket), std::fs::remove_dir_all(folder));
        rests
    }

    /// When it was dead, or the camera could be stopped again; and what may live on.
    fn die(&self, camera: &VirtualCamera, mut launch: GstLaunch) -> (Duration, Option<Alive>) {
        match self.death {
            Signal(name) | Death::SlowWatchdog(name) => {
                let now = camera.now();
                launch.signal(name);
                (now, Some((None, launch)))
            }
            Death::Outage(name) => {
                camera.set_fault(Fault::BlackHole);
                launch.signal(name);
                launch.finish();
                camera.set_fault(Fault::None);
                (camera.now(), None)
            }
            Death::Refused(fault, name) => {
                let before = camera.status().commands;
                camera.set_fault(fault());
                launch.signal(name);
                camera.wait_for(LEFT_ALONE, |status| status.commands >= before + REFUSED_STOPS);
                camera.set_fault(Fault::None);
                (camera.now(), Some((None, launch)))
            }
            Death::Hang => {
                launch.wait_for_line("dying");
                (camera.now(), Some((None, launch)))
            }
            Death::ThreadsHang(name) => {
                let now = camera.now();
                let held = Held::threads(launch.id(), name);
                (now, Some((Some(held), launch)))
            }
            Death::Killed => {
                let (status, output) = launch.finish();
                assert_eq!(status.signal(), Some(libc::SIGKILL), "{}: {status}\n{output}", self.name);
                (camera.now(), None)
            }
            Death::OwnProcessKilled => {
                let process = process_of(launch.id(), CAMERA);
                launch.signal("STOP");
                let now = camera.now();
                signal(process, "KILL");
                (now, Some((None, launch)))
            }
        }
    }
}

/// What lives on, in the order in which it ends: whoever is held cannot be waited for.
type Alive = (Option<Held>, GstLaunch);

impl Application {
    fn is_confined(self) -> bool {
        matches!(self, Self::Confined(_))
    }

    /// What starts it; where it has files, they are in `folder`.
    fn command(
        self,
        camera: &VirtualCamera,
        socket: &Path,
        confinement: Option<&Confinement>,
        folder: &Path,
    ) -> Command {
        let pipeline = format!("{} {}", scene::follow(camera), self.properties(socket));
        match self {
            Self::Script => {
                let mut command = script("headless.sh");
                command.env("CAMERA", camera.url()).env("SIZE", "320x240");
                command.env("CAMERA_USER", scene::USER).env("CAMERA_PASSWORD", scene::PASSWORD);
                command
            }
            Self::Launch(_) => {
                let mut command = tool("gst-launch-1.0");
                command.arg("-f").args(pipeline.split_whitespace());
                command
            }
            Self::Program(what) | Self::Confined(what) => {
                let application = plugin_folder().join("application");
                let mut command = confinement.map_or_else(with_default_signals, Confinement::enter);
                command.arg(application).args([what, &camera.url(), scene::USER]);
                command.env("CAMERA_PASSWORD", scene::PASSWORD);
                command
            }
            Self::Run(more) => Program::command(folder, |folder| {
                Program::entry(CAMERA, &camera.url(), &folder.join("password")) + more
            }),
            Self::Onvif => {
                let mut command = tool("gst-launch-1.0");
                command.args(scene::follow_onvif(camera, "").split_whitespace());
                command
            }
            Self::Container | Self::ContainerOnly => {
                let mut command = tool("unshare");
                command.args(["--map-root-user", "--pid", "--fork", "--kill-child=KILL", "gst-launch-1.0"]);
                command.args(pipeline.split_whitespace());
                command
            }
        }
    }

    fn properties(self, socket: &Path) -> String {
        match self {
            Self::Launch(properties) => properties.to_owned(),
            Self::ContainerOnly => format!("dead-man-socket={}", socket.display()),
            _ => String::new(),
        }
    }
}

/// Runs a program that ignores no signal: one that was started by `nohup` hands that on.
fn with_default_signals() -> Command {
    let mut command = tool("env");
    command.arg("--default-signal");
    command
}

/// A watchdog apart from any application, until this is dropped.
fn listen(socket: &Path) -> GstLaunch {
    let mut command = Command::new(plugin_folder().join("vapix-watchdog"));
    command.arg("--listen").arg(socket);
    let watchdog = GstLaunch::spawn(command);
    wait_for_file(socket);
    watchdog
}

/// A watchdog that takes long to start, until this is dropped.
struct SlowWatchdog {
    /// Started in its place.
    script: PathBuf,
    /// There once it is.
    begun: PathBuf,
    /// There once it runs: by itself it is soon gone again.
    ran: PathBuf,
}

impl SlowWatchdog {
    fn new(id: &str) -> Self {
        let script = scratch(&format!("slow-watchdog-{id}"));
        let [begun, ran] = ["begun", "ran"].map(|what| script.with_extension(what));
        let watchdog = plugin_folder().join("vapix-watchdog");
        let (begin, run) = (begun.display(), ran.display());
        let text = format!(
            "#!/bin/sh\n: > {begin}\nsleep {SLOW_START_S}\n: > {run}\nexec {} \"$@\"\n",
            watchdog.display()
        );
        std::fs::write(&script, text).unwrap();
        std::fs::set_permissions(&script, std::fs::Permissions::from_mode(0o755)).unwrap();
        Self { script, begun, ran }
    }

    /// The camera is not moved before it runs.
    fn is_awaited(&self, camera: &VirtualCamera, launch: &mut GstLaunch) {
        wait_for_file(&self.begun);
        launch.wait_for_line(STARTS);
        assert!(!camera.wait_for(HELD, |status| status.moving), "moved before there was a watchdog");
        assert!(!self.ran.exists(), "it runs before the death");
    }

    /// Nor after that, when all that it is told is to stop.
    fn runs(&self, camera: &VirtualCamera) {
        wait_for_file(&self.ran);
        let turns = |status: &Status| status.pan_rate_deg_s != 0.0 || status.tilt_rate_deg_s != 0.0;
        assert!(!camera.wait_for(LEFT_ALONE, turns), "moved after the death");
    }
}

impl Drop for SlowWatchdog {
    fn drop(&mut self) {
        for file in [&self.script, &self.begun, &self.ran] {
            // It may not have been started.
            let _ = std::fs::remove_file(file);
        }
    }
}

/// As it must come soon.
fn wait_for_file(file: &Path) {
    let begin = Instant::now();
    while !file.exists() {
        assert!(begin.elapsed() < PATIENCE, "{} never came", file.display());
        thread::sleep(LOOK);
    }
}

/// A cgroup that gives its processes so much memory, until this is dropped.
struct Confinement {
    folder: PathBuf,
}

impl Confinement {
    /// Where the memory controller is, of cgroup v2 and of v1, and the file that limits it.
    const CONTROLLERS: [(&str, &str); 2] =
        [("/sys/fs/cgroup", "memory.max"), ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")];

    /// Where this process may make one.
    fn new(id: &str) -> Option<Self> {
        Self::CONTROLLERS.iter().find_map(|(controller, limit)| {
            let folder = Path::new(controller).join(format!("ptztrack-dying-{id}"));
            std::fs::create_dir(&folder).ok()?;
            let confinement = Self { folder };
            // Where there is no such controller, there is no such file.
            let file = File::options().write(true).open(confinement.folder.join(limit));
            file.and_then(|mut file| write!(file, "{MEMORY}")).ok().map(|()| confinement)
        })
    }

    /// What is run by this is in it.
    fn enter(&self) -> Command {
        let mut command = tool("sh");
        command.args(["-c", "echo $$ > \"$0/cgroup.procs\" && exec \"$@\""]).arg(&self.folder);
        command
    }
}

impl Drop for Confinement {
    fn drop(&mut self) {
        // Its watchdog ends in its own time: an empty group that is left over costs nothing.
        let _ = std::fs::remove_dir(&self.folder);
    }
}
