//! Independent clients: FFmpeg plays the streams, two VAPIX libraries from PyPI steer the camera.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::{path::Path, process::Command};

use common::settings;
use virtual_camera::{Auth, Settings, VirtualCamera};

/// Whether a program is there; says so where it is not, because the test is then skipped.
fn has(program: &str, argument: &str) -> bool {
    let found = Command::new(program).arg(argument).output().is_ok_and(|output| output.status.success());
    if !found {
        eprintln!("SKIPPED: {program} is not installed (`make test` installs it)");
    }
    found
}

#[track_caller]
fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let text = [output.stdout.as_slice(), output.stderr.as_slice()].map(String::from_utf8_lossy).concat();
    assert!(output.status.success(), "{command:?}\n{text}");
    text
}

#[test]
fn ffmpeg_plays_mjpeg_and_rtsp() {
    if !has("ffprobe", "-version") {
        return;
    }
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
        let text = run(Command::new("ffprobe")
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
fn vapix_libraries_from_pypi_read_and_steer() {
    if !has("python3", "--version") {
        return;
    }
    let clients = Path::new(env!("CARGO_MANIFEST_DIR")).join("clients");
    let environment = Path::new(env!("CARGO_TARGET_TMPDIR")).join("vapix-clients");
    let created = Command::new("python3").args(["-m", "venv"]).arg(&environment).output().unwrap();
    if !created.status.success() {
        eprintln!("SKIPPED: python3 makes no virtual environment (`make test` installs python3-venv)");
        return;
    }
    let python = environment.join("bin/python");
    run(Command::new(&python)
        .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--requirement"])
        .arg(clients.join("requirements.txt")));
    for client in ["steer_with_axis.py", "steer_with_sensecam.py"] {
        let camera =
            VirtualCamera::start(Settings { auth: Auth::Digest { qop: true }, ..settings() }).unwrap();
        let address = camera.http_address().to_string();
        let text = run(Command::new(&python)
            .arg(clients.join(client))
            .args([&address, "root", "pass"])
            .current_dir(env!("CARGO_TARGET_TMPDIR")));
        assert!(text.contains("steered"), "{client}: {text}");
        assert!(!camera.status().moving, "{client} left the camera moving");
        let statuses: Vec<u16> = camera.commands().iter().map(|command| command.status).collect();
        assert!(statuses.iter().filter(|&&status| status == 204).count() >= 3, "{client}: {statuses:?}");
    }
}
