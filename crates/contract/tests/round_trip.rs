// SPDX-License-Identifier: MPL-2.0

//! Whatever the contract writes it reads back, and what it cannot read it refuses by name.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use proptest::prelude::*;
use ptztrack_contract::*;

fn number() -> impl Strategy<Value = f64> {
    -10.0..10.0f64
}

prop_compose! {
    fn point()(x in number(), y in number()) -> Point { Point { x, y } }
}

prop_compose! {
    fn vector()(x in number(), y in number()) -> Vector { Vector { x, y } }
}

prop_compose! {
    fn rect()(x in number(), y in number(), width in 0.0..2.0f64, height in 0.0..2.0f64) -> Rect {
        Rect { x, y, width, height }
    }
}

fn track_state() -> impl Strategy<Value = TrackState> {
    prop::sample::select(vec![TrackState::Seen, TrackState::Shared, TrackState::Hidden])
}

prop_compose! {
    fn track()(
        id in any::<u64>(),
        bounds in rect(),
        velocity in vector(),
        state in track_state(),
        confidence in 0.0..=1.0f64,
        is_target in any::<bool>(),
    ) -> Track {
        Track { id, bounds, velocity, state, confidence, is_target }
    }
}

prop_compose! {
    fn region()(
        bounds in rect(),
        contour in prop::collection::vec(point(), 0..20),
        perimeter in number(),
        area in number(),
        centroid in point(),
    ) -> Region {
        Region { bounds, contour, perimeter, area, centroid }
    }
}

fn clock_time() -> impl Strategy<Value = gst::ClockTime> {
    (0..u64::MAX).prop_map(gst::ClockTime::from_nseconds)
}

fn release_reason() -> impl Strategy<Value = Option<ReleaseReason>> {
    prop::option::of(prop::sample::select(vec![
        ReleaseReason::Request,
        ReleaseReason::Stationary,
        ReleaseReason::MaxTrackingTime,
    ]))
}

fn target_state() -> impl Strategy<Value = TargetState> {
    prop::sample::select(vec![
        TargetState::Searching,
        TargetState::Tracking,
        TargetState::Occluded,
        TargetState::Lost,
    ])
}

prop_compose! {
    fn target()(
        state in target_state(),
        id in any::<u64>(),
        bounds in rect(),
        centroid in point(),
        velocity in vector(),
        ego_velocity in prop::option::of(vector()),
        ego_zoom in prop::option::of(number()),
        unchanged_for in prop::option::of(clock_time()),
        confidence in 0.0..1.0f64,
        features in prop::collection::vec((point(), any::<bool>()), 0..20),
        (aspect, is_group) in (prop::option::of(0.1..10.0f64), any::<bool>()),
        capture_time in prop::option::of(clock_time()),
    ) -> TargetMeta {
        let features = features.into_iter().map(|(position, kept)| Feature { position, kept }).collect();
        TargetMeta {
            state, id, bounds, is_group, centroid, velocity, ego_velocity, ego_zoom, unchanged_for, confidence, features, aspect,
            capture_time,
        }
    }
}

prop_compose! {
    fn times()(
        timestamp in prop::option::of(clock_time()),
        running_time in prop::option::of(clock_time()),
        stream_time in prop::option::of(clock_time()),
    ) -> Times {
        Times { timestamp, running_time, stream_time }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn motion_meta(
        regions in prop::collection::vec(region(), 0..4), outside in prop::collection::vec(region(), 0..3),
    ) {
        gst::init().unwrap();
        let meta = MotionMeta { regions, outside };
        let mut buffer = gst::Buffer::new();
        meta.attach(buffer.get_mut().unwrap()).unwrap();
        prop_assert_eq!(MotionMeta::of(&buffer).unwrap().unwrap(), meta);
    }

    #[test]
    fn target_meta(meta in target()) {
        gst::init().unwrap();
        let mut buffer = gst::Buffer::new();
        meta.attach(buffer.get_mut().unwrap()).unwrap();
        prop_assert_eq!(TargetMeta::of(&buffer).unwrap().unwrap(), meta);
    }

    #[test]
    fn tracks_meta(tracks in prop::collection::vec(track(), 0..4)) {
        gst::init().unwrap();
        let meta = TracksMeta { tracks };
        let mut buffer = gst::Buffer::new();
        meta.attach(buffer.get_mut().unwrap()).unwrap();
        prop_assert_eq!(TracksMeta::of(&buffer).unwrap().unwrap(), meta);
    }

    #[test]
    fn tracker_event(state in target_state(), bounds in prop::option::of(rect())) {
        gst::init().unwrap();
        let event = TrackerEvent { state, bounds };
        prop_assert_eq!(TrackerEvent::of(&event.to_event()).unwrap().unwrap(), event.clone());
        prop_assert!(CameraEvent::of(&event.to_event()).is_none());
    }

    #[test]
    fn camera_event(moving: bool, known in prop::option::of(number()), rate in number()) {
        gst::init().unwrap();
        let event = CameraEvent {
            moving,
            pan_deg: known,
            tilt_deg: known,
            pan_rate_deg_s: rate,
            tilt_rate_deg_s: -rate,
            horizontal_fov_deg: known,
            vertical_fov_deg: known,
        };
        prop_assert_eq!(CameraEvent::of(&event.to_event()).unwrap().unwrap(), event.clone());
        prop_assert!(TrackerEvent::of(&event.to_event()).is_none());
    }

    #[test]
    fn messages(times in times(), bounds in rect(), centroid in point(), velocity in vector(), id: u64,
                reason in release_reason()) {
        gst::init().unwrap();
        let motion = MotionMessage { change: MotionChange::Start, times, regions: 2, bounds: Some(bounds) };
        prop_assert_eq!(MotionMessage::from_structure(&motion.to_structure()).unwrap(), motion);
        let target = TargetMessage {
            change: TargetChange::Released, reason, times, state: TargetState::Searching, id, bounds, centroid,
            velocity, confidence: 0.5,
        };
        prop_assert_eq!(TargetMessage::from_structure(&target.to_structure()).unwrap(), target);
        let track = TrackMessage { change: TrackChange::Merged, times, id, into: Some(7) };
        prop_assert_eq!(TrackMessage::from_structure(&track.to_structure()).unwrap(), track);
        let camera = CameraMessage { change: CameraChange::AtLimit, times, detail: "pan 180°".into() };
        prop_assert_eq!(CameraMessage::from_structure(&camera.to_structure()).unwrap(), camera);
    }
}

fn plane(width: u32, height: u32, value: u8) -> Plane {
    Plane { width, height, pixels: glib::Bytes::from_owned(vec![value; (width * height) as usize]) }
}

fn scene() -> SceneMeta {
    let homography = Homography([[1.0, 0.1, 0.2], [-0.1, 1.0, 0.3], [0.01, 0.02, 1.0]]);
    SceneMeta {
        from_pts: Some(gst::ClockTime::from_mseconds(40)),
        camera_motion: Some(CameraMotion { homography, covariance: [0.1, 0.2, 0.3], inliers: 17 }),
        coasted_motion: None,
        luma: plane(4, 3, 1),
        chroma: Some([plane(4, 3, 2), plane(4, 3, 3)]),
        foreground: plane(4, 3, 4),
        background: plane(4, 3, 5),
    }
}

#[test]
fn scenes_travel_and_their_pixels_are_shared() {
    gst::init().unwrap();
    let unknown = SceneMeta { from_pts: None, camera_motion: None, chroma: None, ..scene() };
    let coasted = SceneMeta {
        camera_motion: None,
        coasted_motion: Some(Homography([[1.0, 0.0, 0.1], [0.0, 1.0, -0.2], [0.0, 0.0, 1.0]])),
        ..scene()
    };
    for meta in [scene(), unknown, coasted] {
        let mut buffer = gst::Buffer::new();
        meta.attach(buffer.get_mut().unwrap()).unwrap();
        let read = SceneMeta::of(&buffer.copy()).unwrap().unwrap();
        assert_eq!(read, meta);
        assert_eq!(read.luma.pixels.as_ptr(), meta.luma.pixels.as_ptr());
    }
}

#[test]
fn planes_that_do_not_fit_are_refused() {
    gst::init().unwrap();
    let refused = |meta: SceneMeta| {
        let mut buffer = gst::Buffer::new();
        meta.attach(buffer.get_mut().unwrap()).unwrap();
        SceneMeta::of(&buffer).unwrap().unwrap_err().to_string()
    };
    assert!(refused(SceneMeta { background: plane(5, 3, 0), ..scene() }).contains("(5, 3)"));
    let short = Plane { height: 4, ..plane(4, 3, 0) };
    assert!(refused(SceneMeta { foreground: short, ..scene() }).contains("12 bytes"));
}

#[test]
fn attaching_again_replaces() {
    gst::init().unwrap();
    let mut buffer = gst::Buffer::new();
    for id in [1, 2] {
        TargetMeta { id, ..Default::default() }.attach(buffer.get_mut().unwrap()).unwrap();
    }
    assert_eq!(TargetMeta::of(&buffer).unwrap().unwrap().id, 2);
    TargetMeta::detach(buffer.get_mut().unwrap());
    assert!(TargetMeta::of(&buffer).is_none());
}

#[test]
fn refusals_name_what_is_wrong() {
    gst::init().unwrap();
    let other = gst::Structure::new_empty("other");
    assert_eq!(
        MotionMessage::from_structure(&other),
        Err(ContractError::WrongName { expected: "ptztrack-motion", found: "other".into() })
    );
    let mut buffer = gst::Buffer::new();
    TargetMeta::default().attach(buffer.get_mut().unwrap()).unwrap();
    let mut spoil = |field: &str, value: glib::SendValue| {
        let buffer = buffer.get_mut().unwrap();
        let mut meta = gst::meta::CustomMeta::from_mut_buffer(buffer, TargetMeta::NAME).unwrap();
        meta.mut_structure().set_value(field, value);
        TargetMeta::of(buffer).unwrap().unwrap_err().to_string()
    };
    use gst::prelude::*;
    assert!(spoil("state", "dancing".to_send_value()).contains("dancing"));
    assert!(spoil("state", 3i32.to_send_value()).contains("`state`"));
}

#[test]
fn numbers_that_are_none_are_refused() {
    gst::init().unwrap();
    let event = CameraEvent { pan_rate_deg_s: f64::NAN, ..Default::default() }.to_event();
    assert!(matches!(CameraEvent::of(&event), Some(Err(ContractError::Value { .. }))));
}

#[test]
fn times_of_a_segment_that_started_late() {
    gst::init().unwrap();
    let mut segment = gst::FormattedSegment::<gst::ClockTime>::new();
    segment.set_start(gst::ClockTime::from_seconds(2));
    segment.set_time(gst::ClockTime::from_seconds(10));
    let times = Times::of(segment.upcast_ref(), Some(gst::ClockTime::from_seconds(5)));
    assert_eq!(times.running_time, Some(gst::ClockTime::from_seconds(3)));
    assert_eq!(times.stream_time, Some(gst::ClockTime::from_seconds(13)));
    assert_eq!(Times::of(segment.upcast_ref(), None), Times::default());
    assert_eq!(Times::of(&gst::Segment::new(), Some(gst::ClockTime::SECOND)).running_time, None);
}
