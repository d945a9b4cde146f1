// SPDX-License-Identifier: MPL-2.0

//! A scene before it is run: what is the same in all strata, for their builders to change.

use std::time::Duration;

use virtual_camera::{RoomSettings, Seeded, Settings, World};

use super::SceneId;
use crate::{
    experiment::{Experiment, Place, Scene, Target},
    record::{Codec, Delays, FirstBox, Suite, TrackerName},
};

/// How long a scene is.
const LENGTH: Duration = Duration::from_secs(10);

/// Somebody walks across a room of its own, seen by a camera of its own.
pub(super) struct Draft {
    pub room: RoomSettings,
    /// All of the camera but its world.
    pub camera: Settings,
    pub codec: Codec,
    pub delays: Delays,
    /// When the first picture is taken, since the world's start.
    pub begin: Duration,
    /// For so long before the first picture the camera is on the person already.
    pub lead: Duration,
    pub target: Target,
    pub first_box: FirstBox,
}

impl Draft {
    pub fn new(chance: &mut Seeded) -> Self {
        // The reference rooms have small numbers; these are others.
        let seed = chance.bits() >> 32;
        let number = 1 + chance.below(72) as u32;
        let mut camera = Settings::default();
        camera.video.frame_rate = Some(chance.pick(&[25.0, 25.0, 15.0]));
        Self {
            room: RoomSettings::test(number, seed).unwrap_or_default(),
            camera,
            codec: chance.pick(&[Codec::Mjpeg, Codec::Mjpeg, Codec::Mpeg4, Codec::H264]),
            delays: Delays::default(),
            begin: Duration::ZERO,
            lead: Duration::ZERO,
            target: Target::Person(1),
            first_box: FirstBox::Detected,
        }
    }

    pub fn experiment(self, id: SceneId, suite: Suite, tracker: TrackerName) -> Experiment {
        let settings = Settings { world: World::Room(self.room), ..self.camera };
        let scene = Scene {
            suite,
            test: None,
            title: id.to_string(),
            path: id.stratum.to_string(),
            place: Place::Camera(Box::new(settings)),
            begin: self.begin,
            lead: self.lead,
            duration: self.begin + LENGTH,
            target: self.target,
        };
        let (codec, delays, first_box) = (self.codec, self.delays, self.first_box);
        Experiment { codec, delays, first_box, ..Experiment::new(scene, tracker, id.seed) }
    }
}
