// SPDX-License-Identifier: MPL-2.0

//! Everybody who is seen is a track, and every observation has one owner.
//!
//! | step | after | file |
//! |---|---|---|
//! | where a track is, side by side | Kalman filter of SORT (Bewley et al. 2016) | `track`, `axis` |
//! | which region belongs to whom | Hungarian assignment | `association`, `assignment` |
//! | how many people a region shows | Haritaoglu et al. 1999 | `heads` |
//! | several people in one region | McKenna et al. 2000, Senior et al. 2006 | `groups` |
//! | who is a part of somebody | | `merging` |
//! | what they look like | | `looks` |
//! | who comes back | | `memory` |
//! | what changes and goes nowhere | | `places` |
//! | how large they are, by what others are where they stand | Hoiem et al. 2008 | `size`, `floor` |

mod assignment;
mod association;
mod axis;
mod floor;
mod groups;
mod heads;
mod looks;
mod memory;
mod merging;
mod places;
mod region;
mod size;
mod track;

use std::cmp::Reverse;

use opencv::core::{Point2f, Rect2f};
use ptztrack_contract::TrackChange;

use association::Association;
use floor::Floor;
use groups::Partings;
use looks::Viewer;
use memory::Memory;
use places::RestlessPlaces;
use track::{Evidence, Journey};

pub(super) use heads::{body_at, people};
pub(super) use region::Region;
pub(super) use track::{Track, motion};

use super::ego_motion::EgoMotion;
use super::geometry::{Frame, centre, length, overlap, scaled, share_inside};
use crate::vision::Observation;

/// Smaller regions, in pixels of either side, have no features; larger shares of the frame are nobody.
const MIN_SIDE: f32 = 6.0;
const MAX_SHARE: f32 = 0.9;
/// So many regions are looked at, first where somebody has been known for longest and then the largest, and so many tracks are kept on trial: the time
/// that a picture takes is bounded, whatever a detector tells.
const MOST: usize = 128;
/// Part of the box that must be in the picture.
const LEFT: f32 = 0.35;
/// How far, in heights, somebody who is not seen may be from where they should be: at once, and farther with every second.
const REACH: (f32, f32) = (0.5, 2.3);
/// Intersection over union with somebody else from which it is they who are seen.
const TAKEN: f32 = 0.4;
/// How alike in colours somebody new must be to be who is not seen, more than anybody is to anybody (`ANYBODY` of `association`), and what part
/// of their height must have come out.
const ALIKE: f32 = 0.8;
const REAPPEARED: f32 = 0.5;

/// By which rules tracks are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rules {
    /// Pictures in which somebody must be seen to get a number.
    pub confirm_pictures: u32,
    /// How long somebody who is not seen is taken to be there, seconds.
    pub coast_s: f64,
    /// How long who is gone is remembered, seconds.
    pub memory_s: f64,
    /// The longest that the detector may take from one look to the next, seconds; 0 for one that sees every picture.
    pub detector_pause_s: f64,
}

/// What happened to the track of a number; who merged goes on under the second.
pub(super) type TrackEvent = (TrackChange, u64, Option<u64>);

/// Everybody who is seen.
#[derive(Debug, Default)]
pub(super) struct Tracks {
    tracks: Vec<Track>,
    regions: Vec<Region>,
    association: Association,
    places: RestlessPlaces,
    floor: Floor,
    partings: Partings,
    memory: Memory,
    viewer: Viewer,
    events: Vec<TrackEvent>,
    /// Memory: who is seen in one region.
    members: Vec<usize>,
    last_id: u64,
    /// As the rules were last.
    coast_s: f64,
    detector_pause_s: f64,
}

impl Tracks {
    /// Forgets everybody: another stream begins. Numbers go on.
    pub fn restart(&mut self) {
        self.tracks.clear();
        self.regions.clear();
        self.places.clear();
        self.floor.clear();
        self.partings.clear();
        self.memory.clear();
        self.events.clear();
    }

    /// Gives the outlines of the last picture back, as memory for those of the next.
    pub fn give_back(&mut self, outlines: &mut Vec<Vec<Point2f>>) {
        outlines.extend(self.regions.drain(..).map(|mut region| {
            region.contour.clear();
            region.contour
        }));
    }

    /// Takes what a detector saw in one picture, `dt_s` after the last; `ego` is how the background moved since, where that is
    /// known.
    pub fn update(
        &mut self,
        seen: &Observation,
        regions: impl Iterator<Item = Region>,
        ego: Option<EgoMotion>,
        dt_s: f64,
        rules: Rules,
    ) {
        let frame = Frame { width: seen.luma.width() as f32, height: seen.luma.height() as f32 };
        self.events.clear();
        (self.coast_s, self.detector_pause_s) = (rules.coast_s, rules.detector_pause_s);
        self.tracks.retain(|track| !track.is_gone());
        self.tracks.iter_mut().for_each(|track| track.predict(ego, dt_s));
        self.places.carry(ego, dt_s);
        self.floor.carry(ego, frame, dt_s);
        self.memory.pass(ego, dt_s, rules.memory_s);
        self.look(seen, regions, frame);
        let mut association = std::mem::take(&mut self.association);
        association.update(&self.tracks, &self.regions);
        self.take_own(&association, frame, dt_s);
        self.share(&association, frame, dt_s);
        self.join_pieces();
        self.miss(frame, dt_s, rules);
        self.begin(frame);
        self.association = association;
        self.number(rules);
        self.partings.update(&mut self.tracks, &self.regions, dt_s);
        self.places.watch(self.tracks.iter(), dt_s);
        let people = self.tracks.iter().filter(|track| track.is_confirmed() && !track.is_gone());
        self.floor.watch(people, frame, dt_s);
    }

    /// Everybody who has a number.
    pub fn iter(&self) -> impl Iterator<Item = &Track> {
        self.tracks.iter().filter(|track| track.is_confirmed() && !track.is_gone())
    }

    /// Who has that number.
    pub fn get(&self, id: u64) -> Option<&Track> {
        self.iter().find(|track| track.id == id)
    }

    pub fn get_mut(&mut self, id: u64) -> Option<&mut Track> {
        self.tracks.iter_mut().find(|track| track.id == id && track.is_confirmed() && !track.is_gone())
    }

    /// Who has that number, where nobody else is seen with them: they have a region of their own, or had one when the detector last looked,
    /// or were never seen by it, but by an operator.
    pub fn seen_by_itself(&mut self, id: u64) -> Option<&mut Track> {
        let pause_s = self.detector_pause_s;
        self.get_mut(id).filter(|track| {
            let Journey { alone_s, not_alone_s, .. } = track.journey;
            !track.is_shared() && (not_alone_s <= pause_s || alone_s == 0.0)
        })
    }

    /// What happened in the last picture.
    pub fn events(&self) -> &[TrackEvent] {
        &self.events
    }

    /// Everybody who is seen in the last picture, numbered or not.
    pub fn seen(&self) -> impl Iterator<Item = &Track> + Clone {
        self.tracks.iter().filter(|track| track.region().is_some() && !track.is_gone())
    }

    pub fn seen_mut(&mut self) -> impl Iterator<Item = &mut Track> {
        self.tracks.iter_mut().filter(|track| track.region().is_some() && !track.is_gone())
    }

    /// The region in which a track is seen.
    pub fn region(&self, track: &Track) -> Option<&Region> {
        self.regions.get(track.region()?)
    }

    /// How much of what is in `bounds` stands out from the background, 0 to 1; `None` where that is hardly known.
    pub fn stands_out(&mut self, seen: &Observation, bounds: Rect2f) -> Option<f32> {
        self.viewer.stands_out(seen, bounds)
    }

    /// No region shows that track alone, but where its looks say that it is so much stands out, 0 to 1, for `dt_s`.
    pub fn stand_out(&mut self, id: u64, shown: f32, dt_s: f32) {
        let share = dt_s / self.coast_s as f32;
        if let Some(track) = self.get_mut(id) {
            track.stand_out(shown, share);
        }
    }

    /// Whether somebody else than the target is in `area`.
    pub fn is_another_in(&self, area: Rect2f) -> bool {
        self.seen().any(|other| other.is_another() && (other.seen_bounds() & area).area() > 0.0)
    }

    /// Whether what is in `bounds` is somebody else than the target.
    pub fn is_anothers(&self, bounds: Rect2f) -> bool {
        self.iter().any(|other| {
            other.is_alone() && other.is_another() && overlap(bounds, other.seen_bounds()) >= TAKEN
        })
    }

    /// The number of who is seen in exactly `bounds`; where nobody is, of somebody new who is there by an operator's word, alone or
    /// among those who are seen there.
    pub fn number_at(&mut self, seen: &Observation, bounds: Rect2f, frame: Frame) -> u64 {
        let known =
            self.tracks.iter().position(|track| track.region().is_some() && track.seen_bounds() == bounds);
        let index = known.unwrap_or_else(|| self.single_out(seen, bounds, frame));
        let track = &mut self.tracks[index];
        if !track.is_confirmed() {
            self.last_id += 1;
            track.id = self.last_id;
            self.events.push((TrackChange::New, track.id, None));
        }
        track.id
    }

    /// Begins the track of somebody new in `bounds`, which may be a part of a region in which others are seen.
    fn single_out(&mut self, seen: &Observation, bounds: Rect2f, frame: Frame) -> usize {
        let mut region = Region::new(bounds, Vec::new(), false);
        // The sides of the box may show the others.
        region.looks = self.viewer.look(seen, scaled(bounds, 0.5, 1.0), &[]);
        let mut track = Track::new(self.regions.len(), &region, frame);
        let others = self.seen().filter(|other| share_inside(bounds, other.seen_bounds()) > 0.5);
        track.companions = others.map(|other| other.id).filter(|id| *id > 0).collect();
        self.regions.push(region);
        self.tracks.push(track);
        self.tracks.len() - 1
    }

    /// That track is the target from now on: it is there, and the others are yet to be told apart from it.
    pub fn target(&mut self, id: u64) {
        for track in &mut self.tracks {
            track.beside_target_s = 0.0;
            if track.id == id {
                track.establish();
            }
        }
    }

    /// Where the target is not seen, and somebody who has come since it was last seen alone is near where it should be, going about where
    /// that is asked for, and looks like it, it is they: however they sat, stooped or turned before. Who was seen beside it is somebody else.
    pub fn find_again(&mut self, id: u64, must_travel: bool) {
        let Some(lost) = self.tracks.iter().position(|track| track.id == id && track.region().is_none())
        else {
            return;
        };
        let track = &self.tracks[lost];
        let Journey { unseen_s, not_alone_s, .. } = track.journey;
        let bounds = track.bounds();
        let reach = (REACH.0 + REACH.1 * unseen_s as f32) * bounds.height;
        let found = self.tracks.iter().position(|other| {
            let alike = || {
                let region = self.region(other)?;
                track.views.likeness(&region.looks)
            };
            other.is_alone()
                && other.is_confirmed()
                && !other.is_another()
                && other.journey.age_s <= not_alone_s
                && other.height() >= REAPPEARED * bounds.height
                && length(centre(other.bounds()) - centre(bounds)) <= reach
                && (!must_travel || other.travels())
                && alike().is_none_or(|alike| alike >= ALIKE)
        });
        if let Some(found) = found {
            self.tracks[found].views = self.tracks[lost].views.clone();
            self.merge(lost, found, true);
        }
    }

    /// The number that a track has now, which may have gone into another in the last picture.
    pub fn number_now(&self, id: u64) -> u64 {
        let into = self.events.iter().find(|(change, part, _)| *change == TrackChange::Merged && *part == id);
        into.and_then(|(.., whole)| *whole).unwrap_or(id)
    }

    /// Reads the regions that can be somebody.
    fn look(&mut self, seen: &Observation, regions: impl Iterator<Item = Region>, frame: Frame) {
        self.regions.clear();
        self.regions.extend(regions.filter(|region| is_sound(region.bounds, frame)));
        if self.regions.len() > MOST {
            let Self { regions, tracks, .. } = self;
            let known: Vec<_> = tracks.iter().filter(|track| track.is_confirmed()).collect();
            let known_s = |region: &Region| {
                let there = known.iter().filter(|track| (region.bounds & track.bounds()).area() > 0.0);
                there.map(|track| track.journey.age_s).fold(0.0, f64::max)
            };
            // Both are no less than 0, so that their bits are in order.
            regions.sort_by_cached_key(|region| {
                Reverse((known_s(region).to_bits(), region.bounds.area().max(0.0).to_bits()))
            });
            regions.truncate(MOST);
        }
        for region in &mut self.regions {
            region.looks = self.viewer.look(seen, region.bounds, &region.contour);
            region.restless = region.restless.max(self.places.at(region.bounds));
        }
    }

    /// Gives each track its own region.
    fn take_own(&mut self, association: &Association, frame: Frame, dt_s: f64) {
        for (index, track) in self.tracks.iter_mut().enumerate() {
            let own = association.own[index];
            let Some(number) = own.filter(|&number| association.guests(number).next().is_none()) else {
                continue;
            };
            let whole = association.whole[index];
            let cut = frame.cut_sides(whole);
            track.measure(whole, cut.map(|cut| !cut));
            track.see_alone(number, whole, dt_s);
            track.resize(whole, &self.floor, cut, dt_s);
            let region = &mut self.regions[number];
            region.is_owned = true;
            if track.is_seen_whole() {
                track.views.learn(&region.looks, dt_s as f32);
            }
        }
        for (region, owner) in self.regions.iter_mut().zip(&association.part_of) {
            region.is_owned |= owner.is_some();
        }
    }

    /// Who was not seen, or went out of the picture.
    fn miss(&mut self, frame: Frame, dt_s: f64, rules: Rules) {
        for index in 0..self.tracks.len() {
            let track = &self.tracks[index];
            if track.is_gone() {
                continue;
            }
            let bounds = track.bounds();
            let missed =
                track.evidence == Evidence::Missed && track.journey.unseen_s > rules.detector_pause_s;
            // Who is wholly hidden by others in their region may have left it.
            let within = track.is_shared() && !track.is_measured();
            let hidden = within || (missed && self.is_hidden(index));
            let track = &mut self.tracks[index];
            if missed || within {
                track.miss(hidden, dt_s / rules.coast_s);
            }
            let inside = share_inside(bounds, frame.bounds());
            if inside.is_nan() || inside < LEFT {
                track.end();
            }
            if track.is_gone() && track.is_confirmed() {
                self.memory.remember(track);
                self.events.push((TrackChange::Gone, track.id, None));
            }
        }
    }

    /// Whether somebody nearer stands before a track that is not seen.
    fn is_hidden(&self, index: usize) -> bool {
        let bounds = self.tracks[index].bounds();
        self.tracks.iter().enumerate().any(|(other, track)| {
            other != index
                && track.is_measured()
                && track.bounds().br().y > bounds.br().y
                && share_inside(bounds, track.bounds()) > 0.5
        })
    }

    /// What belongs to nobody is somebody new.
    fn begin(&mut self, frame: Frame) {
        let unconfirmed = self.tracks.iter().filter(|track| !track.is_confirmed()).count();
        let room = MOST.saturating_sub(unconfirmed);
        let new = self.regions.iter_mut().enumerate().filter(|(_, region)| !region.is_owned);
        for (number, region) in new.take(room) {
            self.tracks.push(Track::new(number, region, frame));
            region.is_owned = true;
        }
    }

    /// Gives numbers to those who were seen often enough: their old ones to those who were here before.
    fn number(&mut self, rules: Rules) {
        for track in self.tracks.iter_mut().filter(|track| !track.is_confirmed() && !track.is_gone()) {
            if track.journey.pictures < rules.confirm_pictures {
                continue;
            }
            match self.memory.recall(track) {
                Some(id) => {
                    track.id = id;
                    self.events.push((TrackChange::Back, id, None));
                }
                None => {
                    self.last_id += 1;
                    track.id = self.last_id;
                    self.events.push((TrackChange::New, track.id, None));
                }
            }
        }
    }
}

/// Whether a region can be somebody at all.
fn is_sound(bounds: Rect2f, frame: Frame) -> bool {
    [bounds.x, bounds.y, bounds.width, bounds.height].iter().all(|side| side.is_finite())
        && bounds.width >= MIN_SIDE
        && bounds.height >= MIN_SIDE
        && bounds.area() <= MAX_SHARE * frame.bounds().area()
        && share_inside(bounds, frame.bounds()) > 0.5
}

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(super) use tests::{seen_as, seen_in};
