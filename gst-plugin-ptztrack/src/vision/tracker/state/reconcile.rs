// SPDX-License-Identifier: MPL-2.0

//! What holds the target's pixels and its track together.

use opencv::core::Rect2f;

use super::{DECAY_S, Target, Tracker};
use crate::vision::Observation;
use crate::vision::tracker::geometry::{centre, overlap, scaled};
use crate::vision::tracker::policy::Sighting;
use crate::vision::tracker::target::Sight;

/// Intersection over union below which a box is not where the track is seen, and how long it may be so, seconds.
const ASTRAY: f32 = 0.25;
const ASTRAY_S: f64 = 0.3;
/// Intersection over union with somebody else from which they are followed in place of the target.
const TAKEN: f32 = 0.4;
/// How much of what is followed must stand out from the background, 0 to 1, to be anybody where no region shows them: of a wall it
/// is a fiftieth, of somebody in clothes like the wall a fifth.
const FAINT: f32 = 0.1;
/// Pictures in a row in which a track must be seen, and how much of its height, to be followed again there.
const SEEN_AGAIN: u32 = 2;
const PART: f32 = 0.5;

impl Tracker {
    /// What is followed by its pixels is where its track is seen, or nowhere; where the track is not seen, the pixels help it on.
    pub(super) fn reconcile(
        &mut self,
        target: &mut Target,
        sight: Sight,
        seen: &Observation,
        dt_s: f64,
    ) -> opencv::Result<Sight> {
        let bounds = target.follow.estimate().bounds;
        let stands_out = if sight == Sight::Seen { self.tracks.stands_out(seen, bounds) } else { 0.0 };
        if stands_out < FAINT {
            self.tracks.find_again(target.id);
            target.id = self.tracks.number_now(target.id);
        }
        let Some(track) = self.tracks.get(target.id) else { return Ok(Sight::Gone) };
        let estimate = target.follow.estimate();
        let (bounds, velocity) = (estimate.bounds, estimate.own_velocity);
        target.is_borne_out = track.is_alone() || stands_out >= FAINT;
        if track.is_alone() {
            let own = track.seen_bounds();
            target.astray_s = if is_astray(bounds, own) { target.astray_s + dt_s } else { 0.0 };
            let is_sure = track.journey.in_a_row >= SEEN_AGAIN && own.height >= PART * track.height();
            if is_sure && (sight != Sight::Seen || target.astray_s >= ASTRAY_S) {
                let sighting = Sighting { bounds: own, velocity: track.velocity(), ..Sighting::default() };
                if let Some(follow) = self.follow_anew(seen, &sighting)? {
                    target.follow = follow;
                    (target.astray_s, target.seen_at) = (0.0, own);
                    return Ok(Sight::Seen);
                }
            }
            return Ok(sight);
        }
        target.astray_s = 0.0;
        if sight == Sight::Seen {
            let taken = self.tracks.iter().any(|other| {
                other.id != target.id
                    && other.is_alone()
                    && other.beside_target >= self.config.confirm_frames.max(1)
                    && overlap(bounds, other.seen_bounds()) >= TAKEN
            });
            if taken {
                target.follow.expect(track.bounds(), track.velocity());
                return Ok(Sight::Hidden);
            }
            let share = dt_s / self.config.coast_s.max(DECAY_S);
            self.tracks.support(target.id, bounds, velocity, stands_out, share);
        }
        Ok(sight)
    }
}

/// Whether a box is not that of who is seen in `own`.
fn is_astray(bounds: Rect2f, own: Rect2f) -> bool {
    overlap(bounds, own) < ASTRAY || !scaled(own, 1.2, 1.2).contains(centre(bounds))
}
