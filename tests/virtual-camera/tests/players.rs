// SPDX-License-Identifier: MPL-2.0

//! Independent clients: FFmpeg plays the streams, three libraries from PyPI and one from npm steer the camera.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::{ffi::OsStr, fs, path::Path, process::Command};

use common::{PATIENCE, settings};
use virtual_camera::{Auth, OnvifSettings, Settings, VirtualCamera};

/// A program that `make test` installs.
#[track_caller]
fn needs(program: &str, argument: &str) {
    let found = Command::new(program).arg(argument).output().is_ok_and(|output| output.status.success());
    assert!(found, "{program} is not installed: `make test` installs it");
}

/// A program that is ended where it hangs.
fn limited(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new("timeout");
    command.arg(PATIENCE.as_secs().to_string()).arg(program);
    command
}

/// Runs it, and gives what it said: as an error where it failed.
fn try_run(command: &mut Command) -> Result<String, String> {
    let output = command.output().unwrap();
    let text = [output.stdout.as_slice(), output.stderr.as_slice()].map(String::from_utf8_lossy).concat();
    if output.status.success() { Ok(text) } else { Err(format!("{command:?}: {}\n{text}", output.status)) }
}

#[track_caller]
fn run(command: &mut Command) -> String {
    try_run(command).unwrap_or_else(|error| panic!("{error}"))
}

/// Installs what comes from a registry. What is there already is not fetched again.
#[track_caller]
fn install(what: &str, registry: &str, command: &mut Command) {
    try_run(command).unwrap_or_else(|error| {
        panic!(
            "{what} could not be installed from {registry}, without which this test tells nothing:\n{error}"
        )
    });
}

#[test]
fn ffmpeg_plays_mjpeg_and_rtsp() {
    needs("ffprobe", "-version");
    let camera = VirtualCamera::start(Settings { auth: Auth::Both, ..settings() }).unwrap();
    let http = camera.url().replace("http://", "http://root:pass@");
    let rtsp = camera.rtsp_url().replace("rtsp://", "rtsp://root:pass@");
    for (url, codec) in [
        (format!("{http}/axis-cgi/mjpg/video.cgi?resolution=320x240"), "mjpeg"),
        (format!("{rtsp}/axis-media/media.amp?videocodec=mpeg4&resolution=320x240"), "mpeg4"),
        (format!("{rtsp}/axis-media/media.amp?videocodec=h264&resolution=320x240"), "h264"),
        (format!("{rtsp}/axis-media/media.amp?videocodec=jpeg&resolution=320x240"), "mjpeg"),
    ] {
        let transport: &[&str] =
            if url.starts_with("rtsp") { &["-rtsp_transport", "tcp"] } else { &["-f", "mpjpeg"] };
        let text = run(limited("ffprobe")
            .args(["-v", "error"])
            .args(transport)
            .args(["-read_intervals", "%+#5", "-count_frames", "-show_entries"])
            .args(["stream=codec_name,width,height,nb_read_frames", "-of", "csv=p=0", &url]));
        let line =
            text.lines().find(|line| line.starts_with(codec)).unwrap_or_else(|| panic!("{url}: {text}"));
        let words: Vec<&str> = line.split(',').collect();
        assert_eq!(words[1..3], ["320", "240"], "{url}: {text}");
        assert!(words[3].parse::<u32>().unwrap() >= 3, "{url}: {text}");
    }
}

#[test]
fn libraries_from_pypi_read_and_steer() {
    needs("python3", "--version");
    let clients = Path::new(env!("CARGO_MANIFEST_DIR")).join("clients");
    let environment = Path::new(env!("CARGO_TARGET_TMPDIR")).join("vapix-clients");
    let created = Command::new("python3").args(["-m", "venv"]).arg(&environment).output().unwrap();
    assert!(created.status.success(), "python3-venv is not installed: `make test` installs it: {created:?}");
    let python = environment.join("bin/python");
    install(
        "axis, sensecam-control and onvif-zeep",
        "PyPI",
        limited(&python)
            .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"])
            .args(["--retries", "6", "--timeout", "15", "--requirement"])
            .arg(clients.join("requirements.txt")),
    );
    for client in ["steer_with_axis.py", "steer_with_sensecam.py", "steer_with_onvif_zeep.py"] {
        let onvif = Some(OnvifSettings::default());
        let camera =
            VirtualCamera::start(Settings { auth: Auth::Digest { qop: true }, onvif, ..settings() }).unwrap();
        let address = camera.http_address().to_string();
        let text = run(limited(&python)
            .arg(clients.join(client))
            .args([&address, "root", "pass"])
            .current_dir(env!("CARGO_TARGET_TMPDIR")));
        assert!(text.contains("steered"), "{client}: {text}");
        assert!(camera.wait_for(PATIENCE, |status| !status.moving), "{client} left the camera moving");
        assert_eq!(camera.status().pan_deg, 0.0, "it rests where it was sent, not where it cannot go on");
        let statuses: Vec<u16> = camera.commands().iter().map(|command| command.status).collect();
        assert!(
            statuses.iter().filter(|&&status| matches!(status, 200 | 204)).count() >= 3,
            "{client}: {statuses:?}"
        );
    }
}

#[test]
fn a_library_from_npm_finds_and_steers() {
    needs("node", "--version");
    let clients = Path::new(env!("CARGO_MANIFEST_DIR")).join("clients");
    let modules = Path::new(env!("CARGO_TARGET_TMPDIR")).join("onvif-client");
    fs::create_dir_all(&modules).unwrap();
    fs::copy(clients.join("steer_with_onvif.js"), modules.join("steer_with_onvif.js")).unwrap();
    let script = clients.join("install_npm_modules.py");
    install("onvif", "registry.npmjs.org", limited("python3").arg(script).arg(&modules));
    let onvif = Some(OnvifSettings { discoverable: true, ..OnvifSettings::default() });
    let camera =
        VirtualCamera::start(Settings { auth: Auth::Digest { qop: true }, onvif, ..settings() }).unwrap();
    let address = camera.http_address().to_string();
    let text =
        run(limited("node").args(["steer_with_onvif.js", &address, "root", "pass"]).current_dir(&modules));
    assert!(text.contains("steered"), "{text}");
    assert!(camera.wait_for(PATIENCE, |status| !status.moving), "it left the camera moving");
}
