// SPDX-License-Identifier: MPL-2.0

//! Element messages on the bus. Loss is never silent.

use crate::codec::{self, Reader};
use crate::named::named_enum;
use crate::{ContractError, Point, Rect, TargetState, Vector};

/// Name of the details of a warning that the camera refuses to be sent to a position, be it home.
pub const MOVE_REFUSED: &str = "ptztrack-move-refused";

/// The three times that GStreamer's own analysers put on a message; `None` where the stream has none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Times {
    /// The buffer's timestamp.
    pub timestamp: Option<gst::ClockTime>,
    /// The same as running time.
    pub running_time: Option<gst::ClockTime>,
    /// The same as stream time.
    pub stream_time: Option<gst::ClockTime>,
}

impl Times {
    /// The times of a buffer with timestamp `pts` in `segment` (of any format; only time has times).
    pub fn of(segment: &gst::Segment, pts: Option<gst::ClockTime>) -> Self {
        let time_segment = segment.downcast_ref::<gst::ClockTime>();
        Self {
            timestamp: pts,
            running_time: time_segment.and_then(|segment| segment.to_running_time(pts)),
            stream_time: time_segment.and_then(|segment| segment.to_stream_time(pts)),
        }
    }

    pub(crate) fn write(&self, structure: &mut gst::StructureRef) {
        let fields = [
            ("timestamp", self.timestamp),
            ("running-time", self.running_time),
            ("stream-time", self.stream_time),
        ];
        for (field, time) in fields {
            if let Some(time) = time {
                structure.set(field, time);
            }
        }
    }

    pub(crate) fn read(reader: &Reader) -> Result<Self, ContractError> {
        Ok(Self {
            timestamp: reader.get_optional("timestamp")?,
            running_time: reader.get_optional("running-time")?,
            stream_time: reader.get_optional("stream-time")?,
        })
    }
}

named_enum! {
    /// What happened to the motion in the picture.
    MotionChange {
        /// Something began to move.
        Start = "start",
        /// Nothing moves any more.
        End = "end",
    }
}

/// Posted by the detector when motion starts and ends.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionMessage {
    /// What happened.
    pub change: MotionChange,
    /// When.
    pub times: Times,
    /// How many regions move.
    pub regions: u32,
    /// The box of the first of them.
    pub bounds: Option<Rect>,
}

impl MotionMessage {
    const NAME: &'static str = "ptztrack-motion";

    /// Its `GstStructure` form, for an element message.
    pub fn to_structure(&self) -> gst::Structure {
        let mut structure = gst::Structure::new_empty(Self::NAME);
        structure.set("change", self.change.name());
        self.times.write(&mut structure);
        structure.set("regions", self.regions);
        if let Some(bounds) = self.bounds {
            structure.set("box", codec::rect(bounds));
        }
        structure
    }

    /// Reads the structure of an element message.
    pub fn from_structure(structure: &gst::StructureRef) -> Result<Self, ContractError> {
        let reader = Reader::new(structure, Self::NAME)?;
        Ok(Self {
            change: reader.named("change")?,
            times: Times::read(&reader)?,
            regions: reader.get("regions")?,
            bounds: reader.rect_optional("box")?,
        })
    }
}

named_enum! {
    /// What happened to the target.
    TargetChange {
        /// A target was chosen and is followed.
        Acquired = "acquired",
        /// The target disappeared; it is looked for where it should be.
        Occluded = "occluded",
        /// The same target was found again after an occlusion.
        Reacquired = "reacquired",
        /// The target was given up.
        Lost = "lost",
        /// The target was released on purpose; the [`ReleaseReason`] says why.
        Released = "released",
        /// Nothing happened: a periodic report of where the target is.
        Position = "position",
    }
}

named_enum! {
    /// Why a target was released.
    ReleaseReason {
        /// An operator or the application asked for it.
        Request = "request",
        /// It stood still for longer than `stationary-timeout`.
        Stationary = "stationary",
        /// It was tracked for longer than `max-tracking-time`.
        MaxTrackingTime = "max-tracking-time",
    }
}

/// Posted by the tracker on every change, and every `message-interval` in between.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetMessage {
    /// What happened.
    pub change: TargetChange,
    /// Why the target was released, where it was.
    pub reason: Option<ReleaseReason>,
    /// When.
    pub times: Times,
    /// What the tracker does now.
    pub state: TargetState,
    /// Number of the target.
    pub id: u64,
    /// Its box.
    pub bounds: Rect,
    /// Its centre of mass.
    pub centroid: Point,
    /// Its motion in the picture, frames per second of time.
    pub velocity: Vector,
    /// 0 to 1.
    pub confidence: f64,
}

impl TargetMessage {
    const NAME: &'static str = "ptztrack-target";

    /// Its `GstStructure` form, for an element message.
    pub fn to_structure(&self) -> gst::Structure {
        let mut structure = gst::Structure::new_empty(Self::NAME);
        structure.set("change", self.change.name());
        if let Some(reason) = self.reason {
            structure.set("reason", reason.name());
        }
        self.times.write(&mut structure);
        structure.set("state", self.state.name());
        structure.set("id", self.id);
        structure.set("box", codec::rect(self.bounds));
        structure.set("centroid", codec::point(self.centroid));
        structure.set("velocity", codec::vector(self.velocity));
        structure.set("confidence", self.confidence);
        structure
    }

    /// Reads the structure of an element message.
    pub fn from_structure(structure: &gst::StructureRef) -> Result<Self, ContractError> {
        let reader = Reader::new(structure, Self::NAME)?;
        Ok(Self {
            change: reader.named("change")?,
            reason: reader.named_optional("reason")?,
            times: Times::read(&reader)?,
            state: reader.named("state")?,
            id: reader.get("id")?,
            bounds: reader.rect("box")?,
            centroid: reader.point("centroid")?,
            velocity: reader.vector("velocity")?,
            confidence: reader.number("confidence")?,
        })
    }
}

named_enum! {
    /// What happened to the camera.
    CameraChange {
        /// It answers and is under control.
        Connected = "connected",
        /// It stopped answering.
        Disconnected = "disconnected",
        /// It answers, but refuses: wrong credentials, no right to move, no such command.
        Refused = "refused",
        /// It reached the end of its pan or tilt range.
        AtLimit = "at-limit",
        /// Somebody else moves it.
        TakenOver = "taken-over",
        /// Nobody else moves it any more: it is under control again.
        Resumed = "resumed",
        /// It was told to move.
        Moving = "moving",
        /// It was told to stop and said yes.
        Stopped = "stopped",
    }
}

/// Posted by the servo.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraMessage {
    /// What happened.
    pub change: CameraChange,
    /// When: only the running time, as a camera is not a buffer.
    pub times: Times,
    /// In words, for a person.
    pub detail: String,
}

impl CameraMessage {
    const NAME: &'static str = "ptztrack-camera";

    /// Its `GstStructure` form, for an element message.
    pub fn to_structure(&self) -> gst::Structure {
        let mut structure = gst::Structure::new_empty(Self::NAME);
        structure.set("change", self.change.name());
        self.times.write(&mut structure);
        structure.set("detail", self.detail.as_str());
        structure
    }

    /// Reads the structure of an element message.
    pub fn from_structure(structure: &gst::StructureRef) -> Result<Self, ContractError> {
        let reader = Reader::new(structure, Self::NAME)?;
        Ok(Self {
            change: reader.named("change")?,
            times: Times::read(&reader)?,
            detail: reader.get("detail")?,
        })
    }
}
