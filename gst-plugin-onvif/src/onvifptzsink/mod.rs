// SPDX-License-Identifier: MPL-2.0

//! SECTION:element-onvifptzsink
//!
//! # onvifptzsink
//!
//! Steers a pan-tilt-zoom camera of any make so that the target stays in the middle of the picture (thesis 3.6), by ONVIF.
//! Takes the video with the target meta that `lkfeaturetrack` attaches; it never reads the pixels, so any raw video in any
//! memory will do.
//!
//! All that a camera needs is `ContinuousMove` and some way to stop it: neither relative moves, nor a status that tells the
//! truth, nor a calibration run. What the camera does is seen in the picture.
//!
//! It behaves as `vapixptzsink` does, and has its properties, but for `profile` in place of `camera`. What differs:
//!
//! * A move lasts 2 s, or the nearest that the camera takes, and is renewed while it goes on: the camera stops by itself when
//!   this process, the machine or the network fails. A camera that refuses to be told a time is moved without, and a
//!   warning says so: then only `dead-man` stands behind it, as for VAPIX.
//! * A camera is stopped by `Stop`, or where it refuses or does not heed that, by a velocity of zero.
//! * Tokens carry the camera's own time, whatever this machine's is. A log-in that fails is tried once more with fresh time,
//!   then left alone, so that no account is locked. The password is never sent in clear: it is used for WS-UsernameToken's
//!   digest and for HTTP Digest, whichever the camera takes; for Basic only over https with a verified certificate, or with `auth=basic`.
//! * The position is used where the camera tells it in degrees. Without it the limits of pan and tilt cannot be kept, and
//!   an operator is not noticed. A camera that takes too long to tell it is not asked any more.
//! * How fast the camera turns at full velocity is learned from the picture, beginning at `camera-speed`.
//! * With `auto-zoom` the camera zooms by what the picture shows, as it tells nothing of its lens: `zoom-min` and `zoom-max`
//!   cannot be kept. While nobody is there the view is widened.
//! * There is no control queue, and no mode that centres on a pixel.
//!
//! User and password are taken from `user` and `password`, from `location`, or from the environment variables `ONVIF_USER`
//! and `ONVIF_PASSWORD`. A `location` without a path means `/onvif/device_service`.
//!
//! ## Example pipelines
//! ```sh
//! gst-launch-1.0 videotestsrc num-buffers=25 ! video/x-raw,width=320,height=240 ! onvifptzsink location=http://192.168.0.90/onvif/device_service user=admin password=pass
//! ```

use glib::prelude::*;

mod imp;

/// How the camera is moved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, glib::Enum)]
#[enum_type(name = "GstOnvifPtzSinkMode")]
pub enum Mode {
    /// `ContinuousMove`
    #[default]
    #[enum_value(name = "Continuously, by speed (ContinuousMove)", nick = "velocity")]
    Velocity,
    /// `AbsoluteMove`
    #[enum_value(name = "From position to position (AbsoluteMove, in degrees)", nick = "absolute")]
    Absolute,
    /// Pixels
    #[enum_value(name = "By pixels: no ONVIF camera takes these, so another mode is used", nick = "centre")]
    Centre,
}

/// How to authenticate to the camera.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, glib::Enum)]
#[enum_type(name = "GstOnvifPtzSinkAuthentication")]
pub enum Authentication {
    /// Never in clear.
    #[default]
    #[enum_value(
        name = "Digest; over https with a verified certificate also Basic, if the camera has never asked for Digest",
        nick = "auto"
    )]
    Auto,
    /// In clear too.
    #[enum_value(
        name = "As auto, but Basic whenever the camera asks for it: anybody on the network path can then read the password",
        nick = "basic"
    )]
    Basic,
}

/// To what the camera is steered.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, glib::Enum)]
#[enum_type(name = "GstOnvifPtzSinkSteering")]
pub enum Steering {
    /// After the target.
    #[default]
    #[enum_value(name = "After the target", nick = "follow")]
    Follow,
    /// Home.
    #[enum_value(name = "To `home`, whoever is there", nick = "home")]
    Home,
    /// To a place that is told.
    #[enum_value(name = "To `look-at`, whoever is there", nick = "look-at")]
    LookAt,
    /// Not at all.
    #[enum_value(name = "Not at all: the camera is stopped, and left to others", nick = "off")]
    Off,
}

/// How the target's motion is carried forward.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, glib::Enum)]
#[enum_type(name = "GstOnvifPtzSinkPrediction")]
pub enum Prediction {
    /// Thesis 3.16.
    #[enum_value(name = "With its mean over the last second (thesis 3.16)", nick = "average")]
    Average,
    /// Over the last moments.
    #[default]
    #[enum_value(name = "With its rate over the last 0.4 s and the change of that", nick = "lead")]
    Lead,
}

/// How the camera's speed grows with the speed step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, glib::Enum)]
#[enum_type(name = "GstOnvifPtzSinkSpeedCurve")]
pub enum SpeedCurve {
    /// In proportion.
    #[enum_value(name = "In proportion to the step", nick = "linear")]
    Linear,
    /// By the cube.
    #[default]
    #[enum_value(name = "By the cube of the step: in proportion to the ONVIF velocity", nick = "cubic")]
    Cubic,
}

sink::same_values! {
    Authentication = session::http::Authentication { Auto, Basic }
    Mode = servo::Mode { Velocity, Absolute, Centre }
    Prediction = servo::Prediction { Average, Lead }
    SpeedCurve = servo::SpeedCurve { Linear, Cubic }
    Steering = sink::Steering { Follow, Home, LookAt, Off }
}

glib::wrapper! {
    /// The element `onvifptzsink`.
    pub struct OnvifPtzSink(ObjectSubclass<imp::OnvifPtzSink>) @extends gst_base::BaseSink, gst::Element, gst::Object;
}

pub(crate) fn register(plugin: &gst::Plugin) -> Result<(), glib::BoolError> {
    gst::Element::register(Some(plugin), "onvifptzsink", gst::Rank::NONE, OnvifPtzSink::static_type())
}
