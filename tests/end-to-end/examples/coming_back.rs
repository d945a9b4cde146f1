// SPDX-License-Identifier: MPL-2.0

//! Takes a camera away from whoever follows with it, video and PTZ, and prints a table in Markdown of how soon each is back:
//!
//! ```sh
//! cargo build --workspace --lib --bins --examples && cargo run --example coming_back > docs/coming-back.md
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::process::Command;
use std::thread;
use std::time::Duration;

use end_to_end::following::{Following, MJPEG, RTSP, Video, rust, script};
use end_to_end::{PATIENCE, Way};
use virtual_camera::Fault;

const HEADER: &str = "# How soon video and control are back

Video and PTZ come from one camera and are lost together. Measured by `cargo run --example coming_back`, after
`cargo build --workspace --lib --bins --examples`; the worst of three runs, from the moment when the camera can be reached again until a picture arrives, and until the camera accepts the first
command. If the camera went on turning meanwhile, the target has to be found again after that.

| What follows | What is lost | Video is back after | Control is back after |
|---|---|---|---|";

/// A real camera needs about this long.
const REBOOT: Duration = Duration::from_secs(60);
/// Other faults last as long as this.
const LASTS: Duration = Duration::from_secs(10);

/// What becomes of the camera.
struct Loss {
    name: &'static str,
    /// Until it can be reached again.
    happens: fn(&Following),
    /// Whether video is lost.
    video: bool,
}

const fn loss(name: &'static str, happens: fn(&Following)) -> Loss {
    Loss { name, happens, video: true }
}

const LOSSES: [Loss; 4] = [
    loss("reboot of 60 s: refused, then another realm", reboot),
    loss("connections reset", reset),
    loss("connections closed", close),
    loss("nothing passes for 10 s, connections stay", stall),
];

/// Where video does not come the way that PTZ goes.
const RTSP_LOSSES: [Loss; 3] = [
    loss("RTSP session forgotten", forget),
    loss("video alone, refused for 10 s", no_video),
    Loss { name: "PTZ alone, refused for 10 s", happens: no_ptz, video: false },
];

fn reboot(following: &Following) {
    following.camera.set_fault(Fault::Reboot);
    following.network.set(Way::Refused);
    thread::sleep(REBOOT);
    following.camera.set_fault(Fault::None);
    following.network.set(Way::Open);
}

fn reset(following: &Following) {
    following.network.reset();
}

fn close(following: &Following) {
    following.network.close();
}

fn stall(following: &Following) {
    following.network.set(Way::Stalled);
    thread::sleep(LASTS);
    following.network.set(Way::Open);
}

fn forget(following: &Following) {
    following.camera.forget_rtsp_sessions();
}

fn no_video(following: &Following) {
    following.network.rtsp.set(Way::Refused);
    thread::sleep(LASTS);
    following.network.rtsp.set(Way::Open);
}

fn no_ptz(following: &Following) {
    following.network.http.set(Way::Refused);
    thread::sleep(LASTS);
    following.network.http.set(Way::Open);
}

/// When each was back.
#[derive(Clone, Copy, Default)]
struct Back {
    video: Duration,
    control: Duration,
}

fn main() {
    println!("{HEADER}");
    measure("`pipelines/headless.sh`, MJPEG", MJPEG, &[], |_| script("headless.sh"));
    measure("`pipelines/h264-rtsp.sh`", RTSP, &RTSP_LOSSES, |_| script("h264-rtsp.sh"));
    measure("the example `follow`, MJPEG", MJPEG, &[], rust);
}

fn measure(name: &str, video: Video, more: &[Loss], command: fn(&str) -> Command) {
    let losses: Vec<_> = LOSSES.iter().chain(more).collect();
    let run = || {
        let mut following = Following::start(command);
        losses.iter().map(|loss| loss.measure(&mut following, video)).collect::<Vec<_>>()
    };
    let runs = thread::scope(|scope| [(); 3].map(|()| scope.spawn(run)).map(|run| run.join().unwrap()));
    for (index, loss) in losses.iter().enumerate() {
        let worst =
            |of: fn(Back) -> Duration| runs.iter().map(|run| of(run[index])).max().unwrap_or_default();
        let seconds = |time: Duration| format!("{:.1} s", time.as_secs_f64());
        let back = if loss.video { seconds(worst(|back| back.video)) } else { "it goes on".to_owned() };
        println!("| {name} | {} | {back} | {} |", loss.name, seconds(worst(|back| back.control)));
    }
}

impl Loss {
    fn measure(&self, following: &mut Following, video: Video) -> Back {
        // Everything that was asked for before the end does not count; what a moment that is over at once leads to does.
        let asked = video(&following.network).video_requests();
        (self.happens)(following);
        let over = following.camera.now();
        let before = following.camera.status().commands;
        let picture = if self.video {
            video(&following.network).wait_for_picture(asked);
            following.camera.now()
        } else {
            over
        };
        let control = commanded_after(following, before);
        following.follows();
        Back { video: picture.saturating_sub(over), control: control.saturating_sub(over) }
    }
}

/// When the camera accepted one after so many commands.
fn commanded_after(following: &Following, before: u64) -> Duration {
    let mut seen = before;
    loop {
        let commands = following.camera.commands_after(before);
        if let Some(command) = commands.into_iter().find(|command| matches!(command.status, 200 | 204)) {
            return command.time;
        }
        assert!(
            following.camera.wait_for(PATIENCE, |status| status.commands > seen),
            "control never came back"
        );
        seen = following.camera.status().commands;
    }
}
