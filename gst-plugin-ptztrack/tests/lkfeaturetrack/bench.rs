// SPDX-License-Identifier: MPL-2.0

//! The element in a harness, and pictures of a person in a street.

use gst::prelude::*;
use gst_check::Harness;
use gst_video::VideoRegionOfInterestMeta;
use ptztrack_contract::{BufferMeta, TargetChange, TargetMessage, TargetMeta, TargetState, TrackerEvent};

pub const WIDTH: usize = 320;
pub const HEIGHT: usize = 240;
pub const FRAME_MS: u64 = 40;
/// Size of the person in pixels.
pub const PERSON: (usize, usize) = (32, 72);

pub fn init() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(|| {
        gst::init().unwrap();
        gstptztrack::plugin_register_static().unwrap();
    });
}

/// Blocks of 5x5 pixels of any grey, the same for the same place and seed.
pub fn texture(seed: usize, x: usize, y: usize) -> u8 {
    let mut hash = seed.wrapping_mul(0x9e37_79b9)
        ^ (x / 5).wrapping_mul(0x85eb_ca6b)
        ^ (y / 5).wrapping_mul(0xc2b2_ae35);
    hash ^= hash >> 13;
    hash = hash.wrapping_mul(0x27d4_eb2f);
    (hash >> 9) as u8
}

/// The street with a person whose left upper corner is at `person`, behind a wall where `wall` says.
pub fn picture(person: Option<(i32, i32)>, wall: Option<std::ops::Range<usize>>) -> Vec<u8> {
    let mut pixels = street(0, person);
    for y in wall.iter().flat_map(|_| 0..HEIGHT) {
        pixels[y * WIDTH..][wall.clone().unwrap()].fill(150);
    }
    pixels
}

/// The street after the camera has turned to the right by so many pixels, with people at places in the picture.
pub fn street(pan: usize, people: impl IntoIterator<Item = (i32, i32)>) -> Vec<u8> {
    let mut pixels: Vec<u8> =
        (0..WIDTH * HEIGHT).map(|index| 64 + texture(1, index % WIDTH + pan, index / WIDTH) / 4).collect();
    for (left, top) in people {
        for v in 0..PERSON.1 {
            for u in 0..PERSON.0 {
                let (x, y) = (left + u as i32, top + v as i32);
                if (0..WIDTH as i32).contains(&x) && (0..HEIGHT as i32).contains(&y) {
                    pixels[y as usize * WIDTH + x as usize] = texture(7, u, v);
                }
            }
        }
    }
    pixels
}

/// Name and pixels of a region of interest.
pub type Seen<'a> = (&'a str, (u32, u32, u32, u32));

pub struct Bench {
    pub harness: Harness,
    pub frames: u64,
    pub bus: gst::Bus,
}

impl Bench {
    pub fn new(configure: impl Fn(&gst::Element)) -> Self {
        init();
        let harness = Harness::new("lkfeaturetrack");
        configure(&harness.element().unwrap());
        Self::of(harness)
    }

    pub fn of(mut harness: Harness) -> Self {
        let element = harness.element().unwrap();
        let bus = gst::Bus::new();
        element.set_bus(Some(&bus));
        harness.set_src_caps_str("video/x-raw,format=GRAY8,width=320,height=240,framerate=25/1");
        harness.set_sink_caps_str("video/x-raw");
        Self { harness, frames: 0, bus }
    }

    pub fn push(&mut self, pixels: Vec<u8>, detections: &[Seen]) -> TargetMeta {
        let out = self.push_through(pixels, detections);
        TargetMeta::of(&out).expect("a meta on every frame").expect("readable")
    }

    pub fn push_through(&mut self, pixels: Vec<u8>, detections: &[Seen]) -> gst::Buffer {
        let mut buffer = gst::Buffer::from_mut_slice(pixels);
        {
            let buffer = buffer.get_mut().unwrap();
            buffer.set_pts(gst::ClockTime::from_mseconds(self.frames * FRAME_MS));
            for (name, bounds) in detections {
                VideoRegionOfInterestMeta::add(buffer, name, *bounds);
            }
        }
        self.frames += 1;
        self.harness.push_and_pull(buffer).unwrap()
    }

    /// Shows a person at `place` who is detected.
    pub fn detected(&mut self, place: (i32, i32)) -> TargetMeta {
        let bounds = (place.0 as u32, place.1 as u32, PERSON.0 as u32, PERSON.1 as u32);
        self.push(picture(Some(place), None), &[("motion", bounds)])
    }

    /// A person who walks up to `place`, where the tracker has them: who goes nowhere is not taken.
    pub fn acquire(&mut self, place: (i32, i32)) -> TargetMeta {
        for way in [10, 5] {
            assert_eq!(self.detected((place.0 - way, place.1)).state, TargetState::Searching);
        }
        let meta = self.detected(place);
        assert_eq!((meta.state, meta.id), (TargetState::Tracking, 1));
        meta
    }

    pub fn messages(&self) -> Vec<TargetMessage> {
        self.bus
            .iter()
            .filter_map(|message| TargetMessage::from_structure(message.structure()?).ok())
            .collect()
    }

    pub fn changes(&self) -> Vec<TargetChange> {
        self.messages().into_iter().map(|message| message.change).collect()
    }

    /// What the detector was told, the same state in a row once: where the target is, is said with every picture.
    pub fn events(&mut self) -> Vec<TargetState> {
        let mut states: Vec<_> = std::iter::from_fn(|| self.harness.try_pull_upstream_event())
            .filter_map(|event| TrackerEvent::of(&event)?.ok())
            .map(|event| event.state)
            .collect();
        states.dedup();
        states
    }
}

#[track_caller]
pub fn assert_box_at(meta: &TargetMeta, place: (i32, i32)) {
    let (x, y) = (meta.bounds.x * WIDTH as f64, meta.bounds.y * HEIGHT as f64);
    assert!(
        (x - f64::from(place.0)).abs() < 6.0 && (y - f64::from(place.1)).abs() < 8.0,
        "{x} {y} {place:?}"
    );
}
