// SPDX-License-Identifier: MPL-2.0

//! What a camera sees and where it looks.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use gst::prelude::*;
use ptztrack_contract::lock::lock;
use ptztrack_contract::{BufferMeta, CameraEvent, Point, Track, TrackState, TracksMeta, View};
use serde::{Deserialize, Serialize};

use super::known::Known;

/// Somebody in the picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Person {
    /// The track's number.
    pub id: u64,
    /// Left, top, width and height of the box, parts of the picture.
    pub bounds: [f64; 4],
    /// Parts of the picture in a second, to the right and down.
    pub velocity: [f64; 2],
    /// In a region of their own.
    pub seen: bool,
    /// 0 to 1.
    pub confidence: f64,
    pub is_target: bool,
}

/// Where a camera looked, and what it sees from there, in degrees.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// So long ago.
    pub age: Duration,
    pub pan_deg: f64,
    pub tilt_deg: f64,
    pub horizontal_fov_deg: f64,
    pub vertical_fov_deg: f64,
}

/// What one picture showed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Sight {
    pub people: Vec<Person>,
    /// The last places of a camera that turns, as it told them, the oldest first.
    pub poses: Vec<Pose>,
    /// Where it should be by what it was told to do since.
    pub reckoned: Option<Pose>,
    /// How fast it should turn, degrees per second to the right and up.
    pub rate_deg_s: [f64; 2],
    /// It may turn.
    pub moving: bool,
}

/// So many places are remembered: those before and after any picture of the last seconds.
const POSES: usize = 4;

impl From<&Track> for Person {
    fn from(track: &Track) -> Self {
        Self {
            id: track.id,
            bounds: [track.bounds.x, track.bounds.y, track.bounds.width, track.bounds.height],
            velocity: [track.velocity.x, track.velocity.y],
            seen: track.state == TrackState::Seen,
            confidence: track.confidence,
            is_target: track.is_target,
        }
    }
}

impl Person {
    /// Boxes that come so near to the picture's edge may be cut off by it.
    const EDGE: f64 = 0.01;
    /// A click so far beside a box means it, too: the tracker's 12 pixels, of 640.
    const CLICK_REACH: f64 = 0.02;

    /// Where they are so many seconds later, if they go on as they do.
    pub fn ahead(&self, seconds: f64) -> Self {
        let ([x, y, width, height], [right, down]) = (self.bounds, self.velocity);
        Self { bounds: [x + right * seconds, y + down * seconds, width, height], ..self.clone() }
    }

    pub fn feet(&self) -> Point {
        let [x, y, width, height] = self.bounds;
        Point { x: x + width / 2.0, y: y + height }
    }

    pub fn centre(&self) -> Point {
        let [x, y, width, height] = self.bounds;
        Point { x: x + width / 2.0, y: y + height / 2.0 }
    }

    fn covers(&self, place: Point) -> bool {
        let [x, y, width, height] = self.bounds;
        let spans = |from: f64, length: f64, at: f64| {
            (from - Self::CLICK_REACH..=from + length + Self::CLICK_REACH).contains(&at)
        };
        spans(x, width, place.x) && spans(y, height, place.y)
    }

    pub fn head(&self) -> Point {
        let [x, y, width, _] = self.bounds;
        Point { x: x + width / 2.0, y }
    }

    /// Out of the picture in a second, if they go on as they do and the camera does not turn.
    pub fn is_leaving(&self) -> bool {
        let inside = 0.0..=1.0;
        let then = self.ahead(1.0).centre();
        !inside.contains(&then.x) || !inside.contains(&then.y)
    }

    /// Seen by themselves, and where they stand.
    pub fn stands_in_picture(&self) -> bool {
        let feet = self.feet();
        self.seen && feet.y < 1.0 - Self::EDGE && (0.0..=1.0).contains(&feet.x)
    }

    /// Seen by themselves, from head to feet.
    pub fn is_whole(&self) -> bool {
        let [x, y, width, height] = self.bounds;
        let inside = Self::EDGE..=1.0 - Self::EDGE;
        self.seen && [x, y, x + width, y + height].iter().all(|edge| inside.contains(edge))
    }
}

impl Pose {
    /// What the camera sees where.
    pub fn view(&self) -> Option<View> {
        let event = CameraEvent {
            pan_deg: Some(self.pan_deg),
            tilt_deg: Some(self.tilt_deg),
            horizontal_fov_deg: Some(self.horizontal_fov_deg),
            vertical_fov_deg: Some(self.vertical_fov_deg),
            ..CameraEvent::default()
        };
        event.view()
    }

    fn of(event: &CameraEvent) -> Option<Self> {
        Some(Self {
            age: Duration::ZERO,
            pan_deg: event.pan_deg?,
            tilt_deg: event.tilt_deg?,
            horizontal_fov_deg: event.horizontal_fov_deg?,
            vertical_fov_deg: event.vertical_fov_deg?,
        })
    }

    fn is_at(&self, other: &Self) -> bool {
        let place = |pose: &Self| (pose.pan_deg, pose.tilt_deg, pose.horizontal_fov_deg);
        place(self) == place(other)
    }
}

impl Sight {
    /// The target, where it is seen from head to feet.
    pub fn target(&self) -> Option<&Person> {
        self.people.iter().find(|person| person.is_target && person.is_whole())
    }

    /// Who is at a place of the picture: of several the smallest, as the tracker has it.
    pub fn person_at(&self, place: Point) -> Option<&Person> {
        let area = |person: &Person| person.bounds[2] * person.bounds[3];
        let there = self.people.iter().filter(|person| person.seen && person.covers(place));
        there.min_by(|one, other| area(one).total_cmp(&area(other)))
    }

    /// About where the camera looked so long ago: by its own word, or else by dead reckoning.
    pub fn pose_about(&self, age: Duration) -> Option<Pose> {
        self.pose_at(age).or_else(|| {
            let reckoned = self.reckoned.clone()?;
            let since = reckoned.age.as_secs_f64() - age.as_secs_f64();
            let [pan, tilt] = self.rate_deg_s;
            let (pan_deg, tilt_deg) = (reckoned.pan_deg + pan * since, reckoned.tilt_deg + tilt * since);
            Some(Pose { age, pan_deg, tilt_deg, ..reckoned })
        })
    }

    /// Where the camera looked so long ago; `None` where that is not known yet, or no more.
    pub fn pose_at(&self, age: Duration) -> Option<Pose> {
        let last = self.poses.last()?;
        if last.age >= age {
            return (!self.moving).then(|| Pose { age, ..last.clone() });
        }
        let (before, after) = self
            .poses
            .windows(2)
            .filter_map(<[Pose]>::split_first)
            .map(|(before, after)| (before, &after[0]))
            .find(|(before, after)| before.age >= age && after.age <= age)?;
        let span = (before.age - after.age).as_secs_f64();
        let part = if span > 0.0 { (before.age - age).as_secs_f64() / span } else { 1.0 };
        let between = |from: f64, to: f64| from + (to - from) * part;
        // Nothing turns by more than half a turn between two answers.
        let turn = (after.pan_deg - before.pan_deg + 540.0).rem_euclid(360.0) - 180.0;
        Some(Pose {
            age,
            pan_deg: before.pan_deg + turn * part,
            tilt_deg: between(before.tilt_deg, after.tilt_deg),
            horizontal_fov_deg: between(before.horizontal_fov_deg, after.horizontal_fov_deg),
            vertical_fov_deg: between(before.vertical_fov_deg, after.vertical_fov_deg),
        })
    }
}

/// What a camera told of where it looks.
#[derive(Debug, Default)]
struct Told {
    poses: Vec<(Instant, Pose)>,
    reckoned: Option<(Instant, Pose)>,
    rate_deg_s: [f64; 2],
    moving: bool,
}

impl Told {
    fn hear(&mut self, event: &CameraEvent) {
        let sets_out = event.moving && !std::mem::replace(&mut self.moving, event.moving);
        let Some(pose) = Pose::of(event) else { return };
        let is_new = self.poses.last().is_none_or(|(_, last)| !last.is_at(&pose));
        self.reckon(&pose, is_new);
        self.rate_deg_s = [event.pan_rate_deg_s, event.tilt_rate_deg_s];
        // It was there until now, or is there now; an event may tell of something else.
        if sets_out || is_new {
            self.poses.push((Instant::now(), pose));
            self.poses.drain(..self.poses.len().saturating_sub(POSES));
        }
    }

    /// From the last place on at the last rate, unless a new place is told.
    fn reckon(&mut self, told: &Pose, is_new: bool) {
        let now = Instant::now();
        let on = |(at, pose): &(Instant, Pose)| {
            let (seconds, [pan, tilt]) = ((now - *at).as_secs_f64(), self.rate_deg_s);
            let (pan_deg, tilt_deg) = (pose.pan_deg + pan * seconds, pose.tilt_deg + tilt * seconds);
            Pose { pan_deg, tilt_deg, ..told.clone() }
        };
        let pose = self.reckoned.as_ref().filter(|_| !is_new).map_or_else(|| told.clone(), on);
        self.reckoned = Some((now, pose));
    }
}

/// Has what passes the tracker known.
pub fn watch(tracker: &gst::Element, known: &Arc<Known>) {
    let Some(pad) = tracker.static_pad("src") else { return };
    let (known, told) = (known.clone(), Mutex::new(Told::default()));
    pad.add_probe(gst::PadProbeType::BUFFER | gst::PadProbeType::EVENT_UPSTREAM, move |_, info| {
        if let Some(Ok(event)) = info.event().and_then(|event| CameraEvent::of(event)) {
            lock(&told).hear(&event);
        }
        if let Some(Ok(tracks)) = info.buffer().and_then(|buffer| TracksMeta::of(buffer)) {
            let sight = sight(&tracks.tracks, &lock(&told));
            known.sight.send_replace(Arc::new((Instant::now(), sight)));
        }
        gst::PadProbeReturn::Ok
    });
}

fn sight(tracks: &[Track], told: &Told) -> Sight {
    let aged = |(at, pose): &(Instant, Pose)| Pose { age: at.elapsed(), ..pose.clone() };
    Sight {
        people: tracks.iter().map(Person::from).collect(),
        poses: told.poses.iter().map(aged).collect(),
        reckoned: told.reckoned.as_ref().map(aged),
        rate_deg_s: told.rate_deg_s,
        moving: told.moving,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(pan_deg: f64, moving: bool) -> CameraEvent {
        CameraEvent {
            moving,
            pan_deg: Some(pan_deg),
            tilt_deg: Some(0.0),
            horizontal_fov_deg: Some(60.0),
            vertical_fov_deg: Some(40.0),
            ..CameraEvent::default()
        }
    }

    fn pose(ms: u64, pan_deg: f64) -> Pose {
        Pose { age: Duration::from_millis(ms), ..Pose::of(&event(pan_deg, false)).unwrap() }
    }

    #[test]
    fn where_it_looked_lies_between_what_it_told() {
        let poses = vec![pose(1000, 178.0), pose(400, -176.0)];
        let sight = Sight { poses, moving: true, ..Sight::default() };
        let pan = |ms| sight.pose_at(Duration::from_millis(ms)).map(|pose| pose.pan_deg);
        assert_eq!(pan(700), Some(181.0));
        assert_eq!((pan(1200), pan(300)), (None, None));
        let resting = Sight { moving: false, ..sight.clone() };
        assert_eq!(resting.pose_at(Duration::from_millis(300)).unwrap().pan_deg, -176.0);
    }

    #[test]
    fn where_it_looks_is_reckoned_until_it_tells() {
        let (poses, reckoned) = (vec![pose(900, 10.0)], Some(pose(300, 16.0)));
        let sight = Sight { poses, reckoned, rate_deg_s: [10.0, 0.0], moving: true, ..Sight::default() };
        assert_eq!(sight.pose_about(Duration::from_millis(100)).unwrap().pan_deg, 18.0);
        let resting = Sight { moving: false, ..sight };
        assert_eq!(resting.pose_about(Duration::from_millis(100)).unwrap().pan_deg, 10.0);
    }

    #[test]
    fn what_is_told_twice_is_one_place_and_where_it_sets_out_from_another() {
        let mut told = Told::default();
        for (pan, moving) in [(1.0, false), (1.0, false), (1.0, true), (1.0, true), (5.0, true)] {
            told.hear(&event(pan, moving));
        }
        let pans: Vec<f64> = told.poses.iter().map(|(_, pose)| pose.pan_deg).collect();
        assert_eq!(pans, [1.0, 1.0, 5.0]);
        (0..100).for_each(|pan| told.hear(&event(f64::from(pan), true)));
        assert_eq!(told.poses.len(), POSES);
    }

    fn person(bounds: [f64; 4]) -> Person {
        Person { id: 1, bounds, velocity: [0.0; 2], seen: true, confidence: 1.0, is_target: false }
    }

    #[test]
    fn a_click_means_the_smallest_there() {
        let child = Person { id: 2, ..person([0.42, 0.5, 0.05, 0.2]) };
        let people = vec![person([0.4, 0.2, 0.1, 0.5]), child];
        let sight = Sight { people, ..Sight::default() };
        let at = |x, y| sight.person_at(Point { x, y }).map(|person| person.id);
        assert_eq!(
            [at(0.45, 0.3), at(0.45, 0.6), at(0.51, 0.3), at(0.6, 0.3)],
            [Some(1), Some(2), Some(1), None]
        );
    }

    #[test]
    fn who_is_cut_off_is_not_whole() {
        assert!(person([0.4, 0.2, 0.1, 0.5]).is_whole());
        assert!(!person([0.4, 0.2, 0.1, 0.8]).is_whole());
        assert!(!Person { seen: false, ..person([0.4, 0.2, 0.1, 0.5]) }.is_whole());
    }
}
