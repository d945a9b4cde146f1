// SPDX-License-Identifier: MPL-2.0

//! Whether one tracker is better than another, stratum by stratum, and the smallest difference that would have been seen.
//!
//! Both were shown the same scenes, so what is tested are differences in pairs. Recordings of the same scene are averaged first: they
//! are not independent. How it is tested is told in `docs/scenes.md`.

mod calibration;
mod compare;
mod read;
mod statistics;
#[cfg(test)]
mod tests;

pub use calibration::calibrate;
pub use compare::{Comparison, Verdict, compare};
pub use read::CompareError;
pub use statistics::{clopper_pearson, detectable, holm, sign_flip};
