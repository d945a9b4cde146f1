// SPDX-License-Identifier: MPL-2.0

//! The open loop: what a camera saw that was steered by the truth, with an error like ours, is recorded once and then shown to
//! decoder, detector and tracker as often as wanted. Every tracker sees the same pictures, so that two of them are compared in
//! pairs, and nothing is drawn again until what draws changes.

mod library;
mod placement;
mod recorded;
mod recorder;
mod replay;
mod steering;
mod truth;

pub use library::generator;
pub(crate) use recorder::lead;
pub(crate) use replay::drive;
pub use steering::{PointingError, pointing_error};
pub use truth::Stage;
