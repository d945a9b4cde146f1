// SPDX-License-Identifier: MPL-2.0

//! Takes a camera away from `ptztrack` and gives it back, changed or not, and prints a table in Markdown of how soon it follows again,
//! without a restart:
//!
//! ```sh
//! cargo build --workspace --lib --bins && sudo -E cargo run --example returning
//! ```
//! An address that changes behind its name takes root, as the names that the system knows are changed for that program.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::net::Ipv4Addr;
use std::path::PathBuf;
use std::process::Command;
use std::thread;
use std::time::Duration;

use end_to_end::following::{MJPEG, Network, RTSP, Video};
use end_to_end::{Front, GstLaunch, PATIENCE, Way, plugin_folder, scene, scratch, tool};
use virtual_camera::{Fault, ReceivedCommand, VirtualCamera};

/// For so long a camera that reboots is not there.
const REBOOT: Duration = Duration::from_secs(30);
/// The camera's name.
const NAME: &str = "camera.test";

/// How often each is tried: what falls between two attempts to connect falls differently each time.
const RUNS: usize = 3;

/// What changes.
#[derive(Clone, Copy)]
enum Change {
    Reboot,
    Size,
    Profile,
}

fn main() {
    println!("| what happens | by | picture | follows |\n|---|---|---|---|");
    for (what, change) in [("reboot", Change::Reboot), ("another size", Change::Size)] {
        print(what, "MJPEG", || change.measure("mjpeg", MJPEG));
        print(what, "H.264", || change.measure("h264", RTSP));
    }
    print("another profile", "H.264", || Change::Profile.measure("h264", RTSP));
    if Command::new("unshare").args(["--mount", "true"]).status().is_ok_and(|status| status.success()) {
        print("another address behind its name", "MJPEG", another_address);
    } else {
        println!("| another address behind its name | MJPEG | | not run: it takes root |");
    }
}

/// When each was back, after the camera could be reached.
#[derive(Clone, Copy)]
struct Back {
    picture: Duration,
    follows: Duration,
}

fn print(what: &str, by: &str, measure: impl Fn() -> Back + Sync) {
    let runs: Vec<Back> = thread::scope(|scope| {
        let runs: Vec<_> = (0..RUNS).map(|_| scope.spawn(&measure)).collect();
        runs.into_iter().map(|run| run.join().unwrap()).collect()
    });
    let worst = |of: fn(&Back) -> Duration| runs.iter().map(of).max().unwrap().as_secs_f64();
    println!("| {what} | {by} | {:.1} s | {:.1} s |", worst(|back| back.picture), worst(|back| back.follows));
}

/// A camera of this video, and who is before it.
fn camera(change: impl FnOnce(&mut virtual_camera::Video)) -> VirtualCamera {
    let mut settings = scene::near_person();
    change(&mut settings.video);
    VirtualCamera::start(settings).unwrap()
}

/// `ptztrack`, that follows with the camera at these addresses.
fn follow(codec: &str, url: &str, rtsp: &str) -> Command {
    let mut command = tool(plugin_folder().join("ptztrack").to_str().unwrap());
    command.args(["follow", url, "--user", scene::USER, "--codec", codec, "--rtsp", rtsp]);
    command.env("CAMERA_PASSWORD", scene::PASSWORD);
    command
}

impl Change {
    fn measure(self, codec: &str, video: Video) -> Back {
        let before = camera(|_| ());
        let network = Network::before(&before);
        let rtsp = format!("rtsp://{}", network.rtsp.address());
        let _launch = GstLaunch::spawn(follow(codec, &network.url(), &rtsp));
        scene::wait_until_following(&before);
        let after = match self {
            Self::Reboot => None,
            Self::Size => Some(camera(|video| video.size = Some((480, 360)))),
            Self::Profile => Some(camera(|video| video.h264_profile = "main")),
        };
        let asked = video(&network).video_requests();
        match &after {
            None => {
                before.set_fault(Fault::Reboot);
                network.set(Way::Refused);
                // Power is off: it stops, and looks home when it is on again.
                before.operate("move=stop");
                before.operate("move=home");
                thread::sleep(REBOOT);
                before.set_fault(Fault::None);
                network.set(Way::Open);
            }
            Some(after) => network.lead_to(after),
        }
        back(after.as_ref().unwrap_or(&before), video(&network), asked)
    }
}

/// When both are back of a camera that can be reached from now on, after so many requests for video.
fn back(camera: &VirtualCamera, video: &Front, asked: u64) -> Back {
    let (begin, before) = (camera.now(), camera.status().commands);
    video.wait_for_picture(asked);
    let picture = camera.now();
    let moves = |command: &ReceivedCommand| {
        let is_move = command.query.contains("continuouspantiltmove=") && !command.query.contains("move=0,0");
        is_move && command.status == 204 && command.time >= picture
    };
    let mut seen = before;
    loop {
        if let Some(command) = camera.commands_after(before).iter().find(|command| moves(command)) {
            return Back { picture: picture - begin, follows: command.time.saturating_sub(begin) };
        }
        assert!(camera.wait_for(PATIENCE, |status| status.commands > seen), "it is not followed any more");
        seen = camera.status().commands;
    }
}

fn another_address() -> Back {
    let camera = camera(|_| ());
    let before = Front::new(camera.http_address());
    let port = before.address().port();
    let hosts = Hosts::new(port);
    hosts.set(Ipv4Addr::LOCALHOST);
    let url = format!("http://{NAME}:{port}");
    let _launch = GstLaunch::spawn(hosts.known_to(&follow("mjpeg", &url, &camera.rtsp_url())));
    scene::wait_until_following(&camera);
    before.set(Way::Refused);
    hosts.set(OTHER);
    let after = Front::at((OTHER, port), camera.http_address());
    back(&camera, &after, 0)
}

/// Another address of this machine.
const OTHER: Ipv4Addr = Ipv4Addr::new(127, 0, 0, 2);

/// What one program has in the place of `/etc/hosts`.
struct Hosts(PathBuf);

impl Hosts {
    fn new(port: u16) -> Self {
        Self(scratch(&format!("hosts-{port}")))
    }

    fn set(&self, address: Ipv4Addr) {
        fs::write(&self.0, format!("127.0.0.1 localhost\n{address} {NAME}\n")).unwrap();
    }

    fn known_to(&self, program: &Command) -> Command {
        let mut command = Command::new("unshare");
        command.args(["--mount", "sh", "-c", "mount --bind \"$0\" /etc/hosts && exec \"$@\""]).arg(&self.0);
        command.arg(program.get_program()).args(program.get_args());
        command.envs(program.get_envs().filter_map(|(name, value)| Some((name, value?))));
        command
    }
}

impl Drop for Hosts {
    fn drop(&mut self) {
        // Nothing depends on it any more.
        let _ = fs::remove_file(&self.0);
    }
}
