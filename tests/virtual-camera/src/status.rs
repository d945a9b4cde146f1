// SPDX-License-Identifier: MPL-2.0

//! What tests ask a camera, and how they trouble it.

use std::time::Duration;

use serde::{Serialize, Serializer};

/// A camera at one moment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Status {
    /// Since the camera's start; seconds in JSON.
    #[serde(serialize_with = "seconds")]
    pub time: Duration,
    /// Degrees, growing to the right.
    pub pan_deg: f64,
    /// Degrees, growing upwards.
    pub tilt_deg: f64,
    /// VAPIX zoom steps, 1 to 9999.
    pub zoom_step: f64,
    /// Times the widest picture.
    pub magnification: f64,
    /// Degrees that the picture's width covers.
    pub horizontal_fov_deg: f64,
    /// Degrees per second.
    pub pan_rate_deg_s: f64,
    /// Degrees per second.
    pub tilt_rate_deg_s: f64,
    /// Zoom steps per second.
    pub zoom_rate_step_s: f64,
    /// Whether it moves, was told to move and not yet to stop (even against a limit), or a command is still under way.
    pub moving: bool,
    /// Number of the recording's picture in front of the sensor, from 0. What clients receive is older by the video delay.
    pub footage_frame: u64,
    /// Requests to `ptz.cgi` and `param.cgi` so far, whatever became of them.
    pub requests: u64,
    /// Requests to `ptz.cgi` in the list of commands so far.
    pub commands: u64,
    /// Requests answered with 401 so far.
    pub refused: u64,
    /// The most requests to `ptz.cgi` and `param.cgi` that were ever waiting for their answer at the same time.
    pub most_in_flight: u64,
    /// Video clients at this moment.
    pub viewers: u64,
}

/// A request that came to `ptz.cgi`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ReceivedCommand {
    /// From 1, in order of arrival.
    pub number: u64,
    /// When it was answered, since the camera's start; seconds in JSON.
    #[serde(serialize_with = "seconds")]
    pub time: Duration,
    /// The query or form as it was on the wire.
    pub query: String,
    /// HTTP status of the answer; 0 where a fault left none.
    pub status: u16,
}

/// How `ptz.cgi` and `param.cgi` misbehave. Video streams and the live page go on in any case.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Fault {
    /// Not at all.
    #[default]
    None,
    /// Commands act at once, their answers come this much later.
    Delay(Duration),
    /// Nobody listens on the HTTP port; requests on open connections are reset.
    Refuse,
    /// As [`Fault::Refuse`]; and afterwards the camera has another realm and does not know its old nonces.
    Reboot,
    /// Nothing comes back: new connections are not answered, requests on open ones neither.
    BlackHole,
    /// The connection is reset instead of an answer.
    Reset,
    /// These bytes come instead of an answer, then the connection closes.
    Garbage(Vec<u8>),
    /// No answer ever.
    Hang,
    /// This HTTP status with an empty body; nothing is done.
    Status(u16),
    /// This HTTP status leads to this address; nothing is done.
    Redirect {
        /// 301, 302, 307 or 308.
        status: u16,
        /// An address.
        location: String,
    },
    /// Every login is refused, the right one too: the account is locked, or the camera is starting.
    Locked,
    /// 403 for everybody once there were this many wrong logins since the camera's start.
    LockOut(u64),
    /// 200 with a text that never ends; nothing is done.
    EndlessBody,
    /// 200 with a text of one byte in this time, without end; nothing is done.
    Drip(Duration),
    /// 200 with this text, `Error:...` for instance; nothing is done.
    ErrorBody(String),
    /// 200 with an empty body; nothing is done.
    EmptyOk,
    /// A right answer, then the connection closes without having said so.
    CloseAfterResponse,
    /// Right answers, in lines that end in LF instead of CRLF.
    LineFeeds,
    /// Right answers of a camera whose clock is ahead by this: nonces from before are stale.
    ClockAhead(Duration),
}

impl Fault {
    /// Whether no connection comes about.
    pub(crate) fn shuts(&self) -> bool {
        matches!(self, Self::Refuse | Self::Reboot | Self::BlackHole)
    }
}

fn seconds<S: Serializer>(time: &Duration, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64(time.as_secs_f64())
}
