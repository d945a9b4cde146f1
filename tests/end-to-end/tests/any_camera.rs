// SPDX-License-Identifier: MPL-2.0

//! The program `ptztrack` with a camera that speaks nothing but ONVIF.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::process::Command;

use end_to_end::{GstLaunch, PATIENCE, Program, plugin_folder, scene, tool};
use virtual_camera::{OnvifSettings, Quirk, Status, VirtualCamera};

fn camera() -> VirtualCamera {
    let onvif = OnvifSettings { alone: true, discoverable: true, ..OnvifSettings::default() };
    VirtualCamera::start(scene::any_make(onvif)).unwrap()
}

fn ptztrack(arguments: &[&str]) -> Command {
    let mut command = tool(plugin_folder().join("ptztrack").to_str().unwrap());
    command.args(arguments).env("CAMERA_PASSWORD", scene::PASSWORD);
    command
}

#[track_caller]
fn wait_for(camera: &VirtualCamera, wanted: impl FnMut(&Status) -> bool) {
    assert!(camera.wait_for(PATIENCE, wanted), "{:?}", camera.status());
}

#[test]
fn it_is_found_with_everything_that_is_asked_of_it() {
    let camera = camera();
    let found = ptztrack(&["discover", "--wait", "1"]).output().unwrap();
    let table = String::from_utf8(found.stdout).unwrap();
    let line = table.lines().find(|line| line.starts_with(&format!("{} ", camera.url())));
    let cells: Vec<_> = line.unwrap_or_else(|| panic!("{table}")).split_whitespace().skip(1).collect();
    assert_eq!(cells, ["virtual", "camera", "ONVIF", "yes"]);
}

#[test]
fn its_address_is_enough() {
    let camera = camera();
    let address = camera.http_address().to_string();
    let mut launch = GstLaunch::spawn(ptztrack(&["follow", &address, "--user", scene::USER]));
    launch.wait_for_line(&format!("http://{address} speaks ONVIF, its stream is H.264 320x240"));
    launch.wait_for_line("acquired");
    wait_for(&camera, |status| status.moving);
    launch.signal("TERM");
    let (status, output) = launch.finish();
    assert!(status.success() && output.contains("has stopped"), "{output}");
    // It is told in both ways: a move of no velocity may be the last one.
    let stops = camera.commands().iter().rev().take(2).any(|command| command.query.starts_with("Stop"));
    assert!(stops, "{:?}", camera.commands().last());
    wait_for(&camera, |status| !status.moving);
}

#[test]
fn who_may_not_or_is_not_there_is_told_what_to_do() {
    let camera = camera();
    let refused = |arguments: &[&str]| {
        let output = ptztrack(arguments).output().unwrap();
        assert!(!output.status.success(), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    let address = camera.http_address().to_string();
    let text = refused(&["follow", &address]);
    assert!(
        text.contains("asks for a user and password, but none are set. Say who you are by --user"),
        "{text}"
    );
    let text = refused(&["follow", &address, "--user", "somebody"]);
    assert!(text.contains("refuses user `somebody`") && text.contains("is not locked"), "{text}");
    let text = refused(&["follow", &address, "--user", scene::USER, "--protocol", "vapix"]);
    assert!(text.contains("is not a usable camera") && text.contains("by VAPIX: "), "{text}");
    let text = refused(&["follow", &address, "--user", scene::USER, "--rate", "10"]);
    assert!(text.contains("with ONVIF the rate is set on the camera's own pages"), "{text}");
    assert_eq!(camera.commands().len(), 0);
}

/// It says yes to `Stop`, turns on, and its moves do not end by themselves. Whether the application ends in order or is killed, no picture
/// tells any more.
#[test]
fn one_that_heeds_neither_stop_nor_timeout_rests_in_the_end() {
    for signal in ["INT", "KILL"] {
        let quirks = [Quirk::StopIgnored, Quirk::TimeoutIgnored];
        let camera = VirtualCamera::start(scene::any_make(OnvifSettings::with(&quirks))).unwrap();
        let launch = GstLaunch::start(&[], &scene::follow_onvif(&camera, ""));
        wait_for(&camera, |status| status.pan_rate_deg_s.abs() > 3.0);
        let ended = camera.now();
        launch.signal(signal);
        assert!(scene::rests(&camera, ended).is_some(), "{signal}: {:?}", camera.commands().last());
    }
}

/// Page, metrics and hand-over are as for cameras by VAPIX.
#[test]
fn in_a_file_it_is_as_any_other() {
    let camera = camera();
    let file = |folder: &std::path::Path| {
        Program::entry("door", &camera.url(), &folder.join("password"))
            + "protocol = \"onvif\"\ncodec = \"h265\"\n[camera.door.onvifptzsink]\nmax-rate = 8\n"
    };
    let mut program = Program::start("onvif", file, &[]);
    program.launch.wait_for_line("acquired");
    wait_for(&camera, |status| status.moving);
    program.wait_for("/metrics", |metrics| {
        let commands =
            metrics.lines().find(|line| line.starts_with("ptztrack_commands_total{camera=\"door\"}"));
        commands.is_some_and(|line| !line.ends_with(" 0"))
    });
    assert_eq!(program.ask("POST", "/cameras/door/hand-over").0, 204);
    program.wait_for("/cameras", |cameras| cameras.contains("handed over"));
    wait_for(&camera, |status| !status.moving);
    assert_eq!(program.ask("POST", "/cameras/door/take-back").0, 204);
    wait_for(&camera, |status| status.moving);
    let output = program.end("TERM");
    assert!(!output.contains("warning"), "{output}");
    wait_for(&camera, |status| !status.moving);
}
