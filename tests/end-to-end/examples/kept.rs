// SPDX-License-Identifier: MPL-2.0

//! Kills `ptztrack` a hundred times while it keeps who was followed, fills a store with ten thousand events and asks its page for them,
//! and prints a table in Markdown of what is lost, and how long the page takes:
//!
//! ```sh
//! cargo build --release --workspace --lib --bins && cargo run --release --example kept
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod store;

use std::fs;
use std::path::Path;
use std::thread;
use std::time::Duration;

use end_to_end::{Chance, Program, scene, scratch};
use events::{Filter, Reader, Store};
use store::{CAMERAS, EVENTS};
use virtual_camera::VirtualCamera;

const KILLS: usize = 100;
const QUESTIONS: usize = 20;

fn main() {
    println!("| what | how often | figure |\n|---|---|---|");
    println!("| SIGKILL | {KILLS} | {} |", killed());
    let folder = scratch("kept-asked");
    store::fill(&folder);
    let program = program("asked", "http://127.0.0.1:1", &folder);
    for (what, query) in [("", ""), (" that went through a zone", "?left=-10&right=30&bottom=-10&top=0")] {
        let answers: Vec<_> = (0..QUESTIONS).map(|_| store::asked(&program, query)).collect();
        assert!(answers.iter().all(|(_, events, _)| *events == EVENTS as usize), "{answers:?}");
        let (slowest, _, bytes) = answers.into_iter().max().unwrap();
        println!(
            "| the page's list of {EVENTS} events of {CAMERAS} cameras{what}, {bytes} bytes | {QUESTIONS} | {slowest} ms at most |"
        );
    }
    program.end("TERM");
    fs::remove_dir_all(&folder).unwrap();
}

/// At another moment each time after an event was said to be kept.
fn killed() -> String {
    let camera = VirtualCamera::start(scene::walking_person_for(Duration::from_secs(7200))).unwrap();
    let folder = scratch("kept-killed");
    let mut chance = Chance::new(1);
    let mut said = 0;
    for _ in 0..KILLS {
        let mut program = program("killed", &camera.url(), &folder);
        program.launch.wait_for_line("acquired");
        assert_eq!(program.ask("POST", "/cameras/door/release").0, 204);
        program.launch.wait_for_line(": event ");
        said += 1;
        thread::sleep(Duration::from_millis(chance.within((0, 200))));
        let (_, all) = program.end_somehow("KILL");
        // It may have kept another one since.
        said += all.matches(": event ").count() - 1;
        let (_, aside) = Store::open(&folder).unwrap();
        assert_eq!(aside, None, "the file is broken");
    }
    let kept = Reader::open(&folder).unwrap().sightings(&Filter::default()).unwrap().len();
    let pictures = Reader::open(&folder).unwrap();
    let whole = pictures
        .sightings(&Filter::default())
        .unwrap()
        .iter()
        .all(|entry| pictures.picture(entry.id).is_ok());
    fs::remove_dir_all(&folder).unwrap();
    assert!(whole);
    format!("{said} events were said to be kept, {} of them lost, no file broken", said.saturating_sub(kept))
}

fn program(test: &str, address: &str, events: &Path) -> Program {
    let file = |own: &Path| {
        Program::entry("door", address, &own.join("password"))
            + &format!("[events]\nfolder = {events:?}\nkeep = \"10000d\"\n")
    };
    Program::start(&format!("kept-{test}"), file, &[])
}
