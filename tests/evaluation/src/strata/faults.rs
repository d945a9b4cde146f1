// SPDX-License-Identifier: MPL-2.0

//! Cameras with a fault, one a scene: what their pictures show, when these come, and how they turn.

use std::time::Duration;

use virtual_camera::{Event, Lighting, Occlusion, Seeded, SpeedMap, Stall};

use super::draft::Draft;
use crate::record::Codec;

type Fault = fn(&mut Draft);

const FAULTS: [Fault; 19] = [
    |draft| draft.camera.imaging.hunting = 1.0,
    |draft| draft.camera.imaging.night = Some(Duration::from_secs(4)),
    |draft| draft.camera.imaging.overlay = true,
    |draft| draft.camera.imaging.vibration_deg = 0.15,
    |draft| draft.camera.imaging.noise_filter = 0.8,
    |draft| draft.room.shadows = true,
    |draft| draft.room.reflections = true,
    |draft| draft.room.events = vec![Event::Door, Event::Film, Event::Sun, Event::Draught],
    |draft| draft.codec = Codec::H264Low,
    |draft| draft.codec = Codec::Mpeg4Low,
    |draft| draft.camera.video.frame_rate = Some(10.0),
    |draft| draft.delays.video = Duration::from_millis(350),
    |draft| draft.camera.video.jitter = Duration::from_millis(250),
    |draft| {
        let stall = Stall { every: Duration::from_secs(5), lasts: Duration::from_millis(600) };
        draft.camera.video.stall = Some(stall);
    },
    |draft| {
        draft.delays.command = Duration::from_millis(5);
        draft.camera.kinematics.command_jitter = Duration::from_millis(245);
    },
    |draft| draft.camera.kinematics.speed_map = speeds(0.8),
    |draft| draft.camera.kinematics.speed_map = speeds(1.2),
    |draft| draft.camera.kinematics.acceleration_deg_s2 = 100.0,
    |draft| draft.camera.kinematics.backlash_deg = 0.3,
];

/// Those that the servo expects, by a factor.
fn speeds(factor: f64) -> SpeedMap {
    SpeedMap::Cubic { max_deg_s: 450.0 * factor, floor_deg_s: 0.05 * factor }
}

pub(super) fn faults(draft: &mut Draft, chance: &mut Seeded) {
    draft.room.occlusion = Occlusion::None;
    draft.room.lighting = Lighting::Optimal;
    chance.pick(&FAULTS)(draft);
}
