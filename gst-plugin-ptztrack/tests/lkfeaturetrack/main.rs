// SPDX-License-Identifier: MPL-2.0

//! `lkfeaturetrack` in a harness and in pipelines.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod bench;
mod giving_up;
mod properties;

use bench::*;
use gst::prelude::*;
use gst_check::Harness;
use gst_video::{NavigationEvent, VideoRegionOfInterestMeta};
use gstptztrack::luma_source::FORMATS;
use ptztrack_contract::{
    BufferMeta, CameraEvent, MotionMeta, Rect, Region, ReleaseReason, TARGET_ROI, TargetChange,
    TargetMessage, TargetMeta, TargetState, TrackChange, TrackMessage, TracksMeta,
};

#[test]
fn a_walking_person_is_followed() {
    let mut bench = Bench::new(|_| ());
    let meta = bench.acquire((60, 80));
    assert_box_at(&meta, (60, 80));
    let mut last = meta;
    for step in 1..=40 {
        let place = (60 + 3 * step, 80 + step / 4);
        let out = bench.push_through(picture(Some(place), None), &[]);
        let roi = out.iter_meta::<VideoRegionOfInterestMeta>().find(|roi| roi.roi_type() == TARGET_ROI);
        assert!(roi.is_some());
        last = TargetMeta::of(&out).unwrap().unwrap();
        assert_eq!((last.state, last.id), (TargetState::Tracking, 1), "step {step}");
        assert_box_at(&last, place);
    }
    // 3 pixels in 40 ms, to the right.
    assert!((last.velocity.x - 3.0 / 320.0 / 0.04).abs() < 0.05, "{:?}", last.velocity);
    assert!(last.ego_velocity.is_some_and(|ego| ego.x.abs() < 0.01 && ego.y.abs() < 0.01));
    assert!(last.confidence > 0.5 && last.features.iter().any(|feature| feature.kept));
    assert_eq!(last.capture_time, Some(gst::ClockTime::from_mseconds(42 * FRAME_MS)));
    let messages = bench.messages();
    assert_eq!(messages.len(), 1);
    assert_eq!((messages[0].change, messages[0].id), (TargetChange::Acquired, 1));
    assert_eq!(messages[0].times.running_time, Some(gst::ClockTime::from_mseconds(2 * FRAME_MS)));
    assert_eq!(bench.events(), [TargetState::Tracking]);
}

#[test]
fn nothing_to_follow_is_silence() {
    let mut bench = Bench::new(|_| ());
    for step in 0..20 {
        let meta = bench.push(picture(Some((60 + 3 * step, 80)), None), &[("motion", (9, 9, 0, 0))]);
        assert_eq!(meta.state, TargetState::Searching);
    }
    assert_eq!((bench.changes(), bench.events()), (vec![], vec![]));
}

#[test]
fn the_contour_of_the_motion_meta_is_used() {
    let mut bench = Bench::new(|_| ());
    let mut last = None;
    let mut bounds = Rect::default();
    for x in [50, 55, 60] {
        bounds = Rect::from_pixels((x, 80, 32, 72), 320, 240);
        let mut buffer = gst::Buffer::from_mut_slice(picture(Some((x as i32, 80)), None));
        let region = Region { bounds, contour: vec![bounds.centre(); 3], ..Region::default() };
        let whole = Region { contour: Vec::new(), ..region.clone() };
        // The contour of the first has no area, so no corner; the largest is taken, and it is the second.
        let small = Region { bounds: Rect { width: bounds.width / 2.0, ..bounds }, ..region };
        MotionMeta { regions: vec![small, whole], ..MotionMeta::default() }
            .attach(buffer.get_mut().unwrap())
            .unwrap();
        let out = bench.harness.push_and_pull(buffer).unwrap();
        last = TargetMeta::of(&out).map(Result::unwrap);
    }
    let last = last.unwrap();
    assert_eq!(last.state, TargetState::Tracking);
    assert!((last.bounds.width - bounds.width).abs() < 1e-6);
}

#[test]
fn leaving_the_frame_is_a_loss() {
    let mut bench = Bench::new(|element| element.set_property("coast-time", 0_u64));
    bench.acquire((230, 80));
    let states: Vec<_> =
        (1..40).map(|step| bench.push(picture(Some((230 + 4 * step, 80)), None), &[]).state).collect();
    assert_eq!(states.iter().filter(|state| **state == TargetState::Lost).count(), 1);
    assert_eq!(states.last(), Some(&TargetState::Searching));
    assert_eq!(bench.changes(), [TargetChange::Acquired, TargetChange::Lost]);
    assert_eq!(bench.events(), [TargetState::Tracking, TargetState::Lost, TargetState::Searching]);
}

#[test]
fn behind_a_wall_and_back() {
    let mut bench = Bench::new(|_| ());
    bench.acquire((30, 80));
    let mut metas = Vec::new();
    for step in 1..=70 {
        let place = (30 + 3 * step, 80);
        metas.push(bench.push(picture(Some(place), Some(120..180)), &[]));
    }
    let states: Vec<_> = metas.iter().map(|meta| meta.state).collect();
    assert!(states.contains(&TargetState::Occluded), "{states:?}");
    let last = metas.last().unwrap();
    assert_eq!((last.state, last.id), (TargetState::Tracking, 1), "{states:?}");
    assert_box_at(last, (240, 80));
    assert_eq!(bench.changes(), [TargetChange::Acquired, TargetChange::Occluded, TargetChange::Reacquired]);
}

#[test]
fn never_back_is_a_loss_after_the_coast_time() {
    let mut bench = Bench::new(|element| element.set_property("coast-time", 400_000_000_u64));
    bench.acquire((100, 80));
    let states: Vec<_> = (0..30).map(|_| bench.push(picture(None, None), &[]).state).collect();
    let hidden = states.iter().filter(|state| **state == TargetState::Occluded).count();
    assert!((9..=12).contains(&hidden), "{states:?}");
    assert_eq!(bench.changes(), [TargetChange::Acquired, TargetChange::Occluded, TargetChange::Lost]);
}

#[test]
fn any_detector_will_do() {
    let mut bench = Bench::new(|element| element.set_property("roi-type", "person"));
    let mut states = Vec::new();
    for _ in 0..4 {
        let others = [("car", (10, 10, 120, 100)), ("person", (60, 80, 32, 72))];
        states.push(bench.push(picture(Some((60, 80)), None), &others));
    }
    let last = states.last().unwrap();
    assert_eq!(last.state, TargetState::Tracking);
    assert_box_at(last, (60, 80));
}

#[test]
fn a_detector_that_looks_at_every_fourth_frame_will_do() {
    let mut bench = Bench::new(|element| element.set_property("roi-type", "person"));
    let mut state = None;
    for frame in 0..12 {
        let seen = [("person", (60, 80, 32, 72))];
        let seen = if frame % 4 == 0 { &seen[..] } else { &[] };
        state = Some(bench.push(picture(Some((60, 80)), None), seen).state);
    }
    assert_eq!(state, Some(TargetState::Tracking));
}

#[test]
fn clicks_select_and_release() {
    let mut bench = Bench::new(|element| element.set_property_from_str("selection", "manual"));
    for _ in 0..5 {
        assert_eq!(bench.detected((60, 80)).state, TargetState::Searching);
    }
    let click = |bench: &mut Bench, button, x, y| {
        bench.harness.push_upstream_event(NavigationEvent::new_mouse_button_press(button, x, y).build());
    };
    click(&mut bench, 1, 76.0, 110.0);
    let meta = bench.detected((60, 80));
    assert_eq!(meta.state, TargetState::Tracking);
    assert_box_at(&meta, (60, 80));
    click(&mut bench, 3, 0.0, 0.0);
    assert_eq!(bench.detected((60, 80)).state, TargetState::Searching);
    assert_eq!(bench.detected((60, 80)).state, TargetState::Searching);
    assert_eq!(bench.changes(), [TargetChange::Acquired, TargetChange::Released]);
}

#[test]
fn an_application_selects_and_releases() {
    let mut bench = Bench::new(|element| {
        element.set_property_from_str("selection", "manual");
        element.set_property("manual-size", 0.3);
    });
    bench.push(picture(Some((60, 80)), None), &[]);
    let element = bench.harness.element().unwrap();
    element.emit_by_name::<()>("select-target", &[&2.0, &f64::NAN]);
    assert_eq!(bench.push(picture(Some((60, 80)), None), &[]).state, TargetState::Searching);
    element.emit_by_name::<()>("select-target", &[&(76.0 / 320.0), &(116.0 / 240.0)]);
    let meta = bench.push(picture(Some((60, 80)), None), &[]);
    assert_eq!(meta.state, TargetState::Tracking);
    assert!((meta.bounds.height - 0.3).abs() < 1e-6 && meta.bounds.contains(meta.centroid));
    element.emit_by_name::<()>("release-target", &[]);
    assert_eq!(bench.push(picture(Some((60, 80)), None), &[]).state, TargetState::Searching);
}

/// It may be about what was seen before a stop, minutes ago.
#[test]
fn what_is_asked_for_before_the_start_is_forgotten_and_before_the_first_picture_it_is_not() {
    init();
    for started in [false, true] {
        let element = gst::ElementFactory::make("lkfeaturetrack").build().unwrap();
        element.set_property_from_str("selection", "manual");
        let select = || element.emit_by_name::<()>("select-target", &[&(76.0 / 320.0), &(116.0 / 240.0)]);
        if !started {
            select();
        }
        // Starts it.
        let harness = Harness::with_element(&element, Some("sink"), Some("src"));
        if started {
            select();
        }
        let state = Bench::of(harness).push(picture(Some((60, 80)), None), &[]).state;
        let expected = if started { TargetState::Tracking } else { TargetState::Searching };
        assert_eq!(state, expected, "asked for after the start: {started}");
    }
}

/// Two who stand there, and what the bus hears of them.
const TWO: [Seen; 2] = [("motion", (60, 80, 32, 72)), ("motion", (200, 80, 32, 72))];

fn track_messages(bench: &Bench) -> Vec<(TrackChange, u64)> {
    let messages = bench.bus.iter();
    let read = messages.filter_map(|message| TrackMessage::from_structure(message.structure()?).ok());
    read.map(|message| (message.change, message.id)).collect()
}

#[test]
fn everybody_is_told_of_and_whoever_is_asked_for_is_followed() {
    let mut bench = Bench::new(|element| {
        element.set_property_from_str("selection", "manual");
        element.set_property("post-tracks", true);
    });
    let mut tracks = TracksMeta::default();
    let mut see = |bench: &mut Bench| {
        let out = bench.push_through(street(0, [(60, 80), (200, 80)]), &TWO);
        tracks = TracksMeta::of(&out).expect("a meta on every frame").expect("readable");
        let targets: Vec<_> = tracks.tracks.iter().filter(|track| track.is_target).collect();
        assert!(targets.len() <= 1);
        (TargetMeta::of(&out).unwrap().unwrap().id, tracks.tracks.len())
    };
    for _ in 0..3 {
        see(&mut bench);
    }
    assert_eq!(see(&mut bench), (0, 2));
    assert_eq!(track_messages(&bench), [(TrackChange::New, 1), (TrackChange::New, 2)]);
    let element = bench.harness.element().unwrap();
    element.emit_by_name::<()>("select-track", &[&2_u64]);
    assert_eq!(see(&mut bench), (2, 2));
    element.emit_by_name::<()>("next-target", &[]);
    assert_eq!(see(&mut bench), (1, 2));
    bench.harness.push_upstream_event(NavigationEvent::new_key_press("n").build());
    assert_eq!(see(&mut bench), (2, 2));
    bench.harness.push_upstream_event(NavigationEvent::new_key_press("1").build());
    assert_eq!(see(&mut bench), (1, 2));
    element.emit_by_name::<()>("select-track", &[&7_u64]);
    assert_eq!(see(&mut bench), (1, 2), "there is nobody of that number");
    let warnings = std::iter::from_fn(|| bench.bus.pop_filtered(&[gst::MessageType::Warning])).count();
    assert_eq!(warnings, 1);
}

#[test]
fn who_is_released_for_another_is_told_of_as_themselves() {
    let mut bench = Bench::new(|element| element.set_property_from_str("selection", "manual"));
    let see = |bench: &mut Bench| drop(bench.push_through(street(0, [(60, 80), (200, 80)]), &TWO));
    (0..4).for_each(|_| see(&mut bench));
    for number in [1_u64, 2] {
        bench.harness.element().unwrap().emit_by_name::<()>("select-track", &[&number]);
        see(&mut bench);
    }
    let messages = bench.bus.iter();
    let read = messages.filter_map(|message| TargetMessage::from_structure(message.structure()?).ok());
    let told: Vec<_> =
        read.map(|said| (said.change, said.id, said.state, said.reason, said.bounds.x < 0.5)).collect();
    let (tracking, searching) = (TargetState::Tracking, TargetState::Searching);
    assert_eq!(
        told,
        [
            (TargetChange::Acquired, 1, tracking, None, true),
            (TargetChange::Released, 1, searching, Some(ReleaseReason::Request), true),
            (TargetChange::Acquired, 2, tracking, None, false),
        ]
    );
}

/// Two people who go apart: what is told of the target.
fn targets_of_two_who_part(selection: &str) -> Vec<TargetMeta> {
    let mut bench = Bench::new(|element| element.set_property_from_str("selection", selection));
    let targets = (0..50).map(|n| {
        let places = [(130 - 2 * n, 100), (160 + 2 * n, 100)];
        let (width, height) = (PERSON.0 as u32, PERSON.1 as u32);
        let seen = places.map(|(x, y)| ("motion", (x as u32, y as u32, width, height)));
        bench.push(street(0, places), &seen)
    });
    targets.collect()
}

#[test]
fn a_group_is_followed_in_one_box() {
    let sides = |meta: &TargetMeta| {
        [meta.bounds.x, meta.bounds.x + meta.bounds.width].map(|side| side * WIDTH as f64)
    };
    let both = &targets_of_two_who_part("group")[49];
    let [left, right] = sides(both);
    assert!((left - 32.0).abs() < 12.0 && (right - 290.0).abs() < 12.0 && both.is_group, "{left} {right}");
    let one = &targets_of_two_who_part("largest")[49];
    let [left, right] = sides(one);
    assert!(right - left < 60.0 && !one.is_group, "{left} {right}");
}

#[test]
fn who_comes_and_goes_is_told_of_only_where_that_is_asked_for() {
    let mut bench = Bench::new(|_| ());
    bench.acquire((60, 80));
    assert_eq!(track_messages(&bench), []);
}

#[test]
fn what_was_released_is_not_taken_again_at_once() {
    let mut bench = Bench::new(|_| ());
    bench.acquire((60, 80));
    bench.harness.element().unwrap().emit_by_name::<()>("release-target", &[]);
    for _ in 0..20 {
        assert_eq!(bench.detected((60, 80)).state, TargetState::Searching);
    }
}

#[test]
fn positions_are_reported_at_the_interval() {
    let mut bench = Bench::new(|element| element.set_property("message-interval", 200_000_000_u64));
    bench.acquire((60, 80));
    for _ in 0..20 {
        bench.push(picture(Some((60, 80)), None), &[]);
    }
    let positions = bench.changes().into_iter().filter(|change| *change == TargetChange::Position).count();
    assert_eq!(positions, 4);
}

#[test]
fn another_size_loses_the_target_and_video_goes_on() {
    let mut bench = Bench::new(|_| ());
    bench.acquire((60, 80));
    bench.harness.set_src_caps_str("video/x-raw,format=GRAY8,width=17,height=9,framerate=25/1");
    let meta = bench.push(vec![80; 20 * 9], &[]);
    assert_eq!(meta.state, TargetState::Lost);
    assert_eq!(bench.push(vec![80; 20 * 9], &[]).state, TargetState::Searching);
    assert_eq!(bench.changes(), [TargetChange::Acquired, TargetChange::Lost]);
}

#[test]
fn a_seek_loses_the_target() {
    let mut bench = Bench::new(|_| ());
    bench.acquire((60, 80));
    bench.harness.push_event(gst::event::FlushStart::new());
    bench.harness.push_event(gst::event::FlushStop::new(true));
    bench.harness.push_event(gst::event::Segment::new(&gst::FormattedSegment::<gst::ClockTime>::new()));
    assert_eq!(bench.push(picture(None, None), &[]).state, TargetState::Lost);
}

#[test]
fn frames_without_timestamps_are_followed_too() {
    let mut bench = Bench::new(|_| ());
    let mut last = None;
    for step in 0..20 {
        let place = (60 + 2 * step, 80);
        let mut buffer = gst::Buffer::from_mut_slice(picture(Some(place), None));
        let bounds = (place.0 as u32, 80, PERSON.0 as u32, PERSON.1 as u32);
        VideoRegionOfInterestMeta::add(buffer.get_mut().unwrap(), "motion", bounds);
        let out = bench.harness.push_and_pull(buffer).unwrap();
        last = TargetMeta::of(&out).map(Result::unwrap);
    }
    let last = last.unwrap();
    assert_eq!((last.state, last.capture_time), (TargetState::Tracking, None));
    // By the caps, a frame takes 40 ms.
    assert!((last.velocity.x - 2.0 / 320.0 / 0.04).abs() < 0.06, "{:?}", last.velocity);
}

/// A network holds every third picture back until the next two are there.
#[test]
fn who_walks_does_not_run_where_pictures_come_bunched() {
    let mut bench = Bench::new(|_| ());
    bench.acquire((60, 80));
    (1..=20).for_each(|step| drop(bench.push(picture(Some((60 + 2 * step, 80)), None), &[])));
    let begin = bench.frames * FRAME_MS;
    for step in 21..=80 {
        let (bunch, place) = ((step - 21) / 3, (step - 21) % 3);
        let arrived = begin + (3 * bunch + 2) as u64 * FRAME_MS + place as u64;
        let mut buffer = gst::Buffer::from_mut_slice(street(step - 20, [(80 + step as i32, 80)]));
        buffer.get_mut().unwrap().set_pts(gst::ClockTime::from_mseconds(arrived));
        let seen = TargetMeta::of(&bench.harness.push_and_pull(buffer).unwrap()).unwrap().unwrap();
        let fastest = seen.ego_velocity.map(|ego| ego.x.abs().max(seen.velocity.x.abs()));
        // A pixel in 40 ms.
        assert!(fastest.is_some_and(|fastest| fastest < 2.0 / 320.0 / 0.04), "step {step}: {seen:?}");
    }
}

#[test]
fn pixels_pass_untouched_and_uncopied() {
    let mut bench = Bench::new(|_| ());
    bench.acquire((60, 80));
    let pixels = picture(Some((62, 80)), None);
    let buffer = gst::Buffer::from_slice(pixels.clone());
    let shared = buffer.clone();
    let out = bench.harness.push_and_pull(buffer).unwrap();
    assert_eq!(out.peek_memory(0).as_ptr(), shared.peek_memory(0).as_ptr());
    assert_eq!(out.map_readable().unwrap().as_slice(), pixels);
}

#[test]
fn every_format_and_size_is_survived() {
    init();
    for &format in FORMATS {
        for (width, height) in [(1, 1), (16, 16), (33, 17), (321, 241)] {
            survives(format, width, height);
        }
    }
    survives(gst_video::VideoFormat::I420, 4096, 2160);
}

fn survives(format: gst_video::VideoFormat, width: u32, height: u32) {
    let mut harness = Harness::new("lkfeaturetrack");
    let info = gst_video::VideoInfo::builder(format, width, height).build().unwrap();
    harness.set_src_caps(info.to_caps().unwrap());
    harness.element().unwrap().set_property("confirm-frames", 1_u32);
    for frame in 0..3_usize {
        let bytes = (0..info.size()).map(|index| texture(frame, index, index / 640)).collect::<Vec<_>>();
        let mut buffer = gst::Buffer::from_mut_slice(bytes);
        let bounds = (width / 5, height / 5, width / 2, height / 2);
        VideoRegionOfInterestMeta::add(buffer.get_mut().unwrap(), "motion", bounds);
        let out = harness.push_and_pull(buffer).unwrap();
        TargetMeta::of(&out).expect("a meta on every frame").expect("readable");
    }
}

#[test]
fn the_pipelines_of_the_documentation_run() {
    init();
    let pipelines: Vec<_> = include_str!("../../src/lkfeaturetrack/mod.rs")
        .lines()
        .filter_map(|line| line.strip_prefix("//! gst-launch-1.0 "))
        .map(|line| line.trim_start_matches("-m "))
        .collect();
    assert_eq!(pipelines.len(), 5);
    for description in pipelines {
        let pipeline = gst::parse::launch(description).expect(description);
        pipeline.set_state(gst::State::Playing).unwrap();
        let message = pipeline.bus().unwrap().timed_pop_filtered(
            gst::ClockTime::from_seconds(60),
            &[gst::MessageType::Eos, gst::MessageType::Error, gst::MessageType::Warning],
        );
        pipeline.set_state(gst::State::Null).unwrap();
        assert_eq!(message.map(|message| message.type_()), Some(gst::MessageType::Eos), "{description}");
    }
}

#[test]
fn news_of_the_camera_travel_on_to_the_detector() {
    let mut bench = Bench::new(|_| ());
    bench.harness.push_upstream_event(CameraEvent { moving: true, ..CameraEvent::default() }.to_event());
    let events: Vec<_> = std::iter::from_fn(|| bench.harness.try_pull_upstream_event()).collect();
    let moving = events.iter().filter_map(|event| CameraEvent::of(event)?.ok()).map(|event| event.moving);
    assert_eq!(moving.collect::<Vec<_>>(), [true]);
}

#[test]
fn the_detector_is_woken_when_the_tracker_stops() {
    let mut bench = Bench::new(|_| ());
    bench.acquire((60, 80));
    bench.harness.element().unwrap().set_state(gst::State::Null).unwrap();
    assert_eq!(bench.events(), [TargetState::Tracking, TargetState::Searching]);
    let mut idle = Bench::new(|_| ());
    idle.detected((60, 80));
    idle.harness.element().unwrap().set_state(gst::State::Null).unwrap();
    assert_eq!(idle.events(), []);
}

#[test]
fn a_gap_holds_no_picture_and_loses_nothing() {
    let mut bench = Bench::new(|_| ());
    bench.acquire((60, 80));
    // One in place of what was lost is made up.
    for flag in [gst::BufferFlags::GAP, gst::BufferFlags::CORRUPTED] {
        let mut gap = gst::Buffer::from_mut_slice(picture(None, None));
        gap.get_mut().unwrap().set_flags(flag);
        gap.get_mut().unwrap().set_pts(gst::ClockTime::from_mseconds(bench.frames * FRAME_MS));
        bench.frames += 1;
        let out = bench.harness.push_and_pull(gap).unwrap();
        assert!(out.flags().contains(flag));
        assert!(TargetMeta::of(&out).is_none());
    }
    assert_eq!(bench.detected((62, 80)).state, TargetState::Tracking);
    assert_eq!(bench.changes(), [TargetChange::Acquired]);
}

#[test]
fn a_frame_that_cannot_be_read_loses_nothing_and_is_one_warning() {
    let mut bench = Bench::new(|_| ());
    bench.acquire((60, 80));
    for _ in 0..3 {
        let out = bench.push_through(vec![0; 10], &[]);
        assert_eq!(out.size(), 10);
        assert!(TargetMeta::of(&out).is_none());
    }
    let warnings = std::iter::from_fn(|| bench.bus.pop_filtered(&[gst::MessageType::Warning])).count();
    assert_eq!(warnings, 1);
    assert_eq!(bench.detected((60, 80)).state, TargetState::Tracking);
    assert_eq!(bench.events(), [TargetState::Tracking]);
}

#[test]
fn a_target_that_another_tracker_attached_is_replaced() {
    let mut bench = Bench::new(|_| ());
    bench.acquire((60, 80));
    let out = bench.push_through(picture(Some((60, 80)), None), &[("target", (1, 2, 3, 4))]);
    let targets: Vec<_> = out
        .iter_meta::<VideoRegionOfInterestMeta>()
        .filter(|region| region.roi_type() == "target")
        .map(|region| region.rect())
        .collect();
    assert_eq!(targets.len(), 1);
    assert_ne!(targets[0], (1, 2, 3, 4));
}

#[test]
fn no_name_of_detections_is_none() {
    let mut bench = Bench::new(|element| element.set_property("roi-type", None::<String>));
    for _ in 0..4 {
        assert_eq!(bench.detected((60, 80)).state, TargetState::Searching);
    }
}

#[test]
fn upstream_gets_what_downstream_proposes() {
    for supported in [false, true] {
        init();
        let mut harness = Harness::new("lkfeaturetrack");
        if supported {
            harness.add_propose_allocation_meta(gst_video::VideoMeta::meta_api(), None);
            harness.add_propose_allocation_meta(gst_video::VideoCropMeta::meta_api(), None);
        }
        harness.set_src_caps_str("video/x-raw,format=GRAY8,width=320,height=240,framerate=25/1");
        harness.push_and_pull(gst::Buffer::from_mut_slice(picture(None, None))).unwrap();
        let caps = harness.srcpad().unwrap().current_caps().unwrap();
        let mut query = gst::query::Allocation::new(Some(&caps), false);
        assert!(harness.srcpad().unwrap().peer_query(&mut query));
        assert_eq!(query.find_allocation_meta::<gst_video::VideoMeta>().is_some(), supported);
        let crop = query.find_allocation_meta::<gst_video::VideoCropMeta>();
        assert_eq!(crop, None, "pictures are looked at whole");
    }
}
