//! Prediction and control: from where the target is in the picture to what the camera is told.
//!
//! Angles are degrees, positive to the right and up; times are [`Duration`](std::time::Duration)s
//! since any fixed moment, always given by the caller, so that tests turn the clock themselves.
//!
//! ```text
//! Sight ─ View (angles) ─ Aim (prediction, feed-forward) ─ Controller ─ limits ─ SpeedMap ─ Scheduler ─ Command
//! ```
//! [`Pilot`] is the whole of it; [`Link`] judges what the camera answers.

mod aim;
mod authority;
mod camera;
mod control_queue;
mod controller;
mod home;
mod introduction;
mod learning;
#[cfg(test)]
mod learning_tests;
mod limits;
mod link;
#[cfg(test)]
mod meeting_tests;
#[cfg(test)]
mod motion_tests;
mod operator;
mod optics;
mod oscillation;
mod pan_tilt;
mod pilot;
mod prediction;
mod rate;
mod scheduler;
mod settings;
#[cfg(test)]
mod simulation;
mod speed;
mod steps;
mod talk;
mod ways;
mod zoom;
mod zoom_drive;
#[cfg(test)]
mod zoom_tests;
mod zoom_track;

#[cfg(test)]
pub(crate) use aim::tests::sight;
pub use aim::{Aim, Prediction, Sight, Visibility};
pub use authority::{Authority, Finding, Holder};
pub use camera::CameraModel;
pub use control_queue::ControlQueue;
pub use controller::{ControlLaw, Controller, Offset};
pub use home::{Home, Homing};
pub use introduction::Introduction;
pub use learning::{Calibration, Turn};
pub use limits::{LimitGuard, SoftLimits, is_endless, narrower};
pub use link::{Link, LinkChange};
pub use operator::{Commands, OperatorWatch, Verdict};
pub use optics::{Lens, View, magnified, rise_deg};
pub use oscillation::OscillationGuard;
pub use pan_tilt::{PanTilt, around_deg};
pub use pilot::Pilot;
pub use prediction::CommandHistory;
pub use rate::RateAverage;
pub use scheduler::Scheduler;
pub use settings::{Mode, ServoSettings};
pub use speed::{SpeedCurve, SpeedMap};
pub use steps::Steps;
pub use talk::{Answer, Belief, Job, Next, Query, Report, Status};
pub use ways::{Refusal, Ways};
pub use zoom::ZoomController;
pub use zoom_drive::{Jump, ZoomDrive, ZoomGoal};
pub use zoom_track::ZoomTrack;
