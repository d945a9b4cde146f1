// SPDX-License-Identifier: MPL-2.0

//! `ptzoverlay` in a harness: what it changes in pixels, and what it leaves alone.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use gst::prelude::*;
use gst_check::Harness;
use gst_video::prelude::*;
use gst_video::{VideoFormat, VideoInfo, VideoOverlayCompositionMeta};
use ptztrack_contract::{BufferMeta, Feature, MotionMeta, Point, Rect, Region, TargetMeta, TargetState};

const PARTS: [&str; 9] =
    ["contours", "boxes", "tracks", "features", "centroid", "trail", "cross-hair", "state", "offset"];
const COMPOSITION: &str = "meta:GstVideoOverlayComposition";

fn init() {
    gst::init().unwrap();
    gstptztrack::plugin_register_static().unwrap();
}

fn info(format: VideoFormat, width: u32, height: u32) -> VideoInfo {
    VideoInfo::builder(format, width, height).fps(gst::Fraction::new(10, 1)).build().unwrap()
}

fn overlay(parts: &[&str]) -> gst::Element {
    let element = gst::ElementFactory::make("ptzoverlay").build().unwrap();
    for part in PARTS {
        element.set_property(part, parts.contains(&part));
    }
    element
}

/// A harness around it whose sink takes anything, but draws no compositions.
fn harness(parts: &[&str], info: &VideoInfo) -> Harness {
    let mut harness = Harness::with_element(&overlay(parts), Some("sink"), Some("src"));
    harness.set_src_caps(info.to_caps().unwrap());
    harness
}

/// A frame all of one byte, `index` tenths of a second into the stream.
fn grey(info: &VideoInfo, index: u64) -> gst::Buffer {
    let mut buffer = gst::Buffer::from_mut_slice(vec![0x60_u8; info.size()]);
    buffer.make_mut().set_pts(index * 100.mseconds());
    buffer
}

fn target() -> TargetMeta {
    TargetMeta {
        state: TargetState::Tracking,
        id: 1,
        bounds: Rect { x: 0.6, y: 0.5, width: 0.2, height: 0.4 },
        centroid: Point { x: 0.7, y: 0.7 },
        confidence: 0.9,
        features: vec![
            Feature { position: Point { x: 0.65, y: 0.6 }, kept: true },
            Feature { position: Point { x: 0.65, y: 0.8 }, kept: false },
        ],
        ..TargetMeta::default()
    }
}

fn motion() -> MotionMeta {
    let contour = [(0.25, 0.55), (0.35, 0.55), (0.3, 0.9)].map(|(x, y)| Point { x, y }).to_vec();
    let bounds = Rect { x: 0.25, y: 0.55, width: 0.1, height: 0.35 };
    MotionMeta { regions: vec![Region { bounds, contour, ..Region::default() }], ..MotionMeta::default() }
}

fn with_metas(info: &VideoInfo, index: u64) -> gst::Buffer {
    let mut buffer = grey(info, index);
    target().attach(buffer.make_mut()).unwrap();
    motion().attach(buffer.make_mut()).unwrap();
    buffer
}

fn with_target(info: &VideoInfo, index: u64, id: u64, x: f64, y: f64) -> gst::Buffer {
    let mut buffer = grey(info, index);
    TargetMeta { id, centroid: Point { x, y }, ..target() }.attach(buffer.make_mut()).unwrap();
    buffer
}

fn bytes(buffer: &gst::BufferRef) -> Vec<u8> {
    buffer.map_readable().unwrap().to_vec()
}

/// Red, green and blue at a normalised place of an RGB frame.
fn rgb(buffer: &gst::BufferRef, info: &VideoInfo, x: f64, y: f64) -> [u8; 3] {
    let frame = gst_video::VideoFrameRef::from_buffer_ref_readable(buffer, info).unwrap();
    let (x, y) = ((x * f64::from(info.width())) as usize, (y * f64::from(info.height())) as usize);
    let start = y * frame.plane_stride()[0] as usize + x * 3;
    frame.plane_data(0).unwrap()[start..start + 3].try_into().unwrap()
}

const GROUND: [u8; 3] = [0x60; 3];

/// The frame that one part alone makes of the grey one; the second of two, so that there is a trail.
fn drawn(part: &str, info: &VideoInfo) -> gst::Buffer {
    let mut harness = harness(&[part], info);
    harness.push_and_pull(with_target(info, 0, 1, 0.6, 0.2)).unwrap();
    harness.push_and_pull(with_metas(info, 1)).unwrap()
}

#[test]
fn each_part_appears_where_it_belongs() {
    init();
    let info = info(VideoFormat::Rgb, 640, 480);
    let look = |part: &str, x, y| rgb(&drawn(part, &info), &info, x, y);
    assert_ne!(look("contours", 0.30, 0.55), GROUND);
    assert_ne!(look("boxes", 0.25, 0.7), GROUND);
    assert_ne!(look("boxes", 0.6, 0.7), GROUND);
    assert_ne!(look("centroid", 0.7, 0.7), GROUND);
    assert_ne!(look("trail", 0.65, 0.45), GROUND);
    assert_ne!(look("cross-hair", 0.5, 0.54), GROUND);
    assert_ne!(look("state", 0.03, 0.04), GROUND);
    assert_ne!(look("offset", 0.6, 0.6), GROUND);
    let [red, green, _] = look("features", 0.65, 0.6);
    assert!(green > 200 && red < 120, "kept points are green");
    let [red, green, _] = look("features", 0.65, 0.8);
    assert!(red > 200 && green < 120, "rejected points are red");
    for part in PARTS {
        assert_eq!(look(part, 0.95, 0.1), GROUND, "{part} strays");
    }
}

#[test]
fn nothing_changes_where_nothing_is_to_be_drawn() {
    init();
    let info = info(VideoFormat::I420, 321, 241);
    let mut all_off = harness(&[], &info);
    let out = all_off.push_and_pull(with_metas(&info, 0)).unwrap();
    assert_eq!(bytes(&out), bytes(&grey(&info, 0)));

    let mut no_meta = harness(&PARTS, &info);
    let buffer = grey(&info, 0);
    let memory = buffer.peek_memory(0).as_ptr();
    let out = no_meta.push_and_pull(buffer).unwrap();
    assert_eq!(out.peek_memory(0).as_ptr(), memory, "not even copied");
    assert_eq!(bytes(&out), bytes(&grey(&info, 0)));
}

#[test]
fn a_shared_frame_is_copied_not_scribbled_on() {
    init();
    let info = info(VideoFormat::I420, 320, 240);
    let mut harness = harness(&PARTS, &info);
    let shared = with_metas(&info, 0);
    let out = harness.push_and_pull(shared.clone()).unwrap();
    assert_ne!(bytes(&out), bytes(&shared));
    assert_eq!(bytes(&shared), bytes(&grey(&info, 0)));
}

#[test]
fn draws_on_every_format() {
    init();
    for format in gst_video::VIDEO_FORMATS_ALL.iter().copied() {
        let info = info(format, 320, 240);
        let mut harness = harness(&PARTS, &info);
        let out = harness.push_and_pull(with_metas(&info, 0)).unwrap();
        assert_ne!(bytes(&out), bytes(&grey(&info, 0)), "{format:?}");
    }
}

#[test]
fn draws_on_odd_and_tiny_frames() {
    init();
    for format in [VideoFormat::Nv12, VideoFormat::I420, VideoFormat::Rgb] {
        for (width, height) in [(16, 16), (17, 33), (641, 481), (48, 640), (1, 1)] {
            let info = info(format, width, height);
            let mut harness = harness(&PARTS, &info);
            let out = harness.push_and_pull(with_metas(&info, 0)).unwrap();
            assert_eq!(out.size(), info.size(), "{format:?} {width}x{height}");
        }
    }
}

#[test]
fn colours_survive_the_way_to_luma_and_chroma() {
    init();
    let info = info(VideoFormat::I420, 640, 480);
    let out = drawn("features", &info);
    let frame = gst_video::VideoFrameRef::from_buffer_ref_readable(&out, &info).unwrap();
    let (x, y) = (208, 144); // The kept point at (0.65, 0.6), in chroma's half resolution.
    let chroma =
        |plane| frame.plane_data(plane).unwrap()[y * frame.plane_stride()[plane as usize] as usize + x];
    assert!(chroma(1) < 0x60 && chroma(2) < 0x60, "green: U {} V {}", chroma(1), chroma(2));
}

#[test]
fn the_trail_ends_with_its_time_and_its_target() {
    init();
    let info = info(VideoFormat::Rgb, 640, 480);
    let mut harness = harness(&["trail"], &info);
    let mut push = |index, id, x| harness.push_and_pull(with_target(&info, index, id, x, 0.5)).unwrap();
    push(0, 1, 0.2);
    assert_ne!(rgb(&push(1, 1, 0.4), &info, 0.3, 0.5), GROUND);
    assert_eq!(rgb(&push(2, 2, 0.6), &info, 0.3, 0.5), GROUND, "another target, another trail");
    assert_ne!(rgb(&push(3, 2, 0.8), &info, 0.7, 0.5), GROUND);
    assert_eq!(rgb(&push(100, 2, 0.9), &info, 0.7, 0.5), GROUND, "too old");
}

#[test]
fn the_trail_ends_where_time_goes_backwards_or_is_not_known() {
    init();
    let info = info(VideoFormat::Rgb, 640, 480);
    for pts in [Some(gst::ClockTime::ZERO), None] {
        let mut harness = harness(&["trail"], &info);
        harness.push_and_pull(with_target(&info, 1, 1, 0.2, 0.5)).unwrap();
        let out = harness.push_and_pull(with_target(&info, 2, 1, 0.4, 0.5)).unwrap();
        assert_ne!(bytes(&out), bytes(&grey(&info, 2)));
        let mut buffer = grey(&info, 0);
        buffer.make_mut().set_pts(pts);
        // Nobody is there any more.
        TargetMeta::default().attach(buffer.make_mut()).unwrap();
        let out = harness.push_and_pull(buffer).unwrap();
        assert_eq!(bytes(&out), bytes(&grey(&info, 0)), "{pts:?}");
    }
}

#[test]
fn a_flush_ends_the_trail() {
    init();
    let info = info(VideoFormat::Rgb, 640, 480);
    let mut harness = harness(&["trail"], &info);
    harness.push_and_pull(with_target(&info, 0, 1, 0.2, 0.5)).unwrap();
    let out = harness.push_and_pull(with_target(&info, 1, 1, 0.4, 0.5)).unwrap();
    assert_ne!(bytes(&out), bytes(&grey(&info, 1)));
    harness.push_event(gst::event::FlushStart::new());
    harness.push_event(gst::event::FlushStop::new(true));
    harness.push_event(gst::event::Segment::new(&gst::FormattedSegment::<gst::ClockTime>::new()));
    let out = harness.push_and_pull(with_target(&info, 2, 1, 0.6, 0.5)).unwrap();
    assert_eq!(bytes(&out), bytes(&grey(&info, 2)));
}

#[test]
fn attaches_where_downstream_draws() {
    init();
    let info = info(VideoFormat::Nv12, 320, 240);
    let mut harness = Harness::with_element(&overlay(&PARTS), Some("sink"), Some("src"));
    harness.add_propose_allocation_meta(VideoOverlayCompositionMeta::meta_api(), None);
    harness.set_src_caps(info.to_caps().unwrap());
    let out = harness.push_and_pull(with_metas(&info, 0)).unwrap();
    assert_eq!(bytes(&out), bytes(&grey(&info, 0)), "pixels stay");
    let caps = harness.sinkpad().unwrap().current_caps().unwrap();
    assert!(caps.features(0).unwrap().contains(COMPOSITION), "{caps}");
    let meta = out.meta::<VideoOverlayCompositionMeta>().expect("composition");
    let rectangles = meta.overlay().n_rectangles();
    assert!(rectangles > 0);

    // What another overlay attached stays in it.
    let mut buffer = with_metas(&info, 1);
    VideoOverlayCompositionMeta::add(buffer.make_mut(), &meta.overlay_owned());
    let out = harness.push_and_pull(buffer).unwrap();
    let metas: Vec<_> = out.iter_meta::<VideoOverlayCompositionMeta>().collect();
    assert_eq!(metas.len(), 1);
    assert!(metas[0].overlay().n_rectangles() > rectangles);
}

#[test]
fn upstream_gets_what_downstream_proposes_but_crops_itself() {
    init();
    let caps = info(VideoFormat::Gray8, 320, 240).to_caps().unwrap();
    let mut harness = Harness::with_element(&overlay(&PARTS), Some("sink"), Some("src"));
    harness.add_propose_allocation_meta(gst_video::VideoMeta::meta_api(), None);
    harness.add_propose_allocation_meta(gst_video::VideoCropMeta::meta_api(), None);
    harness.set_src_caps(caps.clone());
    let mut query = gst::query::Allocation::new(Some(&caps), false);
    assert!(harness.srcpad().unwrap().peer_query(&mut query));
    assert!(query.find_allocation_meta::<gst_video::VideoMeta>().is_some());
    assert_eq!(query.find_allocation_meta::<gst_video::VideoCropMeta>(), None);
}

#[test]
fn blends_where_downstream_only_lets_everything_pass() {
    init();
    let info = info(VideoFormat::I420, 320, 240);
    let mut harness = harness(&PARTS, &info);
    let out = harness.push_and_pull(with_metas(&info, 0)).unwrap();
    assert!(out.meta::<VideoOverlayCompositionMeta>().is_none());
    let caps = harness.sinkpad().unwrap().current_caps().unwrap();
    assert!(!caps.features(0).unwrap().contains(COMPOSITION), "{caps}");
    assert!(TargetMeta::of(&out).is_some(), "metas go on");
}

#[test]
fn follows_a_change_of_format_and_size() {
    init();
    let mut harness = Harness::with_element(&overlay(&PARTS), Some("sink"), Some("src"));
    for (format, width, height) in [(VideoFormat::I420, 320, 240), (VideoFormat::Rgb, 64, 48)] {
        let info = info(format, width, height);
        harness.set_src_caps(info.to_caps().unwrap());
        let out = harness.push_and_pull(with_metas(&info, 0)).unwrap();
        assert_ne!(bytes(&out), bytes(&grey(&info, 0)));
    }
}

#[test]
fn a_frame_too_small_for_its_caps_passes_with_one_warning() {
    init();
    let info = info(VideoFormat::Rgb, 64, 48);
    let element = overlay(&PARTS);
    let bus = gst::Bus::new();
    element.set_bus(Some(&bus));
    let mut harness = Harness::with_element(&element, Some("sink"), Some("src"));
    harness.set_src_caps(info.to_caps().unwrap());
    for _ in 0..3 {
        let mut buffer = gst::Buffer::from_mut_slice(vec![0_u8; 10]);
        target().attach(buffer.make_mut()).unwrap();
        assert_eq!(harness.push_and_pull(buffer).unwrap().size(), 10);
    }
    assert_eq!(bus.iter_filtered(&[gst::MessageType::Warning]).count(), 1);
    element.set_bus(None);
}

#[test]
fn the_documented_pipelines_run() {
    init();
    let launches: Vec<_> = include_str!("../src/ptzoverlay/mod.rs")
        .lines()
        .filter_map(|line| line.strip_prefix("//! gst-launch-1.0 "))
        .collect();
    assert!(!launches.is_empty());
    for launch in launches {
        let pipeline = gst::parse::launch(launch).unwrap_or_else(|err| panic!("{launch}: {err}"));
        let bus = pipeline.bus().unwrap();
        pipeline.set_state(gst::State::Playing).unwrap();
        let message = bus
            .timed_pop_filtered(60.seconds(), &[gst::MessageType::Eos, gst::MessageType::Error])
            .unwrap_or_else(|| panic!("{launch}: no end"));
        pipeline.set_state(gst::State::Null).unwrap();
        assert_eq!(message.type_(), gst::MessageType::Eos, "{launch}: {message:?}");
    }
}
