// SPDX-License-Identifier: MPL-2.0

//! `GST_EVENT_CUSTOM_UPSTREAM` events: they pass tees and queues against the stream.

use std::time::Duration;

use crate::ContractError;
use crate::codec::{self, Reader};
use crate::{Rect, TargetState};

/// Tracker to detector: what it does, and where the target is, so that the detector does not take somebody who stands
/// for background; with `profile=thesis` it sleeps while the target is followed (thesis, figure 3.1). Sent on every
/// change of state, and with every picture while there is a target.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackerEvent {
    /// What the tracker does now.
    pub state: TargetState,
    /// The target's box, where there is a target.
    pub bounds: Option<Rect>,
}

impl TrackerEvent {
    const NAME: &'static str = "ptztrack-tracker";

    /// The event to push upstream.
    pub fn to_event(&self) -> gst::Event {
        let mut structure = gst::Structure::new_empty(Self::NAME);
        structure.set("state", self.state.name());
        if let Some(bounds) = self.bounds {
            structure.set("box", codec::rect(bounds));
        }
        gst::event::CustomUpstream::new(structure)
    }

    /// Reads an event: `None` where it is of another kind.
    pub fn of(event: &gst::EventRef) -> Option<Result<Self, ContractError>> {
        let structure = custom_upstream(event, Self::NAME)?;
        Some(Self::read(structure))
    }

    fn read(structure: &gst::StructureRef) -> Result<Self, ContractError> {
        let reader = Reader::new(structure, Self::NAME)?;
        Ok(Self { state: reader.named("state")?, bounds: reader.rect_optional("box")? })
    }
}

/// Servo to everyone upstream: what the camera does. Sent when it starts or stops moving, when its position becomes known,
/// and again and again while it moves: who hears nothing for [`CameraEvent::MOVING_HOLDS`] takes it for resting.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CameraEvent {
    /// Whether the camera was told to move and not yet told to stop.
    pub moving: bool,
    /// Pan in degrees, positive to the right.
    pub pan_deg: Option<f64>,
    /// Tilt in degrees, positive up.
    pub tilt_deg: Option<f64>,
    /// Commanded pan rate, degrees per second, positive to the right.
    pub pan_rate_deg_s: f64,
    /// Commanded tilt rate, degrees per second, positive up.
    pub tilt_rate_deg_s: f64,
    /// Horizontal field of view in degrees.
    pub horizontal_fov_deg: Option<f64>,
    /// Vertical field of view in degrees.
    pub vertical_fov_deg: Option<f64>,
}

impl CameraEvent {
    /// That the camera moves is true for so long after it was said: the servo may be gone, or cut off.
    pub const MOVING_HOLDS: Duration = Duration::from_secs(2);

    const NAME: &'static str = "ptztrack-camera-state";

    /// The event to push upstream.
    pub fn to_event(&self) -> gst::Event {
        let mut structure = gst::Structure::new_empty(Self::NAME);
        structure.set("moving", self.moving);
        structure.set("pan-rate", self.pan_rate_deg_s);
        structure.set("tilt-rate", self.tilt_rate_deg_s);
        let optional = [
            ("pan", self.pan_deg),
            ("tilt", self.tilt_deg),
            ("horizontal-fov", self.horizontal_fov_deg),
            ("vertical-fov", self.vertical_fov_deg),
        ];
        for (field, value) in optional {
            if let Some(value) = value {
                structure.set(field, value);
            }
        }
        gst::event::CustomUpstream::new(structure)
    }

    /// Reads an event: `None` where it is of another kind.
    pub fn of(event: &gst::EventRef) -> Option<Result<Self, ContractError>> {
        let structure = custom_upstream(event, Self::NAME)?;
        Some(Self::read(structure))
    }

    fn read(structure: &gst::StructureRef) -> Result<Self, ContractError> {
        let reader = Reader::new(structure, Self::NAME)?;
        Ok(Self {
            moving: reader.get("moving")?,
            pan_deg: reader.number_optional("pan")?,
            tilt_deg: reader.number_optional("tilt")?,
            pan_rate_deg_s: reader.number("pan-rate")?,
            tilt_rate_deg_s: reader.number("tilt-rate")?,
            horizontal_fov_deg: reader.number_optional("horizontal-fov")?,
            vertical_fov_deg: reader.number_optional("vertical-fov")?,
        })
    }
}

fn custom_upstream<'a>(event: &'a gst::EventRef, name: &str) -> Option<&'a gst::StructureRef> {
    (event.type_() == gst::EventType::CustomUpstream)
        .then(|| event.structure())
        .flatten()
        .filter(|structure| structure.name() == name)
}
