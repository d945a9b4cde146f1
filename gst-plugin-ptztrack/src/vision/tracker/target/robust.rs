// SPDX-License-Identifier: MPL-2.0

//! A target followed by its track. Its regions say where it is; its pixels say how it moves, and where it is while no region shows it
//! whole. Neither points nor looks keep a track alive that nothing stands out of the background for.

use opencv::core::Point2f;

use super::appearance::Appearance;
use super::point_flow::PointFlow;
use super::{Estimate, Follow, Sight};
use crate::vision::Observation;
use crate::vision::tracker::ego_motion::EgoMotion;
use crate::vision::tracker::figure::CONTEXT;
use crate::vision::tracker::geometry::{centre, scaled};
use crate::vision::tracker::grey_histogram::near_the_middle;
use crate::vision::tracker::points::Points;
use crate::vision::tracker::tracks::{Track, Tracks};

/// Deviation of the target's looks from where it is expected, in sides of it, beside the track's own doubt.
const SPREAD: f32 = 0.3;
/// Share of what its looks usually say from which the target is there by its looks, and what must stand out from the background there,
/// 0 to 1, to bear that out: of a wall it is a fiftieth, of somebody in clothes like the wall a fifth.
pub(super) const FOUND: f32 = 0.55;
pub(super) const FAINT: f32 = 0.1;
/// What is taken to stand out where the background is not known: so little that nobody is kept for ever by their looks.
const NOT_KNOWN: f32 = 0.2;
/// How far the centre of mass may lie from the middle of the box, as a share of its sides.
const CENTROID_REACH: f32 = 0.15;
/// For how long nothing may be seen of a target that is not hidden, seconds.
const DOUBT_S: f32 = 0.25;

/// A target followed by its track.
pub(in super::super) struct Robust {
    estimate: Estimate,
    flow: PointFlow,
    appearance: Appearance,
    unseen_s: f32,
}

impl Robust {
    /// Takes up a track; `None` where it has no corner.
    pub fn acquire(seen: &Observation, track: &Track) -> opencv::Result<Option<Self>> {
        let bounds = track.seen_bounds();
        let appearance = Appearance::new(seen, bounds);
        let Some(flow) = PointFlow::new(&seen.luma, bounds, appearance.map())? else { return Ok(None) };
        let estimate = Estimate::begun(bounds, track.velocity());
        Ok(Some(Self { estimate, flow, appearance, unseen_s: 0.0 }))
    }

    /// Lets the points say how the track moves.
    fn follow_points(
        &mut self,
        seen: &Observation,
        dt_s: f32,
        tracks: &mut Tracks,
        id: u64,
    ) -> opencv::Result<()> {
        let ego = EgoMotion::seen_or_coasted(seen).unwrap_or_default();
        let expected = self.estimate.own_velocity * dt_s;
        let bounds = self.estimate.bounds;
        let map = self.appearance.map();
        let motion = self.flow.follow(&seen.luma, bounds, (ego, expected), map, dt_s)?;
        // What the points do of a target that was not seen is what hides it does, or the wall, and of one that is not seen by itself, who
        // is seen with it; and what they do against a background that is but taken to have moved may be its own.
        let has_coasted = seen.scene.is_some_and(|scene| scene.coasted_motion.is_some());
        let Some(motion) = motion.filter(|_| self.unseen_s == 0.0 && !has_coasted) else { return Ok(()) };
        if let Some(track) = tracks.seen_by_itself(id) {
            let deviation = motion.deviation / (motion.trust * motion.trust).max(0.01);
            track.measure_velocity(motion.own / dt_s, deviation / dt_s);
        }
        Ok(())
    }
}

impl Follow for Robust {
    fn follow(
        &mut self,
        seen: &Observation,
        dt_s: f32,
        tracks: &mut Tracks,
        id: u64,
    ) -> opencv::Result<Sight> {
        self.follow_points(seen, dt_s, tracks, id)?;
        let Some(track) = tracks.get(id) else { return Ok(Sight::Gone) };
        let ego = EgoMotion::of(seen);
        let reach = scaled(track.bounds(), CONTEXT.0, CONTEXT.1);
        self.appearance.pass(tracks.is_another_in(reach), dt_s);
        let expected = track.bounds();
        let (across, down) = track.variance();
        let doubt = (across.sqrt() / expected.width).max(down.sqrt() / expected.height);
        let place = self.appearance.locate(seen, expected, SPREAD + doubt);
        let (is_alone, is_measured, is_whole) =
            (track.is_alone(), track.is_measured(), track.is_seen_whole());
        let known = tracks.stands_out(seen, place.bounds);
        let is_wall = known.is_some_and(|share| share < self.appearance.least_outstanding());
        let stands_out = known.unwrap_or(NOT_KNOWN);
        let is_there = place.share >= FOUND && !is_wall && (is_alone || !tracks.is_anothers(place.bounds));
        self.estimate.is_borne_out = is_measured || (is_there && stands_out >= FAINT);
        if is_there && !is_alone && stands_out >= FAINT {
            tracks.stand_out(id, stands_out, dt_s);
        }
        let Some(track) = tracks.get_mut(id) else { return Ok(Sight::Gone) };
        if is_there && !is_alone {
            track.measure_place(centre(place.bounds), place.share);
        }
        self.unseen_s = if is_measured || is_there { 0.0 } else { self.unseen_s + dt_s };
        let is_hidden = self.unseen_s > DOUBT_S;
        let bounds = track.bounds();
        self.estimate.bounds = bounds;
        self.estimate.own_velocity = track.velocity();
        self.estimate.ego_velocity = ego.map(|ego| ego.at(centre(bounds)) / dt_s);
        let seen_share = if is_whole { 1.0 } else { place.share.min(1.0) };
        self.estimate.confidence = track.confidence() * if is_hidden { 0.0 } else { seen_share };
        if is_hidden {
            self.estimate.centroid = centre(bounds);
            self.flow.settle(&seen.luma, bounds, self.appearance.map(), false)?;
            return Ok(Sight::Hidden);
        }
        self.appearance.look_closely(seen, bounds);
        // Who is seen whole and alone is learned however they look: who turns round looks new.
        if is_whole {
            self.appearance.learn(&place, known);
        }
        let map = self.appearance.map();
        let mass: Point2f = map.centre_of_mass(bounds).unwrap_or_else(|| centre(bounds));
        self.estimate.centroid = near_the_middle(mass, bounds, CENTROID_REACH);
        self.flow.settle(&seen.luma, bounds, map, is_whole || is_there)?;
        Ok(Sight::Seen)
    }

    fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    fn points(&self) -> &Points {
        self.flow.points()
    }
}
