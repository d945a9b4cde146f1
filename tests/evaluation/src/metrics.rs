// SPDX-License-Identifier: MPL-2.0

//! The metrics of thesis section 5.2, each computed in one place that quotes its equation.
//!
//! Counting begins with the first box: the first picture, with the camera still at home, in which the whole person is
//! inside the view. That depends on nothing that a tracker does, so every tracker is counted over the same time.
//! A value that cannot be computed (no frame to compute it from) is `None`, never a number.

use crate::record::{Estimate, FrameRecord, GroundTruth, Run, TargetState};

mod boxes;
mod centred;
mod identity;
mod losses;

pub use boxes::{box_precision, overlap_with, success};
pub use centred::{centred_after_s, mean_dgc_centred};
pub use identity::{identity_kept, identity_switches, is_hidden};
pub use losses::{Cause, LASTING_S, Loss, holds, losses};

/// A picture contains the target when at least this part of the person is inside it and hidden by nothing.
pub const CONTAINS: f64 = 0.1;

/// Less of the person than this part is nothing to be seen: a finger beside a screen ends no occlusion.
pub const SPECK: f64 = 0.01;

/// What one run is judged by. Shares are 0..1, distances in the unit of their equation.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Metrics {
    /// P, equation 5.1.
    pub precision: Option<f64>,
    /// P where a box that is predicted counts as tracked.
    pub precision_predicted: Option<f64>,
    /// DP, equation 5.2.
    pub detection_precision: Option<f64>,
    /// TF, equation 5.5.
    pub track_fragmentation: Option<f64>,
    /// Mean of d_gc, equation 5.3.
    pub mean_dgc: Option<f64>,
    /// Variance of d_gc.
    pub var_dgc: Option<f64>,
    /// Mean of d_gp, equation 5.4.
    pub mean_dgp: Option<f64>,
    /// Variance of d_gp.
    pub var_dgp: Option<f64>,
    /// From the first counted picture until the person is and stays in the middle, seconds.
    pub centred_after_s: Option<f64>,
    /// Mean of d_gc from then on.
    pub mean_dgc_centred: Option<f64>,
    /// How often the person was lost; `None` where there was nobody to follow.
    pub losses: Option<usize>,
    /// From the first counted picture to the first true positive, seconds.
    pub time_to_acquire_s: Option<f64>,
    /// Whether it was still the same person after every full occlusion; `None` without one.
    pub identity_kept: Option<bool>,
    /// How often what was followed became somebody else; `None` where there is nobody else.
    pub identity_switches: Option<usize>,
    /// Mean overlap of the tracked and the true box.
    pub success: Option<f64>,
    /// Share of pictures in which the middles of the two boxes are at most 20 pixels apart.
    pub box_precision: Option<f64>,
    /// Commands that reached the camera, a second.
    pub commands_per_s: Option<f64>,
    /// Counted pictures, N_F.
    pub frames: usize,
    /// Pictures that contain the target, nF.
    pub frames_with_target: usize,
}

impl Metrics {
    /// Everything that can be said of one run.
    pub fn of(run: &Run) -> Self {
        let frames = &run.frames;
        let (dgc, dgp): (Vec<_>, Vec<_>) = (counted_dgc(frames).collect(), counted_dgp(frames).collect());
        Self {
            precision: precision(frames),
            precision_predicted: precision_predicted(frames),
            detection_precision: detection_precision(frames),
            track_fragmentation: track_fragmentation(frames),
            mean_dgc: mean(&dgc),
            var_dgc: variance(&dgc),
            mean_dgp: mean(&dgp),
            var_dgp: variance(&dgp),
            centred_after_s: centred_after_s(frames),
            mean_dgc_centred: mean_dgc_centred(frames),
            losses: frames.iter().any(|frame| frame.truth.is_some()).then(|| losses(frames).len()),
            time_to_acquire_s: time_to_acquire_s(frames),
            identity_kept: identity_kept(frames),
            identity_switches: identity_switches(frames),
            success: success(frames),
            box_precision: box_precision(frames),
            commands_per_s: commands_per_s(frames, run.frame_rate),
            frames: frames.len(),
            frames_with_target: frames.iter().filter(|frame| contains_target(frame)).count(),
        }
    }
}

/// A hit: the tracker says that it tracks or where it holds the target to be hidden, and the mean of its features lies
/// inside the whole silhouette of the person, hidden parts included.
pub fn is_hit(frame: &FrameRecord) -> bool {
    frame.on_target().is_some_and(|coverage| coverage.hit)
}

/// TP: the tracker says that it tracks, and that is a hit on a person of whom more than a [`SPECK`] is visible.
pub fn is_true_positive(frame: &FrameRecord) -> bool {
    tracked(frame).is_some()
        && frame.truth.as_ref().is_some_and(|truth| truth.visible >= SPECK)
        && is_hit(frame)
}

/// FP: the tracker says that it tracks, and it is wrong. One that says it is searching, or that the target is
/// occluded or lost, is neither right nor wrong.
pub fn is_false_positive(frame: &FrameRecord) -> bool {
    tracked(frame).is_some() && !is_true_positive(frame)
}

/// Whether enough of the person is to be seen for a tracker to find them.
pub fn contains_target(frame: &FrameRecord) -> bool {
    frame.truth.as_ref().is_some_and(|truth| truth.visible >= CONTAINS)
}

/// Whether the middle of the person is outside of the picture, or the person is nowhere.
pub fn is_out(frame: &FrameRecord) -> bool {
    let (width, height) = size(frame);
    let inside = |truth: &GroundTruth| {
        let (x, y) = truth.centroid;
        (0.0..width).contains(&x) && (0.0..height).contains(&y)
    };
    !frame.truth.as_ref().is_some_and(inside)
}

/// P = TP / (TP + FP) (5.1).
pub fn precision(frames: &[FrameRecord]) -> Option<f64> {
    let [right, wrong] = [is_true_positive, is_false_positive].map(|is| count(frames, is));
    share(right, right + wrong)
}

/// P where a predicted box counts as tracked: of the pictures for which the tracker gives a place, the share of hits, on
/// persons who are wholly hidden too.
pub fn precision_predicted(frames: &[FrameRecord]) -> Option<f64> {
    let placed = |frame: &FrameRecord| frame.estimate.as_ref().is_some_and(Estimate::has_place);
    share(count(frames, is_hit), count(frames, placed))
}

/// DP = CDF / nF (5.2), where CDF are the frames in which the target is detected correctly and nF those that contain it.
pub fn detection_precision(frames: &[FrameRecord]) -> Option<f64> {
    let detected = count(frames, |frame| contains_target(frame) && is_true_positive(frame));
    share(detected, count(frames, contains_target))
}

/// TF = T_OUT / N_F (5.5), where T_OUT are the frames in which the target is outside of the field of view.
pub fn track_fragmentation(frames: &[FrameRecord]) -> Option<f64> {
    share(count(frames, is_out), frames.len())
}

/// d_gc = √((x_c − x_g)² + (y_c − y_g)²) / a (5.3): from the person to the middle of the picture, where a is the radius
/// of the circle that circumscribes the picture. Above 1 the person is surely outside.
pub fn d_gc(frame: &FrameRecord) -> Option<f64> {
    let (width, height) = size(frame);
    let person = frame.truth.as_ref()?.centroid;
    Some(distance(person, (width / 2.0, height / 2.0)) / radius(frame))
}

/// d_gp = √((x_p − x_g)² + (y_p − y_g)²) / 2a (5.4): from the person to what is tracked. Only where something is tracked.
pub fn d_gp(frame: &FrameRecord) -> Option<f64> {
    Some(distance(tracked(frame)?, frame.truth.as_ref()?.centroid) / (2.0 * radius(frame)))
}

/// d_gc "on each frame that contains the target": those in which the middle of the person is inside the picture.
fn counted_dgc(frames: &[FrameRecord]) -> impl Iterator<Item = f64> {
    frames.iter().filter(|frame| !is_out(frame)).filter_map(d_gc)
}

/// d_gp on the same frames, as far as the tracker said that it was tracking.
fn counted_dgp(frames: &[FrameRecord]) -> impl Iterator<Item = f64> {
    frames.iter().filter(|frame| !is_out(frame)).filter_map(d_gp)
}

/// From the first counted picture to the first in which the tracker was right.
pub fn time_to_acquire_s(frames: &[FrameRecord]) -> Option<f64> {
    let first = frames.iter().find(|frame| is_true_positive(frame))?;
    Some(first.time_s - frames.first()?.time_s)
}

/// Commands that reached the camera over the counted time, which goes on for one period after the last picture.
pub fn commands_per_s(frames: &[FrameRecord], frame_rate: f64) -> Option<f64> {
    let elapsed_s = frames.last()?.time_s - frames.first()?.time_s + 1.0 / frame_rate;
    let commands: u32 = frames.iter().map(|frame| frame.commands).sum();
    Some(f64::from(commands) / elapsed_s)
}

/// Arithmetic mean.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Variance over all values there are (divided by their number, not by one less).
pub fn variance(values: &[f64]) -> Option<f64> {
    let mean = mean(values)?;
    Some(values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64)
}

/// Where the tracker says the target is, if it says that it tracks.
fn tracked(frame: &FrameRecord) -> Option<(f64, f64)> {
    let estimate = frame.estimate.as_ref().filter(|estimate| estimate.state == TargetState::Tracking)?;
    Some(estimate.centroid)
}

fn count(frames: &[FrameRecord], is: impl Fn(&FrameRecord) -> bool) -> usize {
    frames.iter().filter(|frame| is(frame)).count()
}

fn share(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

fn size(frame: &FrameRecord) -> (f64, f64) {
    (f64::from(frame.size.0), f64::from(frame.size.1))
}

/// a: half the diagonal.
fn radius(frame: &FrameRecord) -> f64 {
    let (width, height) = size(frame);
    width.hypot(height) / 2.0
}

fn distance(a: (f64, f64), b: (f64, f64)) -> f64 {
    (a.0 - b.0).hypot(a.1 - b.1)
}

#[cfg(test)]
mod tests;
