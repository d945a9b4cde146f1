// SPDX-License-Identifier: MPL-2.0

//! The command as it is called: what it refuses before anything is written, and that it gives the same everywhere.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("ptztrack-evaluate-{name}-{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    folder
}

/// Runs it where GStreamer finds no elements but ours.
fn evaluate(line: &str, out: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_evaluate"));
    command.args(line.split_whitespace()).arg("--out").arg(out).arg("--results").arg(out.join("results"));
    command.env("GST_PLUGIN_SYSTEM_PATH_1_0", "").env("GST_PLUGIN_PATH_1_0", "");
    command.env("GST_REGISTRY_FORK", "no").env("GST_REGISTRY_1_0", folder("registry"));
    command.output().unwrap()
}

#[test]
fn nothing_to_run_writes_nothing() {
    let out = folder("nothing");
    let output = evaluate("--test 1 --tracker csrt,kcf", &out);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success());
    assert!(said.starts_with("evaluate: nothing to run: csrt is skipped"), "{said}");
    assert!(said.contains("kcf is skipped"), "{said}");
    assert!(!out.exists());
}

#[test]
fn a_place_where_nothing_can_be_written_is_told_of_first() {
    let file = folder("refused");
    fs::write(&file, "a file").unwrap();
    for line in ["--test 1", "--gallery"] {
        let output = evaluate(line, &file);
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success());
        assert!(said.starts_with(&format!("evaluate: cannot write {}", file.display())), "{line}: {said}");
        assert!(!said.contains("[1/1]"), "it ran before that: {said}");
    }
    assert_eq!(fs::read_to_string(&file).unwrap(), "a file");
    fs::remove_file(&file).unwrap();
}

#[test]
fn a_lesser_processor_gives_the_same_figures() {
    let run = |name: &str, without: &str| {
        let out = folder(name);
        let mut command = Command::new(env!("CARGO_BIN_EXE_evaluate"));
        command
            .args(["--test", "37", "--size", "160x120", "--seed", "4", "--out"])
            .arg(&out)
            .arg("--results")
            .arg(out.join("results"));
        let output = command.env("OPENCV_CPU_DISABLE", without).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        let figures = fs::read_to_string(out.join("results.csv")).unwrap();
        let frames =
            out.join("frames/room/seed4-mjpeg-160x120-detected-video100ms-command60ms/test-37-ptztrack.csv");
        let frames = fs::read_to_string(frames).unwrap();
        fs::remove_dir_all(&out).unwrap();
        (figures, frames)
    };
    // What OpenCV would choose by on most processors.
    let lesser = run("lesser", "AVX2,FMA3,AVX,SSE4.2,SSE4.1");
    assert!(lesser.1.lines().count() > 100, "{}", lesser.0);
    assert!(run("full", "") == lesser);
}
