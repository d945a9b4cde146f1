// SPDX-License-Identifier: MPL-2.0

//! Somebody who is seen: where they are, how they go, what they look like, and whether they are there at all.

use std::collections::VecDeque;

use opencv::core::{Point2f, Rect2f};

use super::axis::{Axis, ProcessNoise, Side};
use super::looks::Views;
use super::region::Region;
use crate::vision::tracker::ego_motion::EgoMotion;
use crate::vision::tracker::geometry::{Frame, breadth, centre, length};

/// Deviation of a side that was seen, in heights of the track: arms and legs swing, heads hardly.
const ACROSS_NOISE: f32 = 0.08;
pub(super) const DOWN_NOISE: f32 = 0.05;
/// And of any side, pixels: what is found is found in a reduced picture.
const PIXEL_NOISE: f32 = 1.5;
/// What somebody does by themselves, in heights: their acceleration as spectral density, heights² per second³, and the change of
/// their size as spectral density, heights² per second.
const ACCELERATION: f32 = 0.5;
const GROWTH: f32 = 0.004;
/// Deviations of what is seen first, in heights: of their rate per second, and of their size, or where that was cut off.
pub(super) const FIRST_RATE: f32 = 0.8;
pub(super) const FIRST_SIZE: f32 = 0.2;
const CUT_SIZE: f32 = 0.6;
/// Logarithm of the odds that a track exists: at first, and at most; and what being seen adds in a second.
const FIRST_EXISTENCE: f32 = 0.4;
const MOST_EXISTENCE: f32 = 3.0;
const SEEN_PER_S: f32 = 6.0;
/// What it adds that all of it stands out from the background, for as long as it takes to be gone where it does not.
const STANDS_OUT: f32 = 12.0;
/// Deviation of where somebody is by their looks, in heights.
const LOOKS_NOISE: f32 = 0.08;
/// How much of the height must be seen for looks to be learned.
const WHOLE: f32 = 0.7;
/// Who was seen beside the target for so long, seconds, is somebody else.
const TOLD_APART_S: f64 = 0.1;
/// Somebody hidden by others is missed less.
const HIDDEN_SHARE: f32 = 0.4;
/// What has been seen for so long, seconds, and has come less far than this part of its own size, goes nowhere.
const TRIAL_S: f64 = 0.5;
const NOWHERE: f32 = 0.4;
/// Seconds over which the way of a track is looked at.
const WAY_S: f64 = 1.0;
/// Who goes somewhere has moved both sides of the box by this share of their breadth, or has come nearer by this share of
/// their height.
const TRAVELLED: f32 = 0.25;
const APPROACHED: f32 = 0.12;

/// What was seen of a track in one picture: numbers of regions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) enum Evidence {
    /// A region of its own.
    Alone(usize),
    /// A region that it shares with others, and whether any side of it is the track's.
    Shared(usize, bool),
    /// Nothing.
    Missed,
}

/// For how long, and which way, a track has been seen.
#[derive(Debug, Clone)]
pub(in super::super) struct Journey {
    pub age_s: f64,
    /// Since it was last seen, alone or not.
    pub unseen_s: f64,
    /// Since it was last seen alone.
    pub not_alone_s: f64,
    /// How long it was seen alone, and in one region with others.
    pub alone_s: f64,
    pub shared_s: f64,
    /// Pictures in which it was seen alone.
    pub pictures: u32,
    /// For how long what is seen of it has had another size, seconds.
    pub(super) unlike_s: f64,
    /// And, of that, has stood on the floor as others do.
    pub(super) stands_s: f64,
    /// Where its middle was first, carried along with the background.
    origin: Point2f,
    /// The farthest from there that it was seen alone, pixels.
    pub farthest: f32,
    /// Regions of its own in the last second, carried along with the background, and how old they are in seconds.
    way: VecDeque<(Rect2f, f64)>,
}

/// Somebody who is seen. Pixels of the picture.
#[derive(Debug, Clone)]
pub(in super::super) struct Track {
    /// Counted from 1; 0 until it is confirmed.
    pub id: u64,
    pub(super) across: Axis,
    pub(super) down: Axis,
    /// Logarithm of the odds that there is somebody.
    existence: f32,
    pub evidence: Evidence,
    pub journey: Journey,
    pub(super) views: Views,
    /// Whom it shared a region with and has not been told apart from since.
    pub companions: Vec<u64>,
    /// For how long it was seen beside the target, seconds: then it is somebody else.
    pub beside_target_s: f64,
}

impl Track {
    /// Of a region that belongs to nobody else.
    pub fn new(number: usize, region: &Region, frame: Frame) -> Self {
        let bounds = region.bounds;
        let height = bounds.height.max(1.0);
        let axis = |middle: f32, size: f32, cut: bool| {
            let size_noise = if cut { CUT_SIZE } else { FIRST_SIZE };
            Axis::new(
                middle,
                size,
                [DOWN_NOISE * height + PIXEL_NOISE, FIRST_RATE * height, size_noise * height],
            )
        };
        let [left, top, right, bottom] = frame.cut_sides(bounds);
        let middle = centre(bounds);
        let mut views = Views::default();
        views.learn(&region.looks, 0.0);
        Self {
            id: 0,
            across: axis(middle.x, bounds.width, left || right),
            down: axis(middle.y, bounds.height, top || bottom),
            existence: FIRST_EXISTENCE,
            evidence: Evidence::Alone(number),
            journey: Journey {
                age_s: 0.0,
                unseen_s: 0.0,
                not_alone_s: 0.0,
                alone_s: 0.0,
                shared_s: 0.0,
                pictures: 1,
                unlike_s: 0.0,
                stands_s: 0.0,
                origin: middle,
                farthest: 0.0,
                way: VecDeque::from([(bounds, 0.0)]),
            },
            views,
            companions: Vec::new(),
            beside_target_s: 0.0,
        }
    }

    /// Its box.
    pub fn bounds(&self) -> Rect2f {
        Rect2f::new(self.across.side(Side::Low), self.down.side(Side::Low), self.across.size, self.down.size)
    }

    /// Its height, pixels.
    pub fn height(&self) -> f32 {
        self.down.size
    }

    /// Its motion against the background, pixels per second.
    pub fn velocity(&self) -> Point2f {
        Point2f::new(self.across.rate, self.down.rate)
    }

    /// Variances of its middle across and down, pixels².
    pub fn variance(&self) -> (f32, f32) {
        (self.across.variance(), self.down.variance())
    }

    /// 0 to 1.
    pub fn confidence(&self) -> f32 {
        (self.existence / MOST_EXISTENCE).clamp(0.0, 1.0)
    }

    pub fn is_confirmed(&self) -> bool {
        self.id > 0
    }

    /// Whether there is nobody any more.
    pub fn is_gone(&self) -> bool {
        self.existence <= 0.0
    }

    /// Whether it is seen in a region of its own.
    pub fn is_alone(&self) -> bool {
        matches!(self.evidence, Evidence::Alone(_))
    }

    /// Whether it is seen in a region with others.
    pub fn is_shared(&self) -> bool {
        matches!(self.evidence, Evidence::Shared(..))
    }

    /// Whether it was seen beside the target, and so is somebody else.
    pub fn is_another(&self) -> bool {
        self.beside_target_s >= TOLD_APART_S
    }

    /// Whether anything of it was seen by itself.
    pub fn is_measured(&self) -> bool {
        matches!(self.evidence, Evidence::Alone(_) | Evidence::Shared(_, true))
    }

    /// The box of what is seen of it; its own where it shares that with others.
    pub fn seen_bounds(&self) -> Rect2f {
        match (self.evidence, self.journey.way.back()) {
            (Evidence::Alone(_), Some((bounds, _))) => *bounds,
            _ => self.bounds(),
        }
    }

    /// Whether all of it is seen, from head to foot, in a region of its own: only then is there something to learn.
    pub fn is_seen_whole(&self) -> bool {
        self.is_alone() && self.companions.is_empty() && self.seen_bounds().height >= WHOLE * self.height()
    }

    /// The number of the region that it is seen in, alone or not.
    pub fn region(&self) -> Option<usize> {
        match self.evidence {
            Evidence::Alone(number) | Evidence::Shared(number, _) => Some(number),
            Evidence::Missed => None,
        }
    }

    /// Goes on into the next picture, in which nothing was seen of it yet. Where nobody saw how the background moved, its way so far
    /// says nothing.
    pub fn predict(&mut self, ego: Option<EgoMotion>, dt_s: f64) {
        if let Some(ego) = ego {
            let middle = Point2f::new(self.across.middle, self.down.middle);
            let (to, scale) = (ego.apply(middle), ego.scale_at(middle));
            self.across.carry(to.x, scale);
            self.down.carry(to.y, scale);
            self.journey.origin = ego.apply(self.journey.origin);
            self.journey.farthest *= scale;
            for (bounds, age_s) in &mut self.journey.way {
                *bounds = ego.apply_to(*bounds);
                *age_s += dt_s;
            }
        }
        let is_seen = ego.is_some_and(|ego| !ego.is_coasted());
        self.journey.way.retain(|(_, age_s)| is_seen && *age_s <= WAY_S);
        let square = self.height() * self.height();
        let noise = ProcessNoise { acceleration: ACCELERATION * square, size: GROWTH * square };
        self.across.predict(dt_s as f32, noise);
        self.down.predict(dt_s as f32, noise);
        self.evidence = Evidence::Missed;
        self.journey.age_s += dt_s;
        self.journey.unseen_s += dt_s;
        self.journey.not_alone_s += dt_s;
    }

    /// Takes the sides of a region that are its own: left, top, right, bottom.
    pub fn measure(&mut self, bounds: Rect2f, sides: [bool; 4]) {
        let height = self.height();
        let across = ACROSS_NOISE * height + PIXEL_NOISE;
        let down = DOWN_NOISE * height + PIXEL_NOISE;
        let end = bounds.br();
        let [left, top, right, bottom] = sides;
        take(&mut self.across, [left, right], [bounds.x, end.x], across);
        take(&mut self.down, [top, bottom], [bounds.y, end.y], down);
    }

    /// Was seen in a region of its own.
    pub fn see_alone(&mut self, number: usize, bounds: Rect2f, dt_s: f64) {
        self.see(Evidence::Alone(number));
        self.journey.alone_s += dt_s;
        self.journey.not_alone_s = 0.0;
        self.journey.pictures += 1;
        // Of whose way nothing is known it is not known how far it went either.
        if !self.journey.way.is_empty() {
            let away = length(centre(self.bounds()) - self.journey.origin);
            self.journey.farthest = self.journey.farthest.max(away);
        }
        self.journey.way.push_back((bounds, 0.0));
        self.existence = (self.existence + SEEN_PER_S * dt_s as f32).min(MOST_EXISTENCE);
    }

    /// Is in a region with others.
    pub fn see_shared(&mut self, number: usize, measured: bool, dt_s: f64) {
        self.see(Evidence::Shared(number, measured));
        self.journey.shared_s += dt_s;
    }

    fn see(&mut self, evidence: Evidence) {
        self.evidence = evidence;
        self.journey.unseen_s = 0.0;
    }

    /// Is not seen for that share of the time after which nobody is there for certain.
    pub fn miss(&mut self, hidden: bool, share: f64) {
        let hidden = if hidden { HIDDEN_SHARE } else { 1.0 };
        self.existence -= hidden * MOST_EXISTENCE * share as f32;
    }

    /// Is there for certain.
    pub fn establish(&mut self) {
        self.existence = MOST_EXISTENCE;
    }

    /// There is nobody any more.
    pub fn end(&mut self) {
        self.existence = 0.0;
    }

    /// Takes its motion against the background, pixels per second, with that deviation.
    pub fn measure_velocity(&mut self, velocity: Point2f, deviation: f32) {
        self.across.measure_rate(velocity.x, deviation);
        self.down.measure_rate(velocity.y, deviation);
    }

    /// Takes the place at which it is by its looks: the less sure they are of it, 0 to 1, the less that counts.
    pub fn measure_place(&mut self, middle: Point2f, sureness: f32) {
        let deviation = (LOOKS_NOISE * self.height() + PIXEL_NOISE) / sureness.clamp(0.1, 1.0);
        self.across.measure_middle(middle.x, deviation);
        self.down.measure_middle(middle.y, deviation);
    }

    /// No region shows it alone, but where its looks say that it is so much is `shown`, 0 to 1, to stand out, for that share of the time
    /// after which nobody is there for certain.
    pub fn stand_out(&mut self, shown: f32, share_of_coast: f32) {
        self.existence = (self.existence + STANDS_OUT * share_of_coast * shown).min(MOST_EXISTENCE);
    }

    /// What it was until now is no part of its way: it was seen in pieces.
    pub fn restart_way(&mut self) {
        self.journey.way.clear();
        self.journey.way.push_back((self.bounds(), 0.0));
    }

    /// Whether it has been seen for a while, is seen now, and is where it was at first.
    pub fn goes_nowhere(&self) -> bool {
        let off = centre(self.bounds()) - self.journey.origin;
        matches!(self.evidence, Evidence::Alone(_))
            && self.journey.age_s >= TRIAL_S
            && off.x.abs() < NOWHERE * self.across.size
            && off.y.abs() < NOWHERE * self.down.size
    }

    /// Whether it was seen as far from where it was first as it is tall, and as that height: no arm of somebody so tall gets there, and
    /// hardly anything that a screen shows.
    pub fn has_gone_as_far_as(&self, height: f32) -> bool {
        self.journey.farthest >= height.max(self.height())
    }

    /// Whether it went somewhere, up to where it is seen now: a screen, a curtain, a door, a lamp change as much as a person does,
    /// but stay.
    pub fn travels(&self) -> bool {
        let Some((now, _)) = self.journey.way.back().copied() else { return false };
        self.journey.way.iter().any(|(then, _)| {
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

/// Takes the sides of an axis that are its `own`.
fn take(axis: &mut Axis, own: [bool; 2], [low, high]: [f32; 2], deviation: f32) {
    match own {
        [true, true] => axis.measure_both(low, high, deviation),
        [true, false] => axis.measure(Side::Low, low, deviation),
        [false, true] => axis.measure(Side::High, high, deviation),
        [false, false] => (),
    }
}

/// How far both sides of a box have moved: one that moves alone shows or hides a part of what is in it.
pub(in super::super) fn motion(then: Rect2f, now: Rect2f) -> Point2f {
    let both = |a: f32, b: f32| if a * b > 0.0 { a.abs().min(b.abs()).copysign(a) } else { 0.0 };
    let (from, to) = (now.tl() - then.tl(), now.br() - then.br());
    Point2f::new(both(from.x, to.x), both(from.y, to.y))
}
