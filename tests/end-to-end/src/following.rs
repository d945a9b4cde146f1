// SPDX-License-Identifier: MPL-2.0

//! Whoever follows with a camera behind a network that fails.

use std::net::Ipv4Addr;
use std::path::{Path, PathBuf};
use std::process::Command;

use virtual_camera::VirtualCamera;

use crate::{Front, GstLaunch, PATIENCE, Way, plugin_folder, scene, tool};

/// The ways to one camera.
pub struct Network {
    /// PTZ, and MJPEG.
    pub http: Front,
    /// Video by RTSP.
    pub rtsp: Front,
}

impl Network {
    /// Both are open.
    pub fn before(camera: &VirtualCamera) -> Self {
        Self::at(Ipv4Addr::LOCALHOST, camera)
    }

    /// The same, that begin at this address.
    pub fn at(address: Ipv4Addr, camera: &VirtualCamera) -> Self {
        let front = |camera| Front::at((address, 0), camera);
        Self { http: front(camera.http_address()), rtsp: front(camera.rtsp_address()) }
    }

    /// Both lead to another camera from now on.
    pub fn lead_to(&self, camera: &VirtualCamera) {
        self.http.lead_to(camera.http_address());
        self.rtsp.lead_to(camera.rtsp_address());
    }

    /// Where the camera is for who has to pass here.
    pub fn url(&self) -> String {
        format!("http://{}", self.http.address())
    }

    /// Both are like this.
    pub fn set(&self, way: Way) {
        self.http.set(way);
        self.rtsp.set(way);
    }

    /// All connections are reset.
    pub fn reset(&self) {
        self.http.reset();
        self.rtsp.reset();
    }

    /// All connections are closed.
    pub fn close(&self) {
        self.http.close();
        self.rtsp.close();
    }

    /// What a follower is told of its camera.
    pub fn surround(&self, command: &mut Command) {
        command
            .env("CAMERA", self.url())
            .env("RTSP", format!("rtsp://{}", self.rtsp.address()))
            .env("CAMERA_USER", scene::USER)
            .env("CAMERA_PASSWORD", scene::PASSWORD)
            .env("SIZE", "320x240");
    }
}

/// A camera behind a network that fails, and whoever follows with it.
pub struct Following {
    /// What it follows with.
    pub camera: VirtualCamera,
    /// Between them.
    pub network: Network,
    /// What follows.
    pub launch: GstLaunch,
}

/// The way that the picture takes; PTZ goes by HTTP.
pub type Video = fn(&Network) -> &Front;
/// By HTTP.
pub const MJPEG: Video = |network| &network.http;
/// By RTSP.
pub const RTSP: Video = |network| &network.rtsp;

impl Following {
    /// Once `command`, which is given the camera's address, follows.
    #[track_caller]
    pub fn start(command: impl FnOnce(&str) -> Command) -> Self {
        let camera = VirtualCamera::start(scene::walking_person()).unwrap();
        let network = Network::before(&camera);
        let mut command = command(&network.url());
        network.surround(&mut command);
        let mut following = Self { launch: GstLaunch::spawn(command), camera, network };
        following.follows();
        following
    }

    /// Control is there, and so is the picture, without which nothing is moved.
    #[track_caller]
    pub fn follows(&mut self) {
        let before = self.camera.status().commands;
        let wanted = |status: &virtual_camera::Status| status.viewers > 0 && status.moving;
        let back = self.camera.wait_for(PATIENCE, wanted)
            && self.camera.wait_for(PATIENCE, |status| status.commands > before);
        assert!(back, "{}", self.launch.said());
    }

    /// The camera sends no picture to anybody.
    #[track_caller]
    pub fn is_lost(&self) {
        assert!(self.camera.wait_for(PATIENCE, |status| status.viewers == 0), "the picture stayed");
    }

    /// After this, another gets video and follows. How many watch tells nothing of that: the next may be there before the
    /// camera misses the last.
    #[track_caller]
    pub fn starts_anew(&mut self, video: Video, fault: impl FnOnce(&Self)) {
        let front = video(&self.network);
        let before = front.video_requests();
        fault(self);
        front.wait_for_picture(before);
        self.follows();
    }
}

/// A file in `pipelines/`.
pub fn pipeline(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../pipelines").join(file)
}

/// A script in `pipelines/`, with what is built here.
pub fn script(file: &str) -> Command {
    let mut command = tool(pipeline(file).to_str().unwrap());
    let path = std::env::var("PATH").unwrap();
    command.env("PATH", format!("{}:{path}", plugin_folder().display()));
    command
}

/// `pipelines/embed/follow.py`, for the camera at this address.
pub fn python(camera: &str) -> Command {
    // Debian's GStreamer bindings belong to Debian's Python, which another one may hide in PATH.
    let mut command = tool("/usr/bin/python3");
    command.arg(pipeline("embed/follow.py")).args([camera, scene::USER]);
    command
}

/// The example `follow`, for the camera at this address.
pub fn rust(camera: &str) -> Command {
    let mut command = tool(plugin_folder().join("examples/follow").to_str().unwrap());
    command.args([camera, scene::USER]);
    command
}
