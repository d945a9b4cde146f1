// SPDX-License-Identifier: MPL-2.0

//! SECTION:element-lkfeaturetrack
//!
//! Follows one target by its feature points (thesis 3.5), also while the camera turns. Takes what
//! `bgavgdetect` saw, or the `GstVideoRegionOfInterestMeta`s of any other detector (`roi-type`), keeps a track of everybody who is
//! seen, chooses one of them as the target (`selection`), and attaches to every frame that holds a picture (neither to gaps
//! nor to what a decoder marks as corrupted, up to 31 in a row) a `PtzTracksMeta` of everybody, a `PtzTargetMeta`, and a region
//! of interest named `target` where there is one. Pixels pass untouched and uncopied.
//!
//! ## Tracks
//! Every track has a number, which is the target's number while it is the target. Of several people in one region each keeps their
//! own. Who is not seen is predicted for three seconds, or for `coast-time` where that is longer; then the track ends. Whoever comes
//! back in the same clothes within `memory-time` has their old number, and a target that was lost is taken up again before anybody
//! else. With `post-tracks` everybody who comes or goes is told of by an element message named `ptztrack-track` (`change`: `new`,
//! `back`, `merged` with the number `into` which it went, `gone`).
//!
//! Where the plugin is built with GStreamer 1.24 or later, its analytics library (`GstAnalyticsRelationMeta`) is spoken, too: object
//! detections whose class is `roi-type` count as detections, whichever element has made them, and every track that is seen is attached as an
//! object detection of that class (`object` where it is `bgavgdetect` who detects) with the track's confidence, related to a
//! tracking of its number.
//!
//! ## Groups
//! With `selection=group` everybody who goes somewhere is followed, in one box that holds all of them: together with `auto-zoom` of a sink
//! the camera keeps them all in the picture. The number is that of one of them. The box takes in who joins, and lets go of who has left or
//! stands for longer than `stationary-timeout`, within about a second, so that the camera does not jump.
//!
//! ## States
//! *Searching* → *tracking* → *occluded* (hidden: coasted for `coast-time` and looked for) → *tracking* again
//! or *lost* for one frame → *searching*. Every change goes upstream as an event, so that the detector
//! knows where the target is (with `profile=thesis` it sleeps meanwhile), and onto the bus as an element message named `ptztrack-target` (`change`:
//! `acquired`, `occluded`, `reacquired`, `lost`, `released`, and every `message-interval` a `position`).
//!
//! A change of size, a seek (flush) or a gap of more than two seconds loses the target: another picture.
//! Buffers that a leaky queue dropped before do not: all motion is taken over real time steps.
//!
//! ## Operator
//! A left click in any video sink (`GstNavigation`) selects the track there, or else a box of `manual-size`
//! around it. Of several who are seen as one it means the body that it is in the middle of, which is told apart from the
//! others when they part. A right click releases the target. The key `n` selects the track of the next number, a digit the
//! track of that number.
//! Applications emit `select-target` (x and y in frame sizes, 0 to 1), `select-track` (a number), `next-target` and
//! `release-target` instead; what is asked for while the element is stopped is forgotten. A number that nobody has is a warning, and the
//! target stays; so is a place where nothing stands out. What was released, with `selection=group` all of them, is not chosen again for
//! three seconds. The tracks in `ignored-tracks` are not chosen at all: they become
//! the target where they are selected.
//!
//! ## Giving up
//! Both limits are off by default: whoever guards a door wants to see who waits there. A message `released` says
//! why (`reason`: `request`, `stationary`, `max-tracking-time`), and the tracker searches again.
//!
//! `stationary-timeout` releases a target that stands still for longer. It stands while it stays within half its
//! width of where it was during the last seconds, and keeps its size. What a turning or zooming camera does to the
//! picture does not count, nor does a sway or a wave of the arms, nor the time in which it is hidden. The camera's
//! motion is seen in the background; where nothing is to be seen there, and with `profile=thesis`, the servo's
//! events tell whether the camera rests. Without a servo it does.
//!
//! Whatever the limits, a target that was chosen because it moves and has not left its place after 1.8 s is released as
//! `stationary`: what a screen shows never leaves the screen.
//!
//! Detections in the place of a target that was given up are not chosen until they have moved by about its width;
//! anybody elsewhere is, at once. The place goes with the background. It is forgotten after a change of size, a
//! seek or a gap, and when the camera turns too fast to be followed.
//!
//! `max-tracking-time` releases a target however it moves. Who walks on has moved at once, so it is not chosen for
//! three seconds besides: somebody else has a turn, or else it is followed again, as a new target.
//!
//! The limits hold for a target that was selected by hand as well. Selecting who was given up follows them again,
//! with all the time anew.
//!
//! ## Profiles
//! `profile=thesis` takes the steps of the thesis alone; `robust` adds the motion of the background, the
//! forward-backward test, new points for lost ones, and the target's silhouette, colours and greys.
//!
//! ## Pipelines
//!
//! Follow the largest thing that moves, and print what happens:
//! ```text
//! gst-launch-1.0 -m videotestsrc pattern=ball num-buffers=60 ! bgavgdetect ! lkfeaturetrack message-interval=500000000 ! fakesink
//! ```
//! The thesis as written, the target chosen nearest to the middle:
//! ```text
//! gst-launch-1.0 videotestsrc pattern=ball num-buffers=60 ! bgavgdetect ! lkfeaturetrack profile=thesis selection=nearest-centre ! fakesink
//! ```
//! Leave who stands for ten seconds to others, and nobody longer than two minutes in view:
//! ```text
//! gst-launch-1.0 -m videotestsrc pattern=ball num-buffers=60 ! bgavgdetect ! lkfeaturetrack stationary-timeout=10000000000 max-tracking-time=120000000000 ! fakesink
//! ```
//! Keep everybody who goes about in the picture:
//! ```text
//! gst-launch-1.0 videotestsrc pattern=ball num-buffers=60 ! bgavgdetect ! lkfeaturetrack selection=group ! fakesink
//! ```
//! An operator chooses with a click, the detections of another element help:
//! ```text
//! gst-launch-1.0 videotestsrc num-buffers=30 ! lkfeaturetrack selection=manual roi-type=person ! videoconvert ! fakesink
//! ```

use glib::prelude::*;

mod buffer;
#[allow(missing_docs, reason = "the derived property accessors are described by their blurbs")]
mod imp;
mod scene_source;

/// Which detection becomes the target.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, glib::Enum)]
#[enum_type(name = "GstLkFeatureTrackSelection")]
#[repr(i32)]
pub enum TargetSelection {
    /// The one of largest area.
    #[default]
    #[enum_value(name = "The detection of largest area", nick = "largest")]
    Largest,
    /// The one that was there first.
    #[enum_value(name = "The detection that was there first", nick = "first")]
    First,
    /// The one nearest to the middle of the frame.
    #[enum_value(name = "The detection nearest to the middle of the frame", nick = "nearest-centre")]
    NearestCentre,
    /// None until an operator or the application selects.
    #[enum_value(name = "None until a click or select-target selects", nick = "manual")]
    Manual,
    /// All who go somewhere, in one box.
    #[enum_value(name = "All detections that go somewhere, in one box", nick = "group")]
    Group,
}

/// Which steps are taken.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, glib::Enum)]
#[enum_type(name = "GstLkFeatureTrackProfile")]
#[repr(i32)]
pub enum Profile {
    /// Thesis 3.5 as written.
    #[enum_value(name = "The thesis as written: points, optical flow, mean-shift", nick = "thesis")]
    Thesis,
    /// With all that makes it follow one person in a crowd.
    #[default]
    #[enum_value(name = "With ego-motion, appearance, new points and coasting", nick = "robust")]
    Robust,
}

glib::wrapper! {
    /// Element `lkfeaturetrack`: follows one target.
    pub struct LkFeatureTrack(ObjectSubclass<imp::LkFeatureTrack>)
        @extends gst_video::VideoFilter, gst_base::BaseTransform, gst::Element, gst::Object;
}

pub(crate) fn register(plugin: &gst::Plugin) -> Result<(), glib::BoolError> {
    gst::Element::register(Some(plugin), "lkfeaturetrack", gst::Rank::NONE, LkFeatureTrack::static_type())
}
