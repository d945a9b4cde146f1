// SPDX-License-Identifier: MPL-2.0

//! Sparse pyramidal Lucas-Kanade (thesis 3.5.2, equations 3.8 to 3.11; Bouguet, "Pyramidal implementation of the Lucas Kanade feature
//! tracker", 2000), as OpenCV's `calcOpticalFlowPyrLK` does it, but that a coarser level is left sooner: it has but to lead to the next.
//!
//! What a point looks like in the first picture, its [`Template`], is worked out once, however many pictures it is looked for in;
//! OpenCV works out the gradients of the whole first picture, and of each point, for every picture anew. Where a point was in view, both
//! found it within 0.05 pixels of each other (OpenCV 4.6, 95 % of points).

mod kernels;
mod pyramid;
mod template;

#[cfg(test)]
mod tests;

pub use pyramid::Pyramid;
#[cfg(test)]
use template::Found;
pub use template::{Precision, Template};

/// Longest side of a window, pixels.
const MAX_SIDE: usize = 31;
/// Numbers that the kernels work on at once.
const LANES: usize = 8;
/// Room for a row of the largest window, with its neighbours on both sides.
const MAX_ROW: usize = (MAX_SIDE + 2).next_multiple_of(LANES) + LANES;
