//! Follows one target through a moving camera's picture (thesis 3.5).
//!
//! | step | thesis | file |
//! |---|---|---|
//! | choose a detection | 3.0, "an operator input which target to track" | `selection` |
//! | corners in its contour, outliers rejected | 3.5.1 | `corners` |
//! | Lucas-Kanade in a patch around it | 3.5.2 | `patch`, `flow` |
//! | centre of mass by mean-shift | 3.5.3 | `mean_shift` |
//! | motion of the background | beyond | `background`, `ego_motion` |
//! | points that leave and join | beyond | `points` |
//! | what it looks like | beyond | `appearance` |
//! | whether it moves at all | beyond | `proof` |
//! | how long it is followed | beyond | `patience` |
//! | who is not taken again | beyond | `given_up` |
//!
//! [`Tracker`] is the state machine around one `target`; `steps` says what each profile does.

mod appearance;
mod background;
mod corners;
mod ego_motion;
mod flow;
mod geometry;
mod given_up;
mod mean_shift;
mod patch;
mod patience;
mod points;
mod proof;
mod selection;
mod state;
mod steps;
#[cfg(test)]
mod synthetic;
mod target;

pub use patience::Limits;
pub use selection::Choice;
pub use state::{Config, Detection, Report, Tracker};
pub use steps::Profile;
