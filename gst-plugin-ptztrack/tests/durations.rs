// SPDX-License-Identifier: MPL-2.0

//! Durations of all three elements, set by somebody who thinks in milliseconds.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use gst::prelude::*;

fn durations(element: &gst::Element) -> Vec<String> {
    let properties = element.list_properties();
    let durations =
        properties.iter().filter(|spec| spec.blurb().is_some_and(|blurb| blurb.contains("in nanoseconds")));
    durations.map(|spec| spec.name().to_string()).collect()
}

fn warnings(bus: &gst::Bus) -> Vec<String> {
    let messages = std::iter::from_fn(|| bus.pop_filtered(&[gst::MessageType::Warning]));
    messages
        .map(|message| match message.view() {
            gst::MessageView::Warning(warning) => warning.error().to_string(),
            _ => unreachable!(),
        })
        .collect()
}

#[test]
fn a_duration_below_a_millisecond_is_refused_and_the_unit_named() {
    gst::init().unwrap();
    gstptztrack::plugin_register_static().unwrap();
    for (factory, count) in [("bgavgdetect", 3), ("lkfeaturetrack", 5), ("ptzoverlay", 1)] {
        let element = gst::ElementFactory::make(factory).build().unwrap();
        let bus = gst::Bus::new();
        element.set_bus(Some(&bus));
        let names = durations(&element);
        assert_eq!(names.len(), count, "{factory}: {names:?}");
        for name in names {
            for right in [0u64, 1_000_000, 2_000_000_000] {
                element.set_property(&name, right);
                assert_eq!((element.property(&name), warnings(&bus)), (right, vec![]), "{factory} {name}");
            }
            for wrong in [1u64, 300, 999_999] {
                element.set_property(&name, wrong);
                let [warning] = warnings(&bus).try_into().unwrap();
                let expected = format!("`{name}`={wrong} is {wrong} ns: durations are in nanoseconds");
                assert!(warning.starts_with(&expected), "{warning}");
                assert_eq!(element.property::<u64>(&name), 2_000_000_000, "{factory} {name}");
            }
        }
    }
}

/// `gst-launch-1.0` sets properties while the elements have no bus yet.
#[test]
fn what_was_refused_before_there_was_a_bus_is_told_at_the_start_and_only_once() {
    gst::init().unwrap();
    gstptztrack::plugin_register_static().unwrap();
    let pipeline = gst::parse::launch(
        "videotestsrc ! bgavgdetect settle-time=300 zones=x ! lkfeaturetrack coast-time=300 ! ptzoverlay trail-duration=300 ! fakesink",
    )
    .unwrap();
    let bus = pipeline.bus().unwrap();
    pipeline.set_state(gst::State::Ready).unwrap();
    assert_eq!(warnings(&bus), Vec::<String>::new());
    pipeline.set_state(gst::State::Paused).unwrap();
    let mut told = warnings(&bus);
    told.sort();
    let [coast, settle, trail, zones] = told.try_into().unwrap();
    assert!(coast.starts_with("`coast-time`=300 is 300 ns"), "{coast}");
    assert!(settle.starts_with("`settle-time`=300 is 300 ns"), "{settle}");
    assert!(trail.starts_with("`trail-duration`=300 is 300 ns"), "{trail}");
    assert!(zones.starts_with("zones stays as it was"), "{zones}");
    pipeline.set_state(gst::State::Ready).unwrap();
    pipeline.set_state(gst::State::Paused).unwrap();
    assert_eq!(warnings(&bus), Vec::<String>::new());
    pipeline.set_state(gst::State::Null).unwrap();
}

/// As applications build a bin of a description, set its properties and put it into their pipeline.
#[test]
fn what_is_refused_in_a_bin_without_a_pipeline_is_told_at_the_start() {
    gst::init().unwrap();
    gstptztrack::plugin_register_static().unwrap();
    let bin =
        gst::parse::bin_from_description("videotestsrc ! bgavgdetect name=d ! fakesink", false).unwrap();
    bin.by_name("d").unwrap().set_property("settle-time", 300u64);
    let pipeline = gst::Pipeline::new();
    pipeline.add(&bin).unwrap();
    let bus = pipeline.bus().unwrap();
    pipeline.set_state(gst::State::Paused).unwrap();
    let [warning] = warnings(&bus).try_into().unwrap();
    assert!(warning.starts_with("`settle-time`=300 is 300 ns"), "{warning}");
    pipeline.set_state(gst::State::Null).unwrap();
}
