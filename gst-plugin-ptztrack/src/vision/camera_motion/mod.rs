// SPDX-License-Identifier: MPL-2.0

//! How the picture moves because the camera does, once a picture.
//!
//! | step | file |
//! |---|---|
//! | where the picture shows nothing to hold on to, it without rain and snow | `opening` |
//! | corners, one in each cell of a grid, topped up where they were lost | `corners` |
//! | pyramidal Lucas-Kanade (thesis 3.5.2) from a key picture | `flow`, with `lucas_kanade` beside this module |
//! | the motion that most of them share, and how well it is known | `fit` |

mod corners;
mod estimator;
mod fit;
mod flow;
mod opening;

pub use estimator::CameraMotionEstimator;
pub(super) use estimator::{displacement, to_pixels};

#[cfg(test)]
mod tests;
