// SPDX-License-Identifier: MPL-2.0

//! Pulls the cable between applications and the cameras that they turn, and prints a table in Markdown of how soon each rests:
//!
//! ```sh
//! cargo build --workspace --lib --bins && sudo -E cargo run --example cable [CAMERA]
//! ```
//! Applications run in network namespaces, which takes root and iproute2.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::{self, Display};
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use end_to_end::{Cable, Front, GstLaunch, PATIENCE, scene, tool};
use virtual_camera::{OnvifSettings, Quirk, ReceivedCommand, Settings, Status, VirtualCamera};

/// It must turn as fast as this to be left turning, °/s.
const TURNS: f64 = 1.0;
/// A camera that still turns so long after the cable is in again is not stopped.
const LIMIT: Duration = Duration::from_secs(10);
/// Cables at once: each application takes a quarter of a core.
const AT_ONCE: usize = 4;

/// What turns the camera when the cable is pulled.
#[derive(Clone, Copy)]
enum Case {
    Vapix,
    /// It is killed while the cable is out: its watchdog is left.
    VapixKilled,
    Onvif(Option<Quirk>),
}

/// What stopped the camera.
enum Stopped {
    /// Itself, so long after the cable was pulled.
    ByItself(Duration),
    /// A stop, so long after the cable was in again.
    ByUs(Duration),
    /// A move with whoever is followed, so long after the cable was in again: it obeys.
    Steered(Duration),
    Never,
    /// Nobody was followed: what the application said.
    NeverTurned(String),
}

fn main() -> ExitCode {
    if let Err(reason) = Cable::lay(0) {
        println!("not run: {reason}. It takes root and iproute2");
        return ExitCode::SUCCESS;
    }
    println!("| camera | what stops it | it rests after |\n|---|---|---|");
    let quirks = Quirk::ALL.iter().map(|quirk| Case::Onvif(Some(*quirk)));
    let only = std::env::args().nth(1).unwrap_or_default();
    let cases = [Case::Vapix, Case::VapixKilled, Case::Onvif(None)].into_iter().chain(quirks);
    let cases: Vec<_> = cases.filter(|case| case.name().contains(&only)).collect();
    let next = AtomicUsize::new(0);
    let take = || {
        let number = next.fetch_add(1, Ordering::Relaxed);
        cases.get(number).map(|case| (number, *case))
    };
    thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(|| {
                for (number, case) in std::iter::from_fn(take) {
                    let stopped = case.run(u8::try_from(number).unwrap());
                    println!("| {} | {stopped} |", case.name());
                    if let Stopped::NeverTurned(said) = stopped {
                        println!("{}: {said}", case.name());
                    }
                }
            });
        }
    });
    ExitCode::SUCCESS
}

impl Case {
    fn name(self) -> String {
        match self {
            Self::Vapix => "VAPIX".to_owned(),
            Self::VapixKilled => "VAPIX, SIGKILL meanwhile".to_owned(),
            Self::Onvif(None) => "ONVIF".to_owned(),
            Self::Onvif(Some(quirk)) => format!("ONVIF, `{}`", quirk.switch()),
        }
    }

    fn run(self, number: u8) -> Stopped {
        let onvif = match self {
            Self::Vapix | Self::VapixKilled => None,
            Self::Onvif(quirk) => Some(OnvifSettings::with(quirk.as_slice())),
        };
        let camera = VirtualCamera::start(Settings { onvif, ..scene::walking_person() }).unwrap();
        let cable = Cable::lay(number).unwrap();
        let front = Front::at((cable.camera_side(), 0), camera.http_address());
        let follow = match camera.onvif_url() {
            Some(_) => scene::follow_onvif(&camera, ""),
            None => scene::follow(&camera),
        };
        let follow = follow.replace(&camera.http_address().to_string(), &front.address().to_string());
        let mut command = tool("gst-launch-1.0");
        command.args(follow.split_whitespace());
        let mut launch = GstLaunch::spawn(cable.at_the_end(&command));
        let turns = |status: &Status| status.pan_rate_deg_s.hypot(status.tilt_rate_deg_s) > TURNS;
        if !camera.wait_for(PATIENCE, turns) {
            launch.read_for(Duration::ZERO);
            return Stopped::NeverTurned(launch.seen().join("\n"));
        }
        cable.pull().unwrap();
        let pulled = camera.now();
        if matches!(self, Self::VapixKilled) {
            launch.signal("KILL");
        }
        let rested = scene::rests(&camera, pulled);
        if let Some(rested) = rested {
            return Stopped::ByItself(rested);
        }
        let told = camera.status().commands;
        cable.plug().unwrap();
        let plugged = camera.now();
        let rested = camera.wait_for(LIMIT, |status| !status.moving).then(|| camera.now());
        // Whoever is in control again may follow at once; of one that was killed only what was under way can come.
        let moves = camera.commands_after(told).into_iter().filter(|_| !matches!(self, Self::VapixKilled));
        let steered = moves.filter(is_move).map(|command| command.time).next();
        let after = |time: Duration| time.saturating_sub(plugged);
        match (rested, steered) {
            (_, Some(steered)) if rested.is_none_or(|rested| steered < rested) => {
                Stopped::Steered(after(steered))
            }
            (Some(rested), _) => Stopped::ByUs(after(rested)),
            (None, _) => Stopped::Never,
        }
    }
}

/// No stop, and no question.
fn is_move(command: &ReceivedCommand) -> bool {
    let ReceivedCommand { query, .. } = command;
    query.contains("ContinuousMove") || query.contains("move=") && !query.contains("move=0,0")
}

impl Display for Stopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ByItself(rested) => write!(f, "its own `Timeout` | {:.1} s", rested.as_secs_f64()),
            Self::ByUs(rested) => {
                write!(f, "a stop, once the cable is in again | {:.1} s after that", rested.as_secs_f64())
            }
            Self::Steered(rested) => {
                write!(f, "a move, once the cable is in again | {:.1} s after that", rested.as_secs_f64())
            }
            Self::Never => write!(f, "nothing | it turns on"),
            Self::NeverTurned(_) => write!(f, "nobody was followed | it never turned"),
        }
    }
}
