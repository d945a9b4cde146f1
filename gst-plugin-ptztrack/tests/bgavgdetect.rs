// SPDX-License-Identifier: MPL-2.0

//! `bgavgdetect` in a harness and in pipelines: what it reports, when it does not, and what it leaves alone.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use gst::glib::ParamSpec;
use gst::prelude::*;
use gst_check::Harness;
use gst_video::prelude::*;
use gst_video::{VideoFormat, VideoInfo, VideoRegionOfInterestMeta};
use gstptztrack::luma_source::FORMATS;
use ptztrack_contract::{
    BufferMeta, CameraEvent, MOTION_ROI, MotionChange, MotionMessage, MotionMeta, Plane, Rect, SceneMeta,
    TargetState, TrackerEvent,
};

const STEP: gst::ClockTime = gst::ClockTime::from_mseconds(100);
const BOX: (u32, u32, u32, u32) = (40, 30, 20, 40);

fn init() {
    gst::init().unwrap();
    gstptztrack::plugin_register_static().unwrap();
}

fn info(format: VideoFormat, width: u32, height: u32) -> VideoInfo {
    init();
    VideoInfo::builder(format, width, height).fps(gst::Fraction::new(10, 1)).build().unwrap()
}

fn grey() -> VideoInfo {
    info(VideoFormat::Gray8, 160, 120)
}

/// A detector that learns from two frames and reports what two frames show.
struct Detector {
    harness: Harness,
    element: gst::Element,
    bus: gst::Bus,
    info: VideoInfo,
    /// Number of the next frame.
    frame: u64,
}

impl Detector {
    fn new(info: &VideoInfo) -> Self {
        init();
        let element = gst::ElementFactory::make("bgavgdetect")
            .property("warm-up", 2u32)
            .property("confirm-frames", 2u32)
            .build()
            .unwrap();
        let bus = gst::Bus::new();
        element.set_bus(Some(&bus));
        let mut harness = Harness::with_element(&element, Some("sink"), Some("src"));
        harness.set_src_caps(info.to_caps().unwrap());
        Self { harness, element, bus, info: info.clone(), frame: 0 }
    }

    /// One that takes the steps of the thesis alone.
    fn thesis() -> Self {
        let mut detector = Self::new(&grey());
        detector.element.set_property_from_str("profile", "thesis");
        assert_eq!(detector.see(&[], 2), [None, None]);
        assert_eq!(detector.see(&[], 1), [Some(0)]);
        detector
    }

    /// One that has learned the empty picture and looks.
    fn learned(info: &VideoInfo) -> Self {
        let mut detector = Self::new(info);
        assert_eq!(detector.see(&[], 2), [None, None]);
        assert_eq!(detector.see(&[], 1), [Some(0)]);
        detector
    }

    fn buffer(&mut self, boxes: &[(u32, u32, u32, u32)]) -> gst::Buffer {
        let mut buffer = picture(&self.info, boxes);
        buffer.get_mut().unwrap().set_pts(STEP * self.frame);
        self.frame += 1;
        buffer
    }

    fn push(&mut self, buffer: gst::Buffer) -> gst::Buffer {
        self.harness.push_and_pull(buffer).unwrap()
    }

    /// How many regions each of `frames` frames with these boxes is said to have; `None` where nobody looked.
    fn see(&mut self, boxes: &[(u32, u32, u32, u32)], frames: usize) -> Vec<Option<usize>> {
        (0..frames)
            .map(|_| {
                let buffer = self.buffer(boxes);
                regions(&self.push(buffer))
            })
            .collect()
    }

    fn messages(&self) -> Vec<MotionMessage> {
        let messages = std::iter::from_fn(|| self.bus.pop_filtered(&[gst::MessageType::Element]));
        messages.map(|message| MotionMessage::from_structure(message.structure().unwrap()).unwrap()).collect()
    }

    fn changes(&self) -> Vec<MotionChange> {
        self.messages().into_iter().map(|message| message.change).collect()
    }

    fn warnings(&self) -> Vec<String> {
        let messages = std::iter::from_fn(|| self.bus.pop_filtered(&[gst::MessageType::Warning]));
        messages
            .map(|message| match message.view() {
                gst::MessageView::Warning(warning) => warning.error().to_string(),
                _ => unreachable!(),
            })
            .collect()
    }

    fn tracker(&mut self, state: TargetState) {
        self.harness.push_upstream_event(TrackerEvent { state, bounds: None }.to_event());
    }

    fn camera(&mut self, moving: bool) {
        self.harness.push_upstream_event(CameraEvent { moving, ..CameraEvent::default() }.to_event());
    }
}

fn regions(buffer: &gst::BufferRef) -> Option<usize> {
    let meta = MotionMeta::of(buffer)?.unwrap();
    let rois = buffer.iter_meta::<VideoRegionOfInterestMeta>();
    let motion = rois.filter(|roi| roi.roi_type() == MOTION_ROI).count();
    assert_eq!(motion, meta.regions.len());
    Some(meta.regions.len())
}

/// A dark picture with bright boxes, in any format.
fn picture(info: &VideoInfo, boxes: &[(u32, u32, u32, u32)]) -> gst::Buffer {
    let buffer = gst::Buffer::from_mut_slice(vec![80u8; info.size()]);
    let mut frame = gst_video::VideoFrame::from_buffer_writable(buffer, info).unwrap();
    let components = if info.is_rgb() { 3 } else { 1 };
    for component in 0..components {
        let (stride, step) = (frame.comp_stride(component) as usize, frame.comp_pstride(component) as usize);
        let (plane, first) = (frame.comp_plane(component), frame.comp_poffset(component) as usize);
        let data = frame.plane_data_mut(plane).unwrap();
        for &(x, y, width, height) in boxes {
            for y in y..y + height {
                for x in x..x + width {
                    data[y as usize * stride + first + x as usize * step] = 200;
                }
            }
        }
    }
    frame.into_buffer()
}

#[test]
fn stillness_is_reported_as_no_regions_and_no_messages() {
    let mut detector = Detector::learned(&grey());
    assert_eq!(detector.see(&[], 30), [Some(0); 30]);
    assert_eq!(detector.changes(), []);
}

#[test]
fn motion_is_reported_with_box_region_of_interest_and_messages() {
    let mut detector = Detector::learned(&grey());
    assert_eq!(detector.see(&[BOX], 1), [Some(0)]);
    let buffer = detector.buffer(&[BOX]);
    let seen = detector.push(buffer);
    let meta = MotionMeta::of(&seen).unwrap().unwrap();
    assert_eq!(meta.regions[0].bounds.to_pixels(160, 120), BOX);
    let roi = seen.iter_meta::<VideoRegionOfInterestMeta>().next().unwrap();
    assert_eq!((roi.roi_type(), roi.rect()), (MOTION_ROI, BOX));
    let [start] = detector.messages().try_into().unwrap();
    assert_eq!((start.change, start.regions), (MotionChange::Start, 1));
    assert_eq!(start.times.timestamp, seen.pts());
    assert_eq!(start.times.running_time, seen.pts());
    assert_eq!(start.bounds, Some(meta.regions[0].bounds));
    // What stays becomes background; motion ends a second after.
    detector.see(&[BOX], 60);
    assert_eq!(detector.changes(), [MotionChange::End]);
}

#[test]
fn a_walker_leaves_no_trail() {
    let mut detector = Detector::learned(&grey());
    for step in 0..8 {
        // As a camera slower than the stream has it: each picture twice.
        detector.see(&[(20 + step * 6, 30, 20, 40)], 2);
    }
    let buffer = detector.buffer(&[(68, 30, 20, 40)]);
    let seen = detector.push(buffer);
    let meta = MotionMeta::of(&seen).unwrap().unwrap();
    assert_eq!(meta.regions[0].bounds.to_pixels(160, 120), (68, 30, 20, 40));
}

#[test]
fn the_end_of_the_stream_ends_motion() {
    let mut detector = Detector::learned(&grey());
    detector.see(&[BOX], 3);
    assert_eq!(detector.changes(), [MotionChange::Start]);
    detector.harness.push_event(gst::event::Eos::new());
    let [end] = detector.messages().try_into().unwrap();
    assert_eq!((end.change, end.times.timestamp), (MotionChange::End, Some(STEP * 5)));
    // Nothing moved in another stream: nothing to end.
    let mut still = Detector::learned(&grey());
    still.harness.push_event(gst::event::Eos::new());
    assert_eq!(still.changes(), []);
}

#[test]
fn messages_can_be_switched_off() {
    let mut detector = Detector::learned(&grey());
    detector.element.set_property("post-messages", false);
    assert_eq!(detector.see(&[BOX], 3), [Some(0), Some(1), Some(1)]);
    assert_eq!(detector.changes(), []);
}

#[test]
fn every_format_is_looked_at_and_left_untouched() {
    for &format in FORMATS {
        let mut detector = Detector::learned(&info(format, 161, 121));
        detector.see(&[BOX], 1);
        let buffer = detector.buffer(&[BOX]);
        let before = buffer.map_readable().unwrap().to_vec();
        let seen = detector.push(buffer);
        assert_eq!(regions(&seen), Some(1), "{format}");
        assert_eq!(seen.map_readable().unwrap().as_slice(), before, "{format}");
        assert_eq!(seen.flags() & gst::BufferFlags::DISCONT, gst::BufferFlags::empty());
    }
}

#[test]
fn any_size_passes() {
    for (width, height) in [(1, 1), (2, 3), (16, 16), (17, 9), (641, 7), (4096, 2160)] {
        let mut detector = Detector::new(&info(VideoFormat::I420, width, height));
        assert_eq!(detector.see(&[], 3), [None, None, Some(0)], "{width}x{height}");
    }
}

#[test]
fn shared_buffers_are_not_copied() {
    let mut detector = Detector::learned(&grey());
    // As behind a tee: somebody else holds the buffer, too.
    let ours = detector.buffer(&[]);
    let theirs = ours.clone();
    let seen = detector.push(ours);
    assert_eq!(regions(&seen), Some(0));
    assert_eq!(regions(&theirs), None);
    let address = |buffer: &gst::BufferRef| buffer.map_readable().unwrap().as_ptr();
    assert_eq!(address(&seen), address(&theirs));
    assert_ne!(seen.as_ptr(), theirs.as_ptr());
}

#[test]
fn own_buffers_pass_as_they_are() {
    let mut detector = Detector::learned(&grey());
    let buffer = detector.buffer(&[]);
    let address = buffer.as_ptr();
    assert_eq!(detector.push(buffer).as_ptr(), address);
}

#[test]
fn the_thesis_sleeps_while_the_tracker_follows_and_relearns_when_it_ceases() {
    for (sleeping, waking) in
        [(TargetState::Tracking, TargetState::Lost), (TargetState::Occluded, TargetState::Searching)]
    {
        let mut detector = Detector::thesis();
        detector.tracker(sleeping);
        assert_eq!(detector.see(&[BOX], 4), [None; 4]);
        assert_eq!(detector.changes(), []);
        detector.tracker(waking);
        // The box is background by now, and found when it goes.
        assert_eq!(detector.see(&[BOX], 3), [None, None, Some(0)]);
        assert_eq!(detector.see(&[], 1), [Some(1)]);
    }
}

#[test]
fn looks_while_the_tracker_follows_and_the_camera_moves() {
    let mut detector = Detector::learned(&grey());
    detector.tracker(TargetState::Tracking);
    detector.camera(true);
    assert_eq!(detector.see(&[BOX], 3), [Some(0), Some(1), Some(1)]);
}

#[test]
fn a_target_that_stands_still_stays_foreground_where_it_is_seen() {
    let stands = |followed: Option<TargetState>| {
        let mut detector = Detector::learned(&grey());
        detector.see(&[BOX], 2);
        if let Some(state) = followed {
            let bounds = Some(Rect::from_pixels((35, 25, 30, 50), 160, 120));
            detector.harness.push_upstream_event(TrackerEvent { state, bounds }.to_event());
        }
        detector.see(&[BOX], 100)[99]
    };
    let states = [Some(TargetState::Tracking), Some(TargetState::Occluded), None];
    assert_eq!(states.map(stands), [Some(1), Some(0), Some(0)]);
}

#[test]
fn a_target_that_stands_still_and_is_not_seen_for_a_moment_stays_foreground() {
    let mut detector = Detector::learned(&grey());
    // Nothing becomes background there before it has been the same for six seconds.
    detector.see(&[], 100);
    for (state, pictures) in [(TargetState::Tracking, 80), (TargetState::Occluded, 30)] {
        let bounds = Some(Rect::from_pixels((35, 25, 30, 50), 160, 120));
        detector.harness.push_upstream_event(TrackerEvent { state, bounds }.to_event());
        assert_eq!(detector.see(&[BOX], pictures).last(), Some(&Some(1)), "{state:?}");
    }
}

#[test]
fn the_scene_travels_with_the_picture() {
    let mut detector = Detector::learned(&info(VideoFormat::I420, 160, 120));
    detector.see(&[BOX], 1);
    let buffer = detector.buffer(&[BOX]);
    let scene = SceneMeta::of(&detector.push(buffer)).unwrap().unwrap();
    assert_eq!(scene.from_pts, Some(STEP * 3));
    assert_eq!((scene.luma.width, scene.luma.height), (160, 120));
    assert!(scene.chroma.is_some());
    let at = |plane: &Plane, x: usize, y: usize| plane.pixels[y * 160 + x];
    assert_eq!([(50, 50), (100, 50)].map(|(x, y)| at(&scene.luma, x, y)), [200, 80]);
    assert_eq!([(50, 50), (100, 50)].map(|(x, y)| at(&scene.foreground, x, y)), [255, 0]);
    assert_eq!([(50, 50), (100, 50)].map(|(x, y)| at(&scene.background, x, y)), [80, 80]);
}

#[test]
fn a_tracker_that_searches_anyway_disturbs_nothing() {
    let mut detector = Detector::learned(&grey());
    detector.tracker(TargetState::Searching);
    assert_eq!(detector.see(&[], 1), [Some(0)]);
}

#[test]
fn events_travel_on_upstream() {
    let mut detector = Detector::learned(&grey());
    detector.tracker(TargetState::Tracking);
    detector.camera(true);
    let events: Vec<gst::Event> = std::iter::from_fn(|| detector.harness.try_pull_upstream_event()).collect();
    assert!(events.iter().any(|event| TrackerEvent::of(event).is_some()));
    assert!(events.iter().any(|event| CameraEvent::of(event).is_some()));
}

#[test]
fn the_thesis_does_not_look_while_the_camera_moves_and_pictures_settle() {
    let mut detector = Detector::thesis();
    detector.element.set_property("settle-time", STEP.nseconds() * 3);
    detector.camera(true);
    assert_eq!(detector.see(&[BOX], 3), [None; 3]);
    detector.camera(false);
    // Three to settle, two to learn.
    assert_eq!(detector.see(&[BOX], 6), [None, None, None, None, None, Some(0)]);
}

#[test]
fn zones_choose_where_to_look() {
    let mut detector = Detector::learned(&grey());
    detector.element.set_property("zones", "0.5,0 1,0 1,1 0.5,1");
    assert_eq!(detector.see(&[BOX], 3), [Some(0); 3]);
    let mut detector = Detector::learned(&grey());
    detector.element.set_property("exclude-zones", "0.5,0 1,0 1,1 0.5,1");
    assert_eq!(detector.see(&[BOX], 3), [Some(0), Some(1), Some(1)]);
}

/// Who is followed may go there.
#[test]
fn what_moves_outside_of_the_zones_is_told_apart() {
    let mut detector = Detector::learned(&grey());
    detector.element.set_property("zones", "0.5,0 1,0 1,1 0.5,1");
    detector.see(&[BOX], 2);
    let buffer = detector.buffer(&[BOX]);
    let meta = MotionMeta::of(&detector.push(buffer)).unwrap().unwrap();
    assert_eq!((meta.regions.len(), meta.outside.len()), (0, 1));
    assert_eq!(detector.changes(), []);
}

/// A wall of patches, seen by a camera that has turned by so many pixels, and somebody before it.
fn paint(buffer: &mut gst::BufferRef, turned: u32, walker: Option<u32>) {
    let patch = |x: u32, y: u32| (x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(2_246_822_519)) >> 13;
    let mut pixels = buffer.map_writable().unwrap();
    for (at, pixel) in (0_u32..).zip(pixels.iter_mut()) {
        let (x, y) = (at % 160, at / 160);
        let before = walker.is_some_and(|left| (left..left + 14).contains(&x) && (40..100).contains(&y));
        *pixel = if before { 230 } else { 40 + (patch((x + turned) / 6, y / 6) % 120) as u8 };
    }
}

#[test]
fn zones_go_with_the_background() {
    let mut detector = Detector::new(&grey());
    detector.element.set_property("zones", "0.5,0 1,0 1,1 0.5,1");
    let mut look = |turned: u32, walker: Option<u32>| {
        let mut buffer = detector.buffer(&[]);
        paint(buffer.get_mut().unwrap(), turned, walker);
        MotionMeta::of(&detector.push(buffer)).map(|meta| meta.unwrap())
    };
    for _ in 0..10 {
        look(0, None);
    }
    for turned in 1..=40 {
        look(2 * turned, None);
    }
    // The middle of the picture in which they were set lies at its left edge now.
    let seen: Vec<_> = (0..8).filter_map(|step| look(80, Some(30 + 2 * step))).collect();
    let last = seen.last().unwrap();
    assert_eq!((last.regions.len(), last.outside.len()), (1, 0), "{last:?}");
}

#[test]
fn zones_that_cannot_be_read_are_refused_with_a_warning() {
    let detector = Detector::learned(&grey());
    let good = "0,0 0.5,0 0.5,0.5";
    for property in ["zones", "exclude-zones"] {
        detector.element.set_property(property, good);
        assert_eq!(detector.warnings(), Vec::<String>::new());
        detector.element.set_property(property, "0,0 0.5,0 2,2");
        let [warning] = detector.warnings().try_into().unwrap();
        assert!(warning.contains("`2,2`") && warning.contains("separated by `;`"), "{warning}");
        assert_eq!(detector.element.property::<String>(property), good);
        detector.element.set_property(property, "");
        assert_eq!(detector.element.property::<String>(property), "");
    }
}

#[test]
fn new_caps_relearn() {
    let mut detector = Detector::learned(&grey());
    for format in [VideoFormat::Gray8, VideoFormat::Nv12, VideoFormat::Bgrx] {
        detector.info = info(format, 200, 150);
        detector.harness.set_src_caps(detector.info.to_caps().unwrap());
        assert_eq!(detector.see(&[], 3), [None, None, Some(0)], "{format}");
        assert_eq!(detector.see(&[BOX], 2), [Some(0), Some(1)], "{format}");
    }
}

#[test]
fn a_flush_relearns() {
    let mut detector = Detector::learned(&grey());
    detector.harness.push_event(gst::event::FlushStart::new());
    detector.harness.push_event(gst::event::FlushStop::new(true));
    detector.harness.push_event(gst::event::Segment::new(&gst::FormattedSegment::<gst::ClockTime>::new()));
    assert_eq!(detector.see(&[], 3), [None, None, Some(0)]);
}

/// An empty picture that does not follow on the one before.
fn see_discont(detector: &mut Detector) -> Option<usize> {
    let mut buffer = detector.buffer(&[]);
    buffer.get_mut().unwrap().set_flags(gst::BufferFlags::DISCONT);
    regions(&detector.push(buffer))
}

#[test]
fn an_interruption_relearns_where_it_was_long() {
    let mut detector = Detector::learned(&grey());
    let discont = |detector: &mut Detector, lost: u64| {
        detector.frame += lost;
        see_discont(detector)
    };
    // As a leaky queue marks it.
    assert_eq!(discont(&mut detector, 2), Some(0));
    assert_eq!(discont(&mut detector, 20), None);
    assert_eq!(detector.see(&[], 2), [None, Some(0)]);
    detector.element.set_property("max-gap", 0u64);
    assert_eq!(discont(&mut detector, 0), None);
}

#[test]
fn a_gap_relearns_where_it_was_long_and_holds_no_picture() {
    let mut detector = Detector::learned(&grey());
    let gap = gst::event::Gap::builder(STEP * detector.frame).duration(STEP * 20).build();
    detector.harness.push_event(gap);
    detector.frame += 20;
    assert_eq!(detector.see(&[], 3), [None, None, Some(0)]);
    // And one in place of what was lost is made up.
    for flag in [gst::BufferFlags::GAP, gst::BufferFlags::CORRUPTED] {
        let mut empty = detector.buffer(&[BOX]);
        empty.get_mut().unwrap().set_flags(flag);
        assert_eq!(regions(&detector.push(empty)), None);
        assert_eq!(detector.see(&[], 1), [Some(0)]);
    }
}

#[test]
fn another_stream_relearns_and_timestamps_that_are_of_no_use_do_not() {
    let mut detector = Detector::learned(&grey());
    detector.frame += 1000;
    assert_eq!(detector.see(&[], 1), [Some(0)]);
    for frame in [2000, 700, 1400, 100, 99, 98, 500] {
        detector.frame = frame;
        assert_eq!(detector.see(&[], 1), [Some(0)], "{frame}");
    }
    assert_eq!(detector.see(&[BOX], 2), [Some(0), Some(1)]);
    // Once they are in order again.
    detector.see(&[], 40);
    detector.frame = 0;
    assert_eq!(see_discont(&mut detector), None);
    assert_eq!(detector.see(&[], 2), [None, Some(0)]);
}

#[test]
fn frames_without_timestamps_are_looked_at() {
    init();
    let info =
        VideoInfo::builder(VideoFormat::Gray8, 160, 120).fps(gst::Fraction::new(0, 1)).build().unwrap();
    let mut detector = Detector::new(&info);
    let mut see = |boxes: &[_]| regions(&detector.push(picture(&info, boxes)));
    assert_eq!(
        [see(&[]), see(&[]), see(&[]), see(&[BOX]), see(&[BOX])],
        [None, None, Some(0), Some(0), Some(1)]
    );
    let [start] = detector.messages().try_into().unwrap();
    assert_eq!(start.times.timestamp, None);
}

#[test]
fn a_change_of_most_of_the_picture_is_no_motion() {
    let mut detector = Detector::learned(&grey());
    assert_eq!(detector.see(&[(0, 0, 160, 100)], 4), [Some(0); 4]);
    assert_eq!(detector.changes(), []);
}

#[test]
fn a_short_buffer_passes_unseen_with_one_warning() {
    let mut detector = Detector::learned(&grey());
    for _ in 0..3 {
        let seen = detector.push(gst::Buffer::with_size(10).unwrap());
        assert_eq!((regions(&seen), seen.size()), (None, 10));
    }
    assert_eq!(detector.warnings().len(), 1);
    assert_eq!(detector.see(&[], 1), [Some(0)]);
}

/// 255 pictures of 4K are 2 GB.
#[test]
fn a_window_of_too_much_memory_is_refused_with_its_size() {
    let mut detector = Detector::new(&info(VideoFormat::Gray8, 3840, 2160));
    for (property, value) in [("profile", "thesis"), ("test", "spread"), ("window", "255")] {
        detector.element.set_property_from_str(property, value);
    }
    assert_eq!(detector.see(&[], 3), [None; 3], "video goes on");
    let warnings = detector.warnings();
    assert!(matches!(&warnings[..], [warning] if warning.contains("3840x2160 are 2017 MB")), "{warnings:?}");
    detector.element.set_property("window", 4u32);
    assert_eq!(detector.see(&[], 3), [None, None, Some(0)]);
}

#[test]
fn all_regions_or_the_longest_contour() {
    let boxes = [BOX, (100, 20, 30, 60)];
    let mut detector = Detector::learned(&grey());
    detector.element.set_property_from_str("selection", "largest-perimeter");
    assert_eq!(detector.see(&boxes, 2), [Some(0), Some(1)]);
    detector.element.set_property_from_str("selection", "all");
    assert_eq!(detector.see(&boxes, 1), [Some(2)]);
    detector.element.set_property("min-area", 0.05);
    assert_eq!(detector.see(&boxes, 1), [Some(1)]);
}

#[test]
fn spread_test_finds_what_exceeds_the_noise() {
    let mut detector = Detector::thesis();
    detector.element.set_property_from_str("test", "spread");
    assert_eq!(detector.see(&[], 4), [Some(0); 4]);
    assert_eq!(detector.see(&[BOX], 1), [Some(1)]);
}

fn pixel(buffer: &gst::BufferRef, info: &VideoInfo, x: usize, y: usize) -> Vec<u8> {
    let frame = gst_video::VideoFrameRef::from_buffer_ref_readable(buffer, info).unwrap();
    let (stride, step) = (frame.plane_stride()[0] as usize, frame.comp_pstride(0) as usize);
    frame.plane_data(0).unwrap()[y * stride + x * step..][..step].to_vec()
}

#[test]
fn mask_shows_the_foreground_and_foreground_the_region() {
    for format in [VideoFormat::I420, VideoFormat::Gray8, VideoFormat::Rgba] {
        let boxes = [BOX, (100, 20, 30, 60)];
        let mut detector = Detector::new(&info(format, 161, 121));
        detector.element.set_property_from_str("output", "mask");
        detector.element.set_property_from_str("selection", "largest-perimeter");
        detector.see(&[], 3);
        let mask = info(VideoFormat::Gray8, 161, 121);
        let buffer = detector.buffer(&boxes);
        let seen = detector.push(buffer);
        let caps = detector.harness.sinkpad().unwrap().current_caps().unwrap();
        assert_eq!(VideoInfo::from_caps(&caps).unwrap().format(), VideoFormat::Gray8);
        let (pts, at) = (seen.pts(), [(50, 50), (110, 50), (80, 50)]);
        assert_eq!(pts, Some(STEP * 3));
        assert_eq!(at.map(|(x, y)| pixel(&seen, &mask, x, y)), [vec![255], vec![255], vec![0]], "{format}");
        assert_eq!(regions(&seen), Some(0));

        detector.element.set_property_from_str("output", "foreground");
        let buffer = detector.buffer(&boxes);
        let seen = detector.push(buffer);
        let rgba = info(VideoFormat::Rgba, 161, 121);
        assert_eq!(regions(&seen), Some(1));
        assert_eq!(at.map(|(x, y)| pixel(&seen, &rgba, x, y)[3]), [0, 255, 0], "{format}");
        let red = pixel(&seen, &rgba, 110, 50)[0];
        assert!(red > pixel(&seen, &rgba, 80, 50)[0] + 80, "{format}: {red}");

        detector.element.set_property_from_str("output", "frame");
        let buffer = detector.buffer(&boxes);
        let before = buffer.map_readable().unwrap().as_ptr();
        let seen = detector.push(buffer);
        assert_eq!(seen.map_readable().unwrap().as_ptr(), before);
        assert_eq!(regions(&seen), Some(1));
    }
}

#[test]
fn while_it_sleeps_the_mask_is_black() {
    let mut detector = Detector::new(&grey());
    detector.element.set_property_from_str("profile", "thesis");
    detector.element.set_property_from_str("output", "mask");
    detector.see(&[], 3);
    detector.see(&[BOX], 1);
    detector.tracker(TargetState::Tracking);
    let buffer = detector.buffer(&[BOX]);
    let seen = detector.push(buffer);
    assert!(seen.map_readable().unwrap().iter().all(|pixel| *pixel == 0));
}

#[test]
fn late_quality_of_service_drops_nothing() {
    let mut detector = Detector::learned(&grey());
    assert!(!detector.element.property::<bool>("qos"));
    let late = gst::event::Qos::new(gst::QOSType::Underflow, 5.0, 10_000_000_000i64, STEP * 100);
    detector.harness.push_upstream_event(late);
    assert_eq!(detector.see(&[], 3), [Some(0); 3]);
}

#[test]
fn every_property_has_a_blurb_and_may_change_while_playing() {
    init();
    let element = gst::ElementFactory::make("bgavgdetect").build().unwrap();
    let own = element.list_properties().into_iter().filter(|spec| spec.owner_type() == element.type_());
    for spec in own {
        assert!(spec.blurb().is_some_and(|blurb| blurb.len() > 10), "{}", spec.name());
        assert!(spec.flags().contains(gst::PARAM_FLAG_MUTABLE_PLAYING), "{}", spec.name());
    }
}

#[test]
fn starting_and_stopping_again_starts_afresh() {
    let mut detector = Detector::learned(&grey());
    for _ in 0..20 {
        detector.tracker(TargetState::Tracking);
        detector.element.set_state(gst::State::Null).unwrap();
        detector.element.set_state(gst::State::Playing).unwrap();
        detector.harness.push_event(gst::event::StreamStart::new("again"));
        detector.harness.set_src_caps(detector.info.to_caps().unwrap());
        assert_eq!(detector.see(&[], 3), [None, None, Some(0)]);
    }
}

#[test]
fn pipelines_of_the_documentation_run() {
    init();
    let docs = include_str!("../src/bgavgdetect/mod.rs");
    let lines: Vec<&str> = docs.lines().filter_map(|line| line.strip_prefix("//! gst-launch-1.0 ")).collect();
    assert_eq!(lines.len(), 5);
    for line in lines {
        let description = line.trim_start_matches("-m ").replace("autovideosink", "fakesink");
        let pipeline = gst::parse::launch(&description).unwrap_or_else(|error| panic!("{line}: {error}"));
        let bus = pipeline.bus().unwrap();
        pipeline.set_state(gst::State::Playing).unwrap();
        let mut started = false;
        loop {
            let message = bus.timed_pop(gst::ClockTime::from_seconds(60)).expect(line);
            match message.view() {
                gst::MessageView::Eos(_) => break,
                gst::MessageView::Error(error) => panic!("{line}: {error}"),
                gst::MessageView::Warning(warning) => panic!("{line}: {warning}"),
                gst::MessageView::Element(element) => {
                    started |= element.structure().is_some_and(|s| MotionMessage::from_structure(s).is_ok());
                }
                _ => (),
            }
        }
        pipeline.set_state(gst::State::Null).unwrap();
        assert!(started, "{line}: the ball was not found");
    }
}

#[test]
fn upstream_gets_what_downstream_proposes_where_frames_pass() {
    for (output, supported, gets) in
        [("frame", false, false), ("frame", true, true), ("mask", false, true), ("mask", true, true)]
    {
        init();
        let mut harness = Harness::new("bgavgdetect");
        harness.element().unwrap().set_property_from_str("output", output);
        if supported {
            harness.add_propose_allocation_meta(gst_video::VideoMeta::meta_api(), None);
            harness.add_propose_allocation_meta(gst_video::VideoCropMeta::meta_api(), None);
        }
        harness.set_src_caps(grey().to_caps().unwrap());
        harness.push_and_pull(picture(&grey(), &[])).unwrap();
        let mut query = gst::query::Allocation::new(Some(&grey().to_caps().unwrap()), false);
        assert!(harness.srcpad().unwrap().peer_query(&mut query));
        let has = query.find_allocation_meta::<gst_video::VideoMeta>().is_some();
        assert_eq!(has, gets, "{output} {supported}");
        let crop = query.find_allocation_meta::<gst_video::VideoCropMeta>();
        assert_eq!(crop, None, "pictures are looked at whole");
    }
}

#[test]
fn regions_that_another_detector_attached_are_replaced() {
    let mut detector = Detector::learned(&grey());
    detector.see(&[BOX], 1);
    let mut buffer = detector.buffer(&[BOX]);
    VideoRegionOfInterestMeta::add(buffer.get_mut().unwrap(), MOTION_ROI, (1, 2, 3, 4));
    VideoRegionOfInterestMeta::add(buffer.get_mut().unwrap(), "face", (5, 6, 7, 8));
    let seen = detector.push(buffer);
    let names = |seen: &gst::BufferRef| {
        seen.iter_meta::<VideoRegionOfInterestMeta>()
            .map(|roi| (roi.roi_type().to_owned(), roi.rect()))
            .collect::<Vec<_>>()
    };
    assert_eq!(names(&seen), [("face".to_owned(), (5, 6, 7, 8)), (MOTION_ROI.to_owned(), BOX)]);
}

#[test]
fn a_fault_in_every_other_frame_is_one_warning() {
    let mut detector = Detector::learned(&grey());
    for _ in 0..3 {
        detector.push(gst::Buffer::with_size(10).unwrap());
        detector.see(&[], 1);
    }
    assert_eq!(detector.warnings().len(), 1);
}

#[test]
fn drops_before_frames_without_timestamps_do_not_keep_it_learning() {
    let mut detector = Detector::new(&grey());
    let found: Vec<_> = (0..4)
        .map(|_| {
            let mut buffer = picture(&grey(), &[]);
            buffer.get_mut().unwrap().set_flags(gst::BufferFlags::DISCONT);
            regions(&detector.push(buffer))
        })
        .collect();
    assert_eq!(found, [None, None, Some(0), Some(0)]);
}

/// All that leaves a detector of these properties, told in words: caps, regions, messages. It is shown a walker beside a speck and a
/// large box, who all leave, a camera that moves and stops, and an interruption of one and a half seconds.
fn told(properties: &[(&str, &str)]) -> String {
    let mut detector = Detector::new(&grey());
    for (name, value) in properties {
        detector.element.set_property_from_str(name, value);
    }
    let mut told = String::new();
    for n in 0..60 {
        let x = 4 + 2 * n;
        let walker = [(x, 40, 20, 18), (x, 62, 20, 30), (120, 10, 3, 3), (10, 100, 60, 16)];
        match n {
            20 => detector.camera(true),
            22 => detector.camera(false),
            45 => detector.frame += 15,
            _ => (),
        }
        let boxes = if (10..40).contains(&n) { &walker[..] } else { &[] };
        let mut buffer = detector.buffer(boxes);
        if n == 45 {
            buffer.get_mut().unwrap().set_flags(gst::BufferFlags::DISCONT);
        }
        let buffer = detector.push(buffer);
        told += &format!("{:?} {:?}\n", buffer.size(), MotionMeta::of(&buffer).map(Result::unwrap));
    }
    told + &format!("{:?} {:?}", detector.messages(), detector.harness.sinkpad().unwrap().current_caps())
}

/// A property, another value, and what it counts with.
type Change = (&'static str, &'static str, &'static [(&'static str, &'static str)]);

/// A property that does nothing is a promise that is not kept.
#[test]
fn every_property_changes_something() {
    const THESIS: (&str, &str) = ("profile", "thesis");
    const SPREAD: &[(&str, &str)] = &[THESIS, ("test", "spread"), ("alpha", "0.05")];
    let changes: &[Change] = &[
        ("alpha", "0.02", &[THESIS]),
        ("analysis-width", "60", &[]),
        ("close-size", "41", &[]),
        ("confirm-frames", "7", &[]),
        ("end-delay", "0", &[]),
        ("exclude-zones", "0,0 0.5,0 0.5,1 0,1", &[]),
        ("max-area", "0.04", &[]),
        ("max-gap", "5000000000", &[]),
        ("min-area", "0.03", &[]),
        ("open-size", "25", &[]),
        ("output", "mask", &[]),
        ("post-messages", "false", &[]),
        ("profile", "thesis", &[]),
        ("selection", "largest-perimeter", &[]),
        ("settle-time", "0", &[THESIS]),
        ("spread-factor", "0.1", SPREAD),
        ("test", "spread", &[THESIS]),
        ("threshold", "0.9", &[THESIS]),
        ("warm-up", "12", &[]),
        ("window", "3", SPREAD),
        ("zones", "0,0 0.5,0 0.5,1 0,1", &[]),
    ];
    let own = |property: &&ParamSpec| property.owner_type().name() == "GstBgAvgDetect";
    let element = Detector::new(&grey()).element;
    let mut names: Vec<_> =
        element.list_properties().iter().filter(own).map(|property| property.name().to_owned()).collect();
    names.sort();
    let mut listed: Vec<_> = changes.iter().map(|(name, ..)| *name).collect();
    listed.sort_unstable();
    assert_eq!(names, listed, "a property is missing here");
    for (name, value, with) in changes {
        assert_ne!(told(with), told(&[*with, &[(*name, *value)]].concat()), "{name}={value} changes nothing");
    }
}
