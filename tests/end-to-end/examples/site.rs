// SPDX-License-Identifier: MPL-2.0

//! Twenty cameras that one program follows with for an hour, before a store of ten thousand events which it adds to. It records them
//! and tells a broker; now and then somebody asks its page for all events and for a picture, and its file changes and is read again.
//! Prints a table in Markdown of how long the page takes, how many pictures were looked at, and whether the program takes more and more:
//!
//! ```sh
//! cargo build --release --workspace --lib --bins && cargo run --release --example site
//! cargo run --release --example site -- --cameras 10 --frame-rate 25 --duration 3120    # as many pictures as of one camera in a night
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod store;

use std::fs;
use std::path::Path;
use std::process::ExitCode;
use std::thread;
use std::time::{Duration, Instant};

use clap::Parser;
use end_to_end::{Broker, Counter, Growth, Program, Usage, growths, scene, scratch};
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
/// After so many the file is another, and is read again.
const RELOAD: usize = 30;
/// A camera rests by then.
const AT_REST: Duration = Duration::from_secs(10);

fn main() -> ExitCode {
    let options = Options::parse();
    let duration = Duration::from_secs(options.duration);
    let camera = |_| VirtualCamera::start(scene::walking_person_at(options.frame_rate, duration)).unwrap();
    let cameras: Vec<_> = (0..options.cameras).map(camera).collect();
    let folder = scratch("site");
    store::fill(&folder);
    let broker = Broker::start();
    let mut heard = broker.listen("site/#");
    let file = |own: &Path, changed| file(&cameras, own, &folder, &broker, changed);
    let program = Program::start("site", |own| file(own, 0), &[]);
    let begin = Instant::now();
    let (mut moments, mut took_ms) = (Vec::new(), Vec::new());
    let (mut shown, mut reloads) = (0, 0);
    let mut counts = Counts::of((0..options.cameras).map(store::name).collect());
    while begin.elapsed() < duration {
        thread::sleep(EVERY);
        moments.extend(Usage::of(program.launch.id(), begin.elapsed(), moments.last()));
        let (took, events, _) = store::asked(&program, "");
        assert!(events >= store::EVENTS as usize, "{events}");
        took_ms.push(took);
        counts.look(&program);
        // Whoever is let go has been there, and is found again.
        let one = store::name(moments.len() as i64 % options.cameras);
        program.ask("POST", &format!("/cameras/{one}/release"));
        shown += usize::from(program.ask("GET", &format!("/cameras/{one}/picture")).0 == 200);
        if moments.len().is_multiple_of(RELOAD) {
            reloads += 1;
            let changed = reloads % options.cameras;
            fs::write(program.folder().join("cameras.toml"), file(program.folder(), changed)).unwrap();
            program.launch.signal("HUP");
        }
    }
    let unsteered = cameras.iter().filter(|camera| camera.status().commands == 0).count();
    counts.look(&program);
    let [came, dropped, pipelines] = counts.totals();
    let pictures = came - dropped;
    let files = recordings(&program.folder().join("recordings"));
    let unrecorded =
        (0..options.cameras).map(store::name).filter(|name| !files.iter().any(|file| is_of(file, name)));
    let unrecorded = unrecorded.count();
    heard.read_for(Duration::ZERO);
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
    println!("| pictures that the page showed | {shown} |");
    println!("| times that the file was read again | {reloads} |");
    println!("| pipelines built | {pipelines} |");
    println!("| messages to the broker | {} |", heard.seen().len());
    println!("| files of recordings in the end | {} |", files.len());
    println!("| cameras that were never steered | {unsteered} |");
    println!("| cameras that were not recorded | {unrecorded} |");
    println!("| cameras left turning | {turning} |");
    // A step has another cause than a slope.
    let memory: Vec<_> =
        moments.iter().step_by(OFTEN).map(|usage| format!("{:.1}", usage.memory_mb)).collect();
    println!("\nmemory, MB, every {} s: {}", (EVERY * OFTEN as u32).as_secs(), memory.join(", "));
    let lost = unsteered + unrecorded + turning;
    let went_on = shown > 0 && pipelines > cameras.len() as u64 && !heard.seen().is_empty();
    let well = growths.iter().filter_map(Growth::fault).count() == 0 && lost == 0 && went_on;
    if well { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// What the program counts, summed up over cameras that begin anew: those whose entries change.
struct Counts {
    cameras: Vec<String>,
    /// Of each name, of each camera.
    counters: [Vec<Counter>; 3],
}

impl Counts {
    const NAMES: [&str; 3] =
        ["ptztrack_pictures_total", "ptztrack_pictures_dropped_total", "ptztrack_pipelines_total"];

    fn of(cameras: Vec<String>) -> Self {
        let counters = Self::NAMES.map(|_| cameras.iter().map(|_| Counter::default()).collect());
        Self { cameras, counters }
    }

    fn look(&mut self, program: &Program) {
        let counts = program.metrics_of(Self::NAMES, &self.cameras);
        for camera in 0..self.cameras.len() {
            // Of pipelines there is one before, and one after.
            let begins_anew = self.counters[0][camera].is_more_than(counts[0][camera]);
            for (counters, counts) in self.counters.iter_mut().zip(&counts) {
                if begins_anew {
                    counters[camera].begin_anew();
                }
                counters[camera].is(counts[camera]);
            }
        }
    }

    fn totals(&self) -> [u64; 3] {
        self.counters.each_ref().map(|counters| counters.iter().map(Counter::total).sum())
    }
}

/// All of them, recorded, who keep what they see in one store; one has longer files than the others.
fn file(cameras: &[VirtualCamera], own: &Path, events: &Path, broker: &Broker, changed: i64) -> String {
    let recordings = own.join("recordings");
    let entry = |(camera, number): (&VirtualCamera, i64)| {
        let name = store::name(number);
        let segment_s = if number == changed { 20 } else { 10 };
        Program::entry(&name, &camera.url(), &own.join("password"))
            + &format!(
                "[camera.{name}.recording]\nfolder = {recordings:?}\nsegment = \"{segment_s}s\"\nkeep = \"1m\"\n"
            )
    };
    let entries: String = cameras.iter().zip(0..).map(entry).collect();
    entries
        + &format!("[events]\nfolder = {events:?}\nkeep = \"10000d\"\n")
        + &format!("[mqtt]\nhost = \"127.0.0.1\"\nport = {}\ntopic = \"site\"\n", broker.port)
}

/// The names of the files in a folder.
fn recordings(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).into_iter().flatten();
    names.map(|file| file.unwrap().file_name().into_string().unwrap()).collect()
}

/// Whether a file is of this camera.
fn is_of(file: &str, camera: &str) -> bool {
    file.strip_prefix(camera).is_some_and(|rest| rest.starts_with('-'))
}
