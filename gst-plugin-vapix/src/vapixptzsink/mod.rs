// SPDX-License-Identifier: MPL-2.0

//! SECTION:element-vapixptzsink
//!
//! # vapixptzsink
//!
//! Steers an Axis pan-tilt-zoom camera so that the target stays in the middle of the picture
//! (thesis 3.6). Takes the video with the target meta that `lkfeaturetrack` attaches; it never reads the
//! pixels, so any raw video in any memory will do.
//!
//! The streaming thread never waits for the network: it leaves the newest target for a task that talks to the camera, with
//! one request in flight and at most `max-rate` commands a second. All durations are nanoseconds. `sync` and `async` are
//! off by default: a late target is worth nothing, and a pipeline must not wait for this sink to preroll.
//!
//! After a target that goes out of the picture the camera keeps turning for `search-time`, to where it would be by now.
//! Otherwise the camera is stopped when the target is lost or released, hidden or not seen for `stale-timeout`, on EOS, on a flush, when leaving
//! PLAYING, when the element goes to READY or NULL, and when it is disposed of. A stop is repeated until the camera confirms
//! it. EOS waits for that for up to 1 s, leaving PLAYING does not wait, and READY waits until 2.5 s after PLAYING was left: a
//! bin pauses all its sinks first, so many take no longer than one. In PAUSED the camera is queried but never moved; in
//! READY nothing is connected.
//!
//! A process that has died can stop nothing. With `dead-man`, another process, `vapix-watchdog`, holds a lease for as long as
//! the camera may move, and stops the camera as soon as this process ends, or 2 s after it hangs. It is started with the
//! first move. `stats` shows its state as `dead-man`; if it cannot be started, one warning says so.
//!
//! The password is never sent in clear: it is used for Digest, or, over https with a verified certificate, for Basic if the camera
//! has never asked for Digest. `auth=basic` allows Basic without that too.
//!
//! User and password are taken from `user` and `password`, from `location` (`http://user:password@host`; they are removed
//! from it at once), or from the environment variables `VAPIX_USER` and `VAPIX_PASSWORD`, which keep them out of process
//! lists and of the parser's log. `user`, `password` and everything about the servo can be changed while playing;
//! `location`, `camera`, `auth`, `timeout`, `ca-file`, `insecure`, `home-at-start`, `dead-man`, `dead-man-socket` and
//! `lockstep` take effect at the next change from READY to PAUSED.
//!
//! With `lockstep` the servo's time is the stream's running time and stands still between buffers: each buffer waits until
//! the camera has answered what is due at its time. A simulated camera that advances only then gives the same run every
//! time, at any speed. It is for simulations: a camera that does not answer holds the stream for up to `timeout`.
//!
//! ## What it learns
//! What the camera reports about itself (field of view, zoom, speed table, limits) is used. The rest is learned while a
//! target is followed, by comparing the background's motion in the picture with the commands: `latency`, `field-of-view`,
//! `camera-speed` and `speed-curve` are only the starting point; `learn=false` keeps them as set. `stats` has the current
//! values: `latency` (ns), `field-of-view` (degrees), `speeds` (degrees per second of the steps 1 to 100), and the camera's
//! own limits, `camera-pan-min` to `camera-zoom-max` and `camera-endless-pan`. What the camera reported is logged in one line
//! at level INFO. If the loop oscillates, the gain is lowered, with a warning.
//!
//! ## Seeking and following
//! In `mode=velocity` a new target is sought at up to twice `gain`, by dead reckoning from the commands sent, until it is
//! within `dead-zone` or for 2 s at most; from then on it is followed at `gain`, by what the pictures show. Steeply below
//! the camera, and while the gain is lowered because the loop oscillates, it is followed from the start. While the camera
//! pans, tilt corrects offsets beyond a third of `dead-zone`.
//!
//! ## Between tracker and camera
//! A picture may be scaled between the tracker and this sink. One that is cropped or gets borders is refused, with a
//! warning. One that is flipped or turned (`videoflip`) cannot be told from any other: put that element in front of the
//! tracker, and see the next section.
//!
//! ## Mounting
//! `rotation` is for pictures that arrive turned clockwise; `invert-pan` and `invert-tilt` are for a camera that hangs, or
//! whose axis turns the picture the other way. Positions, limits and `home` stay those that the camera reports.
//!
//! ## Zoom and limits
//! With `auto-zoom` the target's height is kept at `target-height`, and the camera zooms out when the target is not seen
//! well. `pan-min`, `pan-max`, `tilt-min`, `tilt-max`, `zoom-min` and `zoom-max` bound what the servo does, within what the
//! camera can do; an operator may go beyond them. Zoom steps are those of the lens, 1 to 9999. Digital zoom, beyond that,
//! shows no more detail and is not used; since no camera reports how much it magnifies, the field of view is assumed to be
//! that at the long end of the lens while an operator uses it. In `mode=centre` the limits are kept as exactly as field of
//! view and position are known. A minimum above its maximum is refused with a warning, and the pair keeps its old values.
//!
//! ## Modes
//! A camera that does not support `mode`, by its parameters or because it refuses such commands while it answers
//! everything else, is moved by the best mode it does support: an info message says so, and `stats` has it as
//! `mode`; the property stays as it is. A refused mode is retried every minute, and when `mode` changes.
//!
//! ## Home
//! After `home-timeout` without a target the camera goes to `home`, if that is set: `pan,tilt` or `pan,tilt,zoom`, the
//! name of a preset, or `start`, where it looked when it connected. With `home-at-start` it also goes there on start-up.
//! `home` is kept within the limits, unless it is a preset. `steering=home` sends it there at once, whoever is there;
//! `steering=look-at` turns it to where `look-at` says, as for somebody whom another camera sees.
//! `steering=off` stops it and leaves it to others, until `steering=follow`.
//!
//! ## Operators
//! An operator comes first. When the camera's position contradicts the commands, or its control queue says that it is
//! somebody else's turn, steering pauses until nobody has moved it for `override-timeout`, or until it is our turn. Only a
//! turn of more than 1.5 degrees that no command explains counts; zooming by hand counts only with `auto-zoom`. A camera
//! that is already moving when the connection is made is stopped, as whoever started the move may be gone.
//!
//! ## Messages and events
//! Element messages `ptztrack-camera` with `change` = `connected`, `disconnected`, `refused`, `at-limit`, `taken-over`,
//! `resumed`, `moving`, `stopped`. A fault is one warning when it begins and one `connected` when it ends; one that comes
//! and goes is reported at most every 10 s. Upstream events `ptztrack-camera-state` tell detector and tracker what the
//! camera does.
//!
//! ## Example pipelines
//! ```sh
//! gst-launch-1.0 videotestsrc num-buffers=25 ! video/x-raw,width=320,height=240 ! vapixptzsink location=http://192.168.0.90 user=root password=pass
//! ```
//! A camera with a self-signed certificate, saved in a file, over HTTPS; never faster than 30 degrees a second:
//! ```sh
//! gst-launch-1.0 videotestsrc num-buffers=25 ! vapixptzsink location=https://192.168.0.90 ca-file=camera.pem max-speed=30 mode=velocity
//! ```
//! A camera that returns to its preset "Door" after 20 s without a target, zooms, and never pans farther left than 60 degrees:
//! ```sh
//! gst-launch-1.0 videotestsrc num-buffers=25 ! vapixptzsink location=http://192.168.0.90 home=Door home-timeout=20000000000 auto-zoom=true target-height=0.5 pan-min=-60
//! ```

use glib::prelude::*;

mod imp;

/// How the camera is moved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, glib::Enum)]
#[enum_type(name = "GstVapixPtzSinkMode")]
pub enum Mode {
    /// `continuouspantiltmove`
    #[default]
    #[enum_value(name = "Continuously, by speed (continuouspantiltmove)", nick = "velocity")]
    Velocity,
    /// `pan` and `tilt`
    #[enum_value(name = "From position to position (pan, tilt)", nick = "absolute")]
    Absolute,
    /// `center`
    #[enum_value(name = "By pixels; the camera works out the angles (center)", nick = "centre")]
    Centre,
}

/// How to authenticate to the camera.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, glib::Enum)]
#[enum_type(name = "GstVapixPtzSinkAuthentication")]
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
#[enum_type(name = "GstVapixPtzSinkSteering")]
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
#[enum_type(name = "GstVapixPtzSinkPrediction")]
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
#[enum_type(name = "GstVapixPtzSinkSpeedCurve")]
pub enum SpeedCurve {
    /// In proportion.
    #[enum_value(name = "In proportion to the step", nick = "linear")]
    Linear,
    /// By the cube.
    #[default]
    #[enum_value(name = "By the cube of the step (Axis' example table)", nick = "cubic")]
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
    /// The element `vapixptzsink`.
    pub struct VapixPtzSink(ObjectSubclass<imp::VapixPtzSink>) @extends gst_base::BaseSink, gst::Element, gst::Object;
}

pub(crate) fn register(plugin: &gst::Plugin) -> Result<(), glib::BoolError> {
    gst::Element::register(Some(plugin), "vapixptzsink", gst::Rank::NONE, VapixPtzSink::static_type())
}
