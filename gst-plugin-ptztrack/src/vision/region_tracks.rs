// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use ptztrack_contract::{CameraMotion, Homography, Point, Rect, Region, RegionTrack, Vector};

/// A region that is not seen for longer is another one when it comes again.
const MAX_MISSED: Duration = Duration::from_millis(500);
/// Time constant of a region's place and velocity: regions grow and fall apart from picture to picture.
const SMOOTHING: Duration = Duration::from_millis(200);
/// What has been seen for so long ...
const TRIAL: Duration = Duration::from_millis(500);
/// ... and has come less far than this part of its own size, goes nowhere.
const MIN_TRAVEL: f64 = 0.4;
/// Time constants of how restless a place is believed to be: while something changes there, and after.
const RISE: Duration = Duration::from_millis(400);
const DECAY: Duration = Duration::from_secs(120);
/// Most places that are remembered.
const MAX_PLACES: usize = 64;

/// One region through the pictures.
#[derive(Debug)]
struct Track {
    bounds: Rect,
    /// Smoothed middle of the region, and where that was at first; both lie on the background.
    place: Point,
    origin: Point,
    velocity: Vector,
    id: u64,
    age: Duration,
    missed: Duration,
}

/// A place of the background where something changed for long and nothing came of it.
#[derive(Debug)]
struct RestlessPlace {
    bounds: Rect,
    /// 0 to 1.
    belief: f64,
}

/// Follows regions from picture to picture against the background, and remembers where they go nowhere: a
/// screen, a curtain or a lamp changes much and stays in its place, people's looks travel.
#[derive(Debug, Default)]
pub struct RegionTracks {
    tracks: Vec<Track>,
    /// Memory for those of the next picture.
    before: Vec<Track>,
    places: Vec<RestlessPlace>,
    last_id: u64,
}

impl RegionTracks {
    /// Forgets regions and places; numbers go on.
    pub fn restart(&mut self) {
        self.tracks.clear();
        self.places.clear();
    }

    /// Says of each of `regions`, seen `elapsed` after those of the picture before, what it did since it was first
    /// seen. Where `motion` is not known, the camera is taken to rest.
    pub fn update(&mut self, regions: &mut [Region], motion: Option<&CameraMotion>, elapsed: Duration) {
        self.carry(motion.map_or(Homography::IDENTITY, |motion| motion.homography), elapsed);
        std::mem::swap(&mut self.tracks, &mut self.before);
        // The oldest choose first: what breaks off is new.
        self.before.sort_by_key(|track| std::cmp::Reverse(track.age));
        regions.iter_mut().for_each(|region| region.track = None);
        for mut track in self.before.drain(..) {
            let free = regions.iter_mut().filter(|region| region.track.is_none());
            let overlaps = free.map(|region| (overlap(&track.bounds, &region.bounds), region));
            match overlaps.filter(|(area, _)| *area > 0.0).max_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((_, region)) => {
                    track.see(region, elapsed);
                    region.track = Some(track.told(0.0));
                    self.tracks.push(track);
                }
                None if track.missed < MAX_MISSED => self.tracks.push(track),
                None => {}
            }
        }
        for region in regions.iter_mut().filter(|region| region.track.is_none()) {
            self.last_id += 1;
            let track = Track::new(region, self.last_id);
            region.track = Some(track.told(0.0));
            self.tracks.push(track);
        }
        self.remember(elapsed);
        for region in regions {
            let restless = self.restless(&region.bounds);
            region.track = region.track.map(|track| RegionTrack { restless, ..track });
        }
    }

    /// Moves everything along with the background, and regions with their own velocity.
    fn carry(&mut self, motion: Homography, elapsed: Duration) {
        for track in &mut self.tracks {
            track.origin = motion.apply(track.origin);
            track.place = motion.apply(track.place);
            let (x, y) = (track.velocity.x * elapsed.as_secs_f64(), track.velocity.y * elapsed.as_secs_f64());
            track.bounds = carried(&track.bounds, &motion);
            track.bounds = Rect { x: track.bounds.x + x, y: track.bounds.y + y, ..track.bounds };
            track.missed = track.missed.saturating_add(elapsed);
        }
        for place in &mut self.places {
            place.bounds = carried(&place.bounds, &motion);
        }
    }

    /// Takes note of places where something stays and changes; the others are slowly forgotten.
    fn remember(&mut self, elapsed: Duration) {
        for place in &mut self.places {
            place.belief *= (-elapsed.as_secs_f64() / DECAY.as_secs_f64()).exp();
        }
        self.places.retain(|place| place.belief > 0.01);
        let rise = 1.0 - (-elapsed.as_secs_f64() / RISE.as_secs_f64()).exp();
        for track in self.tracks.iter().filter(|track| track.missed.is_zero() && track.goes_nowhere()) {
            let known = self.places.iter_mut().max_by(|a, b| {
                overlap(&a.bounds, &track.bounds).total_cmp(&overlap(&b.bounds, &track.bounds))
            });
            match known.filter(|place| covered(&track.bounds, &place.bounds) > 0.5) {
                Some(place) => place.belief += rise * (1.0 - place.belief),
                None => self.places.push(RestlessPlace { bounds: track.bounds, belief: rise }),
            }
        }
        let surplus = self.places.len().saturating_sub(MAX_PLACES);
        self.places.drain(..surplus);
    }

    /// How restless the place of `bounds` is, 0 to 1.
    fn restless(&self, bounds: &Rect) -> f64 {
        let places = self.places.iter().map(|place| place.belief * covered(bounds, &place.bounds));
        places.fold(0.0, f64::max).min(1.0)
    }
}

impl Track {
    fn new(region: &Region, id: u64) -> Self {
        let place = region.bounds.centre();
        Self {
            bounds: region.bounds,
            place,
            origin: place,
            velocity: Vector::default(),
            id,
            age: Duration::ZERO,
            missed: Duration::ZERO,
        }
    }

    fn see(&mut self, region: &Region, elapsed: Duration) {
        let seconds = elapsed.max(Duration::from_millis(1)).as_secs_f64();
        let weight = 1.0 - (-seconds / SMOOTHING.as_secs_f64()).exp();
        let to = region.bounds.centre();
        let ahead = Point {
            x: self.place.x + self.velocity.x * seconds,
            y: self.place.y + self.velocity.y * seconds,
        };
        let off = Vector { x: to.x - ahead.x, y: to.y - ahead.y };
        self.place = Point { x: ahead.x + weight * off.x, y: ahead.y + weight * off.y };
        // As an alpha-beta filter that does not swing: beta = alpha²/(2 − alpha).
        let gain = weight * weight / (2.0 - weight) / seconds;
        self.velocity = Vector { x: self.velocity.x + gain * off.x, y: self.velocity.y + gain * off.y };
        self.bounds = region.bounds;
        self.age = self.age.saturating_add(elapsed);
        self.missed = Duration::ZERO;
    }

    fn travelled(&self) -> Vector {
        Vector { x: self.place.x - self.origin.x, y: self.place.y - self.origin.y }
    }

    fn goes_nowhere(&self) -> bool {
        let travelled = self.travelled();
        self.age >= TRIAL
            && travelled.x.abs() < MIN_TRAVEL * self.bounds.width
            && travelled.y.abs() < MIN_TRAVEL * self.bounds.height
    }

    fn told(&self, restless: f64) -> RegionTrack {
        RegionTrack {
            id: self.id,
            age: gst::ClockTime::try_from(self.age).unwrap_or(gst::ClockTime::MAX),
            velocity: self.velocity,
            travelled: self.travelled(),
            restless,
        }
    }
}

fn carried(bounds: &Rect, motion: &Homography) -> Rect {
    let first = motion.apply(Point { x: bounds.x, y: bounds.y });
    let last = motion.apply(Point { x: bounds.x + bounds.width, y: bounds.y + bounds.height });
    Rect { x: first.x, y: first.y, width: last.x - first.x, height: last.y - first.y }
}

/// Area that two boxes share.
fn overlap(a: &Rect, b: &Rect) -> f64 {
    let width = (a.x + a.width).min(b.x + b.width) - a.x.max(b.x);
    let height = (a.y + a.height).min(b.y + b.height) - a.y.max(b.y);
    width.max(0.0) * height.max(0.0)
}

/// Which part of `a` lies in `b`.
fn covered(a: &Rect, b: &Rect) -> f64 {
    overlap(a, b) / (a.width * a.height).max(1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: Duration = Duration::from_millis(40);

    fn at(x: f64) -> Region {
        Region { bounds: Rect { x, y: 0.3, width: 0.08, height: 0.4 }, ..Region::default() }
    }

    fn told(tracks: &mut RegionTracks, x: f64, motion: Option<&CameraMotion>) -> RegionTrack {
        let mut regions = [at(x)];
        tracks.update(&mut regions, motion, STEP);
        regions[0].track.expect("told")
    }

    #[test]
    fn a_walker_travels_under_one_number() {
        let mut tracks = RegionTracks::default();
        let last = (0..25).map(|n| told(&mut tracks, 0.1 + 0.01 * f64::from(n), None)).last().expect("some");
        assert_eq!((last.id, last.restless), (1, 0.0));
        assert!((last.velocity.x - 0.25).abs() < 0.03, "{last:?}");
        assert!((last.travelled.x - 0.24).abs() < 0.03 && last.travelled.y.abs() < 1e-9, "{last:?}");
    }

    #[test]
    fn the_cameras_own_motion_is_no_travel() {
        let pan = CameraMotion { homography: Homography::translation(-0.01, 0.0), ..CameraMotion::default() };
        let mut tracks = RegionTracks::default();
        let stands = (0..25).map(|n| told(&mut tracks, 0.6 - 0.01 * f64::from(n), Some(&pan))).last();
        assert!(stands.expect("some").travelled.x.abs() < 1e-6);
        let mut tracks = RegionTracks::default();
        let walks = (0..25).map(|_| told(&mut tracks, 0.5, Some(&pan))).last();
        assert!((walks.expect("some").travelled.x - 0.24).abs() < 0.03);
    }

    #[test]
    fn what_changes_in_its_place_is_remembered_as_restless() {
        let mut tracks = RegionTracks::default();
        let screen = (0..100).map(|n| told(&mut tracks, 0.5 + 0.01 * f64::from(n % 2), None)).last();
        assert!(screen.expect("some").restless > 0.7);
        for _ in 0..50 {
            tracks.update(&mut [], None, STEP);
        }
        let again = told(&mut tracks, 0.5, None);
        assert!(again.id == 2 && again.restless > 0.7, "{again:?}");
        assert_eq!(told(&mut tracks, 0.1, None).restless, 0.0);
    }

    #[test]
    fn who_breaks_off_is_new() {
        let mut tracks = RegionTracks::default();
        for _ in 0..5 {
            told(&mut tracks, 0.3, None);
        }
        let mut both = [at(0.36), at(0.30)];
        tracks.update(&mut both, None, STEP);
        let ids = both.map(|region| region.track.expect("told").id);
        assert_eq!(ids, [2, 1]);
    }
}
