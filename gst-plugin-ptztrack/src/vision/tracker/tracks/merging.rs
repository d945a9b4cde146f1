// SPDX-License-Identifier: MPL-2.0

//! Tracks that are one, and tracks that are seen as one.

use opencv::core::Rect2f;
use ptztrack_contract::TrackChange;

use super::Tracks;
use super::association::Association;
use super::groups::owners_of_sides;
use super::track::{Journey, Track};
use crate::vision::tracker::geometry::{Frame, is_upright, length, overlap, shared_sides};

/// Who is taller than this part of another is no part of them, nor who was seen alone for so long, seconds; where they are still
/// smaller, that takes longer.
const PART: f32 = 0.8;
const APART_S: f64 = 0.3;
const SMALL: f32 = 0.6;
const SMALL_APART_S: f64 = 2.0;
/// Who was never seen but in one region with another, for so long, seconds, and is where they are by this intersection over union, is they.
const NEVER_PARTED_S: f64 = 2.0;
const SAME: f32 = 0.5;
/// Trunk and legs seen apart are each at least this broad beside their height; for so long, seconds, they were seen, and by so many
/// heights per second they part at most.
const PIECE_ASPECT: f32 = 0.5;
const PIECE_S: f64 = 0.3;
const TOGETHER: f32 = 0.3;

impl Tracks {
    /// Lets those who are seen in one region share it; who is but a part of another goes into them.
    pub(super) fn share(&mut self, association: &Association, frame: Frame, dt_s: f64) {
        for number in 0..self.regions.len() {
            if association.guests(number).next().is_none() {
                continue;
            }
            let owner = association.own.iter().position(|own| *own == Some(number));
            let mut members = std::mem::take(&mut self.members);
            members.clear();
            members.extend(owner);
            let bounds = self.regions[number].bounds;
            for guest in association.guests(number) {
                match owner.filter(|&owner| self.is_part(guest, owner, bounds)) {
                    Some(owner) => self.absorb(guest, owner),
                    None => members.push(guest),
                }
            }
            let cut = frame.cut_sides(bounds);
            let alone = members.len() == 1;
            let owners = owners_of_sides(&self.tracks, &members, bounds);
            for &index in &members {
                let sides = std::array::from_fn(|side| owners[side] == Some(index) && !cut[side]);
                let track = &mut self.tracks[index];
                track.measure(bounds, sides);
                if alone {
                    track.see_alone(number, bounds, dt_s);
                    track.resize(bounds, &self.floor, cut, dt_s);
                } else {
                    track.see_shared(number, sides != [false; 4], dt_s);
                }
            }
            for &index in &members {
                for &other in members.iter().filter(|&&other| other != index) {
                    let id = self.tracks[other].id;
                    let companions = &mut self.tracks[index].companions;
                    if id > 0 && !companions.contains(&id) {
                        companions.push(id);
                    }
                }
            }
            self.regions[number].is_owned = true;
            self.members = members;
        }
    }

    /// Where clothes look like the wall behind them, trunk and legs are seen apart: two tracks that stand one above the other, go the
    /// same way and make a body together are one.
    pub(super) fn join_pieces(&mut self) {
        let found = (0..self.tracks.len()).find_map(|upper| {
            let below = (0..self.tracks.len()).filter(|&lower| lower != upper);
            let lower = below.into_iter().find(|&lower| is_body(&self.tracks[upper], &self.tracks[lower]))?;
            Some((upper, lower))
        });
        if let Some((upper, lower)) = found {
            let whole = self.tracks[upper].seen_bounds() | self.tracks[lower].seen_bounds();
            let (part, rest) = if self.tracks[upper].height() > self.tracks[lower].height() {
                (lower, upper)
            } else {
                (upper, lower)
            };
            self.absorb(part, rest);
            self.tracks[rest].become_whole(whole);
            self.tracks[rest].restart_way();
        }
    }

    /// Whether who is seen inside of another is a part of them: a hand, or legs that were seen first.
    fn is_part(&self, part: usize, whole: usize, region: Rect2f) -> bool {
        let (part, whole) = (&self.tracks[part], &self.tracks[whole]);
        let is_smaller = |share: f32| part.height() < share * whole.height();
        (is_smaller(SMALL) && part.journey.alone_s < SMALL_APART_S)
            || (is_smaller(PART) && is_upright(region) && part.journey.alone_s < APART_S)
            || are_parts_of_a_vehicle(part, whole)
            || are_the_same(part, whole)
    }

    /// What one track was belongs to another from now on, under the number of who was seen alone for longer.
    fn absorb(&mut self, part: usize, whole: usize) {
        let part_is_older = self.tracks[part].journey.alone_s > self.tracks[whole].journey.alone_s;
        self.merge(part, whole, part_is_older);
    }

    /// What one track was belongs to another from now on, under the number of the first where that `keeps_number`.
    pub(super) fn merge(&mut self, part: usize, whole: usize, keeps_number: bool) {
        let (part_id, whole_id) = (self.tracks[part].id, self.tracks[whole].id);
        self.tracks[part].end();
        let companions = std::mem::take(&mut self.tracks[part].companions);
        self.tracks[whole].companions.extend(companions);
        self.tracks[whole].companions.retain(|id| *id != part_id && *id != whole_id);
        let &Journey { age_s, pictures, farthest, .. } = &self.tracks[part].journey;
        let journey = &mut self.tracks[whole].journey;
        journey.age_s = journey.age_s.max(age_s);
        journey.pictures = journey.pictures.max(pictures);
        journey.farthest = journey.farthest.max(farthest);
        if part_id == 0 {
            return;
        }
        self.tracks[part].id = 0;
        let (kept, given_up) =
            if whole_id == 0 || keeps_number { (part_id, whole_id) } else { (whole_id, part_id) };
        self.tracks[whole].id = kept;
        if given_up > 0 {
            self.events.push((TrackChange::Merged, given_up, Some(kept)));
        }
    }
}

/// Whether a pole or a tree parted in two what is one, of those who are seen in one region: neither is upright, as somebody is, and one of
/// them was not seen alone for as long as together with others.
fn are_parts_of_a_vehicle(one: &Track, other: &Track) -> bool {
    let is_broad = |track: &Track| !is_upright(track.bounds());
    let is_mostly_shared = |track: &Track| track.journey.alone_s < track.journey.shared_s;
    [one, other].into_iter().all(is_broad) && [one, other].into_iter().any(is_mostly_shared)
}

/// Whether one of two who are seen in one region was never seen but there, for long, and where the other is: an operator's click was
/// beside the middle of somebody.
fn are_the_same(one: &Track, other: &Track) -> bool {
    let never_parted =
        |track: &Track| track.journey.alone_s == 0.0 && track.journey.shared_s >= NEVER_PARTED_S;
    (never_parted(one) || never_parted(other)) && overlap(one.bounds(), other.bounds()) >= SAME
}

/// Whether two tracks are trunk and legs.
fn is_body(upper: &Track, lower: &Track) -> bool {
    let (above, below) = (upper.seen_bounds(), lower.seen_bounds());
    let is_piece = |track: &Track, bounds: Rect2f| {
        track.is_alone() && track.journey.alone_s >= PIECE_S && bounds.width >= PIECE_ASPECT * bounds.height
    };
    let (across, _) = shared_sides(above, below);
    let gap = below.y - above.br().y;
    let whole = above | below;
    let apart = length(upper.velocity() - lower.velocity());
    is_piece(upper, above)
        && is_piece(lower, below)
        && across > 0.5 * above.width.min(below.width)
        && (-0.2 * whole.height..0.2 * whole.height).contains(&gap)
        && is_upright(whole)
        && apart <= TOGETHER * whole.height
}
