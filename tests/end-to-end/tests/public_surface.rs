// SPDX-License-Identifier: MPL-2.0

//! The public surface of the elements is a checked-in file: a change of it is a decision, not an accident.
//!
//! `UPDATE_SURFACE=1 cargo test -p end-to-end --test public_surface` writes the file anew.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write;

use gst::glib;
use gst::prelude::*;

const ELEMENTS: [&str; 5] = ["bgavgdetect", "lkfeaturetrack", "ptzoverlay", "onvifptzsink", "vapixptzsink"];
const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/public-surface.txt");

#[test]
fn matches_the_checked_in_file() {
    end_to_end::init();
    let surface: String = ELEMENTS.map(describe).join("\n");
    if std::env::var_os("UPDATE_SURFACE").is_some() {
        std::fs::write(FILE, &surface).unwrap();
    }
    let expected = std::fs::read_to_string(FILE).unwrap();
    for (line, (found, wanted)) in surface.lines().zip(expected.lines()).enumerate() {
        assert_eq!(found, wanted, "line {} of {FILE} differs (UPDATE_SURFACE=1 writes it anew)", line + 1);
    }
    assert_eq!(surface.lines().count(), expected.lines().count(), "{FILE} has other lines");
}

#[test]
fn every_property_says_what_it_is() {
    end_to_end::init();
    for element in ELEMENTS {
        for property in own_properties(element) {
            let blurb = property.blurb().unwrap_or_default();
            assert!(blurb.len() > 10, "{element}: property {} has no useful blurb", property.name());
        }
    }
}

#[test]
fn a_password_can_be_written_but_not_read() {
    end_to_end::init();
    for element in ELEMENTS {
        for property in own_properties(element).iter().filter(|property| property.name().contains("password"))
        {
            assert!(!property.flags().contains(glib::ParamFlags::READABLE), "{element}: readable password");
        }
    }
}

fn own_properties(element: &str) -> Vec<glib::ParamSpec> {
    let type_ = gst::ElementFactory::find(element).unwrap().load().unwrap().element_type();
    let class = glib::Class::<glib::Object>::from_type(type_).unwrap();
    let mut properties: Vec<_> =
        class.list_properties().iter().filter(|property| property.owner_type() == type_).cloned().collect();
    properties.sort_by(|a, b| a.name().cmp(b.name()));
    properties
}

fn describe(name: &str) -> String {
    let factory = gst::ElementFactory::find(name).unwrap().load().unwrap();
    let type_ = factory.element_type();
    let mut text = String::new();
    for key in ["long-name", "klass", "description"] {
        writeln!(text, "{name} {key}: {}", factory.metadata(key).unwrap()).unwrap();
    }
    writeln!(text, "{name} rank: {}", i32::from(factory.rank())).unwrap();
    for pad in factory.static_pad_templates() {
        writeln!(text, "{name} pad {} {:?} {:?}", pad.name_template(), pad.direction(), pad.presence())
            .unwrap();
    }
    for property in own_properties(name) {
        writeln!(
            text,
            "{name} property {}: {}{} {:?}",
            property.name(),
            property.value_type(),
            range(&property),
            property.flags()
        )
        .unwrap();
        if property.flags().contains(glib::ParamFlags::WRITABLE) {
            writeln!(text, "    default: {:?}", property.default_value()).unwrap();
        }
        writeln!(text, "    {}", property.blurb().unwrap_or_default()).unwrap();
    }
    for signal in own_signals(type_) {
        writeln!(text, "{name} signal {signal}").unwrap();
    }
    text
}

fn range(property: &glib::ParamSpec) -> String {
    macro_rules! bounds {
        ($($kind:ty),+) => {
            $(if let Some(spec) = property.downcast_ref::<$kind>() {
                return format!(" [{}, {}]", spec.minimum(), spec.maximum());
            })+
        };
    }
    bounds!(
        glib::ParamSpecInt,
        glib::ParamSpecUInt,
        glib::ParamSpecInt64,
        glib::ParamSpecUInt64,
        glib::ParamSpecFloat,
        glib::ParamSpecDouble
    );
    let Some(spec) = property.downcast_ref::<glib::ParamSpecEnum>() else { return String::new() };
    let nicks: Vec<_> = spec.enum_class().values().iter().map(|value| value.nick().to_owned()).collect();
    format!(" [{}]", nicks.join(", "))
}

fn own_signals(type_: glib::Type) -> Vec<String> {
    // Signal queries need the class to be there; `own_properties` has made sure of it.
    let mut signals: Vec<_> = ["select-target", "release-target"]
        .iter()
        .filter_map(|name| glib::subclass::SignalId::lookup(name, type_))
        .map(|id| {
            let query = id.query();
            let parameters: Vec<_> =
                query.param_types().iter().map(|kind| kind.type_().name().to_owned()).collect();
            format!("{}({}) {:?}", query.signal_name(), parameters.join(", "), query.flags())
        })
        .collect();
    signals.sort();
    signals
}
