// SPDX-License-Identifier: MPL-2.0

//! Input that no camera should send and some do.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use end_to_end::Running;
use gst::prelude::*;
use ptztrack_contract::{BufferMeta, TargetMeta};

const CHAIN: &str = "bgavgdetect ! lkfeaturetrack ! ptzoverlay";

/// Runs to the end and gives the number of frames that came out.
#[track_caller]
fn frames_out(source: &str) -> usize {
    let mut running = Running::parse(&format!("{source} ! {CHAIN} ! fakesink name=out sync=false"));
    let count = std::sync::Arc::new(std::sync::atomic::AtomicUsize::new(0));
    let counter = count.clone();
    let pad = running.element("out").static_pad("sink").unwrap();
    pad.add_probe(gst::PadProbeType::BUFFER, move |_, info| {
        let buffer = info.buffer().unwrap();
        assert!(TargetMeta::of(buffer).unwrap().is_ok());
        counter.fetch_add(1, std::sync::atomic::Ordering::SeqCst);
        gst::PadProbeReturn::Ok
    });
    running.pipeline().set_state(gst::State::Playing).unwrap();
    running.wait_for("the end", |message| (message.type_() == gst::MessageType::Eos).then_some(()));
    count.load(std::sync::atomic::Ordering::SeqCst)
}

#[test]
fn sizes_from_tiny_to_huge() {
    for (width, height, frames) in [(1, 1, 5), (3, 5, 5), (16, 16, 20), (17, 33, 20), (4096, 2160, 8)] {
        let source = format!(
            "videotestsrc pattern=ball num-buffers={frames} ! video/x-raw,format=I420,width={width},height={height}"
        );
        assert_eq!(frames_out(&source), frames, "{width}x{height}");
    }
}

/// Runs twenty frames of a moving bar with these timestamps and gives the number that came out.
#[track_caller]
fn frames_out_stamped(framerate: &str, stamp: impl Fn(u64) -> Option<gst::ClockTime>) -> usize {
    let mut running = Running::parse(&format!(
        "appsrc name=source format=time caps=video/x-raw,format=GRAY8,width=160,height=120,framerate={framerate} \
         ! {CHAIN} ! appsink name=out sync=false"
    ));
    let source = running.element("source").downcast::<gst_app::AppSrc>().unwrap();
    running.pipeline().set_state(gst::State::Playing).unwrap();
    for frame in 0..20u64 {
        let mut pixels = vec![80u8; 160 * 120];
        for row in pixels.chunks_exact_mut(160).skip(30).take(60) {
            row[frame as usize * 6..frame as usize * 6 + 20].fill(200);
        }
        let mut buffer = gst::Buffer::from_mut_slice(pixels);
        buffer.get_mut().unwrap().set_pts(stamp(frame));
        source.push_buffer(buffer).unwrap();
    }
    source.end_of_stream().unwrap();
    let sink = running.element("out").downcast::<gst_app::AppSink>().unwrap();
    let frames = std::iter::from_fn(|| sink.pull_sample().ok()).count();
    running.wait_for("the end", |message| (message.type_() == gst::MessageType::Eos).then_some(()));
    frames
}

#[test]
fn variable_frame_rate() {
    let gaps = [0, 1, 2, 50, 40, 3, 700, 40, 40, 0];
    let stamp =
        |frame: u64| Some(gst::ClockTime::from_mseconds(gaps.iter().cycle().take(frame as usize).sum()));
    assert_eq!(frames_out_stamped("0/1", stamp), 20);
}

#[test]
fn no_timestamps() {
    assert_eq!(frames_out_stamped("25/1", |_| None), 20);
}

#[test]
fn timestamps_that_go_backwards() {
    assert_eq!(
        frames_out_stamped("25/1", |frame| Some(gst::ClockTime::from_mseconds(40 * (20 - frame)))),
        20
    );
}

/// Every fourth JPEG ends half-way: what `jpegdec` makes of it passes, the rest is not lost.
#[test]
fn truncated_jpegs() {
    let mut running = Running::parse(&format!(
        "videotestsrc pattern=ball num-buffers=40 ! video/x-raw,width=320,height=240 ! jpegenc ! identity name=cut \
         ! jpegdec max-errors=-1 ! {CHAIN} ! fakesink name=out sync=false"
    ));
    let received = std::sync::Arc::new(std::sync::atomic::AtomicUsize::new(0));
    let number = std::sync::atomic::AtomicUsize::new(0);
    running.element("cut").static_pad("src").unwrap().add_probe(gst::PadProbeType::BUFFER, move |_, info| {
        if number.fetch_add(1, std::sync::atomic::Ordering::SeqCst) % 4 == 3 {
            let buffer = info.buffer_mut().unwrap();
            let half = buffer.copy_region(gst::BufferCopyFlags::all(), 0..buffer.size() / 2).unwrap();
            *buffer = half;
        }
        gst::PadProbeReturn::Ok
    });
    let counter = received.clone();
    running.element("out").static_pad("sink").unwrap().add_probe(gst::PadProbeType::BUFFER, move |_, _| {
        counter.fetch_add(1, std::sync::atomic::Ordering::SeqCst);
        gst::PadProbeReturn::Ok
    });
    running.pipeline().set_state(gst::State::Playing).unwrap();
    running.wait_for("the end", |message| (message.type_() == gst::MessageType::Eos).then_some(()));
    assert!(received.load(std::sync::atomic::Ordering::SeqCst) >= 30);
}

/// A region of no size from a foreign detector is no target.
#[test]
fn region_without_size() {
    let mut running = Running::parse(
        "videotestsrc num-buffers=20 ! video/x-raw,width=160,height=120 ! identity name=mark \
         ! lkfeaturetrack roi-type=face ! fakesink name=out sync=false",
    );
    running.element("mark").static_pad("src").unwrap().add_probe(gst::PadProbeType::BUFFER, |_, info| {
        let buffer = info.buffer_mut().unwrap().make_mut();
        gst_video::VideoRegionOfInterestMeta::add(buffer, "face", (20, 20, 0, 0));
        gst_video::VideoRegionOfInterestMeta::add(buffer, "face", (u32::MAX, u32::MAX, u32::MAX, u32::MAX));
        gst::PadProbeReturn::Ok
    });
    running.element("out").static_pad("sink").unwrap().add_probe(gst::PadProbeType::BUFFER, |_, info| {
        assert_eq!(TargetMeta::of(info.buffer().unwrap()).unwrap().unwrap().id, 0);
        gst::PadProbeReturn::Ok
    });
    running.pipeline().set_state(gst::State::Playing).unwrap();
    running.wait_for("the end", |message| (message.type_() == gst::MessageType::Eos).then_some(()));
}
