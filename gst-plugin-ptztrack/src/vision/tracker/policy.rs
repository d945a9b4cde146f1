// SPDX-License-Identifier: MPL-2.0

//! Which track is the target.

use std::sync::Arc;

use opencv::core::{Point2f, Rect2f};

use super::ego_motion::EgoMotion;
use super::geometry::{Frame, breadth, centre, grown, length, overlap, shared_sides};
use super::tracks::{Track, Tracks};

/// A track at the edge may be half a person: how long it may take to walk in, seconds.
const EDGE_WAIT_S: f64 = 1.2;
/// How long what was released is not taken again, seconds.
const RELEASE_HOLD_S: f64 = 3.0;
/// What lies by more than this where much changed for nothing may be a part of that, as somebody in a film, however far it
/// goes: it has to leave.
const RESTLESS: f32 = 0.5;
/// Most places at which somebody stood that are remembered: the oldest goes.
const MAX_PARKED: usize = 16;
/// Nothing of somebody reaches as far as this part of their height.
pub(super) const ARM: f32 = 0.5;
/// Who is so many times as tall as when they stood has come nearer.
const NEARER: f32 = 1.3;
/// How far beside somebody a click may be, pixels.
const CLICK_REACH: f32 = 12.0;

/// How the target is chosen among the tracks.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Choice {
    /// The one of largest area.
    #[default]
    Largest,
    /// The one that was there first.
    First,
    /// The one nearest to the middle of the frame.
    NearestCentre,
    /// All of them: the one of largest area, and everybody else in the same box.
    Group,
    /// None: an operator chooses.
    Manual,
}

/// Chooses the target.
#[derive(Debug, Default)]
pub(super) struct Policy {
    /// Who stood, and where, in the newest picture: the place goes with the background.
    parked: Vec<(u64, Rect2f)>,
    /// Who was let go on purpose, and for how many seconds more they are left alone.
    released: Vec<(u64, f64)>,
    /// Who is chosen by nobody but an operator.
    ignored: Arc<[u64]>,
}

impl Policy {
    /// Forgets everything but who is to be ignored: another stream begins.
    pub fn restart(&mut self) {
        *self = Self { ignored: std::mem::take(&mut self.ignored), ..Self::default() };
    }

    /// The tracks of these numbers are not chosen, from now on.
    pub fn ignore(&mut self, ids: Arc<[u64]>) {
        self.ignored = ids;
    }

    /// The track of that number is followed from now on.
    pub fn take(&mut self, id: u64) {
        self.parked.retain(|(parked, _)| *parked != id);
        self.released.retain(|(released, _)| *released != id);
    }

    /// That track was let go because it stands: nobody is chosen there until it moves.
    pub fn park(&mut self, id: u64, bounds: Rect2f) {
        if self.parked.len() == MAX_PARKED {
            self.parked.remove(0);
        }
        self.parked.push((id, bounds));
    }

    /// That track was let go on purpose: it is not chosen again for a while.
    pub fn release(&mut self, id: u64) {
        self.released.retain(|(released, _)| *released != id);
        self.released.push((id, RELEASE_HOLD_S));
    }

    /// So much time passes, in which the background moves as `ego`. Where nobody knows how it moves, nobody knows any more where
    /// somebody stood.
    pub fn pass(&mut self, tracks: &Tracks, ego: Option<EgoMotion>, dt_s: f64) {
        self.parked.retain_mut(|(id, place)| {
            let Some(ego) = ego else { return false };
            *place = ego.apply_to(*place);
            tracks.get(*id).is_none_or(|track| stands_at(*place, track.seen_bounds()))
        });
        self.released.retain_mut(|(_, left_s)| {
            *left_s -= dt_s;
            *left_s > 0.0
        });
    }

    /// The tracks that may be followed now: seen, and going somewhere where they `must_travel`.
    pub fn ready<'a>(
        &'a self,
        tracks: &'a Tracks,
        must_travel: bool,
        frame: Frame,
    ) -> impl Iterator<Item = &'a Track> {
        tracks.seen().filter(move |track| {
            let bounds = track.seen_bounds();
            let region = tracks.region(track);
            track.is_confirmed()
                && region
                    .is_some_and(|region| !region.outside && (!must_travel || region.restless <= RESTLESS))
                && (track.journey.age_s >= EDGE_WAIT_S || !is_entering(tracks, bounds, frame))
                && !self.released.iter().any(|(released, _)| *released == track.id)
                && !self.is_unwanted(track)
                && (!must_travel || track.travels())
        })
    }

    /// Whether a track is followed only where an operator asks for it, as it is to be ignored, or stands.
    pub fn is_unwanted(&self, track: &Track) -> bool {
        self.ignored.contains(&track.id) || self.is_parked(track)
    }

    /// Whether a track is where somebody stood that was let go, and may be a part of them: who has come from elsewhere is not.
    fn is_parked(&self, track: &Track) -> bool {
        self.parked.iter().any(|(id, place)| {
            let has_come = *id != track.id && track.has_gone_as_far_as(ARM * place.height);
            !has_come && stands_at(*place, track.seen_bounds())
        })
    }

    /// The tracks that may be followed now, going somewhere where they `must_travel`, in the order in which they are tried: the one of the
    /// number `before` all others, then as is chosen.
    pub fn choices<'a>(
        &'a self,
        tracks: &'a Tracks,
        choice: Choice,
        before: Option<u64>,
        must_travel: bool,
        frame: Frame,
    ) -> Vec<&'a Track> {
        let value = |track: &Track| match choice {
            Choice::Largest | Choice::Group => f64::from(track.seen_bounds().area()),
            Choice::First => -(track.id as f64),
            Choice::NearestCentre => -f64::from(length(centre(track.seen_bounds()) - centre(frame.bounds()))),
            Choice::Manual => f64::NEG_INFINITY,
        };
        let is_known = |track: &Track| Some(track.id) == before;
        let ready = self.ready(tracks, must_travel, frame);
        let mut ready: Vec<_> = ready.filter(|_| choice != Choice::Manual).collect();
        ready.sort_by(|one, other| {
            is_known(other).cmp(&is_known(one)).then_with(|| value(other).total_cmp(&value(one)))
        });
        ready
    }
}

/// Whether who is seen in `bounds` has not moved from a place, sideways by a width or nearer: an arm or a leg is there as well.
fn stands_at(place: Rect2f, bounds: Rect2f) -> bool {
    let offset = centre(bounds) - centre(place);
    let sideways = breadth(place);
    offset.x.abs() < sideways
        && offset.y.abs() < sideways.max(place.height / 2.0)
        && bounds.height < NEARER * place.height
}

/// Whether somebody is still coming into view, or leaving: a leg goes before the body. Of whoever is cut off by the lower edge only, head
/// and trunk are there, by a camera that hangs upright, which may be all that is ever seen of them: somebody near walks past below.
fn is_entering(tracks: &Tracks, bounds: Rect2f, frame: Frame) -> bool {
    let mut parts = tracks.seen().map(Track::seen_bounds).filter(|part| may_be_one(bounds, *part));
    parts.any(|part| {
        let [left, top, right, _] = frame.cut_sides(part);
        left || top || right
    })
}

/// Which of the tracks seen in this picture a click at `point` means: the smallest of those whose outline it is in, or else of those
/// whose box it is in, or a little beside.
pub(super) fn clicked(tracks: &Tracks, point: Point2f) -> Option<&Track> {
    let is_shown = |track: &Track| tracks.region(track).is_some_and(|region| region.shows(point));
    tracks.seen().filter(|track| grown(track.seen_bounds(), CLICK_REACH).contains(point)).min_by(|a, b| {
        let smaller = a.seen_bounds().area().total_cmp(&b.seen_bounds().area());
        is_shown(b).cmp(&is_shown(a)).then(smaller)
    })
}

/// The target is seen at `bounds`: who is seen beside it is somebody else, wherever they go from then on. What is above or below
/// may be a part of it.
pub(super) fn tell_apart(tracks: &mut Tracks, target: u64, bounds: Rect2f, dt_s: f64) {
    for track in tracks.seen_mut().filter(|track| track.id != target) {
        let seen = track.seen_bounds();
        if overlap(bounds, seen) <= 0.0 && !may_be_one(bounds, seen) {
            track.beside_target_s += dt_s;
        }
    }
}

/// Whether two boxes stand one above the other, so near that they may be parts of one body: where clothes look like the wall
/// behind them, legs and trunk are seen apart.
fn may_be_one(a: Rect2f, b: Rect2f) -> bool {
    let (across, down) = shared_sides(a, b);
    across > 0.5 * a.width.min(b.width) && -down < a.height.max(b.height)
}

#[cfg(test)]
mod tests;
