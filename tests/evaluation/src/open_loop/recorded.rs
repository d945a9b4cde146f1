// SPDX-License-Identifier: MPL-2.0

//! What is kept of a scene. Pure data.

use std::time::Duration;

use ptztrack_contract::CameraEvent;
use serde::{Deserialize, Serialize};
use virtual_camera::{Matrix, Sighting};

use crate::record::FrameRecord;

/// A scene as a camera saw it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct RecordedScene {
    /// Of the encoded pictures, in GStreamer's words.
    pub caps: String,
    /// From one picture to the next.
    pub period: Duration,
    /// Index of the first picture that counts.
    pub first: usize,
    pub pictures: Vec<RecordedPicture>,
}

/// One picture and all that is true of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct RecordedPicture {
    /// When it came, since the world's start.
    pub arrival: Duration,
    /// As encoded.
    pub encoded: Vec<u8>,
    /// Where the camera looked, the person to be followed and everybody else.
    pub truth: FrameRecord,
    /// Everybody, in what shape.
    pub people: Vec<Sighting>,
    /// Who hides whom.
    pub hidings: Vec<Hiding>,
    /// How the background moved since the picture before, from its pixels to those of this one.
    pub motion: Option<Matrix>,
    /// What upstream was told of the camera after this picture.
    pub told: Option<CameraState>,
}

/// Somebody is behind somebody else.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Hiding {
    /// Number of who is behind.
    pub hidden: u32,
    /// Number of who is in front.
    pub by: u32,
    /// Part of the whole silhouette of who is behind, 0 to 1.
    pub part: f64,
}

impl Hiding {
    /// All among these people, as far as it is known who is nearer.
    pub fn all(people: &[Sighting]) -> Vec<Self> {
        let away = |one: &Sighting| one.truth.position_m.map(|[x, _, z]| x.hypot(z));
        let pairs = people.iter().flat_map(|hidden| people.iter().map(move |by| (hidden, by)));
        let nearer = pairs.filter(|(hidden, by)| away(hidden) > away(by) && away(by).is_some());
        let hiding = nearer.map(|(hidden, by)| Self {
            hidden: hidden.truth.id,
            by: by.truth.id,
            part: hidden.silhouette.part_behind(&by.silhouette),
        });
        hiding.filter(|hiding| hiding.part > 0.0).collect()
    }
}

/// A [`CameraEvent`] that can be kept.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct CameraState {
    pub moving: bool,
    /// Pan and tilt in degrees.
    pub position_deg: (f64, f64),
    /// As commanded, pan and tilt in degrees per second.
    pub rate_deg_s: (f64, f64),
    /// Horizontal and vertical, degrees.
    pub fov_deg: (f64, f64),
}

impl CameraState {
    pub fn event(&self) -> gst::Event {
        CameraEvent {
            moving: self.moving,
            pan_deg: Some(self.position_deg.0),
            tilt_deg: Some(self.position_deg.1),
            pan_rate_deg_s: self.rate_deg_s.0,
            tilt_rate_deg_s: self.rate_deg_s.1,
            horizontal_fov_deg: Some(self.fov_deg.0),
            vertical_fov_deg: Some(self.fov_deg.1),
        }
        .to_event()
    }
}
