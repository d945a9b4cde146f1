// SPDX-License-Identifier: MPL-2.0

//! Which observation belongs to whom.
//!
//! Each track gets at most one region, all together the likeliest (as in SORT, Bewley et al. 2016). What is left over is a part of
//! somebody who was seen in pieces, shows several people at once (McKenna et al. 2000, Senior et al. 2006), or is somebody new.

use opencv::core::Rect2f;

use super::assignment::Assigner;
use super::region::Region;
use super::size::SIZE_TIME_S;
use super::track::Track;
use crate::vision::tracker::geometry::{centre, overlap, share_inside, shared_sides};

/// Deviation of a region from its track, in heights of the track, beside the track's own doubt.
const PLACE_NOISE: f32 = 0.12;
/// Deviations of the logarithms of height and width: where more is seen than the track, somebody else is in it, where less,
/// something hides the rest.
const LARGER: (f32, f32) = (0.3, 0.5);
const SMALLER: (f32, f32) = (0.7, 0.8);
/// How alike by colours anybody is to anybody, and what being less so costs.
const ANYBODY: f32 = 0.7;
const COLOUR_WEIGHT: f32 = 8.0;
/// The same of those who come out of a group, as who is where in it is hardly known.
const COLOUR_WEIGHT_PARTING: f32 = 24.0;
/// What taking a region costs at most: beyond that nothing is seen of the track, and the region is somebody else's.
const GATE: f32 = 16.0;
/// The same where it would be in another region, with somebody else: who is farther off is hardly they.
const GATE_IN_A_GROUP: f32 = 6.0;
/// What a track must offer more for each second that it has not been there for, as who was seen before goes first.
const NOVELTY: f32 = 2.0;
/// Share of a box that lies in another from which it is in it.
const IN: f32 = 0.5;
/// Parts of one body are no farther apart: in widths of the narrower one across, in heights of the taller one down.
const APART: f32 = 0.5;
/// By how much a part must make the whole more alike to what was expected.
const BETTER: f32 = 0.05;

/// What belongs to whom in one picture; kept as memory for the next.
#[derive(Debug, Default)]
pub(super) struct Association {
    /// For each track the region that it was given.
    pub own: Vec<Option<usize>>,
    /// For each track the region in which it is seen with others, where it was given none.
    pub guest_in: Vec<Option<usize>>,
    /// For each track the box around all its parts.
    pub whole: Vec<Rect2f>,
    /// For each region whose part it is, where it is one.
    pub part_of: Vec<Option<usize>>,
    /// Regions that are nobody's yet, the largest first.
    left: Vec<usize>,
    assigner: Assigner,
}

impl Association {
    /// Gives the regions of one picture to the tracks, which are predicted for it.
    pub fn update(&mut self, tracks: &[Track], regions: &[Region]) {
        let Self { own, guest_in, whole, part_of, left, assigner } = self;
        guest_in.clear();
        guest_in.extend(tracks.iter().map(|track| around(track.bounds(), regions)));
        assigner.assign(
            tracks.len(),
            regions.len(),
            |track, region| {
                let elsewhere = guest_in[track].is_some_and(|within| within != region);
                let gate = if elsewhere { GATE_IN_A_GROUP } else { GATE };
                cost(&tracks[track], &regions[region]).filter(|cost| *cost < gate)
            },
            own,
        );
        for (within, _) in guest_in.iter_mut().zip(&*own).filter(|(_, own)| own.is_some()) {
            *within = None;
        }
        whole.clear();
        whole.extend(tracks.iter().zip(&*own).map(|(track, own)| match own {
            Some(region) => regions[*region].bounds,
            None => track.bounds(),
        }));
        part_of.clear();
        part_of.resize(regions.len(), None);
        let is_left = |region: &usize| !own.contains(&Some(*region)) && !guest_in.contains(&Some(*region));
        left.clear();
        left.extend((0..regions.len()).filter(is_left));
        left.sort_unstable_by(|a, b| regions[*b].bounds.area().total_cmp(&regions[*a].bounds.area()));
        for &region in &*left {
            let part = regions[region].bounds;
            let beside = || {
                let seen = (0..tracks.len()).filter(|&track| own[track].is_some());
                seen.filter(|&track| can_be_one_body(whole[track], part))
            };
            let gain = |track: usize| {
                let expected = tracks[track].bounds();
                overlap(whole[track] | part, expected) - overlap(whole[track], expected)
            };
            let best = beside().map(|track| (track, gain(track))).max_by(|a, b| a.1.total_cmp(&b.1));
            part_of[region] = match best {
                Some((track, gain)) if gain >= BETTER => {
                    whole[track] |= part;
                    Some(track)
                }
                _ => beside().find(|&track| share_inside(part, tracks[track].bounds()) >= IN),
            };
        }
    }

    /// Who is seen in a region, though it was not given to them.
    pub fn guests(&self, region: usize) -> impl Iterator<Item = usize> + '_ {
        let guests = self.guest_in.iter().enumerate();
        guests.filter(move |(_, within)| **within == Some(region)).map(|(track, _)| track)
    }
}

/// Whether two parts are near enough to each other. Two people who were seen as one are no parts of somebody once they walk apart.
fn can_be_one_body(one: Rect2f, other: Rect2f) -> bool {
    let (across, down) = shared_sides(one, other);
    -across <= APART * one.width.min(other.width) && -down <= APART * one.height.max(other.height)
}

/// The region that most of a box lies in.
fn around(bounds: Rect2f, regions: &[Region]) -> Option<usize> {
    let within = regions.iter().enumerate().map(|(region, r)| (region, share_inside(bounds, r.bounds)));
    let best = within.max_by(|a, b| a.1.total_cmp(&b.1));
    best.filter(|(_, share)| *share >= IN).map(|(region, _)| region)
}

/// What it costs the track to be seen in the region: twice a negative logarithm of likelihoods. `None` where it cannot be.
fn cost(track: &Track, region: &Region) -> Option<f32> {
    let (expected, seen) = (track.bounds(), region.bounds);
    let noise = (PLACE_NOISE * expected.height).powi(2);
    let (across, down) = track.variance();
    let (from, to) = (centre(expected), centre(seen));
    // Whatever hides a part of somebody leaves one of their sides where it was.
    let least = |off: &[f32]| off.iter().fold(f32::INFINITY, |least, off| least.min(off.abs()));
    let x = least(&[seen.x - expected.x, seen.br().x - expected.br().x, to.x - from.x]);
    let y = least(&[seen.y - expected.y, seen.br().y - expected.br().y]);
    // The less is known of where it is, the less likely is any place.
    let doubt = (1.0 + across / noise).ln() + (1.0 + down / noise).ln();
    let place = x * x / (across + noise) + y * y / (down + noise) + doubt;
    let settled = (track.journey.age_s / SIZE_TIME_S).min(1.0) as f32;
    let height = size_cost(seen.height / expected.height, LARGER.0, SMALLER.0);
    let width = size_cost(seen.width / expected.width, LARGER.1, SMALLER.1);
    let size = (0.2 + 0.8 * settled) * (height + width);
    let weight = if track.companions.is_empty() { COLOUR_WEIGHT } else { COLOUR_WEIGHT_PARTING };
    let colour = track.views.likeness(&region.looks).map_or(0.0, |alike| weight * (ANYBODY - alike));
    let novelty = NOVELTY * (1.0 - track.confidence());
    let cost = place + size + colour + novelty;
    cost.is_finite().then_some(cost)
}

fn size_cost(ratio: f32, larger: f32, smaller: f32) -> f32 {
    let off = ratio.max(0.05).ln();
    (off / if off > 0.0 { larger } else { smaller }).powi(2)
}
