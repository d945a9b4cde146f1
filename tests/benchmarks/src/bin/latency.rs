// SPDX-License-Identifier: MPL-2.0

//! From a decoded picture at `bgavgdetect` to the command that it led to, at the camera: `latency SECONDS WxH`.
//!
//! A virtual camera shows somebody in the room by MJPEG over HTTP and is moved after them, all in this process and by the
//! clock. Commands may follow each other as fast as the sink allows, so that none waits for its turn. Counted is the first
//! command that the camera has after a picture came to `bgavgdetect`, before the next picture came: what follows it is not
//! the picture's delay. Prints a line of CSV with a header: commands that move the camera, median and 99th percentile in
//! milliseconds.

use std::error::Error;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use gst::prelude::*;
use virtual_camera::{Auth, RoomSettings, Settings, VirtualCamera, World};

/// Until somebody is followed.
const WARM_UP: Duration = Duration::from_secs(4);

fn main() -> Result<(), Box<dyn Error>> {
    gst::init()?;
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [seconds, size] = arguments.as_slice() else { return Err("latency SECONDS WxH".into()) };
    let room = RoomSettings::test(1, 1).ok_or("no such test")?;
    let settings = Settings { auth: Auth::None, world: World::Room(room), ..Settings::default() };
    // The camera notes a command when it has carried it out.
    let camera = Arc::new(VirtualCamera::start(Settings { service_time: Duration::ZERO, ..settings })?);
    let url = camera.url();
    let launch = format!(
        "souphttpsrc is-live=true do-timestamp=true location={url}/axis-cgi/mjpg/video.cgi?resolution={size} \
         ! multipartdemux ! jpegdec ! queue leaky=downstream max-size-buffers=1 max-size-bytes=0 max-size-time=0 \
         ! bgavgdetect name=detect ! lkfeaturetrack ! vapixptzsink max-rate=50 location={url}"
    );
    let pipeline = gst::parse::launch(&launch)?.downcast::<gst::Pipeline>().map_err(|_| "no pipeline")?;
    let arrivals = Arc::new(Mutex::new(Vec::<Duration>::new()));
    let (clock, noted) = (camera.clone(), arrivals.clone());
    let pad = pipeline.by_name("detect").and_then(|detect| detect.static_pad("sink")).ok_or("no pad")?;
    pad.add_probe(gst::PadProbeType::BUFFER, move |_, _| {
        noted.lock().unwrap_or_else(PoisonError::into_inner).push(clock.now());
        gst::PadProbeReturn::Ok
    });
    pipeline.set_state(gst::State::Playing)?;
    thread::sleep(WARM_UP);
    let start = camera.now();
    thread::sleep(Duration::from_secs_f64(seconds.parse()?));
    let commands = camera.commands();
    pipeline.set_state(gst::State::Null)?;
    let arrivals = arrivals.lock().unwrap_or_else(PoisonError::into_inner);
    let moves: Vec<Duration> = commands
        .iter()
        .filter(|command| command.time > start && command.query.contains("continuouspantiltmove"))
        .map(|command| command.time)
        .collect();
    let mut delays: Vec<f64> = arrivals
        .windows(2)
        .filter_map(|pictures| {
            let first = moves.iter().find(|time| (pictures[0]..pictures[1]).contains(time))?;
            Some(1000.0 * (*first - pictures[0]).as_secs_f64())
        })
        .collect();
    delays.sort_by(f64::total_cmp);
    let last = delays.len().checked_sub(1).ok_or("no command was sent")?;
    let percentile = |part: f64| delays[(part * last as f64).round() as usize];
    println!("commands,p50_ms,p99_ms");
    println!("{},{:.2},{:.2}", delays.len(), percentile(0.5), percentile(0.99));
    Ok(())
}
