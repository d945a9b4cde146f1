// SPDX-License-Identifier: MPL-2.0

//! Runs everything that can come between `vapixptzsink` and its camera, and prints a table in Markdown of
//! what the user sees and how long it takes:
//!
//! ```sh
//! cargo run -p gst-plugin-vapix --example faults > docs/faults.md
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used)]

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/surviving/mod.rs"]
mod surviving;

use std::thread;
use std::time::Duration;

use surviving::scene::Trouble;
use surviving::{Case, Outcome, cases, name_not_yet_known, survive, unknown_name, wrong_password};
use virtual_camera::Fault;

const HEADER: &str = "# What can go wrong with the camera

Measured by `cargo run -p gst-plugin-vapix --example faults`, over HTTP and with the default properties,
on a camera that is being steered. Each fault lasts 4 s or more, the reboot 60 s. The figures are the worst
of three runs, in which the fault ends at different moments between two attempts; the last three rows are
one run each. The user sees one warning when the fault begins, and one `connected` when it is over. A
request that hangs is given up after `timeout`, 1.5 s by default; with a longer timeout, control is back
that much later.

Where only PTZ is lost, the element accepted every picture at once throughout. Where video is lost too, no
picture arrived until the fault was over. For pipelines whose source fails together with the camera, see
[How soon video and control are back](coming-back.md).

| Fault | Lost | What the user sees | Requests per second meanwhile | Back in control after |
|---|---|---|---|---|";

/// As the element has it by default.
const TIMEOUT: Duration = Duration::from_millis(1500);

/// How long faults last. They end at different moments of the pauses between attempts.
const LAST: [Duration; 3] =
    [Duration::from_millis(4100), Duration::from_millis(5000), Duration::from_millis(5350)];

/// What is lost where pictures go on coming.
const PTZ: &str = "PTZ";

/// A real camera needs about this long.
const REBOOT: Duration = Duration::from_secs(60);

fn main() {
    common::init();
    println!("{HEADER}");
    for case in cases() {
        let lasts = if case.trouble == Trouble::Camera(Fault::Reboot) { [REBOOT; 3] } else { LAST };
        row(&case, lasts);
    }
    print("host name unknown from the start, then known", PTZ, "0", &name_not_yet_known(TIMEOUT));
    print("unknown host name (then corrected)", PTZ, "0", &unknown_name(TIMEOUT));
    print("wrong password (then corrected)", PTZ, "2 in all", &wrong_password());
}

/// Runs a case three times at once.
fn row(case: &Case, lasts: [Duration; 3]) {
    let outcomes: Vec<(Outcome, Duration)> = thread::scope(|scope| {
        let runs = lasts.map(|lasts| scope.spawn(move || (survive(case, TIMEOUT, lasts), lasts)));
        runs.into_iter().map(|run| run.join().unwrap()).collect()
    });
    let rate = |(outcome, lasts): &(Outcome, Duration)| outcome.requests as f64 / lasts.as_secs_f64();
    let most = outcomes.iter().map(rate).fold(0.0, f64::max);
    let worst = outcomes.iter().map(|(outcome, _)| outcome).max_by_key(|outcome| outcome.back_after);
    let lost = match (case.noticed, case.video_lost) {
        (_, true) => "PTZ and video",
        (true, false) => PTZ,
        (false, false) => "nothing",
    };
    print(case.name, lost, &format!("{most:.1}"), worst.unwrap());
}

fn print(name: &str, lost: &str, requests: &str, outcome: &Outcome) {
    let (seen, back) = match &outcome.warning {
        Some(warning) => (warning.as_str(), format!("{:.2} s", outcome.back_after.as_secs_f64())),
        None => ("nothing, it goes on", "—".to_owned()),
    };
    println!("| {name} | {lost} | {seen} | {requests} | {back} |");
}
