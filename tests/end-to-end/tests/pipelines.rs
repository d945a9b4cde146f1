// SPDX-License-Identifier: MPL-2.0

//! Every file in `pipelines/` as a user runs it, against the virtual camera.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::{Path, PathBuf};
use std::process::Command;

use end_to_end::following::{pipeline, python, rust, script};
use end_to_end::{GstLaunch, PATIENCE, pictures_in, plugin_folder, scene, scratch, tool};
use virtual_camera::{OnvifSettings, Settings, VirtualCamera};

/// A command that finds the camera by the pipelines' environment variables.
fn against(camera: &VirtualCamera, mut command: Command) -> Command {
    command
        .env("CAMERA", camera.url())
        .env("RTSP", camera.rtsp_url())
        .env("CAMERA_USER", scene::USER)
        .env("CAMERA_PASSWORD", scene::PASSWORD)
        .env("SIZE", "320x240");
    command
}

/// Runs it until the camera follows somebody, then presses Ctrl-C: it ends well and the camera stands still.
#[track_caller]
fn follows_until_interrupted(camera: &VirtualCamera, command: Command) -> String {
    let launch = GstLaunch::spawn(command);
    let moved = camera.wait_for(PATIENCE, |status| status.moving);
    launch.signal("INT");
    let (status, output) = launch.finish();
    assert!(moved, "the camera never moved:\n{output}");
    assert!(status.success(), "{output}");
    assert!(camera.wait_for(PATIENCE, |status| !status.moving), "left moving:\n{output}");
    output
}

#[track_caller]
fn follows(file: &str) {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let output = follows_until_interrupted(&camera, against(&camera, script(file)));
    assert!(output.contains("ptztrack-target, change=(string)acquired"), "{output}");
}

#[test]
fn mjpeg() {
    follows("mjpeg.sh");
}

#[test]
fn mpeg4_over_rtsp() {
    follows("mpeg4-rtsp.sh");
}

#[test]
fn h264_over_rtsp() {
    follows("h264-rtsp.sh");
}

#[test]
fn onvif_over_rtsp() {
    let onvif = Some(OnvifSettings::default());
    let camera = VirtualCamera::start(Settings { onvif, ..scene::walking_person() }).unwrap();
    let stream = format!("{}/axis-media/media.amp?videocodec=h264", camera.rtsp_url());
    let mut command = against(&camera, script("onvif-rtsp.sh"));
    command.env("STREAM", stream);
    let output = follows_until_interrupted(&camera, command);
    assert!(output.contains("ptztrack-target, change=(string)acquired"), "{output}");
    assert!(camera.commands().iter().any(|command| command.query.contains("ContinuousMove")));
}

#[test]
fn headless() {
    follows("headless.sh");
}

/// Others on the same machine can read the arguments of every process.
#[test]
fn no_argument_has_the_password() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let launch = GstLaunch::spawn(against(&camera, script("headless.sh")));
    let moved = camera.wait_for(PATIENCE, |status| status.moving);
    let arguments = std::fs::read(format!("/proc/{}/cmdline", launch.id())).unwrap();
    launch.signal("INT");
    let (_, output) = launch.finish();
    assert!(moved, "the camera never moved:\n{output}");
    let arguments = String::from_utf8_lossy(&arguments);
    assert!(arguments.contains(scene::USER) && !arguments.contains(scene::PASSWORD), "{arguments}");
}

#[test]
fn a_camera_may_have_an_address_of_ipv6() {
    let folder = scratch("ipv6");
    std::fs::create_dir_all(&folder).unwrap();
    std::os::unix::fs::symlink("/bin/echo", folder.join("ptztrack-launch")).unwrap();
    let path = format!("{}:{}", folder.display(), std::env::var("PATH").unwrap());
    let mut command = script("h264-rtsp.sh");
    let output = command.env("PATH", path).env("CAMERA", "http://[2001:db8::1]:8080/").output().unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    let arguments = String::from_utf8_lossy(&output.stdout);
    assert!(arguments.contains("location=rtsp://[2001:db8::1]:554/axis-media/"), "{output:?}");
    assert!(arguments.contains("vapixptzsink location=http://[2001:db8::1]:8080"), "{output:?}");
}

#[test]
fn recording_is_complete_and_playable() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let recording = scratch("recording.mkv");
    let mut command = against(&camera, script("record-overlay.sh"));
    command.env("OUT", &recording);
    follows_until_interrupted(&camera, command);
    let probe = pictures_in(&recording);
    std::fs::remove_file(&recording).unwrap();
    assert!(probe.as_ref().is_ok_and(|frames| *frames > 5), "{probe:?}");
}

#[test]
fn detection_alone_tells_of_motion_and_moves_nothing() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut launch = GstLaunch::spawn(against(&camera, script("detect-only.sh")));
    launch.wait_for_line("ptztrack-motion, change=(string)start");
    launch.signal("INT");
    let (status, output) = launch.finish();
    assert!(status.success(), "{output}");
    assert!(camera.commands().is_empty());
}

#[test]
fn without_a_camera_each_says_how_it_is_used() {
    for file in scripts() {
        let output = Command::new(&file).env_remove("CAMERA").output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{file:?}: {said}");
        assert!(said.contains("CAMERA is not set") && said.contains("CAMERA_PASSWORD"), "{file:?}: {said}");
    }
}

/// It would never be reached.
#[test]
fn an_address_without_a_scheme_ends_each_at_once() {
    for file in scripts() {
        let output = Command::new(&file).env("CAMERA", "127.0.0.1:1").output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{file:?}: {said}");
        assert!(said.starts_with("CAMERA needs http:// or https://"), "{file:?}: {said}");
    }
}

#[test]
fn no_file_is_left_out_here() {
    let this = include_str!("pipelines.rs");
    for file in scripts() {
        let name = file.file_name().unwrap().to_str().unwrap();
        assert!(this.contains(&format!("\"{name}\"")), "{name} has no test");
    }
}

fn scripts() -> Vec<PathBuf> {
    let files = std::fs::read_dir(pipeline("")).unwrap().map(|entry| entry.unwrap().path());
    files
        .filter(|file| {
            file.extension().is_some_and(|extension| extension == "sh") && !file.ends_with("common.sh")
        })
        .collect()
}

#[test]
fn embedded_in_python() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let output = follows_until_interrupted(&camera, against(&camera, python(&camera.url())));
    assert!(output.contains("target 1 acquired"), "{output}");
}

#[test]
fn embedded_in_rust() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let output = follows_until_interrupted(&camera, against(&camera, rust(&camera.url())));
    assert!(output.contains("target 1 acquired"), "{output}");
}

/// A striped box that walks through a picture which otherwise stands still, five seconds to and five seconds fro.
fn footage(folder: &Path) -> PathBuf {
    let file = folder.join("walker.mkv");
    let walker = "[1]crop=40:110:20:20[walker];[0]trim=end_frame=1,loop=-1:1,setpts=N/10/TB[still];\
                  [still][walker]overlay=x='60+120*abs(mod(t\\,10)-5)':y=260:shortest=1";
    let status = Command::new("ffmpeg")
        .args(["-v", "error", "-y", "-f", "lavfi", "-i", "mandelbrot=size=768x576:rate=10:start_scale=0.3"])
        .args(["-f", "lavfi", "-i", "testsrc2=size=200x200:rate=10:duration=20", "-filter_complex", walker])
        .args(["-r", "10", "-c:v", "mjpeg", "-q:v", "3"])
        .arg(&file)
        .status()
        .unwrap();
    assert!(status.success());
    file
}

#[test]
fn the_demonstration_leaves_video_plot_and_summary() {
    let camera = plugin_folder().join("virtual-camera");
    assert!(camera.exists(), "the virtual camera is not built: run `cargo build` first");
    let out = scratch("demo");
    std::fs::create_dir_all(&out).unwrap();
    let mut command = tool("python3");
    command
        .arg(pipeline("demo/demo.py"))
        .args(["--codec", "mjpeg", "--duration", "8", "--footage"])
        .arg(footage(&out))
        .arg("--camera")
        .arg(camera)
        .arg("--out")
        .arg(&out);
    let (status, output) = GstLaunch::spawn(command).finish();
    assert!(status.success(), "{output}");
    assert!(output.contains("target acquired: #1") && output.contains("at rest"), "{output}");
    assert!(output.lines().filter(|line| line.ends_with(" fps")).count() >= 5, "a line a second:\n{output}");
    for file in ["followed.mkv", "plot.png", "samples.csv", "summary.json", "summary.txt"] {
        assert!(out.join(file).metadata().unwrap().len() > 100, "{file} is empty");
    }
    std::fs::remove_dir_all(&out).unwrap();
}
