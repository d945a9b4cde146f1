// SPDX-License-Identifier: MPL-2.0

//! Writes what the elements say of every picture of a recording: `metas RECORDING > file`.
//!
//! Two builds of the plugins that compute the same write the same, to the last digit. Planes and pixels are written as a
//! hash. The plugins are found as GStreamer finds them (`GST_PLUGIN_PATH`).

use std::error::Error;
use std::hash::{DefaultHasher, Hash, Hasher};

use gst::prelude::*;
use ptztrack_contract::{BufferMeta, MotionMeta, Plane, SceneMeta, TargetMeta};

fn main() -> Result<(), Box<dyn Error>> {
    gst::init()?;
    let [file] = std::env::args().skip(1).collect::<Vec<_>>().try_into().map_err(|_| "metas RECORDING")?;
    let decoder = if file.ends_with(".mpeg4") { "avidemux ! avdec_mpeg4" } else { "avidemux ! jpegdec" };
    let launch = format!(
        "filesrc name=source ! {decoder} ! bgavgdetect ! lkfeaturetrack name=track ! ptzoverlay ! fakesink name=sink sync=false"
    );
    let pipeline = gst::parse::launch(&launch)?.downcast::<gst::Pipeline>().map_err(|_| "no pipeline")?;
    let pad = |element: &str, pad: &str| pipeline.by_name(element)?.static_pad(pad);
    pipeline.by_name("source").ok_or("no source")?.set_property("location", file);
    pad("track", "src").ok_or("no pad")?.add_probe(gst::PadProbeType::BUFFER, |_, info| {
        info.buffer().into_iter().for_each(|buffer| write_metas(buffer));
        gst::PadProbeReturn::Ok
    });
    pad("track", "sink").ok_or("no pad")?.add_probe(gst::PadProbeType::EVENT_UPSTREAM, |_, info| {
        let structure = info.event().and_then(|event| event.structure());
        structure.iter().for_each(|structure| println!("event {structure}"));
        gst::PadProbeReturn::Ok
    });
    pad("sink", "sink").ok_or("no pad")?.add_probe(gst::PadProbeType::BUFFER, |_, info| {
        let map = info.buffer().and_then(|buffer| buffer.map_readable().ok());
        map.iter().for_each(|map| println!("drawn {:x}", hash(map)));
        gst::PadProbeReturn::Ok
    });
    pipeline.set_state(gst::State::Playing)?;
    let bus = pipeline.bus().ok_or("no bus")?;
    let mut result = Ok(());
    for message in bus.iter_timed(gst::ClockTime::NONE) {
        match message.view() {
            gst::MessageView::Eos(_) => break,
            gst::MessageView::Error(error) => {
                result = Err(error.error().to_string().into());
                break;
            }
            _ => {}
        }
    }
    pipeline.set_state(gst::State::Null)?;
    result
}

fn write_metas(buffer: &gst::BufferRef) {
    println!("picture {:?}", buffer.pts());
    println!("{:?}", MotionMeta::of(buffer));
    println!("{:?}", TargetMeta::of(buffer));
    match SceneMeta::of(buffer) {
        Some(Ok(scene)) => {
            println!("scene {:?} {:?}", scene.from_pts, scene.camera_motion);
            let planes = [&scene.luma, &scene.foreground, &scene.background].into_iter();
            planes.chain(scene.chroma.iter().flatten()).for_each(write_plane);
        }
        other => println!("{:?}", other.map(|scene| scene.map(|_| ()))),
    }
    for region in buffer.iter_meta::<gst_video::VideoRegionOfInterestMeta>() {
        println!("region {} {:?}", region.roi_type(), region.rect());
    }
}

fn write_plane(plane: &Plane) {
    println!("plane {}x{} {:x}", plane.width, plane.height, hash(&plane.pixels));
}

fn hash(bytes: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    hasher.finish()
}
