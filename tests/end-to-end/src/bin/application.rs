// SPDX-License-Identifier: MPL-2.0

//! The application of a user who embeds the elements: run by tests that need a process of its own, with its
//! own `GST_DEBUG` and tracers.
//!
//! `application follow URL USER`: follows for 60 frames, to the end of the stream.
//! `application cycle URL USER N`: starts and stops N times, with the caps changing mid-stream each time.
//! `application fork URL USER`: follows with the camera; when it first moves, forks a child, which keeps everything open.
//! `application reap URL USER`: follows with the camera, and has the system reap all children before anybody can wait for them.
//! `application hoard URL USER`: the same, but takes all memory that it can get.
//! `application hang URL USER`: the same, but its streaming thread waits for ever.
//! The password is read from the environment variable `CAMERA_PASSWORD`.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use gst::prelude::*;
use ptztrack_contract::{CameraChange, CameraMessage};

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
        ["fork", url, user] => follow(url, user, |_| fork()),
        ["reap", url, user] => {
            // SAFETY: no code of ours runs on a signal.
            unsafe { libc::signal(libc::SIGCHLD, libc::SIG_IGN) };
            follow(url, user, |_| println!("moving"));
        }
        ["hoard", url, user] => follow(url, user, hoard),
        ["hang", url, user] => follow(url, user, hang),
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

/// Follows for ever, and does something when the camera first moves.
fn follow(url: &str, user: &str, first_move: impl FnOnce(&gst::Pipeline)) {
    let pipeline = pipeline(&camera_source(url, user), url, user);
    pipeline.set_state(gst::State::Playing).unwrap();
    let bus = pipeline.bus().unwrap();
    let moves = |message: &gst::Message| {
        let message = message.structure().map(CameraMessage::from_structure);
        matches!(message, Some(Ok(message)) if message.change == CameraChange::Moving)
    };
    let mut first_move = Some(first_move);
    for message in bus.iter_timed(gst::ClockTime::NONE) {
        assert_ne!(message.type_(), gst::MessageType::Error, "{message:?}");
        if let Some(first_move) = first_move.take_if(|_| moves(&message)) {
            first_move(&pipeline);
        }
    }
}

/// The child has every descriptor of ours until it is killed.
fn fork() {
    // SAFETY: the child does nothing but wait, which is allowed after a fork of many threads.
    match unsafe { libc::fork() } {
        0 => loop {
            // SAFETY: no memory is involved.
            unsafe { libc::pause() };
        },
        child => println!("child {child}"),
    }
}

/// Takes a gibibyte of memory, and is to be killed for that.
fn hoard(_: &gst::Pipeline) {
    println!("dying");
    let hoard: Vec<_> = (0..64).map(|_| vec![1u8; 16 << 20]).collect();
    println!("alive with {} pieces", hoard.len());
}

/// No picture comes through any more.
fn hang(pipeline: &gst::Pipeline) {
    let source = pipeline.by_name("newest").and_then(|queue| queue.static_pad("src")).unwrap();
    source.add_probe(gst::PadProbeType::BUFFER, |_, _| {
        println!("dying");
        loop {
            std::thread::park();
        }
    });
}

/// The camera's pictures.
fn camera_source(url: &str, user: &str) -> gst::Element {
    let description = "souphttpsrc name=source is-live=true do-timestamp=true ! multipartdemux ! jpegdec \
        ! queue name=newest leaky=downstream max-size-buffers=1";
    let bin = gst::parse::bin_from_description(description, false).unwrap();
    let end = bin.by_name("newest").unwrap().static_pad("src").unwrap();
    bin.add_pad(&gst::GhostPad::with_target(&end).unwrap()).unwrap();
    let source = bin.by_name("source").unwrap();
    source.set_property("location", format!("{url}/axis-cgi/mjpg/video.cgi"));
    source.set_property("user-id", user);
    source.set_property("user-pw", std::env::var("CAMERA_PASSWORD").unwrap());
    bin.upcast()
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
