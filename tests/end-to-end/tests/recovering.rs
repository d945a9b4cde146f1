// SPDX-License-Identifier: MPL-2.0

//! What keeps no camera of the program `ptztrack` away for good, nor anybody who waits for it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use end_to_end::following::Network;
use end_to_end::{PATIENCE, Program, plugin_folder, scene, signal};
use virtual_camera::{Fault, VirtualCamera};

/// As one that is starting refuses everybody, and one that was attacked locks the account.
#[test]
fn a_camera_that_refuses_an_account_that_worked_is_tried_again() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let network = Network::before(&camera);
    let file = |folder: &Path| Program::entry("door", &network.url(), &folder.join("password"));
    let mut program = Program::start("locked", file, &[]);
    scene::wait_until_following(&camera);

    camera.set_fault(Fault::Locked);
    network.reset();
    let line = program.launch.wait_for_line("the camera refuses user");
    assert!(line.contains("tried again"), "{line}");
    program.wait_for("/cameras", |cameras| cameras.contains("no picture"));
    camera.set_fault(Fault::None);
    program.launch.wait_for_line("door: the picture is there");
    scene::wait_until_following(&camera);
    program.end("TERM");
    scene::assert_left_at_rest(&camera);
}

/// The next process of a camera knows that its account has worked; and the watchdog, refused as well, stops the camera once it can.
#[test]
fn a_camera_that_refuses_everybody_as_its_process_crashes_is_stopped_and_tried_again() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let file = |folder: &Path| {
        Program::entry("door", &camera.url(), &folder.join("password")) + "isolation = \"process\"\n"
    };
    let mut program = Program::start("crashed", file, &[]);
    scene::wait_until_following(&camera);
    program.wait_for("/metrics", |metrics| metrics.contains("ptztrack_picture_up{camera=\"door\"} 1"));

    camera.set_fault(Fault::Locked);
    signal(program.process_of("door"), "ABRT");
    let line = program.launch.wait_for_line("the camera refuses user");
    assert!(line.contains("tried again"), "{line}");
    camera.set_fault(Fault::None);
    program.launch.wait_for_line("door: the picture is there");
    program.end("TERM");
    scene::assert_left_at_rest(&camera);
}

/// The thread that asks for the name cannot be ended: whoever waits for it waits for as long as the name server likes.
#[test]
fn a_name_that_is_looked_up_for_ever_keeps_nobody_waiting() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let network = Network::before(&camera);
    let names = plugin_folder().join("examples/libsilent_names.so");
    // Where there is no such library the linker only warns.
    assert!(names.is_file(), "{}", names.display());
    let good = |folder: &Path| Program::entry("good", &network.url(), &folder.join("password"));
    let file = |folder: &Path| {
        good(folder) + &Program::entry("lost", "http://camera.silent", &folder.join("password"))
    };
    let mut program = Program::start_in("silent-name", file, &[], &[("LD_PRELOAD", &names)]);
    scene::wait_until_following(&camera);
    program.launch.wait_for_line("lost: error: ");

    // Neither who reads the file again, nor who asks whether all is well, nor another camera.
    fs::write(program.folder().join("cameras.toml"), good(program.folder())).unwrap();
    program.launch.signal("HUP");
    program.launch.wait_for_line("read again");
    program.wait_for("/cameras", |cameras| !cameras.contains("lost"));
    assert_eq!(program.ask("GET", "/healthz"), (200, "ok\n".to_owned()));
    let before = camera.status().commands;
    assert!(camera.wait_for(PATIENCE, |status| status.commands > before + 10), "not steered");
    assert_eq!(network.http.video_requests(), 2, "it is touched");
    program.end("TERM");
    scene::assert_left_at_rest(&camera);
}

/// A driver that never comes back, as far as the others can tell.
#[test]
fn a_camera_whose_own_process_hangs_is_given_another() {
    let [good, door] = [(); 2].map(|()| VirtualCamera::start(scene::walking_person()).unwrap());
    let file = |folder: &Path| {
        let password = folder.join("password");
        Program::entry("good", &good.url(), &password)
            + &Program::entry("door", &door.url(), &password)
            + "isolation = \"process\"\n"
    };
    let mut program = Program::start("hangs", file, &[]);
    [&good, &door].into_iter().for_each(scene::wait_until_following);
    let process = program.process_of("door");
    let limits = fs::read_to_string(format!("/proc/{process}/limits")).unwrap();
    let memory = limits.lines().find(|line| line.starts_with("Max data size")).unwrap();
    assert!(memory.contains(" 2147483648 "), "{memory}");
    signal(process, "STOP");
    program.launch.wait_for_line("door: error: its process hangs; it is started again");
    program.launch.wait_for_line("door: the picture is there");
    assert_ne!(program.process_of("door"), process);
    scene::wait_until_following(&door);
    assert_eq!(program.ask("GET", "/healthz"), (200, "ok\n".to_owned()));
    program.end("TERM");
    [good, door].iter().for_each(scene::assert_left_at_rest);
}
