//! The application of a user who embeds the elements: run by tests that need a process of its own, with its
//! own `GST_DEBUG` and tracers.
//!
//! `application follow URL USER`: follows for 60 frames, to the end of the stream.
//! `application cycle URL USER N`: starts and stops N times, with the caps changing mid-stream each time.
//! The password is read from the environment variable `CAMERA_PASSWORD`.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use gst::prelude::*;

/// Size, format and frame rate of the pieces of one stream.
const PIECES: [&str; 4] = [
    "video/x-raw,format=I420,width=320,height=240,framerate=15/1",
    "video/x-raw,format=I420,width=176,height=144,framerate=15/1",
    "video/x-raw,format=NV12,width=176,height=144,framerate=30/1",
    "video/x-raw,format=RGB,width=321,height=241,framerate=0/1",
];
const FRAMES_PER_PIECE: u64 = 3;

fn main() {
    gst::init().unwrap();
    gstptztrack::plugin_register_static().unwrap();
    gstvapix::plugin_register_static().unwrap();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["follow", url, user] => run(&pipeline(&follow_source(), url, user)),
        ["cycle", url, user, times] => {
            for _ in 0..times.parse::<u32>().unwrap() {
                let pipeline = pipeline(&changing_source(), url, user);
                run(&pipeline);
            }
        }
        _ => panic!("what is to be done? {arguments:?}"),
    }
    // SAFETY: nothing of GStreamer is used after this; it lets the leak tracer report.
    unsafe { gst::deinit() };
}

/// Built by hand, as a description would put the password into GStreamer's own log of what it parses.
fn pipeline(source: &gst::Element, url: &str, user: &str) -> gst::Pipeline {
    let make = |name: &str| gst::ElementFactory::make(name).build().unwrap();
    let sink = make("vapixptzsink");
    sink.set_property("location", url);
    sink.set_property("user", user);
    sink.set_property("password", std::env::var("CAMERA_PASSWORD").unwrap());
    let elements = [source.clone(), make("bgavgdetect"), make("lkfeaturetrack"), make("ptzoverlay"), sink];
    let pipeline = gst::Pipeline::new();
    pipeline.add_many(&elements).unwrap();
    gst::Element::link_many(&elements).unwrap();
    pipeline
}

fn follow_source() -> gst::Element {
    gst::ElementFactory::make("videotestsrc")
        .property("num-buffers", 60)
        .property("is-live", true)
        .build()
        .unwrap()
}

/// An `appsrc` that has everything queued: a few frames of each of the pieces.
fn changing_source() -> gst::Element {
    let source = gst_app::AppSrc::builder().format(gst::Format::Time).max_bytes(0).build();
    let mut frame = 0;
    for piece in PIECES {
        let caps: gst::Caps = piece.parse().unwrap();
        let info = gst_video::VideoInfo::from_caps(&caps).unwrap();
        for _ in 0..FRAMES_PER_PIECE {
            let mut pixels = vec![90u8; info.size()];
            let end = pixels.len().min(2000 + 300 * frame as usize);
            pixels[end / 2..end].fill(220);
            let mut buffer = gst::Buffer::from_mut_slice(pixels);
            buffer.get_mut().unwrap().set_pts(gst::ClockTime::from_mseconds(40 * frame));
            frame += 1;
            let sample = gst::Sample::builder().buffer(&buffer).caps(&caps).build();
            source.push_sample(&sample).unwrap();
        }
    }
    source.end_of_stream().unwrap();
    source.upcast()
}

/// Plays to the end and shuts down; an error ends the process.
fn run(pipeline: &gst::Pipeline) {
    pipeline.set_state(gst::State::Playing).unwrap();
    let wanted = [gst::MessageType::Eos, gst::MessageType::Error];
    let bus = pipeline.bus().unwrap();
    let end = bus.timed_pop_filtered(gst::ClockTime::from_seconds(60), &wanted).expect("it never ended");
    assert_eq!(end.type_(), gst::MessageType::Eos, "{end:?}");
    pipeline.set_state(gst::State::Null).unwrap();
}
