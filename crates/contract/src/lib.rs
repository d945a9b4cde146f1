// SPDX-License-Identifier: MPL-2.0

//! What travels between ptztrack's elements: metas on buffers, upstream events and bus messages.
//!
//! Every kind is a typed struct with its [`gst::Structure`] form, so that an application in any
//! language reads the same fields that the elements exchange. Coordinates are normalised to the
//! frame (0 is left or top, 1 right or bottom), so that scaling between elements does no harm. Without the feature
//! `gst` there are only the plain records, for who computes with them and knows no GStreamer.
//!
//! | kind | struct | `GstStructure` name |
//! |---|---|---|
//! | meta | [`MotionMeta`] | `PtzMotionMeta` |
//! | meta | [`SceneMeta`] | `PtzSceneMeta` |
//! | meta | [`TargetMeta`] | `PtzTargetMeta` |
//! | meta | [`TracksMeta`] | `PtzTracksMeta` |
//! | upstream event | [`TrackerEvent`] | `ptztrack-tracker` |
//! | upstream event | [`CameraEvent`] | `ptztrack-camera-state` |
//! | element message | [`MotionMessage`] | `ptztrack-motion` |
//! | element message | [`TargetMessage`] | `ptztrack-target` |
//! | element message | [`TrackMessage`] | `ptztrack-track` |
//! | element message | [`CameraMessage`] | `ptztrack-camera` |

#[cfg(feature = "gst")]
mod codec;
mod duration;
#[cfg(feature = "gst")]
mod error;
#[cfg(feature = "gst")]
mod events;
mod geometry;
mod homography;
pub mod lock;
#[cfg(feature = "gst")]
mod messages;
#[cfg(feature = "gst")]
mod meta;
#[cfg(feature = "gst")]
mod motion;
mod named;
#[cfg(feature = "gst")]
mod refused_values;
#[cfg(feature = "gst")]
mod scene;
mod target;
#[cfg(feature = "gst")]
mod target_meta;
#[cfg(feature = "gst")]
mod tracks;
#[cfg(feature = "gst")]
mod view;

pub use duration::mistaken_unit;
pub use geometry::{Point, Rect, Vector, aspect};
pub use homography::Homography;
pub use target::{TARGET_ROI, TargetState};

/// What travels, beside the plain records: each with its `GstStructure` form.
#[cfg(feature = "gst")]
mod forms {
    pub use crate::error::ContractError;
    pub use crate::events::{CameraEvent, TrackerEvent};
    pub use crate::messages::{
        CameraChange, CameraMessage, MOVE_REFUSED, MotionChange, MotionMessage, ReleaseReason, TargetChange,
        TargetMessage, Times,
    };
    pub use crate::meta::BufferMeta;
    pub use crate::motion::{MOTION_ROI, MotionMeta, Region};
    pub use crate::refused_values::RefusedValues;
    pub use crate::scene::{CameraMotion, Plane, SceneMeta};
    pub use crate::target_meta::{Feature, TargetMeta};
    pub use crate::tracks::{Track, TrackChange, TrackMessage, TrackState, TracksMeta};
    pub use crate::view::View;
}
#[cfg(feature = "gst")]
pub use forms::*;
