// SPDX-License-Identifier: MPL-2.0

//! Follows one target through a moving camera's picture (thesis 3.5).
//!
//! | step | thesis | file |
//! |---|---|---|
//! | choose a detection that goes somewhere | 3.0, "an operator input which target to track" | `selection` |
//! | figure and ground around it, by motion, colour and silhouette | beyond | `figure`, `colour` |
//! | corners on the figure, outliers rejected | 3.5.1 | `corners` |
//! | Lucas-Kanade in a patch around it | 3.5.2 | `patch`, `flow` |
//! | points that leave and join; those on the wall do not count | beyond | `points` |
//! | what it looks like, the wall left out | beyond | `correlation_filter` |
//! | whether it is there at all | beyond | `presence` |
//! | centre of mass | 3.5.3 | `figure`; `grey_histogram` by mean-shift, as the thesis has it |
//! | how long it is followed and stands | beyond | `dwell_time` |
//! | who is not taken again | beyond | `suppressed_regions` |
//!
//! [`Tracker`] is the state machine around one `target`, which is followed by all cues (`target/robust.rs`) or as the
//! thesis does it (`target/thesis.rs`).

mod colour;
mod corners;
mod correlation_filter;
mod dwell_time;
mod ego_motion;
mod figure;
mod flow;
mod geometry;
mod grey_histogram;
mod patch;
mod points;
mod presence;
mod sample;
mod selection;
mod state;
mod suppressed_regions;
#[cfg(test)]
mod synthetic;
mod target;

pub use dwell_time::TimeLimits;
pub use selection::Choice;
pub use state::{Config, Detection, Profile, TargetRequest, Tracked, Tracker};
