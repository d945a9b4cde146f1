// SPDX-License-Identifier: MPL-2.0

//! Has clocks and timestamps go wrong while somebody is followed, and the picture freeze, and prints tables in Markdown of what came
//! of it:
//!
//! ```sh
//! cargo build --workspace --lib --bins && cargo run --example clocks
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::thread;
use std::time::Duration;

use end_to_end::{GstLaunch, InView, PATIENCE, Running, Watchdog, scene, signal, tool};
use gst::prelude::*;
use ptztrack_contract::{TargetMessage, TargetState};
use virtual_camera::{Fault, Status, VirtualCamera};

/// Somebody is followed for so long with each fault: long enough for them to be lost by a camera that is not steered any more.
const WATCHED: Duration = scene::FAR_LAP;
/// And so long before it.
const BEFORE: Duration = Duration::from_secs(3);
const HOUR: gst::ClockTime = gst::ClockTime::from_seconds(3600);
/// The machine is suspended for so long: longer than a lease lasts.
const SUSPENDED: Duration = Duration::from_secs(10);
/// So fast the camera turns at most that is suspended, °/s: whom it followed is before it still where it comes to rest.
const SLOW: f64 = 2.0;
/// What is said of a picture that freezes.
const FROZEN: &str = "the picture stays the same";
/// Whoever is so far off the middle, in parts of the picture, has the camera turn for long.
const FAR: f64 = 0.25;

/// What becomes of a timestamp, in the picture of this number.
type Stamp = fn(u64, gst::ClockTime) -> Option<gst::ClockTime>;

const STAMPS: [(&str, Stamp); 6] = [
    ("timestamps jump an hour ahead", |_, time| time.checked_add(HOUR)),
    ("timestamps jump an hour back", |_, time| Some(time.saturating_sub(HOUR))),
    ("timestamps are missing", |_, _| None),
    ("timestamps are all the same", |_, _| Some(gst::ClockTime::SECOND)),
    ("timestamps run backwards", |picture, _| HOUR.checked_sub(gst::ClockTime::from_mseconds(66 * picture))),
    ("timestamps are in no order", |picture, time| {
        time.checked_add(gst::ClockTime::from_mseconds(picture * 7919 % 5000))
    }),
];

fn main() {
    println!("| what goes wrong | in view | out of view for at most | warnings |\n|---|---|---|---|");
    for (what, stamp) in STAMPS {
        follows(what, &scene::mjpeg, |_, running| restamp(running, stamp));
    }
    follows("the pipeline's clock jumps an hour ahead", &scene::mjpeg, |_, running| {
        jump(running, |base| base.saturating_sub(HOUR))
    });
    follows("the pipeline's clock jumps an hour back", &scene::mjpeg, |_, running| {
        jump(running, |base| base + HOUR)
    });
    follows("the camera's clock jumps by an hour", &scene::mjpeg, |camera, _| {
        camera.set_fault(Fault::ClockAhead(HOUR.into()));
    });
    let rtsp = |camera: &VirtualCamera| scene::rtsp(camera, "h264");
    follows("RTP's timestamp and sequence wrap", &rtsp, |_, _| ());
    println!(
        "\n| the machine is suspended for {SUSPENDED:?} | it rests after | somebody is followed again after |\n|---|---|---|"
    );
    let (rests, follows) = suspended();
    println!("| and goes on | {:.1} s | {:.1} s |", rests.as_secs_f64(), follows.as_secs_f64());
    println!(
        "\n| the picture freezes, by | noticed after | it stands after | and moves again before the picture does |\n|---|---|---|---|"
    );
    freezes("MJPEG", &scene::mjpeg);
    freezes("MPEG-4", &|camera| scene::rtsp(camera, "mpeg4"));
    freezes("H.264", &rtsp);
}

type Source<'a> = &'a dyn Fn(&VirtualCamera) -> String;

/// A pipeline that follows by these pictures; `more` are properties of the sink.
fn follow(camera: &VirtualCamera, source: Source, more: &str) -> Running {
    let tracker = "bgavgdetect name=detector ! lkfeaturetrack message-interval=100000000";
    Running::start(&format!("{} ! {tracker} ! {} {more}", source(camera), scene::servo(camera)))
}

fn follows(what: &str, source: Source, goes_wrong: impl FnOnce(&VirtualCamera, &Running)) {
    let camera = VirtualCamera::start(scene::far_person()).unwrap();
    let mut running = follow(&camera, source, "");
    scene::wait_until_following(&camera);
    thread::sleep(BEFORE);
    goes_wrong(&camera, &running);
    let seen = InView::watch(&camera, WATCHED);
    let out = seen.longest_out.as_secs_f64();
    println!("| {what} | {:.1} % | {out:.1} s | {} |", 100.0 * seen.share, running.complaints().join("; "));
}

/// Gives every picture another timestamp.
fn restamp(running: &Running, stamp: Stamp) {
    let pad = running.element("detector").static_pad("sink").unwrap();
    let number = std::sync::atomic::AtomicU64::new(0);
    pad.add_probe(gst::PadProbeType::BUFFER, move |_, info| {
        if let Some(buffer) = info.buffer_mut() {
            let picture = number.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            let time = buffer.pts().and_then(|time| stamp(picture, time));
            buffer.make_mut().set_pts(time);
        }
        gst::PadProbeReturn::Ok
    });
}

/// Has the pipeline's running time be what this makes of it from now on.
fn jump(running: &Running, base: fn(gst::ClockTime) -> gst::ClockTime) {
    let pipeline = running.pipeline();
    let base = base(pipeline.base_time().unwrap_or_default());
    for element in pipeline.iterate_recurse().into_iter().map_while(Result::ok) {
        element.set_base_time(base);
    }
    pipeline.set_base_time(base);
}

/// How soon after it goes on the camera rests, which was turning all the while, and somebody is followed again.
fn suspended() -> (Duration, Duration) {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let watchdog = Watchdog::new("suspended");
    let mut command = watchdog.of(tool("gst-launch-1.0"));
    command.args(scene::follow(&camera).split_whitespace()).arg(format!("max-speed={SLOW}"));
    let launch = GstLaunch::spawn(command);
    let turns = |status: &Status| status.pan_rate_deg_s.abs() > SLOW / 2.0;
    assert!(camera.wait_for(PATIENCE, turns), "it never turned");
    // A machine stops its watchdog too: what would stop the camera is away as long as what moves it.
    let watchdogs = watchdog.processes();
    assert_eq!(watchdogs.len(), 1, "there is no watchdog to be suspended");
    let all = || watchdogs.iter().copied().chain([launch.id()]);
    all().for_each(|process| signal(process, "STOP"));
    thread::sleep(SUSPENDED);
    let (begin, last) = (camera.now(), camera.status());
    // First, or they would stay where this fails.
    all().for_each(|process| signal(process, "CONT"));
    assert!(turns(&last), "somebody stopped it while all were suspended");
    assert!(camera.wait_for(PATIENCE, |status| !status.moving), "it turns on");
    let rests = camera.now() - begin;
    scene::wait_until_following(&camera);
    (rests, camera.now() - begin)
}

/// The picture freezes while somebody far off the middle has the camera turn.
fn freezes(by: &str, source: Source) {
    let camera = VirtualCamera::start(scene::walking_person()).unwrap();
    let mut running = follow(&camera, source, "steering=off max-speed=20");
    running.wait_for_message("somebody far off the middle", TargetMessage::from_structure, |target| {
        target.state == TargetState::Tracking && (target.centroid.x - 0.5).abs() > FAR
    });
    camera.freeze_video(true);
    running.element("servo").set_property_from_str("steering", "follow");
    scene::wait_until_following(&camera);
    let begin = camera.now();
    running.wait_for("a warning of the picture", |message| match message.view() {
        gst::MessageView::Warning(warning) => warning.error().message().contains(FROZEN).then_some(()),
        _ => None,
    });
    let noticed = camera.now() - begin;
    let stands = scene::rests(&camera, begin);
    let moves = camera.wait_for(Duration::from_secs(5), |status| status.moving);
    let stands = stands.map_or("never".to_owned(), |time| format!("{:.1} s", time.as_secs_f64()));
    let moves = if moves { "yes" } else { "no" };
    println!("| {by} | {:.1} s | {stands} | {moves} |", noticed.as_secs_f64());
}
