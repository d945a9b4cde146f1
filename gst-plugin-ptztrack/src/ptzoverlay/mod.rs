// SPDX-License-Identifier: MPL-2.0

//! SECTION:element-ptzoverlay
//!
//! Draws what `bgavgdetect` and `lkfeaturetrack` attached to a frame: contours and boxes of what moves,
//! the target with its feature points (kept green, rejected red: thesis figure 3.7), its centre of mass,
//! its recent trail, its state, and its offset from the middle of the frame. Each part is a property.
//!
//! Where downstream says that it draws a `GstVideoOverlayComposition` itself, the drawing is attached and
//! the pixels stay as they are; elsewhere they are drawn on. A frame without metas passes untouched.
//!
//! ## Pipelines
//!
//! Everything, on a test picture:
//! ```text
//! gst-launch-1.0 videotestsrc pattern=ball num-buffers=30 ! bgavgdetect ! lkfeaturetrack ! ptzoverlay ! videoconvert ! fakesink
//! ```
//! Only the target's box and a trail of ten seconds:
//! ```text
//! gst-launch-1.0 videotestsrc pattern=ball num-buffers=30 ! video/x-raw,width=640,height=360 ! bgavgdetect ! lkfeaturetrack ! ptzoverlay contours=false features=false offset=false cross-hair=false trail-duration=10000000000 ! fakesink
//! ```
//! What the detector alone sees:
//! ```text
//! gst-launch-1.0 videotestsrc pattern=ball num-buffers=30 ! bgavgdetect selection=all ! ptzoverlay ! fakesink
//! ```

use glib::prelude::*;

mod caps;
#[allow(missing_docs, reason = "the derived property accessors are described by their blurbs")]
mod imp;
mod pixels;

glib::wrapper! {
    /// Element `ptzoverlay`: draws what detector and tracker saw.
    pub struct PtzOverlay(ObjectSubclass<imp::PtzOverlay>) @extends gst::Element, gst::Object;
}

pub(crate) fn register(plugin: &gst::Plugin) -> Result<(), glib::BoolError> {
    gst::Element::register(Some(plugin), "ptzoverlay", gst::Rank::NONE, PtzOverlay::static_type())
}
