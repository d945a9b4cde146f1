// SPDX-License-Identifier: MPL-2.0

//! Who was followed is kept, and told; nobody is followed the worse for it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use ::events::{FILE, Reader, Store};
use end_to_end::{PATIENCE, Program, plugin_folder, scene, scratch, tool};
use rusqlite::Connection;
use serde_json::Value;
use virtual_camera::VirtualCamera;

/// What `ptztrack events` prints.
fn events(folder: &Path, more: &[&str]) -> String {
    let mut command = tool(plugin_folder().join("ptztrack").to_str().unwrap());
    let output = command.arg("events").args(more).arg("--folder").arg(folder).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

#[track_caller]
fn is_steered(camera: &VirtualCamera) {
    let before = camera.status().commands;
    assert!(camera.wait_for(PATIENCE, |status| status.commands > before + 20), "not steered");
}

fn file(camera: &VirtualCamera, more: &str) -> impl FnOnce(&Path) -> String {
    let (url, more) = (camera.url(), more.to_owned());
    move |folder| Program::entry("door", &url, &folder.join("password")) + &more
}

/// By a camera of this process and by one of its own.
#[test]
fn who_was_followed_is_kept_with_way_and_picture_and_deleted_by_number() {
    for isolation in ["none", "process"] {
        let camera = VirtualCamera::start(scene::walking_person()).unwrap();
        let folder = scratch(&format!("events-{isolation}"));
        let more =
            format!("isolation = \"{isolation}\"\n[events]\npixelate-faces = true\nfolder = {folder:?}\n");
        let mut program = Program::start(&format!("events-{isolation}"), file(&camera, &more), &[]);
        scene::wait_until_following(&camera);
        is_steered(&camera);
        // Whoever is let go has been there.
        assert_eq!(program.ask("POST", "/cameras/door/release").0, 204);
        let line = program.launch.wait_for_line(": event 1: target ");
        assert!(line.contains(" door: event 1: target 1 was followed for "), "{line}");
        let all = events(&folder, &["--json", "--camera", "door", "--since", "1h"]);
        let event: Value = serde_json::from_str(all.lines().next().unwrap()).unwrap();
        assert_eq!((&event["id"], &event["camera"], &event["track"]), (&1.into(), &"door".into(), &1.into()));
        assert!(event["way_deg"].as_f64().is_some_and(|way| (1.0..90.0).contains(&way)), "{event}");
        // On a level with the camera's first view, where they walk up and down.
        let path = event["path"].as_array().unwrap();
        let within = |step: &Value| {
            (-26.0..26.0).contains(&step[1].as_f64().unwrap())
                && (-8.0..4.0).contains(&step[2].as_f64().unwrap())
        };
        assert!(!path.is_empty() && path.iter().all(within), "{event}");
        assert_eq!(event["picture"], true);
        assert!(events(&folder, &["--csv"]).starts_with("id,camera,track,from,to"));
        assert!(events(&folder, &[]).contains("door"));
        assert_eq!(events(&folder, &["--camera", "yard"]), "");
        assert_eq!(events(&folder, &["delete", "1"]), "Event 1 is deleted.\n");
        assert!(!events(&folder, &["--json"]).contains("\"id\":1,"));
        // At the end whoever is followed is kept, too.
        is_steered(&camera);
        program.launch.signal("TERM");
        program.launch.wait_for_line(": event 2: target ");
        let said = program.end("TERM");
        assert!(!said.contains("not kept"), "{said}");
        let picture = Reader::open(&folder).unwrap().picture(2).unwrap().unwrap();
        assert!(picture.starts_with(&[0xff, 0xd8]) && picture.ends_with(&[0xff, 0xd9]), "no JPEG");
        fs::remove_dir_all(&folder).unwrap();
    }
}

#[test]
fn where_nothing_is_to_be_kept_there_is_no_file() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut program = Program::start("events-off", file(&camera, "[events]\nstore = \"off\"\n"), &[]);
    scene::wait_until_following(&camera);
    assert_eq!(program.ask("POST", "/cameras/door/release").0, 204);
    program.launch.wait_for_line("target 1 released");
    assert!(!program.folder().join("state").exists());
    let said = program.end("TERM");
    assert!(!said.contains("event 1"), "{said}");
}

/// A file lies where the folder should be, until it is gone.
#[test]
fn a_folder_that_cannot_be_written_is_said_once_and_nobody_is_followed_the_worse_for_it() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let there = scratch("events-unwritable");
    fs::write(&there, "").unwrap();
    let mut program =
        Program::start("events-unwritable", file(&camera, &format!("[events]\nfolder = {there:?}\n")), &[]);
    program.launch.wait_for_line("warning: events are not kept: ");
    scene::wait_until_following(&camera);
    is_steered(&camera);
    assert_eq!(program.ask("POST", "/cameras/door/release").0, 204);
    fs::remove_file(&there).unwrap();
    program.launch.wait_for_line("events are kept again");
    program.launch.wait_for_line(": event 1: target 1 was followed");
    let said = program.end("TERM");
    fs::remove_dir_all(&there).unwrap();
    assert_eq!(said.matches("are not kept").count(), 1, "{said}");
}

/// As by somebody who copies it, or cleans it up.
#[test]
fn a_store_that_another_writer_has_locked_is_said_once_and_written_once_it_is_free() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let there = scratch("events-locked");
    drop(Store::open(&there).unwrap());
    let writer = Connection::open(there.join(FILE)).unwrap();
    writer.execute_batch("BEGIN IMMEDIATE").unwrap();
    let mut program =
        Program::start("events-locked", file(&camera, &format!("[events]\nfolder = {there:?}\n")), &[]);
    let line = program.launch.wait_for_line("warning: events are not kept: ");
    assert!(line.contains("database is locked"), "{line}");
    scene::wait_until_following(&camera);
    is_steered(&camera);
    assert_eq!(program.ask("POST", "/cameras/door/release").0, 204);
    writer.execute_batch("COMMIT").unwrap();
    program.launch.wait_for_line("events are kept again");
    program.launch.wait_for_line(": event 1: target 1 was followed");
    let said = program.end("TERM");
    assert_eq!(said.matches("are not kept").count(), 1, "{said}");
    assert!(Reader::open(&there).unwrap().sighting(1).unwrap().is_some());
    fs::remove_dir_all(&there).unwrap();
}

#[test]
fn a_file_that_is_no_database_is_moved_aside_and_a_new_one_begun() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let there = scratch("events-broken");
    fs::create_dir_all(&there).unwrap();
    let nonsense = "nonsense ".repeat(1000);
    fs::write(there.join("events.db"), &nonsense).unwrap();
    let mut program =
        Program::start("events-broken", file(&camera, &format!("[events]\nfolder = {there:?}\n")), &[]);
    program.launch.wait_for_line("warning: the file of events is broken or of another version: it is ");
    scene::wait_until_following(&camera);
    program.launch.signal("TERM");
    program.launch.wait_for_line(": event 1: target ");
    program.end("TERM");
    let kept = fs::read_dir(&there).unwrap().map(|entry| fs::read(entry.unwrap().path()).unwrap());
    assert!(kept.into_iter().any(|text| text == nonsense.as_bytes()));
    fs::remove_dir_all(&there).unwrap();
}
