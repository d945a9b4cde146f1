// SPDX-License-Identifier: MPL-2.0

//! However an application dies, in the middle of a pan, the camera's last order is a stop.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::os::unix::fs::PermissionsExt;
use std::time::{Duration, Instant};

use end_to_end::scene::{assert_left_at_rest, wait_until_following};
use end_to_end::{GstLaunch, Held, PATIENCE, Watchdog, scene, scratch, signal, tool};
use virtual_camera::{Fault, VirtualCamera};

/// How often the stick that an operator holds says where to.
const HELD: Duration = Duration::from_millis(50);

/// So long each of two cameras is seen to rest, of the 8 s that are left for a watchdog to start.
const REST: Duration = Duration::from_secs(2);

/// `gst-launch-1.0` that follows, with a watchdog of its own.
struct Application {
    camera: VirtualCamera,
    launch: GstLaunch,
    watchdog: Watchdog,
}

fn launch(watchdog: &Watchdog, options: &[&str], pipeline: &str) -> GstLaunch {
    let mut command = watchdog.of(tool("gst-launch-1.0"));
    command.args(options).args(pipeline.split_whitespace());
    GstLaunch::spawn(command)
}

impl Application {
    fn following(test: &str, options: &[&str]) -> Self {
        let camera = VirtualCamera::start(scene::walking_person()).unwrap();
        let watchdog = Watchdog::new(test);
        let launch = launch(&watchdog, options, &scene::follow(&camera));
        wait_until_following(&camera);
        Self { camera, launch, watchdog }
    }

    fn dies_of(self, signal: &str) {
        self.launch.signal(signal);
        let (status, output) = self.launch.finish();
        assert!(!status.success(), "{output}");
        assert_left_at_rest(&self.camera);
        self.watchdog.wait_for("it has nothing more to do", <[u32]>::is_empty);
    }
}

#[test]
fn killed() {
    Application::following("killed", &[]).dies_of("KILL");
}

#[test]
fn terminated() {
    Application::following("terminated", &[]).dies_of("TERM");
}

/// Without `-f`, `gst-launch-1.0` catches this and waits for a debugger.
#[test]
fn segmentation_fault() {
    Application::following("segmentation-fault", &["-f"]).dies_of("SEGV");
}

#[test]
fn aborted() {
    Application::following("aborted", &[]).dies_of("ABRT");
}

/// A process that is stopped, or swapped out, or in a debugger; and that goes on.
#[test]
fn suspended() {
    let Application { camera, launch, watchdog } = Application::following("suspended", &[]);
    launch.signal("STOP");
    assert_left_at_rest(&camera);
    launch.signal("CONT");
    wait_until_following(&camera);
    launch.signal("INT");
    launch.finish();
    assert_left_at_rest(&camera);
    watchdog.wait_for("it has nothing more to do", <[u32]>::is_empty);
}

/// As in a driver that never returns: pictures go on, and nobody is left who would stop the camera.
#[test]
fn a_camera_task_that_hangs_and_goes_on() {
    let Application { camera, launch, watchdog } = Application::following("task-hangs", &[]);
    let held = Held::threads(launch.id(), "ptz-camera");
    assert_left_at_rest(&camera);
    drop(held);
    wait_until_following(&camera);
    launch.signal("INT");
    launch.finish();
    assert_left_at_rest(&camera);
    watchdog.wait_for("it has nothing more to do", <[u32]>::is_empty);
}

/// A program of its own that follows.
fn application(watchdog: &Watchdog, camera: &VirtualCamera, what: &str) -> GstLaunch {
    let mut command = watchdog.of(tool(env!("CARGO_BIN_EXE_application")));
    command.args([what, &camera.url(), scene::USER]).env("CAMERA_PASSWORD", scene::PASSWORD);
    GstLaunch::spawn(command)
}

/// The socket to the watchdog stays open, and nobody speaks.
#[test]
fn a_forked_child_that_has_its_descriptors_lives_on() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let watchdog = Watchdog::new("fork");
    let mut launch = application(&watchdog, &camera, "fork");
    let child = launch.wait_for_line("child ").trim_start_matches("child ").parse().unwrap();
    wait_until_following(&camera);
    launch.signal("KILL");
    assert_left_at_rest(&camera);
    signal(child, "KILL");
    launch.finish();
    watchdog.wait_for("it has nothing more to do", <[u32]>::is_empty);
}

/// As one that waits for any child (`waitpid(-1)`): whoever started one hears nothing of its end.
#[test]
fn a_host_that_reaps_all_children_has_a_watchdog_too() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let watchdog = Watchdog::new("reap");
    let mut launch = application(&watchdog, &camera, "reap");
    launch.wait_for_line("moving");
    assert_eq!(watchdog.processes().len(), 1);
    wait_until_following(&camera);
    launch.signal("KILL");
    launch.finish();
    assert_left_at_rest(&camera);
}

/// Everything was done right, and the camera could not be reached.
#[test]
fn exits_right_after_null_in_an_outage() {
    let Application { camera, launch, watchdog } = Application::following("exits", &[]);
    camera.set_fault(Fault::BlackHole);
    launch.signal("INT");
    launch.finish();
    assert!(camera.status().moving);
    camera.set_fault(Fault::None);
    assert_left_at_rest(&camera);
    watchdog.wait_for("it has nothing more to do", <[u32]>::is_empty);
}

#[test]
fn one_watchdog_stops_all_cameras_of_an_application() {
    let cameras = [(); 2].map(|()| VirtualCamera::start(scene::walking_person()).unwrap());
    let watchdog = Watchdog::new("two");
    let pipelines = cameras.each_ref().map(|camera| scene::follow(camera).replace(" name=servo", ""));
    let launch = launch(&watchdog, &[], &pipelines.join(" "));
    cameras.iter().for_each(wait_until_following);
    assert_eq!(watchdog.processes().len(), 1);
    launch.signal("KILL");
    launch.finish();
    cameras.iter().for_each(assert_left_at_rest);
    watchdog.wait_for("it has nothing more to do", <[u32]>::is_empty);
}

/// A host in C dies of SIGPIPE where it writes to a socket that nobody reads.
#[test]
fn a_watchdog_that_dies_takes_nobody_along_and_is_replaced() {
    let Application { camera, launch, watchdog } = Application::following("replaced", &["-m"]);
    let first = watchdog.processes();
    signal(first[0], "KILL");
    watchdog
        .wait_for("no other was started", |processes| processes.first().is_some_and(|id| *id != first[0]));
    wait_until_following(&camera);
    launch.signal("KILL");
    launch.finish();
    assert_left_at_rest(&camera);
}

/// Whoever has taken the camera in the meantime is not to be stopped by us.
#[test]
fn an_operator_who_has_the_camera_keeps_it() {
    let Application { camera, mut launch, watchdog } = Application::following("operator", &["-m"]);
    let begin = Instant::now();
    let told = |line: &String, change: &str| line.contains(&format!("change=(string){change}"));
    // Whose move it is in is found out after that; until then it may be ours, which is to be stopped.
    let given_up = |seen: &[String]| {
        let has_ended =
            seen.iter().rev().take_while(|line| !told(line, "moving")).any(|line| told(line, "stopped"));
        has_ended && seen.iter().any(|line| told(line, "taken-over"))
    };
    // He holds the stick, to and fro, so that no end of the travel is in his way.
    let held = |to| [to; 20];
    let mut turns = [held("continuouspantiltmove=-40,0"), held("continuouspantiltmove=40,0")]
        .concat()
        .into_iter()
        .cycle();
    while !given_up(launch.seen()) {
        assert!(begin.elapsed() < PATIENCE, "{:?}", launch.seen());
        assert!(turns.next().is_some_and(|turn| camera.operate(turn)));
        launch.read_for(HELD);
    }
    launch.signal("STOP");
    launch.signal("KILL");
    let orders = camera.status().commands;
    launch.finish();
    watchdog.wait_for("it has nothing to do", <[u32]>::is_empty);
    assert_eq!(camera.status().commands, orders);
}

#[test]
fn without_a_watchdog_one_warning_says_so() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut command = tool("gst-launch-1.0");
    command.env("VAPIX_WATCHDOG", "/nonexistent/vapix-watchdog");
    command.arg("-m").args(scene::follow(&camera).split_whitespace());
    let mut launch = GstLaunch::spawn(command);
    launch.wait_for_line("ptztrack-camera, change=(string)moving");
    launch.signal("INT");
    let (_, output) = launch.finish();
    let warnings: Vec<_> = output.lines().filter(|line| line.starts_with("WARNING")).collect();
    assert_eq!(warnings.len(), 1, "{output}");
    assert!(
        output.contains("no watchdog process: `/nonexistent/vapix-watchdog` cannot be started"),
        "{output}"
    );
}

/// Nobody would stop a camera that turned as this process died; once that is given up they are followed, without being held back
/// for the next one. Neither does the picture wait, and two cameras have no worker more than there are.
#[test]
fn a_watchdog_that_never_starts_is_waited_for_once_and_keeps_no_camera_from_following() {
    let cameras = [(); 2].map(|()| VirtualCamera::start(scene::near_person()).unwrap());
    let program = scratch("sleeper");
    let starts = program.with_extension("starts");
    let script = format!("#!/bin/sh\necho started >> {}\nexec sleep 60\n", starts.display());
    std::fs::write(&program, script).unwrap();
    let started = || std::fs::read_to_string(&starts).unwrap_or_default().lines().count();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    let mut command = tool("gst-launch-1.0");
    command.env("VAPIX_WATCHDOG", &program);
    let pipelines = cameras.each_ref().map(|camera| scene::follow(camera).replace(" name=servo", ""));
    command.arg("-m").args(pipelines.join(" ").split_whitespace());
    let mut launch = GstLaunch::spawn(command);
    for _ in &cameras {
        launch.wait_for_line("has said nothing for 2 s; a camera that rests is not moved before it does");
    }
    cameras.iter().for_each(|camera| assert!(!camera.wait_for(REST, |status| status.moving), "too early"));
    for _ in &cameras {
        launch.wait_for_line("cannot be started: it says nothing for 10 s");
    }
    cameras.iter().for_each(wait_until_following);
    let begin = Instant::now();
    while started() < 2 {
        assert!(begin.elapsed() < PATIENCE, "it is not tried again");
        std::thread::sleep(HELD);
    }
    // They are followed, not only set going once.
    for camera in &cameras {
        let before = camera.status().commands;
        assert!(camera.wait_for(PATIENCE, |status| status.commands > before + 10), "not steered");
    }
    launch.signal("INT");
    let (_, output) = launch.finish();
    cameras.iter().for_each(assert_left_at_rest);
    assert_eq!(output.matches("no watchdog process").count(), 2 * cameras.len(), "{output}");
    [program, starts].iter().for_each(|file| std::fs::remove_file(file).unwrap());
}

/// Not by who only looks, nor before there is something to stop.
#[test]
fn none_is_started_before_the_first_move() {
    let watchdog = Watchdog::new("first");
    let mut inspect = watchdog.of(tool("gst-inspect-1.0"));
    assert!(inspect.arg("vapixptzsink").output().unwrap().status.success());
    let camera = VirtualCamera::start(scene::nobody()).unwrap();
    let mut launch = launch(&watchdog, &["-m"], &scene::follow(&camera));
    launch.wait_for_line("ptztrack-camera, change=(string)connected");
    assert!(watchdog.processes().is_empty());
    launch.signal("KILL");
    launch.finish();
}

/// It is there before the move that it is for.
#[test]
fn a_camera_that_moves_has_its_watchdog() {
    let Application { camera, launch, watchdog } = Application::following("there", &[]);
    assert_eq!(watchdog.processes().len(), 1);
    launch.signal("INT");
    launch.finish();
    assert_left_at_rest(&camera);
    watchdog.wait_for("it has nothing more to do", <[u32]>::is_empty);
}
