//! SECTION:element-bgavgdetect
//!
//! Finds what moves in the picture of a camera at rest, by background subtraction with the averaging
//! method (thesis 3.2 to 3.4): running mean of every pixel, foreground by `test`, opening, closing,
//! contours. Attaches a `PtzMotionMeta` to every frame that was looked at (no regions: nothing moved) and
//! a region of interest named `motion` for each region. Pixels pass untouched and uncopied.
//!
//! ## The background
//! The mean follows the picture with weight `alpha` for pictures that come `alpha-interval` apart. For
//! other distances, measured by timestamps, the weight is scaled: 1 − (1 − α)^(distance/interval). So the
//! frame rate, a variable one too, does not change what is found. `alpha-interval=0` gives every picture
//! the weight `alpha`, as the thesis has it: at 25 frames a second, only the edges of a walker are found.
//!
//! With `test=relative`, a pixel is foreground when it differs from the mean of the pictures before by
//! `threshold` of that mean or more (thesis 3.3); with `test=spread`, when it differs by more than
//! `spread-factor` standard deviations of the last `window` pictures (thesis 3.2). In both, a difference
//! below `noise-floor` grey levels never counts.
//!
//! ## Learning
//! The background is learned from `warm-up` pictures, during which nothing is reported, after: start, new
//! caps, a flush, time that runs backwards, a DISCONT or gap of more than `max-gap` (a leaky queue marks
//! whatever follows a dropped frame as DISCONT, which is no reason to learn anew), more than
//! `relearn-fraction` of the picture in the foreground, waking, and rest of the camera.
//!
//! It sleeps while a tracker downstream says by its event that it follows a target, and does not look
//! while a servo says that the camera moves, and for `settle-time` after. Without such events it always looks.
//!
//! ## Regions
//! Wide pictures are reduced to `analysis-width` first. The closing is upright, as people are: it joins
//! head and legs and not neighbours. The mean keeps a trail of whoever walked through; with `shed-trail`, a
//! region is cut to where the picture has changed within the last 100 ms; one in which hardly anything
//! changed stands and is left as it is. A region is reported in the `confirm-frames`th
//! picture in a row that shows it; `selection` says which. Pixels outside `zones` or in `exclude-zones`
//! are never foreground; both are polygons separated by `;`, each of three or more points `x,y` separated
//! by spaces, with x and y from 0 (left, top) to 1 (right, bottom).
//!
//! ## Profiles
//! `profile=thesis` takes the steps of the thesis alone: no noise floor, no shedding of trails, no learning anew, every
//! picture at its own size and of the same weight, a region reported as soon as it is seen, and, where no size is given,
//! a square closing. It overrides the properties of these steps.
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
//! gst-launch-1.0 videotestsrc pattern=ball num-buffers=60 ! bgavgdetect output=mask threshold=0.1 noise-floor=8 ! videoconvert ! autovideosink
//! ```
//! Only the moving region, the rest transparent (before a chequered ground):
//! ```text
//! gst-launch-1.0 videotestsrc pattern=ball num-buffers=60 ! bgavgdetect output=foreground ! compositor background=checker ! videoconvert ! autovideosink
//! ```
//! Everything that moves in the left half, but not where the trees are:
//! ```text
//! gst-launch-1.0 videotestsrc pattern=ball num-buffers=60 ! bgavgdetect selection=all zones="0,0 0.5,0 0.5,1 0,1" exclude-zones="0,0 0.2,0 0.2,0.3; 0.3,0 0.5,0 0.5,0.2" ! fakesink
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
        name = "With noise floor, upright closing, shed trails, confirmation and learning anew",
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
pub enum Selection {
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
