//! The thesis' 72 closed-loop experiments (chapter 5), rerun by anyone: real elements in a real pipeline against the
//! virtual camera, in virtual time, so that the same seed gives the same table on any machine.

pub mod metrics;
pub mod record;
pub mod report;
mod truth;
