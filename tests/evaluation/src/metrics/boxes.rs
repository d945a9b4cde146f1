// SPDX-License-Identifier: MPL-2.0

//! What trackers are judged by on a recording as it is, where no camera follows: the two measures of Y. Wu, J. Lim and
//! M.-H. Yang, "Online object tracking: a benchmark", CVPR 2013, section 3. Where a camera follows, the same is computed
//! in its pictures.

use super::{contains_target, distance, mean, tracked};
use crate::record::{Bounds, FrameRecord};

/// How far apart the middles of two boxes may be, pixels ("threshold = 20 pixels").
const NEAR_PX: f64 = 20.0;

/// Success: the area under the curve of the success plot, which shows for each threshold t from 0 to 1 the share of the
/// frames whose overlap S = |r_t ∩ r_a| / |r_t ∪ r_a| of tracked and true box is above it.
///
/// The integral of that share over t is the mean of S, so that is what is computed, without the paper's steps in t. It is
/// over the frames that contain the target, with S = 0 where nothing is tracked.
pub fn success(frames: &[FrameRecord]) -> Option<f64> {
    let overlaps: Vec<_> = frames.iter().filter(|frame| contains_target(frame)).map(overlap).collect();
    mean(&overlaps)
}

/// Precision: the share of the frames in which the middles of the tracked and the true box are within 20 pixels. It is
/// over the same frames.
pub fn box_precision(frames: &[FrameRecord]) -> Option<f64> {
    let near = |frame: &FrameRecord| f64::from(u8::from(is_near(frame)));
    let near: Vec<_> = frames.iter().filter(|frame| contains_target(frame)).map(near).collect();
    mean(&near)
}

/// The true and the tracked box.
fn boxes(frame: &FrameRecord) -> Option<(Bounds, Bounds)> {
    tracked(frame)?;
    Some((frame.truth.as_ref()?.bounds, frame.estimate.as_ref()?.bounds))
}

fn is_near(frame: &FrameRecord) -> bool {
    let middle = |b: Bounds| (b.left + b.width / 2.0, b.top + b.height / 2.0);
    boxes(frame).is_some_and(|(truth, ours)| distance(middle(truth), middle(ours)) <= NEAR_PX)
}

fn overlap(frame: &FrameRecord) -> f64 {
    boxes(frame).map_or(0.0, |(a, b)| overlap_with(&a, &b))
}

/// Intersection over union of two boxes, 0 to 1.
pub fn overlap_with(a: &Bounds, b: &Bounds) -> f64 {
    let common = |from: (f64, f64), to: (f64, f64)| (from.1.min(to.1) - from.0.max(to.0)).max(0.0);
    let wide = common((a.left, a.left + a.width), (b.left, b.left + b.width));
    let high = common((a.top, a.top + a.height), (b.top, b.top + b.height));
    let union = a.width * a.height + b.width * b.height - wide * high;
    if union > 0.0 { wide * high / union } else { 0.0 }
}
