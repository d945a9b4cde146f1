//! What travels between ptztrack's elements: metas on buffers, upstream events and bus messages.
//!
//! Every kind is a typed struct with its [`gst::Structure`] form, so that an application in any
//! language reads the same fields that the elements exchange. Coordinates are normalised to the
//! frame (0 is left or top, 1 right or bottom), so that scaling between elements does no harm.
//!
//! | kind | struct | `GstStructure` name |
//! |---|---|---|
//! | meta | [`MotionMeta`] | `PtzMotionMeta` |
//! | meta | [`SceneMeta`] | `PtzSceneMeta` |
//! | meta | [`TargetMeta`] | `PtzTargetMeta` |
//! | upstream event | [`TrackerEvent`] | `ptztrack-tracker` |
//! | upstream event | [`CameraEvent`] | `ptztrack-camera-state` |
//! | element message | [`MotionMessage`] | `ptztrack-motion` |
//! | element message | [`TargetMessage`] | `ptztrack-target` |
//! | element message | [`CameraMessage`] | `ptztrack-camera` |

mod codec;
mod error;
mod events;
mod geometry;
mod homography;
mod messages;
mod meta;
mod motion;
mod scene;
mod target;

pub use error::ContractError;
pub use events::{CameraEvent, TrackerEvent};
pub use geometry::{Point, Rect, Vector};
pub use homography::Homography;
pub use messages::{
    CameraChange, CameraMessage, MotionChange, MotionMessage, ReleaseReason, TargetChange, TargetMessage,
    Times,
};
pub use meta::BufferMeta;
pub use motion::{MOTION_ROI, MotionMeta, Region, RegionTrack};
pub use scene::{CameraMotion, Plane, SceneMeta};
pub use target::{Feature, TARGET_ROI, TargetMeta, TargetState};
