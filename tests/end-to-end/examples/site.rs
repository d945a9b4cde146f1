// SPDX-License-Identifier: MPL-2.0

//! Twenty cameras that one program follows with for an hour, before a store of ten thousand events which it adds to; now and then
//! somebody asks its page for all of them. Prints a table in Markdown of how long the page takes, how many pictures were looked at, and
//! whether the program takes more and more:
//!
//! ```sh
//! cargo build --release --workspace --lib --bins && cargo run --release --example site
//! cargo run --release --example site -- --cameras 8 --frame-rate 25 --duration 3750    # as many pictures as of one camera in a night
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod store;

use std::fs;
use std::path::Path;
use std::process::ExitCode;
use std::thread;
use std::time::{Duration, Instant};

use clap::Parser;
use end_to_end::{Growth, Program, Usage, growths, scene, scratch};
use events::{Filter, Reader};
use virtual_camera::VirtualCamera;

#[derive(Parser)]
struct Options {
    /// Seconds.
    #[arg(long, default_value_t = 3600)]
    duration: u64,
    /// How many.
    #[arg(long, default_value_t = store::CAMERAS)]
    cameras: i64,
    /// Of their pictures, which are drawn on the same machine: a second.
    #[arg(long, default_value_t = 5.0)]
    frame_rate: f64,
}

/// From one look at the program to the next.
const EVERY: Duration = Duration::from_secs(10);
/// Of so many looks one is shown.
const OFTEN: usize = 12;
/// A camera rests by then.
const AT_REST: Duration = Duration::from_secs(10);

fn main() -> ExitCode {
    let options = Options::parse();
    let duration = Duration::from_secs(options.duration);
    let camera = |_| VirtualCamera::start(scene::walking_person_at(options.frame_rate, duration)).unwrap();
    let cameras: Vec<_> = (0..options.cameras).map(camera).collect();
    let folder = scratch("site");
    store::fill(&folder);
    let program = Program::start("site", |own| file(&cameras, own, &folder), &[]);
    let begin = Instant::now();
    let (mut moments, mut took_ms) = (Vec::new(), Vec::new());
    while begin.elapsed() < duration {
        thread::sleep(EVERY);
        moments.extend(Usage::of(program.launch.id(), begin.elapsed(), moments.last()));
        let (took, events, _) = store::asked(&program, "");
        assert!(events >= store::EVENTS as usize, "{events}");
        took_ms.push(took);
        // Whoever is let go has been there, and is found again.
        let one = store::name(moments.len() as i64 % options.cameras);
        program.ask("POST", &format!("/cameras/{one}/release"));
    }
    let metric = |name| program.metric(name) as u64;
    let pictures = metric("ptztrack_pictures_total") - metric("ptztrack_pictures_dropped_total");
    let unsteered = cameras.iter().filter(|camera| camera.status().commands == 0).count();
    program.end("TERM");
    let turning = cameras.iter().filter(|camera| !scene::left_at_rest(camera, AT_REST)).count();
    let kept = Reader::open(&folder).unwrap().sightings(&Filter::default()).unwrap().len();
    fs::remove_dir_all(&folder).unwrap();

    took_ms.sort_unstable();
    let growths = growths(&moments);
    println!(
        "| {} cameras, {} s | on average | in an hour (95 %) | |\n|---|---:|---:|---|",
        cameras.len(),
        options.duration
    );
    growths.iter().for_each(|growth| println!("| {growth} |"));
    println!("\n| what | how many |\n|---|---:|");
    println!("| pictures that were looked at | {pictures} |");
    println!(
        "| events kept, beside those that were there | {} |",
        kept.saturating_sub(store::EVENTS as usize)
    );
    println!("| times that the page was asked for all events | {} |", took_ms.len());
    println!("| ms that it took: median | {} |", took_ms[took_ms.len() / 2]);
    println!("| ms that it took: at most | {} |", took_ms[took_ms.len() - 1]);
    println!("| cameras that were never steered | {unsteered} |");
    println!("| cameras left turning | {turning} |");
    // A step has another cause than a slope.
    let memory: Vec<_> =
        moments.iter().step_by(OFTEN).map(|usage| format!("{:.1}", usage.memory_mb)).collect();
    println!("\nmemory, MB, every {} s: {}", (EVERY * OFTEN as u32).as_secs(), memory.join(", "));
    let well = growths.iter().filter_map(Growth::fault).count() == 0 && unsteered + turning == 0;
    if well { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// All of them, who keep what they see in one store.
fn file(cameras: &[VirtualCamera], own: &Path, events: &Path) -> String {
    let entry = |(camera, number): (&VirtualCamera, i64)| {
        Program::entry(&store::name(number), &camera.url(), &own.join("password"))
    };
    let entries: String = cameras.iter().zip(0..).map(entry).collect();
    entries + &format!("[events]\nfolder = {events:?}\nkeep = \"10000d\"\n")
}
