// SPDX-License-Identifier: MPL-2.0

use std::sync::Once;

use gst_check::Harness;
use ptztrack_contract::{BufferMeta, TargetMeta, TargetState};

use crate::{Camera, Footage};

/// Pictures after which somebody is followed.
const WARM_UP: u64 = 40;
/// Distance of the pictures, milliseconds.
const PERIOD_MS: u64 = 40;

/// The elements, in the order in which pictures go through them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// `bgavgdetect`.
    Detect,
    /// `lkfeaturetrack`.
    Track,
    /// `ptzoverlay`, which blends.
    Overlay,
}

/// The elements, each in a harness, while they follow somebody.
pub struct Stages {
    footage: Footage,
    number: u64,
    harnesses: [Harness; 3],
}

impl Stages {
    /// After enough pictures of that size, with so many people, for one of them to be followed.
    ///
    /// # Panics
    /// Where nobody is: what is measured then is something else.
    #[allow(clippy::expect_used, clippy::unwrap_used, reason = "a measurement that cannot be made")]
    pub fn warmed_up(size: (usize, usize), camera: Camera, people: u64) -> Self {
        static ONCE: Once = Once::new();
        ONCE.call_once(|| {
            gst::init().unwrap();
            gstptztrack::plugin_register_static().unwrap();
        });
        let caps = format!("video/x-raw,format=I420,width={},height={},framerate=25/1", size.0, size.1);
        let harnesses = ["bgavgdetect", "lkfeaturetrack", "ptzoverlay"].map(|name| {
            let mut harness = Harness::new(name);
            harness.set_caps_str(&caps, "video/x-raw");
            harness
        });
        let mut stages = Self { footage: Footage::new(size, camera, people), number: 0, harnesses };
        let mut last = None;
        for _ in 0..WARM_UP {
            let picture = stages.next_before(Stage::Overlay);
            last = TargetMeta::of(&picture);
            stages.pass(Stage::Overlay, picture);
        }
        let state = last.expect("a meta").expect("a readable meta").state;
        assert_eq!(state, TargetState::Tracking, "{size:?}, {camera:?}, {people} people");
        stages
    }

    /// The next picture, as it reaches `stage`.
    pub fn next_before(&mut self, stage: Stage) -> gst::Buffer {
        let mut buffer = gst::Buffer::from_mut_slice(self.footage.picture(self.number));
        if let Some(buffer) = buffer.get_mut() {
            buffer.set_pts(gst::ClockTime::from_mseconds(self.number * PERIOD_MS));
        }
        self.number += 1;
        let before = [Stage::Detect, Stage::Track].into_iter().filter(|before| *before < stage);
        before.fold(buffer, |buffer, stage| self.pass(stage, buffer))
    }

    /// A picture that went through `stage`.
    ///
    /// # Panics
    /// Where the element refuses it.
    #[allow(clippy::expect_used, reason = "a measurement that cannot be made")]
    pub fn pass(&mut self, stage: Stage, picture: gst::Buffer) -> gst::Buffer {
        let passed = self.harnesses[stage as usize].push_and_pull(picture).expect("the picture passes");
        // What the tracker tells the detector.
        let (before, after) = self.harnesses.split_at_mut(stage as usize);
        if let ([.., before], [harness, ..]) = (before, after) {
            while let Some(event) = harness.try_pull_upstream_event() {
                before.push_upstream_event(event);
            }
        }
        passed
    }
}
