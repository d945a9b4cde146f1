// SPDX-License-Identifier: MPL-2.0

//! Keeps account of everybody who is seen, and follows one of them through a moving camera's picture (thesis 3.5).
//!
//! | step | thesis | file |
//! |---|---|---|
//! | whose each detection is | beyond | `tracks` |
//! | choose a track that goes somewhere | 3.0, "an operator input which target to track" | `policy` |
//! | or several, by a box that holds all | beyond | `group` |
//! | figure and ground around it, by motion, colour and silhouette | beyond | `figure`, `colour` |
//! | corners on the figure, outliers rejected | 3.5.1 | `corners` |
//! | Lucas-Kanade in a patch around it | 3.5.2 | `patch`, `flow` |
//! | points that leave and join; those on the wall do not count | beyond | `points` |
//! | where it is by its looks: silhouette, and greys by normalised cross-correlation | beyond | `target/appearance`, `figure/` |
//! | centre of mass | 3.5.3 | `figure`; `grey_histogram` by mean-shift, as the thesis has it |
//! | how long it is followed and stands | beyond | `dwell_time` |
//!
//! [`Tracker`] is the state machine around one `target`, which is the number of a track and is where that is. Its pixels help the track
//! on (`target/robust.rs`), or are all that counts, as in the thesis (`target/thesis.rs`).

mod colour;
mod config;
mod corner_strength;
mod corners;
mod dwell_time;
mod ego_motion;
mod figure;
mod flow;
mod geometry;
mod grey_histogram;
mod group;
mod outline;
mod patch;
mod points;
mod policy;
mod profile;
mod report;
mod sample;
mod state;
#[cfg(test)]
mod synthetic;
mod target;
mod tracks;

pub use config::{Config, TargetRequest};
pub use dwell_time::TimeLimits;
pub use policy::Choice;
pub use profile::Profile;
pub use report::{Detection, Released, Tracked};
pub use state::Tracker;
