// SPDX-License-Identifier: MPL-2.0

//! A property that does nothing is a promise that is not kept.

use gst::prelude::*;
use ptztrack_contract::{BufferMeta, TargetMeta, TracksMeta};

use crate::bench::*;

/// All that leaves a tracker of these properties, told in words: metas and messages. It is shown somebody who walks, is hidden for a
/// moment, stands, is gone for three seconds and more and comes back, beside somebody else who is nearer and leaves; then a click into an empty
/// street.
fn told(property: Option<(&str, &str)>) -> String {
    let mut bench = Bench::new(|element| {
        if let Some((name, value)) = property {
            element.set_property_from_str(name, value);
        }
    });
    let mut told = String::new();
    for n in 0..220 {
        let walker = match n {
            0..50 => Some((20 + 3 * n.min(40), 100)),
            60..90 => Some((140, 100)),
            175..210 => Some((140 + 3 * (n - 175).min(15), 100)),
            _ => None,
        };
        let other = (n < 35).then_some((250 - 4 * n, 90));
        let (width, height) = (PERSON.0 as u32, PERSON.1 as u32);
        let walker_seen = walker.map(|(x, y)| ("motion", (x as u32, y as u32, width, height)));
        let other_seen = other.map(|(x, y)| ("motion", (x as u32, y as u32, width + 8, height + 20)));
        let seen: Vec<_> = walker_seen.into_iter().chain(other_seen).collect();
        if n == 214 {
            bench.harness.element().unwrap().emit_by_name::<()>("select-target", &[&0.8, &0.5]);
        }
        let out = bench.push_through(street(0, walker.into_iter().chain(other)), &seen);
        told += &format!("{:?} {:?}\n", TargetMeta::of(&out), TracksMeta::of(&out));
    }
    let messages = bench.bus.iter().filter_map(|message| message.structure().map(ToString::to_string));
    told + &messages.collect::<Vec<_>>().join("\n")
}

#[test]
fn every_property_changes_something() {
    let changes = [
        ("coast-time", "0"),
        ("confirm-frames", "9"),
        ("ignored-tracks", "1"),
        ("manual-size", "0.9"),
        ("max-tracking-time", "500000000"),
        ("memory-time", "0"),
        ("message-interval", "200000000"),
        ("post-tracks", "true"),
        ("profile", "thesis"),
        ("roi-type", "person"),
        ("selection", "first"),
        ("stationary-timeout", "500000000"),
    ];
    init();
    let element = gst::ElementFactory::make("lkfeaturetrack").build().unwrap();
    let properties = element.list_properties();
    let own = properties.iter().filter(|property| property.owner_type().name() == "GstLkFeatureTrack");
    let mut names: Vec<_> = own.map(|property| property.name()).collect();
    names.sort_unstable();
    assert_eq!(names, changes.map(|(name, _)| name), "a property is missing here");
    let usual = told(None);
    assert!(usual == told(None), "the same twice");
    for (name, value) in changes {
        assert!(usual != told(Some((name, value))), "{name}={value} changes nothing");
    }
}
