// SPDX-License-Identifier: MPL-2.0

//! Which detection becomes the target.

use std::collections::VecDeque;

use opencv::core::{Point2f, Rect2f};

use super::ego_motion::EgoMotion;
use super::geometry::{Frame, breadth, centre, grown, length, overlap, share_inside};
use super::suppressed_regions::SuppressedRegions;

/// Smaller regions, in pixels of either side, have no features; larger shares of the frame are no target.
const MIN_SIDE: f32 = 6.0;
const MAX_SHARE: f32 = 0.9;
/// Intersection over union from which a detection continues an earlier one.
const SAME: f32 = 0.2;
/// Frames that a detection may be missing, however often the detector looks.
const PATIENCE: u32 = 2;
/// A detection at the edge may be half a person: how long it may take to walk in, seconds.
const EDGE_WAIT_S: f64 = 1.2;
/// Pixels from the edge of the frame that count as touching it.
const EDGE: f32 = 2.0;
/// How long what was released is not taken again, seconds.
const RELEASE_HOLD_S: f64 = 3.0;
/// Seconds over which the way of a detection is looked at.
const WAY_S: f64 = 1.0;
/// Who goes somewhere has moved both sides of the box by this share of their breadth, or has come nearer by this share of
/// their height.
const TRAVELLED: f32 = 0.25;
const APPROACHED: f32 = 0.12;
/// What lies by more than this where much changed for nothing may be a part of that, as somebody in a film, however far it
/// goes: it has to leave.
const RESTLESS: f32 = 0.5;

/// How the target is chosen among the detections.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Choice {
    /// The one of largest area.
    #[default]
    Largest,
    /// The one that was there first.
    First,
    /// The one nearest to the middle of the frame.
    NearestCentre,
    /// None: an operator chooses.
    Manual,
}

/// Something that a detector saw, in pixels.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Sighting {
    pub bounds: Rect2f,
    /// Polygon around it; empty where only the box is known.
    pub contour: Vec<Point2f>,
    /// How much of it lies where much changed before and nothing came of it: 0 to 1.
    pub restless: f32,
    /// Whether it lies where nobody is to be chosen.
    pub outside: bool,
    /// Pixels per second; nothing where it was seen only once.
    pub velocity: Point2f,
    /// Whether it was seen beside the target, and so is somebody else.
    pub another: bool,
    /// How many others have merged with it and not split off again.
    pub merged: u32,
}

impl Sighting {
    /// Whether it shows several people.
    pub fn is_group(&self) -> bool {
        self.merged > 0
    }
}

struct Candidate {
    sighting: Sighting,
    frames: u32,
    missed: u32,
    missed_s: f64,
    age_s: f64,
    /// Frames in which it was seen beside the target.
    frames_beside: u32,
    /// Its boxes of the last second, carried along with the background, and how old they are in seconds.
    way: VecDeque<(Rect2f, f64)>,
}

impl Candidate {
    fn new(sighting: Sighting) -> Self {
        let way = VecDeque::from([(sighting.bounds, 0.0)]);
        Self { sighting, frames: 1, missed: 0, missed_s: 0.0, age_s: 0.0, frames_beside: 0, way }
    }

    /// Goes with the background into the next frame; where nobody knows how that moved, the way so far says nothing.
    fn carry(&mut self, ego: Option<EgoMotion>, dt_s: f64) {
        self.missed += 1;
        self.missed_s += dt_s;
        self.age_s += dt_s;
        match ego {
            Some(ego) => {
                self.sighting.bounds = ego.apply_to(self.sighting.bounds);
                self.way.iter_mut().for_each(|(bounds, age_s)| {
                    *bounds = ego.apply_to(*bounds);
                    *age_s += dt_s;
                });
                self.way.retain(|(_, age_s)| *age_s <= WAY_S);
            }
            None => self.way.clear(),
        }
    }

    /// Takes the next sighting; the edges of a detection flicker, so its velocity is smoothed.
    fn continue_with(&mut self, sighting: Sighting, dt_s: f64) {
        const SMOOTHING: f32 = 0.5;
        let time_s = (f64::from(self.missed) * dt_s) as f32;
        let velocity = motion(self.sighting.bounds, sighting.bounds) / time_s.max(f32::EPSILON);
        let old = self.sighting.velocity;
        let velocity = old + (velocity - old) * SMOOTHING;
        let Sighting { another, merged, .. } = self.sighting;
        self.sighting = Sighting { velocity, another, merged, ..sighting };
        self.frames += 1;
        (self.missed, self.missed_s) = (0, 0.0);
        self.way.push_back((self.sighting.bounds, 0.0));
    }

    /// Whether it went somewhere: a screen, a curtain, a door, a lamp change as much as a person does, but stay.
    fn travels(&self) -> bool {
        if self.sighting.restless > RESTLESS {
            return false;
        }
        let now = self.sighting.bounds;
        self.way.iter().any(|(then, _)| {
            let (left, right) = (now.x - then.x, now.br().x - then.br().x);
            let bottom = now.br().y - then.br().y;
            let moved = motion(*then, now);
            let least = TRAVELLED * breadth(now).min(breadth(*then));
            let nearer = (now.height / then.height.max(1.0) - 1.0).abs() >= APPROACHED
                && bottom * left < 0.0
                && bottom * right > 0.0;
            moved.x.abs() >= least || moved.y.abs() >= least || nearer
        })
    }
}

/// Follows detections until one is sure enough to become the target.
#[derive(Default)]
pub(super) struct TargetSelector {
    /// Who is not chosen until they move.
    pub suppressed: SuppressedRegions,
    /// The longest that a detector may take from one look to the next, seconds; 0 for one that sees every frame.
    pub detector_pause_s: f64,
    candidates: Vec<Candidate>,
    released: Option<(Rect2f, f64)>,
    /// Memory: boxes of candidates, before the last frame and of those that are gone in it.
    before: Vec<Rect2f>,
    gone: Vec<Rect2f>,
}

impl TargetSelector {
    /// Forgets everything: another stream begins.
    pub fn reset(&mut self) {
        self.candidates.clear();
        self.suppressed.clear();
    }

    /// The detection at `bounds` was taken: the others are forgotten.
    pub fn take(&mut self, bounds: Rect2f) {
        let seen = self.candidates.iter().filter(|candidate| candidate.missed == 0);
        self.suppressed.free(bounds, seen.map(|candidate| candidate.sighting.bounds));
        self.candidates.clear();
    }

    /// The target is seen at `bounds`: who is seen beside it, in `confirm_frames` frames or more, is somebody else, wherever they
    /// go from then on. What is above or below may be a part of it.
    pub fn tell_apart(&mut self, bounds: Rect2f, confirm_frames: u32) {
        for candidate in self.candidates.iter_mut().filter(|candidate| candidate.missed == 0) {
            let seen = candidate.sighting.bounds;
            if (bounds & seen).area() <= 0.0 && !may_be_one(bounds, seen) {
                candidate.frames_beside += 1;
                candidate.sighting.another = candidate.frames_beside >= confirm_frames;
            }
        }
    }

    /// What is at `bounds` was let go on purpose: it is not chosen again for a while.
    pub fn release(&mut self, bounds: Rect2f) {
        self.released = Some((bounds, RELEASE_HOLD_S));
    }

    /// Takes the detections of one frame, `dt_s` after the last; `ego` is how the background moved since, where that is
    /// known.
    pub fn update(
        &mut self,
        sightings: impl IntoIterator<Item = Sighting>,
        ego: Option<EgoMotion>,
        frame: Frame,
        dt_s: f64,
    ) {
        self.suppressed.carry(ego);
        self.candidates.iter_mut().for_each(|candidate| candidate.carry(ego, dt_s));
        self.before.clear();
        self.before.extend(self.candidates.iter().map(|candidate| candidate.sighting.bounds));
        for sighting in sightings.into_iter().filter(|sighting| is_sound(sighting, frame)) {
            let same = self
                .candidates
                .iter_mut()
                .filter(|candidate| candidate.missed > 0)
                .map(|candidate| (overlap(candidate.sighting.bounds, sighting.bounds), candidate))
                .filter(|(share, _)| *share >= SAME)
                .max_by(|(a, _), (b, _)| a.total_cmp(b));
            match same {
                Some((_, candidate)) => candidate.continue_with(sighting, dt_s),
                None => self.candidates.push(Candidate::new(sighting)),
            }
        }
        self.merge_and_split();
        self.candidates
            .retain(|candidate| candidate.missed <= PATIENCE || candidate.missed_s <= self.detector_pause_s);
        self.follow_released(dt_s);
    }

    /// Who is no longer seen where another is has merged with them; who is new where another was before has split off.
    fn merge_and_split(&mut self) {
        let (old, new) = self.candidates.split_at_mut(self.before.len());
        let gone = old.iter().filter(|candidate| candidate.missed == 1 && candidate.frames > 1);
        self.gone.clear();
        self.gone.extend(gone.map(|candidate| candidate.sighting.bounds));
        for (candidate, before) in
            old.iter_mut().zip(&self.before).filter(|(candidate, _)| candidate.missed == 0)
        {
            let now = candidate.sighting.bounds;
            let others = self.gone.iter().filter(|gone| !may_be_one(**gone, *before));
            let merged = others.filter(|gone| lies_in(**gone, now)).count();
            let split = new.iter().filter(|new| lies_in(new.sighting.bounds, *before)).count();
            candidate.sighting.merged =
                (candidate.sighting.merged + merged as u32).saturating_sub(split as u32);
        }
    }

    /// The released target moves on, and so does the place that is held back.
    fn follow_released(&mut self, dt_s: f64) {
        self.released = self.released.filter(|(_, left)| *left > dt_s).map(|(bounds, left)| {
            let same = self.candidates.iter().filter(|candidate| candidate.missed == 0);
            let bounds = same
                .map(|candidate| candidate.sighting.bounds)
                .find(|seen| overlap(*seen, bounds) > 0.0)
                .unwrap_or(bounds);
            (bounds, left - dt_s)
        });
    }

    /// The detection to follow now, seen in at least `confirm_frames` frames and in this one, and going somewhere where
    /// it `must_travel`.
    pub fn choose(
        &self,
        choice: Choice,
        confirm_frames: u32,
        must_travel: bool,
        frame: Frame,
    ) -> Option<&Sighting> {
        let ready = self.confirmed(confirm_frames).filter(|candidate| {
            let bounds = candidate.sighting.bounds;
            !candidate.sighting.outside
                && (candidate.age_s >= EDGE_WAIT_S || !self.is_entering(bounds, frame))
                && self.released.is_none_or(|(released, _)| overlap(released, bounds) == 0.0)
                && !self.suppressed.holds(bounds)
                && (!must_travel || candidate.travels())
        });
        let by = |value: fn(&Candidate, Frame) -> f64| {
            let best = move |candidate: &&Candidate| value(candidate, frame);
            ready.max_by(|a, b| best(a).total_cmp(&best(b)))
        };
        let chosen = match choice {
            Choice::Largest => by(|candidate, _| f64::from(candidate.sighting.bounds.area())),
            Choice::First => by(|candidate, _| candidate.age_s),
            Choice::NearestCentre => by(|candidate, frame| {
                -f64::from(length(centre(candidate.sighting.bounds) - centre(frame.bounds())))
            }),
            Choice::Manual => None,
        };
        chosen.map(|candidate| &candidate.sighting)
    }

    /// Whether somebody is still coming into view, or leaving: a leg goes before the body.
    fn is_entering(&self, bounds: Rect2f, frame: Frame) -> bool {
        let body = self.current().filter(|sighting| may_be_one(bounds, sighting.bounds));
        body.map(|part| part.bounds).any(|part| touches_edge(part, frame))
    }

    /// The detections of this frame that go somewhere, wholly in view, and may be the target: the largest first.
    pub fn travelling(&self, confirm_frames: u32, frame: Frame) -> Vec<&Sighting> {
        let ready = self.confirmed(confirm_frames).filter(|candidate| {
            !candidate.sighting.another
                && !touches_edge(candidate.sighting.bounds, frame)
                && candidate.travels()
        });
        let mut ready: Vec<_> = ready.map(|candidate| &candidate.sighting).collect();
        ready.sort_by(|a, b| b.bounds.area().total_cmp(&a.bounds.area()));
        ready
    }

    /// The detections of this frame.
    pub fn current(&self) -> impl Iterator<Item = &Sighting> {
        self.confirmed(0).map(|candidate| &candidate.sighting)
    }

    /// Those seen in this frame, and in so many in all.
    fn confirmed(&self, frames: u32) -> impl Iterator<Item = &Candidate> {
        self.candidates.iter().filter(move |candidate| candidate.missed == 0 && candidate.frames >= frames)
    }

    /// The smallest detection of this frame that a click at `point` means, a little beside it too.
    pub fn at(&self, point: Point2f) -> Option<&Sighting> {
        const REACH: f32 = 12.0;
        self.current()
            .filter(|sighting| grown(sighting.bounds, REACH).contains(point))
            .min_by(|a, b| a.bounds.area().total_cmp(&b.bounds.area()))
    }
}

/// Whether most of `part` lies in `whole`.
fn lies_in(part: Rect2f, whole: Rect2f) -> bool {
    share_inside(part, whole) > 0.5
}

/// How far both sides of a box have moved: one that moves alone shows or hides a part of what is in it.
fn motion(then: Rect2f, now: Rect2f) -> Point2f {
    let both = |a: f32, b: f32| if a * b > 0.0 { a.abs().min(b.abs()).copysign(a) } else { 0.0 };
    let (from, to) = (now.tl() - then.tl(), now.br() - then.br());
    Point2f::new(both(from.x, to.x), both(from.y, to.y))
}

/// Whether a region can be a target at all.
fn is_sound(sighting: &Sighting, frame: Frame) -> bool {
    let bounds = sighting.bounds;
    let sides = [bounds.x, bounds.y, bounds.width, bounds.height];
    sides.iter().all(|side| side.is_finite())
        && bounds.width >= MIN_SIDE
        && bounds.height >= MIN_SIDE
        && bounds.area() <= MAX_SHARE * frame.bounds().area()
        && share_inside(bounds, frame.bounds()) > 0.5
}

/// Whether two boxes stand one above the other, so near that they may be parts of one body: where clothes look like the wall
/// behind them, legs and trunk are seen apart.
fn may_be_one(a: Rect2f, b: Rect2f) -> bool {
    let across = a.br().x.min(b.br().x) - a.x.max(b.x);
    let between = a.y.max(b.y) - a.br().y.min(b.br().y);
    across > 0.5 * a.width.min(b.width) && between < a.height.max(b.height)
}

fn touches_edge(bounds: Rect2f, frame: Frame) -> bool {
    bounds.x < EDGE
        || bounds.y < EDGE
        || bounds.br().x > frame.width - EDGE
        || bounds.br().y > frame.height - EDGE
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Frame = Frame { width: 640.0, height: 480.0 };
    const DT: f64 = 0.1;
    const STILL: Option<EgoMotion> = None;

    fn at(x: f32, y: f32, width: f32, height: f32) -> Sighting {
        Sighting { bounds: Rect2f::new(x, y, width, height), ..Sighting::default() }
    }

    fn seen(frames: usize, sightings: &[Sighting]) -> TargetSelector {
        let mut selection = TargetSelector::default();
        for _ in 0..frames {
            selection.update(sightings.to_vec(), STILL, FRAME, DT);
        }
        selection
    }

    #[test]
    fn choices() {
        let mut selection = seen(2, &[at(300.0, 200.0, 20.0, 50.0)]);
        for _ in 0..3 {
            let all =
                [at(300.0, 200.0, 20.0, 50.0), at(30.0, 30.0, 60.0, 120.0), at(400.0, 220.0, 30.0, 60.0)];
            selection.update(all.to_vec(), STILL, FRAME, DT);
        }
        let x = |choice| selection.choose(choice, 3, false, FRAME).map(|sighting| sighting.bounds.x);
        assert_eq!(x(Choice::Largest), Some(30.0));
        assert_eq!(x(Choice::First), Some(300.0));
        assert_eq!(x(Choice::NearestCentre), Some(300.0));
        assert_eq!(x(Choice::Manual), None);
    }

    #[test]
    fn outside_of_the_zones_nobody_is_chosen_but_seen() {
        let outside = Sighting { outside: true, ..at(100.0, 100.0, 40.0, 90.0) };
        let mut selection = seen(5, &[outside]);
        assert!(selection.choose(Choice::Largest, 3, false, FRAME).is_none());
        assert_eq!(selection.current().count(), 1);
        selection.update(vec![at(104.0, 100.0, 40.0, 90.0)], STILL, FRAME, DT);
        assert!(selection.choose(Choice::Largest, 3, false, FRAME).is_some(), "who comes in");
    }

    #[test]
    fn a_flicker_is_not_chosen() {
        assert!(seen(2, &[at(100.0, 100.0, 40.0, 90.0)]).choose(Choice::Largest, 3, false, FRAME).is_none());
        let mut selection = TargetSelector::default();
        for n in 0..9 {
            selection.update(vec![at(50.0 * n as f32, 100.0, 20.0, 30.0)], STILL, FRAME, DT);
        }
        assert!(selection.choose(Choice::Largest, 3, false, FRAME).is_none());
    }

    /// A neural network may look at every fourth frame, or less.
    #[test]
    fn a_detector_need_not_see_every_frame() {
        let confirmed = |detector_pause_s: f64| {
            let mut selection = TargetSelector { detector_pause_s, ..Default::default() };
            (0..12).any(|n| {
                let seen = (n % 4 == 0).then(|| at(100.0 + 2.0 * n as f32, 100.0, 40.0, 90.0));
                selection.update(seen, STILL, FRAME, DT);
                selection.choose(Choice::Largest, 3, false, FRAME).is_some()
            })
        };
        assert!(confirmed(1.0));
        assert!(!confirmed(0.0), "what flickers is not confirmed by one that sees every frame");
    }

    #[test]
    fn half_a_person_at_the_edge_is_awaited_but_not_for_ever() {
        let edge = [at(0.0, 100.0, 30.0, 90.0)];
        assert!(seen(5, &edge).choose(Choice::Largest, 3, false, FRAME).is_none());
        assert!(seen(16, &edge).choose(Choice::Largest, 3, false, FRAME).is_some());
    }

    #[test]
    fn the_velocity_of_a_detection_is_known() {
        let mut selection = TargetSelector::default();
        for n in 0..8 {
            selection.update(vec![at(100.0 + 6.0 * n as f32, 100.0, 30.0, 60.0)], STILL, FRAME, DT);
        }
        let velocity = selection.choose(Choice::Largest, 3, false, FRAME).expect("confirmed").velocity;
        assert!((velocity.x - 60.0).abs() < 1.0 && velocity.y.abs() < 1e-3, "{velocity:?}");
    }

    #[test]
    fn what_comes_into_view_or_goes_behind_something_does_not_move_by_that() {
        let mut selection = TargetSelector::default();
        for n in 0..8 {
            selection.update(vec![at(100.0, 100.0, 60.0 - 4.0 * n as f32, 90.0)], STILL, FRAME, DT);
        }
        let velocity = selection.choose(Choice::Largest, 3, false, FRAME).expect("confirmed").velocity;
        assert_eq!(velocity, Point2f::default());
    }

    /// Whether what looks like `path` at each frame is chosen within two seconds, where it must travel.
    fn chosen(ego: EgoMotion, path: impl Fn(f32) -> Sighting) -> bool {
        let mut selection = TargetSelector::default();
        (0..20).any(|n| {
            selection.update(vec![path(n as f32)], Some(ego), FRAME, DT);
            selection.choose(Choice::Largest, 3, true, FRAME).is_some()
        })
    }

    #[test]
    fn a_walker_travels_whatever_the_camera_does() {
        for pan in [0.0, -4.0, 7.0] {
            let ego = EgoMotion::translation(Point2f::new(pan, 0.0));
            assert!(chosen(ego, |n| at(300.0 + (4.0 + pan) * n, 100.0, 40.0, 90.0)), "{pan}");
        }
        assert!(
            chosen(EgoMotion::default(), |n| at(300.0 - 0.5 * n, 100.0, 40.0 + n, 90.0 + 2.0 * n)),
            "nearer"
        );
    }

    #[test]
    fn what_changes_but_stays_does_not_travel() {
        let still = EgoMotion::default();
        assert!(!chosen(still, |_| at(300.0, 100.0, 60.0, 40.0)), "a screen");
        assert!(!chosen(still, |n| at(300.0, 100.0, 40.0 + 4.0 * n, 200.0)), "a door");
        assert!(!chosen(still, |n| at(300.0 + 5.0 * (n % 2.0), 100.0, 60.0, 200.0)), "a curtain");
        let pan = EgoMotion::translation(Point2f::new(6.0, 0.0));
        assert!(!chosen(pan, |n| at(200.0 + 6.0 * n, 100.0, 60.0, 40.0)), "a screen, the camera turning");
    }

    /// Somebody in a film goes from one side of the screen to the other.
    #[test]
    fn who_is_where_much_changed_for_nothing_must_come_out_of_there() {
        let come = |restless: fn(f32) -> f32| {
            let path = |n: f32| Sighting { restless: restless(n), ..at(200.0 + 10.0 * n, 100.0, 30.0, 40.0) };
            chosen(EgoMotion::default(), path)
        };
        assert!(come(|_| 0.0) && !come(|_| 0.8));
        assert!(come(|n| if n < 10.0 { 0.8 } else { 0.4 }), "who comes out of there");
    }

    #[test]
    fn absurd_regions_are_ignored() {
        let absurd = [
            at(10.0, 10.0, 0.0, 0.0),
            at(0.0, 0.0, 640.0, 480.0),
            at(f32::NAN, 10.0, 30.0, 60.0),
            at(-900.0, 10.0, 30.0, 60.0),
            at(10.0, 10.0, f32::INFINITY, 60.0),
            at(10.0, 10.0, -30.0, -60.0),
        ];
        assert!(seen(20, &absurd).choose(Choice::Largest, 1, false, FRAME).is_none());
    }

    #[test]
    fn what_was_released_is_held_back() {
        let one = [at(300.0, 200.0, 30.0, 60.0)];
        let mut selection = seen(4, &one);
        selection.release(one[0].bounds);
        selection.update(one.to_vec(), STILL, FRAME, DT);
        assert!(selection.choose(Choice::Largest, 3, false, FRAME).is_none());
        for _ in 0..40 {
            selection.update(one.to_vec(), STILL, FRAME, DT);
        }
        assert!(selection.choose(Choice::Largest, 3, false, FRAME).is_some());
    }

    #[test]
    fn a_click_means_the_smallest_region_there() {
        let selection = seen(1, &[at(200.0, 100.0, 200.0, 300.0), at(290.0, 200.0, 30.0, 60.0)]);
        let x = |x, y| selection.at(Point2f::new(x, y)).map(|sighting| sighting.bounds.x);
        assert_eq!(x(300.0, 220.0), Some(290.0));
        assert_eq!(x(220.0, 120.0), Some(200.0));
        assert_eq!(x(600.0, 20.0), None);
    }

    #[test]
    fn who_was_seen_beside_the_target_stays_somebody_else() {
        let target = at(300.0, 100.0, 40.0, 90.0);
        let mut selection = TargetSelector::default();
        let mut walk = |frames: std::ops::Range<usize>| {
            for n in frames {
                let other = at(100.0 + 10.0 * n as f32, 100.0, 40.0, 90.0);
                selection.update(vec![target.clone(), other], STILL, FRAME, DT);
                selection.tell_apart(target.bounds, 3);
            }
            selection.current().map(|sighting| sighting.another).collect::<Vec<_>>()
        };
        assert_eq!(walk(0..2), [false, false], "not yet confirmed");
        assert_eq!(walk(2..4), [false, true]);
        assert_eq!(walk(4..18), [false, true], "nor when they pass in front of it");
    }

    #[test]
    fn people_merge_and_split() {
        let (left, right) = (at(100.0, 100.0, 40.0, 90.0), at(150.0, 100.0, 40.0, 90.0));
        let both = at(100.0, 100.0, 90.0, 90.0);
        let mut selection = seen(3, &[left.clone(), right.clone()]);
        let mut groups = |sightings: &[Sighting]| {
            selection.update(sightings.to_vec(), STILL, FRAME, DT);
            selection.current().map(Sighting::is_group).collect::<Vec<_>>()
        };
        assert_eq!(groups(&[left.clone(), right.clone()]), [false, false]);
        assert_eq!(groups(std::slice::from_ref(&both)), [true]);
        for _ in 0..5 {
            assert_eq!(groups(std::slice::from_ref(&both)), [true], "for as long as they are together");
        }
        assert_eq!(groups(&[left.clone(), right]), [false, false]);
        assert_eq!(groups(std::slice::from_ref(&left)), [false], "who goes away merges with nobody");
    }

    #[test]
    fn somebody_else_does_not_travel_as_the_target_might() {
        let path = |n: usize| at(100.0 + 20.0 * n as f32, 100.0, 40.0, 90.0);
        let travelling = |beside: bool| {
            let mut selection = TargetSelector::default();
            for n in 0..6 {
                selection.update(vec![path(n)], Some(EgoMotion::default()), FRAME, DT);
                if beside {
                    selection.tell_apart(at(500.0, 100.0, 40.0, 90.0).bounds, 3);
                }
            }
            selection.travelling(3, FRAME).len()
        };
        assert_eq!((travelling(false), travelling(true)), (1, 0));
    }

    #[test]
    fn a_leg_goes_before_the_body() {
        let (leg, body, bystander) =
            (at(20.0, 300.0, 30.0, 100.0), at(0.0, 120.0, 45.0, 160.0), at(0.0, 120.0, 15.0, 280.0));
        let chosen = |sightings: &[Sighting]| {
            let selection = seen(5, sightings);
            selection.choose(Choice::Largest, 3, false, FRAME).map(|sighting| sighting.bounds)
        };
        assert_eq!(chosen(std::slice::from_ref(&leg)), Some(leg.bounds), "of a dog, say");
        assert_eq!(chosen(&[leg.clone(), body.clone()]), None);
        assert_eq!(chosen(&[leg.clone(), bystander]), Some(leg.bounds), "beside it");
        let inside = at(6.0, 120.0, 45.0, 160.0);
        assert_eq!(chosen(&[leg, inside.clone()]), Some(inside.bounds), "all of the body");
    }

    #[test]
    fn parts_of_one_body_are_no_others_and_no_group() {
        let (trunk, legs, whole) =
            (at(100.0, 100.0, 40.0, 80.0), at(105.0, 190.0, 30.0, 60.0), at(100.0, 100.0, 40.0, 150.0));
        let mut selection = seen(1, &[trunk.clone(), legs.clone()]);
        for _ in 0..5 {
            selection.update(vec![trunk.clone(), legs.clone()], STILL, FRAME, DT);
            selection.tell_apart(trunk.bounds, 3);
        }
        assert!(selection.current().all(|sighting| !sighting.another));
        selection.update(vec![whole], STILL, FRAME, DT);
        assert!(selection.current().all(|sighting| !sighting.is_group()));
    }
}
