// SPDX-License-Identifier: MPL-2.0

//! One target and how it is followed: as its track is, with the help of its pixels, or as the thesis does it.

mod appearance;
mod point_flow;
mod robust;
mod thesis;

use opencv::core::{Point2f, Rect2f};

pub(super) use robust::Robust;
pub(super) use thesis::Thesis;

use super::geometry::{Frame, centre, share_inside};
use super::points::Points;
use super::tracks::Tracks;
use crate::vision::{Luma, Observation};

/// While it is this young, seconds, a target's box is still the detector's: half of a person may have come into view.
pub(super) const YOUNG_S: f32 = 1.0;
/// Part of the box that must be in the picture.
const MIN_INSIDE: f32 = 0.35;
/// Points followed at most: more cost time and add nothing to their median.
const MAX_POINTS: usize = 64;

/// Confidence from which what is seen elsewhere is somebody else.
const SURE: f32 = 0.7;

/// What one step saw of the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sight {
    /// It was followed.
    Seen,
    /// It is hidden, or something else is in its place.
    Hidden,
    /// It is no longer in the picture.
    Gone,
}

/// What is known of a target. All pixels are of the picture.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Estimate {
    pub bounds: Rect2f,
    pub centroid: Point2f,
    /// 0 to 1.
    pub confidence: f32,
    /// Whether more than its looks says that it is there.
    pub is_borne_out: bool,
    /// Motion against the background, pixels per second.
    pub own_velocity: Point2f,
    /// Motion of the background at the target, pixels per second; `None` where it could not be seen.
    pub ego_velocity: Option<Point2f>,
}

impl Estimate {
    /// Of a target that was just seen, and goes so many pixels per second.
    fn begun(bounds: Rect2f, own_velocity: Point2f) -> Self {
        Self {
            bounds,
            centroid: centre(bounds),
            confidence: 1.0,
            is_borne_out: true,
            own_velocity,
            ego_velocity: None,
        }
    }

    /// Whether it is seen so well that it is nowhere else.
    pub fn is_sure(&self) -> bool {
        self.is_borne_out && self.confidence >= SURE
    }
}

/// A way to follow one target from picture to picture.
pub(super) trait Follow: Send {
    /// Follows the target, which is the track of number `id`, into the next picture, `dt_s` later.
    fn follow(
        &mut self,
        seen: &Observation,
        dt_s: f32,
        tracks: &mut Tracks,
        id: u64,
    ) -> opencv::Result<Sight>;

    /// What is known of the target now.
    fn estimate(&self) -> &Estimate;

    /// Its points.
    fn points(&self) -> &Points;
}

/// Whether too little of the box is left in the picture.
fn is_gone(bounds: Rect2f, luma: &Luma) -> bool {
    let frame = Frame { width: luma.width() as f32, height: luma.height() as f32 };
    share_inside(bounds, frame.bounds()) < MIN_INSIDE
}

/// A window that sees a part of the body, not the street on both sides of it.
fn window_for(bounds: Rect2f, step: usize) -> usize {
    let side = bounds.width.min(bounds.height) / step as f32;
    2 * (side / 6.0).clamp(4.0, 8.0) as usize + 1
}

/// Distance between points so that some sixty fit onto the target.
fn spacing(bounds: Rect2f) -> f32 {
    (bounds.area() / (2.0 * MAX_POINTS as f32)).sqrt().max(2.0)
}
