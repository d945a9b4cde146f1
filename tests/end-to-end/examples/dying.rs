// SPDX-License-Identifier: MPL-2.0

//! Lets applications die in every way while they turn a camera, and prints a table in Markdown of what stops the camera
//! and how soon:
//!
//! ```sh
//! cargo build --workspace --lib --bins && cargo run -p end-to-end --example dying > docs/dying.md
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::Duration;

use end_to_end::following::script;
use end_to_end::{GstLaunch, PATIENCE, plugin_folder, scene, signal, tool};
use virtual_camera::{Fault, VirtualCamera};

const HEADER: &str = "# Ways to die

What happens to a camera whose application dies while the camera turns. Measured by `cargo run -p end-to-end --example dying`, over
HTTP with the default properties; the worst of three runs, from the death (in an outage: from the end of the outage) until the camera is
at rest. In the last column the watchdog could not be started.

| Way to die | What stops the camera | It rests after | Without `vapix-watchdog` |
|---|---|---|---|";

const FOOTER: &str = "
`vapix-watchdog` notices at once that a process has ended; that a process is stopped or hangs, it notices when the lease runs out,
after 2 s. In an outage it retries twice a second, for a minute.

What is not covered: loss of power or of the network for longer than that minute, and everything that ends the watchdog together with
the application, such as the end of PID 1 of a container. Run the watchdog outside that container, with `vapix-watchdog --listen` and
`dead-man-socket`. `mode=absolute` gives the camera a position to go to, not a speed: it comes to rest by itself.";

/// It must turn as fast as this to be left turning, °/s.
const TURNS: f64 = 3.0;
/// A camera that rested for so long rests: longer than a lease lasts.
const SETTLED: Duration = Duration::from_secs(3);
/// A camera that still turns after this is not stopped.
const LIMIT: Duration = Duration::from_secs(10);
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
    /// PID 1 of a container, with the watchdog in it.
    Container,
    /// The same with the watchdog outside.
    ContainerOnly,
}

/// A way to die.
struct Case {
    name: &'static str,
    application: Application,
    signal: &'static str,
}

const fn case(name: &'static str, application: Application, signal: &'static str) -> Case {
    Case { name, application, signal }
}

const PLAIN: Application = Application::Launch("");
/// It has a child that holds what it had open.
const FORKED: Application = Application::Program("fork");
const OUTAGE: &str = "`exit()` right after NULL in an outage";

const CASES: [Case; 14] = [
    case("Ctrl-C", Application::Script, "INT"),
    case("SIGTERM, caught as in `pipelines/` and the examples", Application::Script, "TERM"),
    case("SIGHUP, caught as in `pipelines/` and the examples", Application::Script, "HUP"),
    case("SIGTERM, not caught", PLAIN, "TERM"),
    // Not of `gst-launch-1.0`, which takes it for a wish to see a graph.
    case("SIGHUP, not caught", Application::Program("reap"), "HUP"),
    case("SIGKILL; the out-of-memory killer", PLAIN, "KILL"),
    case("SIGSEGV", PLAIN, "SEGV"),
    case("abort", PLAIN, "ABRT"),
    case("SIGSTOP; it hangs", PLAIN, "STOP"),
    case(OUTAGE, PLAIN, "INT"),
    case("SIGKILL, a forked child holds its descriptors", FORKED, "KILL"),
    case("SIGKILL of PID 1 of a container, the watchdog in it", Application::Container, "KILL"),
    case("SIGKILL of PID 1 of a container, `dead-man-socket` out of it", Application::ContainerOnly, "KILL"),
    case("SIGKILL, `mode=absolute`", Application::Launch("mode=absolute"), "KILL"),
];

fn main() {
    println!("{HEADER}");
    for case in &CASES {
        let (with, without) = thread::scope(|scope| {
            let with = [0, 1, 2].map(|run| scope.spawn(move || case.run(run, true)));
            let without = scope.spawn(|| case.run(3, false));
            (with.map(|run| run.join().unwrap()), without.join().unwrap())
        });
        // `None` is the worst.
        let worst = with.into_iter().max_by_key(|rests| rests.unwrap_or(Duration::MAX)).flatten();
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
    rests.map_or_else(|| "it turns on".to_owned(), |time| format!("{:.1} s", time.as_secs_f64()))
}

impl Case {
    /// What only happens with the watchdog is its doing.
    fn stopped_by(&self, with: Option<Duration>, without: Option<Duration>) -> &'static str {
        match (with, without, self.application) {
            (None, ..) => "nothing",
            (Some(_), None, _) => "`vapix-watchdog`",
            (Some(_), Some(_), Application::Launch("mode=absolute")) => {
                "`vapix-watchdog`; without it the camera itself, as it arrives"
            }
            (Some(_), Some(_), _) => "`vapixptzsink`",
        }
    }

    /// How long the camera takes to rest, where it does.
    fn run(&self, run: usize, watchdog: bool) -> Option<Duration> {
        let camera = VirtualCamera::start(scene::walking_person()).unwrap();
        let socket = std::env::temp_dir().join(format!("ptztrack-dying-{}-{run}", std::process::id()));
        let elsewhere = self.application == Application::ContainerOnly && watchdog;
        let _elsewhere = elsewhere.then(|| listen(&socket));
        let mut command = self.application.command(&camera, &socket);
        if !watchdog {
            command.env("VAPIX_WATCHDOG", "/nonexistent/vapix-watchdog");
        }
        let mut launch = GstLaunch::spawn(command);
        let child = (self.application == FORKED)
            .then(|| launch.wait_for_line("child ").trim_start_matches("child ").parse().unwrap());
        let turns = camera.wait_for(PATIENCE, |status| status.pan_rate_deg_s.abs() > TURNS);
        assert!(turns, "{}: the camera never turned", self.name);
        let (since, _alive) = self.die(&camera, launch);
        let rests = rests(&camera, since);
        if let Some(child) = child {
            signal(child, "KILL");
        }
        let _ = std::fs::remove_file(socket);
        rests
    }

    /// When it was dead, or the outage over that it died in; and what may live on.
    fn die(&self, camera: &VirtualCamera, launch: GstLaunch) -> (Duration, Option<GstLaunch>) {
        if self.name == OUTAGE {
            camera.set_fault(Fault::BlackHole);
            launch.signal(self.signal);
            launch.finish();
            camera.set_fault(Fault::None);
            return (camera.now(), None);
        }
        let now = camera.now();
        launch.signal(self.signal);
        (now, Some(launch))
    }
}

impl Application {
    fn command(self, camera: &VirtualCamera, socket: &Path) -> Command {
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
            Self::Program(what) => {
                let mut command = tool(plugin_folder().join("application").to_str().unwrap());
                command.args([what, &camera.url(), scene::USER]).env("CAMERA_PASSWORD", scene::PASSWORD);
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

/// A watchdog apart from any application, until this is dropped.
fn listen(socket: &Path) -> GstLaunch {
    let mut command = Command::new(plugin_folder().join("vapix-watchdog"));
    command.arg("--listen").arg(socket);
    let watchdog = GstLaunch::spawn(command);
    while !socket.exists() {
        thread::sleep(LOOK);
    }
    watchdog
}

/// How long after this moment the camera came to rest, and stayed so.
fn rests(camera: &VirtualCamera, since: Duration) -> Option<Duration> {
    loop {
        let moving = |status: &virtual_camera::Status| status.moving;
        if !camera.wait_for(LIMIT, |status| !moving(status)) {
            return None;
        }
        let rested = camera.now();
        if !camera.wait_for(SETTLED, moving) {
            return Some(rested.saturating_sub(since));
        }
        if rested > since + LIMIT {
            return None;
        }
    }
}
