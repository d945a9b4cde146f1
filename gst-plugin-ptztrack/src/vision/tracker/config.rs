// SPDX-License-Identifier: MPL-2.0

//! How a tracker works, and what it can be asked for.

use ptztrack_contract::Point;

use super::dwell_time::TimeLimits;
use super::policy::Choice;
use super::profile::Profile;

/// How a [`Tracker`] works. Changes hold from the next target or frame on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// Which steps are taken.
    pub profile: Profile,
    /// How the target is chosen.
    pub choice: Choice,
    /// Frames that a detection must be seen in before it is chosen.
    pub confirm_frames: u32,
    /// Seconds that a hidden target is coasted and looked for, and after which nobody is where nobody is seen.
    pub coast_s: f64,
    /// Seconds for which who is gone is remembered: whoever comes back within them has their old number.
    pub memory_s: f64,
    /// Height, in frame heights, of the box that is made around a place selected by hand.
    pub manual_size: f64,
    /// Whether a detection is chosen only once it has travelled across the background: right for a motion detector,
    /// wrong for one that finds people who stand.
    pub must_travel: bool,
    /// The longest that the detector may take from one look to the next, seconds; 0 for one that sees every frame.
    pub detector_pause_s: f64,
    /// How long a target is followed at most.
    pub limits: TimeLimits,
}

/// What an operator or the application asked for; carried out with the next frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TargetRequest {
    /// Follow what is at this place: the track there, or else a box of [`Config::manual_size`] around it.
    Select(Point),
    /// Follow the track of that number, if there is one.
    SelectTrack(u64),
    /// Follow the track of the next number, or that of the first after the last.
    Next,
    /// Let the target go.
    Release,
}
