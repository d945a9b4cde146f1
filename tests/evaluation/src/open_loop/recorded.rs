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
    /// Everybody: in what shape, and who hides whom.
    pub people: Vec<Sighting>,
    /// How the background moved since the picture before, from its pixels to those of this one.
    pub motion: Option<Matrix>,
    /// What upstream was told of the camera after this picture.
    pub told: Option<CameraState>,
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
