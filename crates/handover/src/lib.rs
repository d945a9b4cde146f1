// SPDX-License-Identifier: MPL-2.0

//! Where a camera that turns has to look to see somebody whom another camera sees.
//!
//! Nobody measures where the cameras hang. While both see the same person, [`Pair`]s come by themselves: the [`Place`] of the feet
//! as the one camera sees them, and the [`Direction`] in which the other one sees them. A [`Map`] is made of these: the homography
//! of the ground where the ground is a plane, a local regression where it is not, and how much either is to be doubted.
//!
//! Plain types: no picture, no camera, no network.

mod geometry;
mod homography;
mod local;
mod map;
mod moved;
mod pairs;
mod robust;

pub use geometry::{Direction, Place};
pub use map::{Aim, Learned, Map, NotRead};
pub use pairs::Pair;
