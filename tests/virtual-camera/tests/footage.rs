// SPDX-License-Identifier: MPL-2.0

//! The footage world, with recordings made on the spot.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::{path::PathBuf, time::Duration};

use common::settings;
use gst::prelude::*;
use virtual_camera::{
    Clock, Error, FootageError, FootageSettings, Pose, Settings, VirtualCamera, World, project,
};

/// Twenty pictures at ten a second, in a file of this name.
fn recording(name: &str, encoder_and_muxer: &str) -> PathBuf {
    gst::init().unwrap();
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let pipeline = gst::parse::launch(&format!(
        "videotestsrc num-buffers=20 pattern=smpte ! video/x-raw,format=I420,width=320,height=240,framerate=10/1 \
         ! {encoder_and_muxer} ! filesink name=file"
    ))
    .unwrap()
    .downcast::<gst::Pipeline>()
    .unwrap();
    pipeline.by_name("file").unwrap().set_property("location", &path);
    pipeline.set_state(gst::State::Playing).unwrap();
    let end = pipeline.bus().unwrap().timed_pop_filtered(
        gst::ClockTime::from_seconds(30),
        &[gst::MessageType::Eos, gst::MessageType::Error],
    );
    pipeline.set_state(gst::State::Null).unwrap();
    assert_eq!(end.unwrap().type_(), gst::MessageType::Eos);
    path
}

fn looking_at(footage: FootageSettings) -> Settings {
    Settings { world: World::Footage(footage), video: Default::default(), ..settings() }
}

/// A snapshot's luma at a place, by decoding it.
fn snapshot(camera: &VirtualCamera) -> (gst_video::VideoInfo, gst::Buffer) {
    let url = format!("{}/axis-cgi/jpg/image.cgi", camera.url());
    let launch = format!(
        "souphttpsrc location={url} ! jpegdec ! videoconvert ! video/x-raw,format=GRAY8 ! appsink name=sink"
    );
    let pipeline = gst::parse::launch(&launch).unwrap().downcast::<gst::Pipeline>().unwrap();
    let sink = pipeline.by_name("sink").and_downcast::<gst_app::AppSink>().unwrap();
    pipeline.set_state(gst::State::Playing).unwrap();
    let sample = sink.try_pull_sample(gst::ClockTime::from_seconds(30)).unwrap();
    pipeline.set_state(gst::State::Null).unwrap();
    let info = gst_video::VideoInfo::from_caps(sample.caps().unwrap()).unwrap();
    (info, sample.buffer_owned().unwrap())
}

#[test]
fn every_common_container_can_be_looked_around_in() {
    for (name, encoder_and_muxer) in [
        ("jpeg.avi", "jpegenc ! avimux"),
        ("h264.mp4", "x264enc ! mp4mux"),
        ("h264.mkv", "x264enc ! matroskamux"),
        ("h264.ts", "x264enc ! mpegtsmux"),
    ] {
        let footage = FootageSettings::new(recording(name, encoder_and_muxer));
        let camera = VirtualCamera::start(Settings { clock: Clock::Stepped, ..looking_at(footage) }).unwrap();
        let (info, _) = snapshot(&camera);
        // 640 wide, of the recording's shape.
        assert_eq!((info.width(), info.height()), (640, 480), "{name}");
        let limits = camera.limits();
        assert!(limits.pan_deg.1 > 10.0 && limits.tilt_deg.1 > 5.0, "{name}: {limits:?}");
        // Beyond its end: it begins again.
        camera.advance_to(Duration::from_millis(2550));
        assert_eq!(camera.status().footage_frame, 5, "{name}");
        snapshot(&camera);
    }
}

#[test]
fn the_view_shows_what_the_homography_says() {
    let camera = VirtualCamera::start(Settings {
        home: Some(Pose { pan_deg: -9.0, tilt_deg: 3.0, zoom_step: 1.0 }),
        ..looking_at(FootageSettings {
            looped: false,
            ..FootageSettings::new(recording("bars.avi", "jpegenc ! avimux"))
        })
    })
    .unwrap();
    let pose = camera.pose_at(camera.status().time);
    assert_eq!(pose.pan_deg, -9.0);
    let to_view = camera.recording_to_view(&pose, camera.view_size());
    let (info, buffer) = snapshot(&camera);
    let frame = gst_video::VideoFrameRef::from_buffer_ref_readable(&buffer, &info).unwrap();
    let luma = frame.plane_data(0).unwrap();
    // The bars of the test picture are 320/7 wide and lose brightness from left to right.
    let mut seen = Vec::new();
    for bar in 0..7 {
        let (x, y) = project(&to_view, (f64::from(bar) + 0.5) * 320.0 / 7.0, 100.0);
        if (0.0..f64::from(info.width())).contains(&x) && (0.0..f64::from(info.height())).contains(&y) {
            seen.push(luma[y as usize * info.stride()[0] as usize + x as usize]);
        }
    }
    assert!(seen.len() >= 3, "{seen:?}");
    assert!(seen.windows(2).all(|pair| pair[0] > pair[1].saturating_add(5)), "{seen:?}");
}

#[test]
fn a_start_in_the_middle_and_an_end_that_holds() {
    let path = recording("once.avi", "jpegenc ! avimux");
    let footage =
        FootageSettings { start: Duration::from_millis(1500), looped: false, ..FootageSettings::new(path) };
    let camera = VirtualCamera::start(Settings { clock: Clock::Stepped, ..looking_at(footage) }).unwrap();
    assert_eq!(camera.status().footage_frame, 15);
    camera.advance_to(Duration::from_millis(800));
    assert_eq!(camera.status().footage_frame, 19);
    snapshot(&camera);
}

#[test]
fn people_written_down_are_where_the_homography_takes_them() {
    let ground_truth = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("gt.txt");
    std::fs::write(&ground_truth, "3,7,100,80,20,50,1,-1,-1,-1\n3,8,310,80,10,50\n4,7,104,80,20,50\n")
        .unwrap();
    let pose = Pose { pan_deg: -9.0, tilt_deg: 3.0, zoom_step: 1.0 };
    let camera = VirtualCamera::start(Settings {
        home: Some(pose),
        clock: Clock::Stepped,
        ..looking_at(FootageSettings {
            ground_truth: Some(ground_truth.clone()),
            ..FootageSettings::new(recording("truth.avi", "jpegenc ! avimux"))
        })
    })
    .unwrap();
    let size = camera.view_size();
    let seen = |milliseconds| camera.ground_truth(Duration::from_millis(milliseconds), size);
    assert_eq!(seen(150), []);
    // The third picture of ten a second.
    let [person, far] = &seen(250)[..] else { panic!("{:?}", seen(250)) };
    let to_view = camera.recording_to_view(&pose, size);
    let (x, y) = project(&to_view, 109.5, 104.5);
    let (centre_x, centre_y) = person.centroid;
    assert!((centre_x - x - 0.5).hypot(centre_y - y - 0.5) < 0.5, "{person:?} {x} {y}");
    assert_eq!((person.id, person.visible, person.unhidden), (7, 1.0, 1.0));
    assert!(person.bounds.width > 20.0 * 1.8 && person.bounds.height > 50.0 * 1.8);
    assert_eq!((far.id, far.visible, far.in_view, far.unhidden), (8, 0.0, 0.0, 1.0));
    let moved = &seen(350)[0];
    assert!(moved.bounds.left > person.bounds.left + 7.0);
    // It begins again, and so do they.
    assert_eq!(seen(2250), seen(250));

    std::fs::write(&ground_truth, "1,2,3\n").unwrap();
    let bad = FootageSettings { ground_truth: Some(ground_truth), ..FootageSettings::new("truth.avi") };
    let error = VirtualCamera::start(looking_at(bad)).err().unwrap().to_string();
    assert!(error.contains("gt.txt, line 1: top is missing"), "{error}");
}

#[test]
fn what_is_no_recording_is_said_to_be_none() {
    let start = |footage| VirtualCamera::start(looking_at(footage)).err();
    let missing = start(FootageSettings::new("/no/such/file.avi"));
    assert!(matches!(missing, Some(Error::Footage(FootageError::Unreadable { .. }))), "{missing:?}");
    let text = start(FootageSettings::new(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml")));
    assert!(matches!(text, Some(Error::Footage(FootageError::Undecodable { .. }))), "{text:?}");
    let late = FootageSettings {
        start: Duration::from_secs(60),
        ..FootageSettings::new(recording("late.avi", "jpegenc ! avimux"))
    };
    let late = start(late);
    assert!(
        matches!(late, Some(Error::Footage(FootageError::Empty { frames: 20, start: 600, .. }))),
        "{late:?}"
    );
}
