// SPDX-License-Identifier: MPL-2.0

//! Two hundred lives of a pipeline, each with caps that change mid-stream: nothing is left over.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::process::Stdio;

use end_to_end::{scene, tool};
use virtual_camera::VirtualCamera;

#[test]
fn two_hundred_cycles_leak_nothing() {
    let camera = VirtualCamera::start(scene::nobody()).unwrap();
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| cycles_leak_nothing(&camera, "100"));
        }
    });
}

/// In a process of their own.
#[track_caller]
fn cycles_leak_nothing(camera: &VirtualCamera, cycles: &str) {
    let output = tool(env!("CARGO_BIN_EXE_application"))
        .args(["cycle", &camera.url(), scene::USER, cycles])
        .env("CAMERA_PASSWORD", scene::PASSWORD)
        .env("GST_TRACERS", "leaks(name=all-objects,stack-traces-flags=none)")
        .env("GST_DEBUG", "GST_TRACER:7")
        .env("GST_DEBUG_NO_COLOR", "1")
        .env("G_DEBUG", "fatal_criticals")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .output()
        .unwrap();
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{:?}\n{}", output.status, tail(&log));
    assert!(!log.contains("panicked"), "{}", tail(&log));
    // The tracer says `object-alive` for each object that outlived GStreamer.
    let is_report = |line: &&str| line.contains("object-alive, ") && !line.contains("new format string");
    let alive: Vec<_> = log.lines().filter(is_report).collect();
    assert!(log.contains("new format string: object-alive"), "the leak tracer did not run");
    assert_eq!(alive, [] as [&str; 0]);
}

fn tail(log: &str) -> String {
    let lines: Vec<_> = log.lines().collect();
    lines[lines.len().saturating_sub(30)..].join("\n")
}
