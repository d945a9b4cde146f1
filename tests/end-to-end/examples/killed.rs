// SPDX-License-Identifier: MPL-2.0

//! Kills applications that turn cameras by ONVIF, as specified and with each quirk, and prints a table in Markdown of how soon each
//! camera rests:
//!
//! ```sh
//! cargo build --workspace --lib --bins && cargo run --example killed [CAMERA]
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::{self, Display};
use std::iter;
use std::thread;
use std::time::Duration;

use end_to_end::{GstLaunch, PATIENCE, scene};
use virtual_camera::{OnvifSettings, Quirk, Status, VirtualCamera};

/// It must turn as fast as this to be left turning, °/s.
const TURNS: f64 = 3.0;
/// Of so many runs the worst counts.
const RUNS: usize = 3;

/// What became of a camera, the worst last.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Ended {
    /// It rested so long after the application was killed.
    Rested(Duration),
    /// Nobody was followed: nothing is shown.
    NeverTurned,
    /// It turns on.
    Never,
}

struct Case {
    name: String,
    quirks: Vec<Quirk>,
}

fn main() {
    println!("Killed while the camera turned by {TURNS}° a second or more; the worst of {RUNS} runs.\n");
    println!("| camera | it rests after |\n|---|---|");
    let only = std::env::args().nth(1).unwrap_or_default();
    for case in cases().filter(|case| case.name.contains(&only)) {
        let runs = thread::scope(|scope| {
            let runs: Vec<_> = (0..RUNS).map(|_| scope.spawn(|| case.run())).collect();
            runs.into_iter().map(|run| run.join().unwrap()).collect::<Vec<_>>()
        });
        let worst = runs.into_iter().max().unwrap_or(Ended::Never);
        println!("| {} | {worst} |", case.name);
    }
}

fn cases() -> impl Iterator<Item = Case> {
    let plain = Case { name: "as specified".to_owned(), quirks: Vec::new() };
    let each =
        Quirk::ALL.iter().map(|quirk| Case { name: format!("`{}`", quirk.switch()), quirks: vec![*quirk] });
    let together = Case { name: "all that can be had together".to_owned(), quirks: Quirk::together() };
    iter::once(plain).chain(each).chain(iter::once(together))
}

impl Case {
    fn run(&self) -> Ended {
        let camera = VirtualCamera::start(scene::any_make(OnvifSettings::with(&self.quirks))).unwrap();
        let launch = GstLaunch::start(&[], &scene::follow_onvif(&camera));
        let turns = |status: &Status| status.pan_rate_deg_s.hypot(status.tilt_rate_deg_s) > TURNS;
        if !camera.wait_for(PATIENCE, turns) {
            return Ended::NeverTurned;
        }
        let killed = camera.now();
        launch.signal("KILL");
        scene::rests(&camera, killed).map_or(Ended::Never, Ended::Rested)
    }
}

impl Display for Ended {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rested(time) => write!(f, "{:.1} s", time.as_secs_f64()),
            Self::NeverTurned => write!(f, "nobody was followed: it never turned"),
            Self::Never => write!(f, "it turns on"),
        }
    }
}
