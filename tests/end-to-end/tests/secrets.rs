// SPDX-License-Identifier: MPL-2.0

//! The password stays where it was put: not in a log at any level, not in a graph of the pipeline.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;

use end_to_end::{PATIENCE, Program, Running, scene, tool};
use gst::prelude::*;
use virtual_camera::VirtualCamera;

#[test]
fn not_in_a_log_of_everything() {
    let camera = VirtualCamera::start(scene::nobody()).unwrap();
    let log = std::env::temp_dir().join(format!("ptztrack-secrets-{}.log", std::process::id()));
    let status = tool(env!("CARGO_BIN_EXE_application"))
        .args(["follow", &camera.url(), scene::USER])
        .env("CAMERA_PASSWORD", scene::PASSWORD)
        .env("GST_DEBUG", "*:9")
        .env("GST_DEBUG_FILE", &log)
        .env("GST_DEBUG_NO_COLOR", "1")
        .status()
        .unwrap();
    let text = fs::read(&log).unwrap();
    fs::remove_file(&log).unwrap();
    assert!(status.success());
    assert!(camera.status().requests > 0, "the camera must have been asked to prove anything");
    let text = String::from_utf8_lossy(&text);
    assert!(text.contains("vapixptzsink"), "the log must be of our elements to prove anything");
    assert_eq!(text.lines().find(|line| line.contains(scene::PASSWORD)), None);
}

#[test]
fn not_in_a_graph_of_the_pipeline() {
    let camera = VirtualCamera::start(scene::nobody()).unwrap();
    let running = Running::start(&format!("videotestsrc is-live=true ! {}", scene::servo(&camera)));
    assert!(camera.wait_for(PATIENCE, |status| status.requests > 0));
    let graph = running.pipeline().debug_to_dot_data(gst::DebugGraphDetails::all());
    assert!(graph.contains(scene::USER), "the graph must show properties to prove anything");
    assert!(!graph.contains(scene::PASSWORD));
}

/// What is left of a process that has crashed may be read by others.
#[test]
fn not_in_a_core_dump_of_the_program() {
    let camera = VirtualCamera::start(scene::nobody()).unwrap();
    let program =
        Program::start("core", |folder| Program::entry("door", &camera.url(), &folder.join("password")), &[]);
    let limits = fs::read_to_string(format!("/proc/{}/limits", program.launch.id())).unwrap();
    let core = limits.lines().find_map(|line| line.strip_prefix("Max core file size")).unwrap();
    // Of 1 byte nothing is kept, and nothing is given to a program that keeps them (core(5)).
    let limits: Vec<_> = core.split_whitespace().take(2).collect();
    assert_eq!(limits, ["1", "1"]);
    program.end("TERM");
}
