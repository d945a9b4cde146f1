//! Video and PTZ are lost together, and both come back when the camera does.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use end_to_end::{Front, GstLaunch, PATIENCE, Way, plugin_folder, scene, tool};
use virtual_camera::VirtualCamera;

/// A camera behind a network that fails, and whoever follows with it.
struct Following {
    camera: VirtualCamera,
    http: Front,
    launch: GstLaunch,
}

impl Following {
    fn start(command: impl FnOnce(&str) -> Command) -> Self {
        let camera = VirtualCamera::start(scene::walking_person()).unwrap();
        let http = Front::new(camera.http_address());
        let url = format!("http://{}", http.address());
        let mut command = command(&url);
        command
            .env("CAMERA", url)
            .env("CAMERA_USER", scene::USER)
            .env("CAMERA_PASSWORD", scene::PASSWORD)
            .env("SIZE", "320x240");
        let mut following = Self { launch: GstLaunch::spawn(command), camera, http };
        following.follows();
        following
    }

    /// Control is there, and so is the picture, without which nothing is moved.
    #[track_caller]
    fn follows(&mut self) {
        let before = self.camera.status().commands;
        let wanted = |status: &virtual_camera::Status| status.viewers > 0 && status.moving;
        let back = self.camera.wait_for(PATIENCE, wanted)
            && self.camera.wait_for(PATIENCE, |status| status.commands > before);
        assert!(back, "{}", self.said());
    }

    #[track_caller]
    fn is_lost(&mut self) {
        assert!(self.camera.wait_for(PATIENCE, |status| status.viewers == 0), "{}", self.said());
    }

    fn said(&mut self) -> String {
        self.launch.read_for(Duration::ZERO);
        self.launch.seen().join("\n")
    }

    /// Everything that can become of a camera, one after the other.
    fn comes_back_from_everything(mut self, end: &str) {
        self.http.set(Way::Refused);
        self.is_lost();
        self.http.set(Way::Open);
        self.follows();

        // How many watch tells nothing of these: the next may be there before the camera misses the last.
        for fault in [Front::reset, Front::close] {
            let before = self.http.video_requests();
            fault(&self.http);
            self.http.wait_for_video_request(before);
            self.follows();
        }

        // It gives up by itself: nobody closes.
        let before = self.http.video_requests();
        self.http.set(Way::Stalled);
        self.http.wait_for_video_request(before);
        self.http.set(Way::Open);
        self.follows();

        self.launch.signal(end);
        let (_, output) = self.launch.finish();
        assert!(self.camera.wait_for(PATIENCE, |status| !status.moving), "left moving:\n{output}");
    }
}

fn script(file: &str) -> Command {
    tool(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../pipelines").join(file).to_str().unwrap())
}

#[test]
fn mjpeg_over_http() {
    Following::start(|_| script("headless.sh")).comes_back_from_everything("TERM");
}

#[test]
fn embedded_in_python() {
    Following::start(|camera| {
        // Debian's GStreamer bindings belong to Debian's Python, which another one may hide in PATH.
        let mut command = tool("/usr/bin/python3");
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../pipelines/embed/follow.py");
        command.arg(file).args([camera, scene::USER]);
        command
    })
    .comes_back_from_everything("TERM");
}

#[test]
fn embedded_in_rust() {
    Following::start(|camera| {
        let mut command = tool(plugin_folder().join("examples/follow").to_str().unwrap());
        command.args([camera, scene::USER]);
        command
    })
    .comes_back_from_everything("HUP");
}

/// A camera that refuses a password may lock the account, and does not change its mind.
#[test]
fn a_wrong_password_is_not_tried_for_ever() {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut command = script("headless.sh");
    command.env("CAMERA", camera.url()).env("CAMERA_USER", scene::USER).env("CAMERA_PASSWORD", "falsch");
    let (status, output) = GstLaunch::spawn(command).finish();
    assert!(!status.success() && output.contains("Not started anew"), "{output}");
}

/// Each part of a recording stays.
#[test]
fn a_recording_goes_on_in_another_file() {
    let folder = plugin_folder().join(format!("recordings-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let out = folder.join("a.mkv");
    let mut following = Following::start(|_| {
        let mut command = script("record-overlay.sh");
        command.env("OUT", &out);
        command
    });
    let before = following.http.video_requests();
    following.http.reset();
    following.http.wait_for_video_request(before);
    following.follows();
    following.launch.signal("TERM");
    following.launch.finish();
    for file in ["a.mkv", "a-2.mkv"] {
        assert!(folder.join(file).metadata().unwrap().len() > 1000, "{file}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}
