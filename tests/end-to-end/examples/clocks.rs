// SPDX-License-Identifier: MPL-2.0

//! Has clocks and timestamps go wrong while somebody is followed, and the picture freeze, and prints tables in Markdown of what came
//! of it:
//!
//! ```sh
//! cargo build --workspace --lib --bins --examples && cargo run --example clocks
//! ```
//! The machine's own clock is not touched: a program has another one, by a library that is loaded before it. The pipelines' clock, which
//! never jumps by itself, is made to jump apart from that.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::iter;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use chrono::DateTime;
use end_to_end::{
    GstLaunch, InView, PATIENCE, Program, Running, Viewer, Watchdog, complaints_in, plugin_folder, scene,
    scratch, signal, tool,
};
use gst::prelude::*;
use ptztrack_contract::{TargetMessage, TargetState};
use virtual_camera::{Fault, OnvifSettings, Quirk, Settings, Status, VirtualCamera};

/// Somebody is followed for so long with each fault: long enough for them to be lost by a camera that is not steered any more.
const WATCHED: Duration = scene::FAR_LAP;
/// And so long before it.
const BEFORE: Duration = Duration::from_secs(3);
const HOUR_S: i64 = 3600;
const HOUR: gst::ClockTime = gst::ClockTime::from_seconds(HOUR_S.unsigned_abs());
/// The machine is suspended for so long: longer than a lease lasts.
const SUSPENDED: Duration = Duration::from_secs(10);
/// So fast the camera turns at most that is suspended, °/s: whom it followed is before it still where it comes to rest.
const SLOW: f64 = 2.0;
/// More documents than come while somebody is watched.
const MOST_DOCUMENTS: usize = 1000;
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
    let ahead = || Fault::ClockAhead(HOUR.into());
    follows("the camera's clock jumps an hour ahead", &scene::mjpeg, |camera, _| camera.set_fault(ahead()));
    follows("the camera's clock jumps an hour back", &scene::mjpeg, |camera, _| {
        camera.set_fault(ahead());
        // What it has handed out by then is of the future.
        thread::sleep(BEFORE);
        camera.set_fault(Fault::None);
    });
    for (protocol, camera) in [("vapix", scene::far_person as fn() -> Settings), ("onvif", strict_person)] {
        for (to, off_s) in [("ahead", HOUR_S), ("back", -HOUR_S)] {
            machine_jumps(
                &format!("the machine's clock jumps an hour {to}, {protocol}"),
                camera(),
                protocol,
                off_s,
            );
        }
    }
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
    print(what, seen, &running.complaints());
}

fn print(what: &str, seen: InView, warnings: &[String]) {
    let out = seen.longest_out.as_secs_f64();
    println!("| {what} | {:.1} % | {out:.1} s | {} |", 100.0 * seen.share, warnings.join("; "));
}

/// The same person before a camera by ONVIF, which lets nobody in whose log-in is not of this moment by its own clock; that is an hour
/// behind.
fn strict_person() -> Settings {
    let onvif = OnvifSettings::with(&[Quirk::ClockBehind]);
    Settings { world: scene::far_person().world, ..scene::any_make(onvif) }
}

/// The program follows, and passes the camera on, while the machine's clock jumps. The camera's stays as it is.
fn machine_jumps(what: &str, settings: Settings, protocol: &str, off_s: i64) {
    let camera = VirtualCamera::start(settings).unwrap();
    let clock = MachineClock::new();
    let file = |folder: &Path| {
        let door = Program::entry("door", &camera.url(), &folder.join("password"));
        format!("{door}protocol = {protocol:?}\n[restream]\nlisten = \"127.0.0.1:0\"\n")
    };
    let mut program = Program::start_in("machine-jumps", file, &[], &clock.environment());
    let line = program.launch.wait_for_line("passes the cameras on at ");
    scene::wait_until_following(&camera);
    let viewer = Viewer::start(&line.rsplit(' ').next().unwrap().replace("NAME", "door"), |_| ());
    let before_s = told_s(&viewer.document().0);
    thread::sleep(BEFORE);
    clock.set(off_s);
    let seen = InView::watch(&camera, WATCHED);
    // Or nothing has jumped. Those from before come first.
    let has_jumped = |document: &String| (told_s(document) - before_s - off_s).abs() < HOUR_S / 2;
    let newest = iter::repeat_with(|| viewer.document().0).take(MOST_DOCUMENTS).find(has_jumped);
    assert!(newest.is_some(), "{what}: it tells of the same time as before");
    drop(viewer);
    let said = program.end("TERM");
    print(what, seen, &complaints_in(&said));
}

/// When what a document tells of was, in seconds since 1970.
fn told_s(document: &str) -> i64 {
    let time = document.split("UtcTime=\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap();
    DateTime::parse_from_rfc3339(time).unwrap().timestamp()
}

/// The machine's clock, as one program sees it.
struct MachineClock {
    /// Loaded before the program.
    library: PathBuf,
    /// By how much it is off.
    file: PathBuf,
}

impl MachineClock {
    fn new() -> Self {
        let library = plugin_folder().join("examples/libwall_clock.so");
        // Where there is no such library the linker only warns.
        assert!(library.is_file(), "{}", library.display());
        let clock = Self { library, file: scratch("machine-clock") };
        clock.set(0);
        clock
    }

    fn set(&self, off_s: i64) {
        fs::write(&self.file, off_s.to_ne_bytes()).unwrap();
    }

    fn environment(&self) -> [(&str, &Path); 2] {
        [("LD_PRELOAD", &self.library), ("WALL_CLOCK", &self.file)]
    }
}

impl Drop for MachineClock {
    fn drop(&mut self) {
        // Nothing depends on it any more.
        let _ = fs::remove_file(&self.file);
    }
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
