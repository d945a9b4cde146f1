// SPDX-License-Identifier: MPL-2.0

//! Whether it is still the same person.

use super::{SPECK, distance, is_hit, is_true_positive, tracked};
use crate::record::{FrameRecord, GroundTruth};

/// The second that is looked at begins so long after the end of a full occlusion.
const AFTER_S: f64 = 1.0;
const FOR_S: f64 = 1.0;

/// After every time that the person was wholly hidden: was the tracker right in at least half of the frames of the second
/// that begins one second after they came out again? `None` if nobody was hidden, or the test ended before.
pub fn identity_kept(frames: &[FrameRecord]) -> Option<bool> {
    let ends = frames.windows(2).filter(|pair| is_hidden(&pair[0]) && !is_hidden(&pair[1]));
    let kept: Vec<bool> = ends.filter_map(|pair| kept_from(frames, pair[1].time_s + AFTER_S)).collect();
    (!kept.is_empty()).then(|| kept.iter().all(|kept| *kept))
}

fn kept_from(frames: &[FrameRecord], begin_s: f64) -> Option<bool> {
    let second = |frame: &&FrameRecord| (begin_s..begin_s + FOR_S).contains(&frame.time_s);
    // Hidden once more is no fault of the tracker.
    let looked_at: Vec<_> = frames.iter().filter(second).filter(|frame| !is_hidden(frame)).collect();
    let right = looked_at.iter().filter(|frame| is_true_positive(frame)).count();
    (!looked_at.is_empty()).then_some(2 * right >= looked_at.len())
}

/// Whether the person is behind something, wholly but for a [`SPECK`], wherever the camera looks.
pub fn is_hidden(frame: &FrameRecord) -> bool {
    frame.truth.as_ref().is_some_and(|truth| truth.unhidden < SPECK)
}

/// How often the person on whom the tracked point lies became another one. Where silhouettes overlap, the point is on the
/// target; otherwise it stays with whom it was on; otherwise it is on the nearest. On nobody is no switch.
pub fn identity_switches(frames: &[FrameRecord]) -> Option<usize> {
    frames.iter().any(|frame| !frame.others.is_empty()).then(|| {
        let mut on = None;
        frames
            .iter()
            .filter_map(|frame| {
                let now = person_at_point(frame, on)?;
                on.replace(now).filter(|before| *before != now)
            })
            .count()
    })
}

fn person_at_point(frame: &FrameRecord, before: Option<u32>) -> Option<u32> {
    let point = tracked(frame)?;
    if is_hit(frame) {
        return frame.truth.as_ref().map(|truth| truth.id);
    }
    let here = |person: &&GroundTruth| frame.coverage.iter().any(|one| one.hit && one.id == person.id);
    let mut others: Vec<_> = frame.others.iter().filter(here).collect();
    others.sort_by(|a, b| distance(a.centroid, point).total_cmp(&distance(b.centroid, point)));
    let same = others.iter().find(|person| Some(person.id) == before);
    same.or(others.first()).map(|person| person.id)
}
