// SPDX-License-Identifier: MPL-2.0

//! SECTION:element-bgavgdetect
//!
//! Finds what moves, whether the camera rests or turns, by background subtraction (thesis 3.2 to 3.4): running mean
//! and spread of every pixel, foreground by their difference, opening, closing, contours. Attaches to every frame a
//! `PtzMotionMeta` (no regions: nothing moved), a region of interest named `motion` for each region, and a
//! `PtzSceneMeta` with the motion of the camera, the reduced picture, the likelihood of foreground and the mean of the
//! background. Pixels pass untouched and uncopied.
//!
//! ## The background
//! It travels with the camera: the motion of the picture is measured once a frame on the frame reduced to
//! `analysis-width`, and the background is carried along (Yi et al., CVPR Workshops 2013). What was just turned into view
//! is learned within four frames. What stays the same becomes background after 6 s, except where a tracker says that it
//! sees its target; there, less difference from the background is enough for a region.
//!
//! Where the camera's motion cannot be seen and the picture shows another place, and after: start, new caps, a flush, a
//! DISCONT or gap of more than `max-gap` (a leaky queue marks whatever follows a dropped frame as DISCONT, which is no
//! reason to learn anew) or into the past, the background is learned anew. Nothing is reported in the first `warm-up`
//! frames of a stream.
//!
//! ## Regions
//! The closing is upright, as people are: it joins head and legs and not neighbours. A region is reported in the
//! `confirm-frames`th picture in a row that shows it; `selection` says which.
//!
//! Regions whose middle lies outside `zones` or in `exclude-zones` are not reported, and nobody is chosen there; whoever is
//! followed may go there. Both are polygons separated by `;`, each of three or more points `x,y` separated by spaces, with
//! x and y from 0 (left, top) to 1 (right, bottom) of the picture in which they are set. When the camera turns, they go
//! with the background.
//!
//! ## Profiles
//! `profile=thesis` takes the steps of the thesis alone, for a camera at rest: `alpha`, `test`, `threshold`,
//! `spread-factor` and `window` are those of its equations 3.1 to 3.3, every picture is looked at in its own size and has
//! the same weight, a region is reported as soon as it is seen, the closing is square where no size is given, and pixels
//! outside the zones are never foreground. It
//! sleeps while a tracker downstream says that it follows a target and while a servo says that the camera moves, and for
//! `settle-time` after, and then learns anew from `warm-up` pictures. These properties do nothing in the other profile.
//!
//! ## Messages
//! An element message `ptztrack-motion` with `change` (`start`, `end`), `timestamp`, `running-time`,
//! `stream-time`, `regions` (number) and `box` (of the first region) when motion starts, and when nothing
//! has moved for `end-delay` or the stream ends. None while it does not look.
//!
//! ## Pipelines
//!
//! Print when something starts and ceases to move:
//! ```text
//! gst-launch-1.0 -m videotestsrc pattern=ball num-buffers=60 ! bgavgdetect ! fakesink
//! ```
//! See what the detector sees, while tuning it:
//! ```text
//! gst-launch-1.0 videotestsrc pattern=ball num-buffers=60 ! bgavgdetect output=mask profile=thesis threshold=0.1 ! videoconvert ! autovideosink
//! ```
//! Only the moving region, the rest transparent (before a chequered ground):
//! ```text
//! gst-launch-1.0 videotestsrc pattern=ball num-buffers=60 ! bgavgdetect output=foreground ! compositor background=checker ! videoconvert ! autovideosink
//! ```
//! Everything that moves in the right half, but not where the trees are:
//! ```text
//! gst-launch-1.0 videotestsrc pattern=ball num-buffers=60 ! bgavgdetect selection=all zones="0.5,0 1,0 1,1 0.5,1" exclude-zones="0.5,0 0.7,0 0.7,0.3; 0.8,0 1,0 1,0.2" ! fakesink
//! ```
//! The thesis as written:
//! ```text
//! gst-launch-1.0 videotestsrc pattern=ball num-buffers=60 ! bgavgdetect profile=thesis ! fakesink
//! ```

use glib::prelude::*;

mod caps;
#[allow(missing_docs, reason = "the derived property accessors are described by their blurbs")]
mod imp;
mod settings;
mod stream;

/// What leaves the element.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, glib::Enum)]
#[enum_type(name = "GstBgAvgDetectOutput")]
#[repr(i32)]
pub enum Output {
    /// The frames themselves.
    #[default]
    #[enum_value(name = "The frames, untouched", nick = "frame")]
    Frame,
    /// The cleaned foreground mask.
    #[enum_value(name = "The foreground after opening and closing, 255 on 0 (GRAY8)", nick = "mask")]
    Mask,
    /// The frames with the reported regions in alpha (thesis 3.4.2).
    #[enum_value(name = "The frames, opaque only within the reported regions (RGBA)", nick = "foreground")]
    Foreground,
}

/// Which steps are taken.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, glib::Enum)]
#[enum_type(name = "GstBgAvgDetectProfile")]
#[repr(i32)]
pub enum Profile {
    /// Thesis 3.2 to 3.4 as written.
    #[enum_value(name = "The thesis as written: running mean, opening, closing, contours", nick = "thesis")]
    Thesis,
    /// With all that makes it find people in noise, at any frame rate.
    #[default]
    #[enum_value(
        name = "With a background that travels with the camera, upright closing and confirmation",
        nick = "robust"
    )]
    Robust,
}

/// How foreground is told from background.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, glib::Enum)]
#[enum_type(name = "GstBgAvgDetectTest")]
#[repr(i32)]
pub enum Test {
    /// By a fraction of the mean (thesis 3.3).
    #[default]
    #[enum_value(name = "Difference of `threshold` times the mean", nick = "relative")]
    Relative,
    /// By the windowed standard deviation (thesis 3.2).
    #[enum_value(name = "Difference of `spread-factor` standard deviations over `window`", nick = "spread")]
    Spread,
}

/// Which regions are reported.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, glib::Enum)]
#[enum_type(name = "GstBgAvgDetectSelection")]
#[repr(i32)]
pub enum RegionSelection {
    /// The one of longest contour.
    #[enum_value(name = "The region whose contour is longest", nick = "largest-perimeter")]
    LargestPerimeter,
    /// All.
    #[default]
    #[enum_value(name = "All regions between min-area and max-area", nick = "all")]
    All,
}

glib::wrapper! {
    /// Element `bgavgdetect`: finds what moves.
    pub struct BgAvgDetect(ObjectSubclass<imp::BgAvgDetect>)
        @extends gst_video::VideoFilter, gst_base::BaseTransform, gst::Element, gst::Object;
}

pub(crate) fn register(plugin: &gst::Plugin) -> Result<(), glib::BoolError> {
    gst::Element::register(Some(plugin), "bgavgdetect", gst::Rank::NONE, BgAvgDetect::static_type())
}
