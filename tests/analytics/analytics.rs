// SPDX-License-Identifier: MPL-2.0

//! Elements of gst-plugins-rs read whom `lkfeaturetrack` tells of, and what they make it takes as a detector's.

use std::ops::ControlFlow;

use gst::buffer::BufferMetaForeachAction::{Keep, Remove};
use gst::prelude::*;
use gst_analytics::prelude::*;
use gst_analytics::{AnalyticsODMtd, AnalyticsRelationMeta, AnalyticsTrackingMtd, RelTypes};
use ptztrack_contract::{BufferMeta, TargetMeta, TargetState, Track, TrackState, TracksMeta};

const SIZE: (u32, u32) = (320, 240);

/// A ball that moves, and who tells of it.
const BALL: &str = "videotestsrc pattern=ball num-buffers=60 ! video/x-raw,format=GRAY8,width=320,height=240,framerate=25/1 \
    ! bgavgdetect ! lkfeaturetrack";

/// Runs it to the end, and gives what comes to its `appsink`.
fn run(description: &str, set_up: impl FnOnce(&gst::Pipeline)) -> Vec<gst::Buffer> {
    gst::init().unwrap();
    gstptztrack::plugin_register_static().unwrap();
    gstrsanalytics::plugin_register_static().unwrap();
    let description = format!("{description} ! appsink name=sink sync=false");
    let pipeline = gst::parse::launch(&description).unwrap().downcast::<gst::Pipeline>().unwrap();
    set_up(&pipeline);
    let sink = pipeline.by_name("sink").unwrap().downcast::<gst_app::AppSink>().unwrap();
    pipeline.set_state(gst::State::Playing).unwrap();
    let buffers = std::iter::from_fn(|| sink.pull_sample().ok()?.buffer_owned()).collect();
    let error = pipeline.bus().unwrap().pop_filtered(&[gst::MessageType::Error]);
    pipeline.set_state(gst::State::Null).unwrap();
    assert!(error.is_none(), "{error:?}");
    buffers
}

/// Those who are seen.
fn tracks(buffer: &gst::BufferRef) -> Vec<Track> {
    let all = TracksMeta::of(buffer).unwrap().unwrap().tracks;
    all.into_iter().filter(|track| track.state != TrackState::Hidden).collect()
}

/// Left, top, width and height.
fn pixels(track: &Track) -> [i32; 4] {
    let (width, height) = (f64::from(SIZE.0), f64::from(SIZE.1));
    let bounds = track.bounds;
    [bounds.x * width, bounds.y * height, bounds.width * width, bounds.height * height]
        .map(|side| side.round() as i32)
}

#[test]
fn everybody_is_an_object_with_class_confidence_and_number() {
    let buffers = run(BALL, |_| {});
    let mut seen = 0;
    for buffer in &buffers {
        let Some(meta) = buffer.meta::<AnalyticsRelationMeta>() else {
            assert_eq!(tracks(buffer), []);
            continue;
        };
        let told: Vec<_> = meta
            .iter::<AnalyticsODMtd>()
            .map(|object| {
                let at = object.location().unwrap();
                let mut numbers =
                    meta.iter_direct_related::<AnalyticsTrackingMtd>(object.id(), RelTypes::RELATE_TO);
                let (number, first_seen, ..) = numbers.next().unwrap().info();
                assert!(Some(first_seen) <= buffer.pts());
                let class = object.obj_type().unwrap().as_str().to_string();
                (class, number, [at.x, at.y, at.w, at.h], at.loc_conf_lvl)
            })
            .collect();
        let expected: Vec<_> = tracks(buffer)
            .iter()
            .map(|track| ("object".to_owned(), track.id, pixels(track), track.confidence as f32))
            .collect();
        assert_eq!(told, expected);
        seen += told.len();
    }
    assert!(seen > 30, "{seen}");
}

/// As ONVIF's metadata, in the form that those elements have for it.
#[test]
fn another_element_makes_documents_of_it() {
    let buffers = run(&format!("{BALL} ! relationmeta2onvifmeta time-source=running-time"), |_| {});
    let last = buffers.last().unwrap();
    let [track] = tracks(last)[..] else { panic!("{:?}", tracks(last)) };
    let meta = gst::meta::CustomMeta::from_buffer(last, "OnvifXMLFrameMeta").unwrap();
    let documents = meta.structure().get::<gst::BufferList>("frames").unwrap();
    let map = documents.get(0).unwrap().map_readable().unwrap();
    let text = std::str::from_utf8(&map).unwrap();
    let [left, top, width, height] = pixels(&track);
    for expected in [
        ">object<".to_owned(),
        format!("left=\"{left}\""),
        format!("top=\"{top}\""),
        format!("right=\"{}\"", left + width),
        format!("bottom=\"{}\"", top + height),
    ] {
        assert!(text.contains(&expected), "{expected} is not in {text}");
    }
}

/// All that the second tracker sees is what the element in between has made of a document.
#[test]
fn objects_of_another_element_are_followed() {
    let others = "relationmeta2onvifmeta ! identity name=only-the-document ! onvifmeta2relationmeta";
    let follow = |class: &str| {
        let description = format!("{BALL} ! {others} ! lkfeaturetrack roi-type={class}");
        run(&description, |pipeline| {
            let identity = pipeline.by_name("only-the-document").unwrap();
            identity.static_pad("src").unwrap().add_probe(gst::PadProbeType::BUFFER, |_, info| {
                let buffer = info.buffer_mut().unwrap().make_mut();
                buffer.foreach_meta_mut(|mut meta| {
                    let is_relation = meta.downcast_ref::<AnalyticsRelationMeta>().is_some();
                    ControlFlow::Continue(if is_relation { Remove } else { Keep })
                });
                gst::PadProbeReturn::Ok
            });
        })
    };
    let target = |buffer: &gst::Buffer| TargetMeta::of(buffer).unwrap().unwrap();
    let followed = follow("object");
    let tracking = followed.iter().filter(|buffer| target(buffer).state == TargetState::Tracking).count();
    assert!(tracking > 30, "{tracking} of {}", followed.len());
    let nobody = follow("car");
    assert!(nobody.iter().all(|buffer| target(buffer).state == TargetState::Searching));
}
