// SPDX-License-Identifier: MPL-2.0

//! What can be set, what cannot, and that no password comes out.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::cell::Cell;

use common::{Heard, PATIENCE, Rig, camera, init, target};
use gst::prelude::*;
use ptztrack_contract::TargetState;
use virtual_camera::Auth;

#[test]
fn without_a_location_it_says_what_to_set() {
    init();
    let rig = Rig::ready("");
    assert!(rig.sink.set_state(gst::State::Paused).is_err());
    match &rig.heard()[..] {
        [Heard::Error(text)] => assert!(text.contains("location=http://192.168.0.90"), "{text}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_location_that_is_none_is_refused_and_the_old_one_stays() {
    let rig = Rig::ready("http://192.168.0.90").with("location", "rtsp://root:geheim@camera/media");
    assert_eq!(rig.sink.property::<Option<String>>("location").as_deref(), Some("http://192.168.0.90"));
    match &rig.heard()[..] {
        [Heard::Warning(text)] => {
            assert!(text.contains("rtsp://camera") && !text.contains("geheim"), "{text}")
        }
        other => panic!("{other:?}"),
    }
}

/// Beyond there is digital zoom, which the servo does not use.
#[test]
fn zoom_limits_are_those_of_the_lens() {
    let rig = Rig::ready("http://192.168.0.90");
    for name in ["zoom-min", "zoom-max"] {
        let limit = rig.sink.find_property(name).unwrap();
        let limit = limit.downcast_ref::<glib::ParamSpecUInt>().unwrap();
        assert_eq!((limit.minimum(), limit.maximum()), (1, 9999));
    }
}

#[test]
fn crossed_limits_are_refused_with_both_values_and_the_old_ones_stay() {
    let limits = |rig: &Rig| {
        (
            rig.sink.property::<f64>("pan-min"),
            rig.sink.property::<f64>("pan-max"),
            rig.sink.property::<u32>("zoom-min"),
        )
    };
    let camera = camera(Auth::None);
    // In either order, and each at first beyond the other.
    for [first, second] in
        [[("pan-min", 100.0), ("pan-max", 150.0)], [("pan-max", -150.0), ("pan-min", -160.0)]]
    {
        let rig = Rig::ready(&camera.url()).with(first.0, first.1).with(second.0, second.1).play();
        assert!(!rig.heard().iter().any(Heard::is_warning));
    }
    let rig =
        Rig::ready(&camera.url()).with("pan-min", 50.0).with("pan-max", -50.0).with("zoom-min", 9u32).play();
    assert_eq!(limits(&rig), (-180.0, 180.0, 9));
    let rig = rig.with("pan-min", -10.0).with("pan-max", -20.0);
    assert_eq!(limits(&rig), (-10.0, 180.0, 9));
    let warnings: Vec<_> = rig.heard().into_iter().filter_map(Heard::into_warning).collect();
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(warnings[0].contains("`pan-min`=50") && warnings[0].contains("`pan-max`=-50"), "{warnings:?}");
    assert!(warnings[1].contains("`pan-min`=-10") && warnings[1].contains("`pan-max`=-20"), "{warnings:?}");
}

/// As a line written for milliseconds would have them.
#[test]
fn a_duration_below_a_millisecond_is_refused_and_the_unit_named() {
    for (name, wrong, right) in
        [("latency", 300u64, 300_000_000u64), ("timeout", 2000, 2_000_000_000), ("home-timeout", 999_999, 0)]
    {
        let rig = Rig::ready("http://192.168.0.90").with(name, right).with(name, wrong);
        assert_eq!(rig.sink.property::<u64>(name), right);
        match &rig.heard()[..] {
            [Heard::Warning(text)] => {
                let expected = format!("`{name}`={wrong} is {wrong} ns: durations are in nanoseconds");
                assert!(text.starts_with(&expected), "{text}");
                assert!(text.ends_with(&format!("`{name}` stays as it was")), "{text}");
            }
            other => panic!("{other:?}"),
        }
    }
}

/// `gst-launch-1.0` sets properties while the element has no bus yet.
#[test]
fn what_was_refused_before_there_was_a_bus_is_told_at_the_start() {
    init();
    let pipeline = gst::parse::launch("videotestsrc ! vapixptzsink latency=300 rotation=45").unwrap();
    let bus = pipeline.bus().unwrap();
    assert!(pipeline.set_state(gst::State::Paused).is_err(), "it has no location");
    let told: Vec<String> = std::iter::from_fn(|| bus.pop_filtered(&[gst::MessageType::Warning]))
        .filter_map(|message| match message.view() {
            gst::MessageView::Warning(warning) => Some(warning.error().to_string()),
            _ => None,
        })
        .collect();
    let [latency, rotation] = told.try_into().unwrap();
    assert!(latency.starts_with("`latency`=300 is 300 ns: durations are in nanoseconds"), "{latency}");
    assert!(rotation.contains("[0, 90, 180, 270]"), "{rotation}");
    pipeline.set_state(gst::State::Null).unwrap();
}

#[test]
fn a_rotation_is_by_quarters() {
    let rig = Rig::ready("http://192.168.0.90").with("rotation", 90u32).with("rotation", 45u32);
    assert_eq!(rig.sink.property::<u32>("rotation"), 90);
    match &rig.heard()[..] {
        [Heard::Warning(text)] => assert!(text.contains("[0, 90, 180, 270]"), "{text}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_duration_below_its_range_is_refused_with_the_range() {
    let rig = Rig::ready("http://192.168.0.90").with("timeout", 20_000_000u64);
    assert_eq!(rig.sink.property::<u64>("timeout"), 1_500_000_000);
    match &rig.heard()[..] {
        [Heard::Warning(text)] => assert!(text.contains("100ms") && text.contains("60s"), "{text}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn user_and_password_of_a_location_are_used_and_taken_out() {
    let camera = camera(Auth::Digest { qop: true });
    let location = camera.url().replace("http://", "http://root:pass@");
    let mut rig = Rig::playing(&location);
    rig.set_going(&camera);
    assert_eq!(rig.sink.property::<Option<String>>("location"), Some(camera.url()));
    assert_eq!(rig.sink.property::<Option<String>>("user").as_deref(), Some("root"));
}

#[test]
fn the_password_cannot_be_read() {
    let rig = Rig::ready("http://192.168.0.90");
    let password = rig.sink.find_property("password").unwrap();
    assert!(!password.flags().contains(glib::ParamFlags::READABLE));
}

#[test]
fn every_property_says_what_it_is() {
    let rig = Rig::ready("http://192.168.0.90");
    let properties = rig.sink.list_properties();
    let own = properties.iter().filter(|property| property.owner_type() == rig.sink.type_());
    let own: Vec<_> = own.map(|property| (property.name(), property.blurb())).collect();
    assert!(own.iter().any(|(name, _)| *name == "stats"), "{own:?}");
    assert!(own.iter().all(|(_, blurb)| blurb.is_some_and(|blurb| blurb.len() > 10)), "{own:?}");
}

#[test]
fn it_prerolls_nothing_and_waits_for_no_clock() {
    let rig = Rig::ready("http://192.168.0.90");
    for property in ["sync", "async", "qos"] {
        assert!(!rig.sink.property::<bool>(property), "{property}");
    }
}

#[test]
fn no_password_in_log_or_graph() {
    thread_local! {
        static LOGGING: Cell<bool> = const { Cell::new(false) };
    }
    init();
    // Which would fill the terminal.
    gst::log::remove_default_log_function();
    let log = std::sync::Arc::new(std::sync::Mutex::new(String::new()));
    let sink = log.clone();
    gst::log::add_log_function(move |category, level, file, _, _, object, message| {
        // The log function itself may log. No other line is left out.
        if !LOGGING.replace(true) {
            let object = object.map(|object| object.to_string()).unwrap_or_default();
            let line = format!("{} {level:?} {file} {object} {:?}\n", category.name(), message.get());
            *sink.lock().unwrap() += &line;
            LOGGING.set(false);
        }
    });
    gst::log::set_default_threshold(gst::DebugLevel::Trace);
    let camera = camera(Auth::Basic);
    let rig = Rig::ready(&camera.url()).with("user", "root").with("password", "pass");
    let mut rig = rig.with_str("auth", "basic").play();
    rig.set_going(&camera);
    rig.push_until(&target(TargetState::Lost, 0.0, 0.0), &camera, |status| !status.moving);
    let bin = gst::Bin::new();
    let other = Rig::ready(&camera.url()).with("password", "geheimwort");
    bin.add(&other.sink).unwrap();
    let graph = bin.debug_to_dot_data(gst::DebugGraphDetails::ALL);
    // The function stays: another thread may be in it, and GStreamer would free it all the same.
    gst::log::set_default_threshold(gst::DebugLevel::None);
    let log = log.lock().unwrap();
    assert!(log.contains("% of full speed"), "the log is of this element");
    // "root:pass" in base64, as Basic sends it.
    assert!(!log.contains("cm9vdDpwYXNz") && !log.contains("geheimwort"));
    assert!(!graph.contains("geheimwort"));
}

/// The pipelines in the element's documentation, with the address replaced by the camera's.
#[test]
fn the_documented_pipelines_run() {
    init();
    let camera = camera(Auth::Digest { qop: true });
    let documentation = include_str!("../src/vapixptzsink/mod.rs");
    let lines: Vec<_> =
        documentation.lines().filter_map(|line| line.strip_prefix("//! gst-launch-1.0 ")).collect();
    assert_eq!(lines.len(), 3);
    for line in lines {
        // The virtual camera speaks no TLS; tests/https.rs sees to that.
        let launch = line.replace("https://", "http://").replace("http://192.168.0.90", &camera.url());
        assert_ne!(launch, line);
        let pipeline = gst::parse::launch(&launch).unwrap();
        pipeline.set_state(gst::State::Playing).unwrap();
        let bus = pipeline.bus().unwrap();
        let end = bus.timed_pop_filtered(
            gst::ClockTime::try_from(PATIENCE).unwrap(),
            &[gst::MessageType::Eos, gst::MessageType::Error],
        );
        assert_eq!(end.map(|message| message.type_()), Some(gst::MessageType::Eos), "{line}");
        pipeline.set_state(gst::State::Null).unwrap();
    }
    assert!(common::moves(&camera).is_empty(), "a test picture has no target");
}

#[test]
fn any_layout_of_the_pixels_is_welcome() {
    let rig = Rig::ready("http://192.168.0.90");
    let caps: gst::Caps = "video/x-raw,format=I420,width=321,height=241,framerate=25/1".parse().unwrap();
    let pad = rig.sink.static_pad("sink").unwrap();
    let mut query = gst::query::Allocation::new(Some(&caps), false);
    pad.set_active(true).unwrap();
    assert!(pad.query(&mut query));
    assert!(query.find_allocation_meta::<gst_video::VideoMeta>().is_some());
}

/// As an application's handler of messages may.
#[test]
fn what_is_set_while_it_starts_counts() {
    let camera = camera(Auth::Digest { qop: true });
    let rig = Rig::ready(&camera.url()).with("pan-min", 50.0).with("pan-max", -50.0);
    let sink = rig.sink.clone();
    rig.bus.set_sync_handler(move |_, message| {
        if let gst::MessageView::Warning(warning) = message.view()
            && warning.error().message().contains("pan-min")
        {
            sink.set_property("user", "root");
            sink.set_property("password", "pass");
        }
        gst::BusSyncReply::Pass
    });
    let mut rig = rig.play();
    rig.set_going(&camera);
    // It holds the sink, which holds the bus.
    rig.bus.unset_sync_handler();
}
