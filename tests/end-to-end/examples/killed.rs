// SPDX-License-Identifier: MPL-2.0

//! Kills applications that turn cameras by ONVIF, or zoom with them, as specified and with each quirk, and prints a table in Markdown
//! of how soon each camera rests:
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
/// It must zoom as fast as this to be left zooming, steps of 9998 a second.
const ZOOMS: f64 = 50.0;
/// Of so many runs the worst counts.
const RUNS: usize = 3;

/// What became of a camera, the worst last.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Ended {
    /// It rested so long after the application was killed.
    Rested(Duration),
    /// Nobody was followed, or the zoom is left alone: nothing is shown.
    NeverMoved,
    /// It moves on.
    Never,
}

struct Case {
    name: String,
    quirks: Vec<Quirk>,
}

fn main() {
    println!(
        "Killed while the camera turned by {TURNS}° a second or more, or zoomed; the worst of {RUNS} runs.\n"
    );
    println!("| camera | killed as it turns, it rests after | as it zooms |\n|---|---|---|");
    let only = std::env::args().nth(1).unwrap_or_default();
    for case in cases().filter(|case| case.name.contains(&only)) {
        println!("| {} | {} | {} |", case.name, case.worst(&TURNING), case.worst(&ZOOMING));
    }
}

fn cases() -> impl Iterator<Item = Case> {
    let plain = Case { name: "as specified".to_owned(), quirks: Vec::new() };
    let each =
        Quirk::ALL.iter().map(|quirk| Case { name: format!("`{}`", quirk.switch()), quirks: vec![*quirk] });
    let together = Case { name: "all that can be had together".to_owned(), quirks: Quirk::together() };
    iter::once(plain).chain(each).chain(iter::once(together))
}

/// How a camera is to be moving.
struct Moving {
    /// Of the servo.
    properties: &'static str,
    /// Whether it does.
    shows: fn(&Status) -> bool,
    /// By when it does, if it ever does.
    by: Duration,
}

const TURNING: Moving = Moving {
    properties: "",
    shows: |status| status.pan_rate_deg_s.hypot(status.tilt_rate_deg_s) > TURNS,
    by: PATIENCE,
};

const ZOOMING: Moving = Moving {
    properties: "auto-zoom=true target-height=0.9",
    shows: |status| status.zoom_rate_step_s.abs() > ZOOMS,
    by: Duration::from_secs(30),
};

impl Case {
    fn worst(&self, moving: &Moving) -> Ended {
        thread::scope(|scope| {
            let runs: Vec<_> = (0..RUNS).map(|_| scope.spawn(|| self.run(moving))).collect();
            runs.into_iter().map(|run| run.join().unwrap()).max().unwrap_or(Ended::Never)
        })
    }

    fn run(&self, moving: &Moving) -> Ended {
        let camera = VirtualCamera::start(scene::any_make(OnvifSettings::with(&self.quirks))).unwrap();
        let launch = GstLaunch::start(&[], &scene::follow_onvif(&camera, moving.properties));
        if !camera.wait_for(moving.by, moving.shows) {
            return Ended::NeverMoved;
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
            Self::NeverMoved => write!(f, "it never moved so"),
            Self::Never => write!(f, "it turns on"),
        }
    }
}
