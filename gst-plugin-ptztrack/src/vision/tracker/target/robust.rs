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
use crate::vision::tracker::geometry::{centre, length, overlap, scaled};
use crate::vision::tracker::grey_histogram::near_the_middle;
use crate::vision::tracker::points::Points;
use crate::vision::tracker::tracks::{Track, Tracks};

/// Deviation of the target's looks from where it is expected, in sides of it, beside the track's own doubt; and that at most.
const SPREAD: f32 = 0.2;
const WIDE_SPREAD: f32 = 0.6;
/// Share of what is usually seen of the target from which it is there by its looks, and what must stand out from the background there,
/// 0 to 1, to bear that out: of a wall it is a fiftieth, of somebody in clothes like the wall a fifth.
const FOUND: f32 = 0.55;
const FAINT: f32 = 0.1;
/// How much of a wall stands out, 0 to 1, the share of what usually stands out of the target without which its looks are those of
/// the wall, and the times over which that is learned, upwards and downwards, seconds.
const WALL: f32 = 0.02;
const OUTSTANDING: f32 = 0.3;
const RISE_S: f32 = 0.2;
const FALL_S: f32 = 10.0;
/// From so many heights per second on somebody moves.
const MOVING: f32 = 0.2;
/// The same share where the background is not known.
const NOT_KNOWN: f32 = 0.5;
/// How far the centre of mass may lie from the middle of the box, as a share of its sides.
const CENTROID_REACH: f32 = 0.15;
/// Intersection over union below which a box is another than the one that was followed: its pixels are learned anew.
const ANOTHER: f32 = 0.4;
/// For how long nothing may be seen of a target that is not hidden, seconds, and pictures in a row in which one that is must be seen,
/// and how much of its height.
const DOUBT_S: f32 = 0.25;
const SEEN_AGAIN: u32 = 2;
const PART: f32 = 0.5;

/// A target followed by its track.
pub(in super::super) struct Robust {
    estimate: Estimate,
    flow: PointFlow,
    appearance: Appearance,
    /// How much of it stands out from the background while it is seen, 0 to 1.
    usually_stands_out: f32,
    unseen_s: f32,
    seen_in_a_row: u32,
    is_hidden: bool,
}

impl Robust {
    /// Takes up a track; `None` where it has no corner.
    pub fn acquire(seen: &Observation, track: &Track) -> opencv::Result<Option<Self>> {
        let bounds = track.seen_bounds();
        let appearance = Appearance::new(seen, bounds)?;
        let Some(flow) = PointFlow::new(&seen.luma, bounds, appearance.map())? else { return Ok(None) };
        let estimate = Estimate::begun(bounds, track.velocity());
        Ok(Some(Self {
            estimate,
            flow,
            appearance,
            unseen_s: 0.0,
            seen_in_a_row: 0,
            is_hidden: false,
            usually_stands_out: 0.0,
        }))
    }

    /// Lets the points say how the track moves.
    fn follow_points(
        &mut self,
        seen: &Observation,
        dt_s: f32,
        tracks: &mut Tracks,
        id: u64,
    ) -> opencv::Result<()> {
        let ego = EgoMotion::of(seen).unwrap_or_default();
        let expected = self.estimate.own_velocity * dt_s;
        let bounds = self.estimate.bounds;
        let map = self.appearance.map();
        let motion = self.flow.follow(&seen.luma, bounds, (ego, expected), map, dt_s)?;
        // What the points of a target do that is not seen is what hides it does, or the wall.
        let Some(motion) = motion.filter(|_| self.unseen_s == 0.0) else { return Ok(()) };
        if let Some(track) = tracks.get_mut(id) {
            let deviation = motion.deviation / (motion.trust * motion.trust).max(0.01);
            track.measure_velocity(motion.own / dt_s, deviation / dt_s);
        }
        Ok(())
    }

    /// Learns how much of the target stands out where it is seen. Who stood out does so still: nothing becomes background where the
    /// target is.
    fn learn_to_stand_out(&mut self, stands_out: f32, dt_s: f32) {
        let change = stands_out - self.usually_stands_out;
        let time_s = if change > 0.0 { RISE_S } else { FALL_S };
        self.usually_stands_out += change * dt_s / (dt_s + time_s);
    }

    /// Takes note of whether anything was seen of the target, and of what it shows for one that is hidden.
    fn judge(&mut self, is_seen: bool, is_clear: bool, dt_s: f32) {
        self.unseen_s = if is_seen { 0.0 } else { self.unseen_s + dt_s };
        self.seen_in_a_row = if is_clear { self.seen_in_a_row + 1 } else { 0 };
        self.is_hidden =
            if self.is_hidden { self.seen_in_a_row < SEEN_AGAIN } else { self.unseen_s > DOUBT_S };
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
        let expected = ego.map_or(self.estimate.bounds, |ego| ego.apply_to(self.estimate.bounds));
        if track.is_alone() && overlap(expected, track.bounds()) < ANOTHER {
            self.appearance = Appearance::new(seen, track.bounds())?;
        }
        let reach = scaled(track.bounds(), CONTEXT.0, CONTEXT.1);
        self.appearance.watch_others(tracks.is_another_in(reach), dt_s);
        let (across, down) = track.variance();
        let expected = track.bounds();
        let doubt = (across.sqrt() / expected.width).max(down.sqrt() / expected.height);
        let place = self.appearance.locate(seen, expected, (SPREAD + doubt).min(WIDE_SPREAD))?;
        let (is_alone, is_measured, is_whole) =
            (track.is_alone(), track.is_measured(), track.is_seen_whole());
        let clear = is_alone && track.seen_bounds().height >= PART * track.height();
        let stands_out = tracks.stands_out(seen, place.bounds);
        let usual = self.usually_stands_out;
        let is_wall = stands_out.is_some_and(|share| share + WALL < OUTSTANDING * usual);
        let is_there = place.share >= FOUND && (is_alone || !(is_wall || tracks.is_anothers(place.bounds)));
        let is_outstanding = stands_out.is_none_or(|share| share >= FAINT);
        self.estimate.is_borne_out = is_measured || (is_there && is_outstanding);
        let Some(track) = tracks.get_mut(id) else { return Ok(Sight::Gone) };
        if is_there && !is_alone {
            track.measure_place(centre(place.bounds), place.share);
            let as_usual = |share: f32| share / usual.max(FAINT);
            track.stand_out(stands_out.map_or(NOT_KNOWN, as_usual), dt_s);
        }
        self.judge(is_measured || is_there, clear || is_there, dt_s);
        let bounds = track.bounds();
        self.estimate.bounds = bounds;
        self.estimate.own_velocity = track.velocity();
        self.estimate.ego_velocity = ego.map(|ego| ego.at(centre(bounds)) / dt_s);
        let seen_share = if is_whole { 1.0 } else { place.share.clamp(0.0, 1.0) };
        self.estimate.confidence = track.confidence() * if self.is_hidden { 0.0 } else { seen_share };
        if self.is_hidden {
            self.estimate.centroid = centre(bounds);
            self.flow.settle(&seen.luma, bounds, self.appearance.map(), false)?;
            return Ok(Sight::Hidden);
        }
        // Who stands and is seen by nobody else may be background by now.
        let moves = length(self.estimate.own_velocity) >= MOVING * bounds.height;
        if let Some(share) = stands_out.filter(|_| is_measured || moves) {
            self.learn_to_stand_out(share, dt_s);
        }
        self.appearance.look_closely(seen, bounds);
        // Who is seen whole and alone is learned however they look: who turns round looks new. A detector that knows nothing of the
        // background may see somebody where there is nothing but wall by now.
        if is_whole && !is_wall {
            self.appearance.learn(seen, bounds, &place)?;
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
