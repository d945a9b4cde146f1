// SPDX-License-Identifier: MPL-2.0

//! Lets cameras that are recordings play by the clock, and counts what becomes of their pictures:
//! `live RECORDING CAMERAS SECONDS ELEMENTS`, for example `live room.avi 4 20 "bgavgdetect ! lkfeaturetrack"`.
//!
//! All of them are in this one process, each in a pipeline of its own, with the queue that drops what nobody has time for
//! between decoder and elements. The first seconds, in which somebody is found, are not counted. Prints a line of CSV with a
//! header: pictures decoded, delivered and delivered with somebody followed, those dropped, processor time for each that was
//! decoded and as a part of one core, and the memory that is this process' own.

use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use std::{fs, thread};

use gst::prelude::*;
use ptztrack_contract::{BufferMeta, TargetMeta, TargetState};

/// Until somebody is found, caches are warm and memory has grown.
const WARM_UP: Duration = Duration::from_secs(4);
/// Clock ticks a second in `/proc`, on every Linux.
const TICKS: f64 = 100.0;

#[derive(Debug, Default)]
struct Counts {
    decoded: AtomicU64,
    delivered: AtomicU64,
    following: AtomicU64,
}

impl Counts {
    fn now(&self) -> [u64; 3] {
        [&self.decoded, &self.delivered, &self.following].map(|count| count.load(Ordering::Relaxed))
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    gst::init()?;
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [recording, cameras, seconds, elements] = arguments.as_slice() else {
        return Err("live RECORDING CAMERAS SECONDS ELEMENTS".into());
    };
    let (cameras, seconds): (u32, f64) = (cameras.parse()?, seconds.parse()?);
    let counts = Arc::new(Counts::default());
    let pipelines = (0..cameras).map(|_| camera(recording, elements, &counts));
    let pipelines = pipelines.collect::<Result<Vec<_>, _>>()?;
    for pipeline in &pipelines {
        pipeline.set_state(gst::State::Playing)?;
        // Cameras do not expose at the same moment.
        thread::sleep(Duration::from_secs(1) / cameras.max(1));
    }
    thread::sleep(WARM_UP);
    let (before, busy, start) = (counts.now(), processor_s()?, Instant::now());
    thread::sleep(Duration::from_secs_f64(seconds));
    let (after, busy, elapsed) = (counts.now(), processor_s()? - busy, start.elapsed().as_secs_f64());
    let memory = private_mb()?;
    for pipeline in &pipelines {
        if let Some(message) = pipeline.bus().and_then(|bus| bus.pop_filtered(&[gst::MessageType::Error])) {
            return Err(format!("{message:?}").into());
        }
    }
    let [decoded, delivered, following] = [0, 1, 2].map(|index| after[index] - before[index]);
    println!("cameras,seconds,decoded,delivered,following,dropped,ms_a_picture,cores,private_mb");
    println!(
        "{cameras},{elapsed:.2},{decoded},{delivered},{following},{},{:.3},{:.3},{memory:.1}",
        decoded.saturating_sub(delivered),
        1000.0 * busy / decoded.max(1) as f64,
        busy / elapsed
    );
    pipelines.iter().try_for_each(|pipeline| pipeline.set_state(gst::State::Null).map(drop))?;
    Ok(())
}

fn camera(recording: &str, elements: &str, counts: &Arc<Counts>) -> Result<gst::Pipeline, Box<dyn Error>> {
    let decoder = if recording.ends_with(".mpeg4") {
        "avidemux ! clocksync ! avdec_mpeg4"
    } else {
        "avidemux ! clocksync ! jpegdec"
    };
    let launch = format!(
        "filesrc name=source ! {decoder} ! queue name=newest leaky=downstream max-size-buffers=1 max-size-bytes=0 \
         max-size-time=0 ! {elements} ! fakesink name=sink sync=false"
    );
    let pipeline = gst::parse::launch(&launch)?.downcast::<gst::Pipeline>().map_err(|_| "no pipeline")?;
    pipeline.by_name("source").ok_or("no source")?.set_property("location", recording);
    let pad = |element: &str| pipeline.by_name(element)?.static_pad("sink");
    let decoded = counts.clone();
    pad("newest").ok_or("no pad")?.add_probe(gst::PadProbeType::BUFFER, move |_, _| {
        decoded.decoded.fetch_add(1, Ordering::Relaxed);
        gst::PadProbeReturn::Ok
    });
    let delivered = counts.clone();
    pad("sink").ok_or("no pad")?.add_probe(gst::PadProbeType::BUFFER, move |_, info| {
        delivered.delivered.fetch_add(1, Ordering::Relaxed);
        let target = info.buffer().and_then(|buffer| TargetMeta::of(buffer));
        if let Some(Ok(target)) = target
            && target.state == TargetState::Tracking
        {
            delivered.following.fetch_add(1, Ordering::Relaxed);
        }
        gst::PadProbeReturn::Ok
    });
    Ok(pipeline)
}

/// Processor time of this process until now, user and system, in seconds.
fn processor_s() -> Result<f64, Box<dyn Error>> {
    let stat = fs::read_to_string("/proc/self/stat")?;
    // The name in parentheses may hold spaces.
    let (_, fields) = stat.rsplit_once(')').ok_or("/proc/self/stat")?;
    let ticks = fields.split_whitespace().skip(11).take(2).map(str::parse::<f64>).sum::<Result<f64, _>>()?;
    Ok(ticks / TICKS)
}

/// Memory that no other process shares.
fn private_mb() -> Result<f64, Box<dyn Error>> {
    let rollup = fs::read_to_string("/proc/self/smaps_rollup")?;
    let private = rollup.lines().filter(|line| line.starts_with("Private_"));
    let kilobytes = private.filter_map(|line| line.split_whitespace().nth(1)).map(str::parse::<f64>);
    Ok(kilobytes.sum::<Result<f64, _>>()? / 1024.0)
}
