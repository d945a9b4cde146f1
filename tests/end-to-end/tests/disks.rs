// SPDX-License-Identifier: MPL-2.0

//! What a disk can do to a recording, and to nothing else: the camera is followed all the while.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use end_to_end::following::Network;
use end_to_end::{Disk, PATIENCE, Program, scene};
use virtual_camera::VirtualCamera;

/// More than all of these disks hold.
const MEBIBYTES: u64 = 4;

/// A camera that is recorded there, and followed.
struct Recorded {
    camera: VirtualCamera,
    network: Network,
    program: Program,
}

impl Recorded {
    #[track_caller]
    fn on(disk: &Disk, test: &str) -> Self {
        let camera = VirtualCamera::start(scene::walking_person()).unwrap();
        let network = Network::before(&camera);
        let file = |folder: &Path| {
            let recording = disk.folder();
            Program::entry("door", &network.url(), &folder.join("password"))
                + &format!("[camera.door.recording]\nfolder = {recording:?}\nkeep = \"1h\"\n")
        };
        let program = Program::start(test, file, &[]);
        scene::wait_until_following(&camera);
        Self { camera, network, program }
    }

    #[track_caller]
    fn is_steered(&self) {
        let before = self.camera.status().commands;
        assert!(self.camera.wait_for(PATIENCE, |status| status.commands > before + 20), "not steered");
    }

    fn end(self) -> String {
        let said = self.program.end("TERM");
        scene::assert_left_at_rest(&self.camera);
        said
    }
}

fn recordings(disk: &Disk) -> Vec<String> {
    let names = fs::read_dir(disk.folder())
        .unwrap()
        .filter_map(|entry| entry.unwrap().file_name().into_string().ok());
    names.filter(|name| name.starts_with("door-")).collect()
}

#[track_caller]
fn wait_until(what: &str, done: impl Fn() -> bool) {
    let begin = Instant::now();
    while !done() {
        assert!(begin.elapsed() < PATIENCE, "{what}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

const OLD: [&str; 2] = ["door-20260101T000000000.mkv", "door-20260102T000000000.mkv"];
const EARLY: &str = "door: warning: the oldest recordings are deleted before their time";

/// Somebody else's files are in the way: ours to say, not to delete.
#[test]
fn a_full_disk_is_said_once_and_recorded_on_when_there_is_room() {
    let disk = Disk::new("full", MEBIBYTES);
    for name in OLD {
        fs::write(disk.folder().join(name), "x").unwrap();
    }
    let other = disk.folder().join("other");
    // As much as there is room for.
    let _ = fs::write(&other, vec![0; (MEBIBYTES as usize) << 20]);
    let mut recorded = Recorded::on(&disk, "full");
    let short = "door: warning: nothing is recorded: less than a fortieth of the disk is free";
    recorded.program.launch.wait_for_line(short);
    assert_eq!(recordings(&disk), [OLD[1]], "the last of the room is for others");
    recorded.is_steered();
    assert_eq!(recorded.network.http.video_requests(), 2, "a pipeline is built anew");
    fs::remove_file(other).unwrap();
    recorded.program.launch.wait_for_line("door: it is recorded again");
    let said = recorded.end();
    assert_eq!(["nothing is recorded", EARLY].map(|line| said.matches(line).count()), [1, 1], "{said}");
}

/// A camera that is followed, with its events there.
fn with_events_on(disk: &Disk, test: &str) -> (VirtualCamera, Program) {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let file = |folder: &Path| {
        let events = disk.folder();
        Program::entry("door", &camera.url(), &folder.join("password"))
            + &format!("[events]\nfolder = {events:?}\n")
    };
    let program = Program::start(test, file, &[]);
    scene::wait_until_following(&camera);
    (camera, program)
}

#[track_caller]
fn is_steered(camera: &VirtualCamera) {
    let before = camera.status().commands;
    assert!(camera.wait_for(PATIENCE, |status| status.commands > before + 20), "not steered");
}

#[test]
fn a_full_disk_of_events_is_said_once_and_they_are_kept_when_there_is_room() {
    let disk = Disk::new("events-full", MEBIBYTES);
    let other = disk.folder().join("other");
    let _ = fs::write(&other, vec![0; (MEBIBYTES as usize) << 20]);
    let (camera, mut program) = with_events_on(&disk, "events-full");
    program.launch.wait_for_line("warning: events are not kept: ");
    is_steered(&camera);
    assert_eq!(program.ask("POST", "/cameras/door/release").0, 204);
    is_steered(&camera);
    fs::remove_file(other).unwrap();
    // What was missing may have been a file or a first event.
    program.launch.wait_for_line("events are kept again");
    let said = program.end("TERM");
    assert!(said.contains(": event 1: target "), "{said}");
    assert_eq!(said.matches("are not kept").count(), 1, "{said}");
    scene::assert_left_at_rest(&camera);
}

/// Whoever keeps events waits, and so does whoever asks for them; nobody else does.
#[test]
fn a_disk_of_events_that_hangs_holds_nobody() {
    let disk = Disk::new("events-hang", MEBIBYTES);
    let (camera, program) = with_events_on(&disk, "events-hang");
    wait_until("no file of events", || disk.folder().join("events.db").exists());
    disk.hang();
    assert_eq!(program.ask("POST", "/cameras/door/release").0, 204);
    is_steered(&camera);
    assert_eq!(program.ask("GET", "/healthz"), (200, "ok\n".to_owned()));
    program.end("TERM");
    scene::assert_left_at_rest(&camera);
}

/// Before it is full: a share of it is left free for others.
#[test]
fn the_oldest_recordings_make_room_for_the_newest() {
    let disk = Disk::new("short", MEBIBYTES);
    for name in OLD {
        fs::write(disk.folder().join(name), vec![0; 1_650_000]).unwrap();
    }
    let recorded = Recorded::on(&disk, "short");
    let names = || recordings(&disk);
    wait_until("the oldest stays, or the newest is not there", || {
        let names = names();
        !names.iter().any(|name| name == OLD[0]) && names.len() > 1
    });
    assert!(names().iter().any(|name| name == OLD[1]), "{:?}", names());
    let said = recorded.end();
    assert!(!said.contains("nothing is recorded"), "{said}");
    assert_eq!(said.matches(EARLY).count(), 1, "{said}");
}

/// It takes a little now and then, and keeps whoever writes on it waiting in between.
#[test]
fn a_slow_disk_holds_nobody() {
    let disk = Disk::new("slow", MEBIBYTES);
    let recorded = Recorded::on(&disk, "slow");
    wait_until("nothing is recorded", || !recordings(&disk).is_empty());
    let before = recorded.network.http.video_requests();
    let steered = recorded.camera.status().commands;
    for _ in 0..5 {
        disk.hang();
        std::thread::sleep(Duration::from_millis(900));
        disk.go_on();
        std::thread::sleep(Duration::from_millis(100));
    }
    // At ten a second or so: a disk that is waited for leaves a tenth of them.
    assert!(recorded.camera.status().commands > steered + 20, "not steered");
    assert_eq!(recorded.network.http.video_requests(), before, "a pipeline is built anew");
    let said = recorded.end();
    assert!(!said.contains("door: error"), "{said}");
}

/// Whoever writes on it cannot be ended; everybody else goes on, through a new pipeline too, and the program can be ended.
#[test]
fn a_disk_that_hangs_holds_nobody() {
    let disk = Disk::new("hangs", MEBIBYTES);
    let recorded = Recorded::on(&disk, "hangs");
    wait_until("nothing is recorded", || !recordings(&disk).is_empty());
    disk.hang();
    recorded.is_steered();
    let before = recorded.network.http.video_requests();
    recorded.network.reset();
    recorded.network.http.wait_for_picture(before);
    recorded.is_steered();
    assert_eq!(recorded.program.ask("GET", "/healthz"), (200, "ok\n".to_owned()));
    recorded.end();
}
