// SPDX-License-Identifier: MPL-2.0

//! The feature points of a target: who belongs to it, who left it, who may join.

use opencv::core::Point2f;

use super::ego_motion::EgoMotion;
use super::geometry::{length, mean, weighted_median};

/// Share of a point's travel against the background that is remembered from frame to frame.
const MEMORY: f32 = 0.8;
/// Travel in pixels from which the target measurably differs from the background.
const MEASURABLE: f32 = 2.0;
/// A point that travels less than this share of the target's travel belongs to the background.
const BACKGROUND_SHARE: f32 = 0.35;
/// Frames that a new point must move with the target before it counts.
const PROBATION: u32 = 4;
/// Frames in a row that a point may disagree with the others.
const PATIENCE: u32 = 2;
/// Fewer points cannot tell an outlier.
const MIN_CONSENSUS: usize = 3;
/// Pixels from one frame to the next that tell a walker from the wall.
const MEASURABLE_STEP: f32 = 1.0;
/// A point less likely to lie on the figure lies on the wall.
const GROUND_WEIGHT: f32 = 0.25;

/// One point that is followed.
#[derive(Debug, Clone, Copy)]
struct Tracked {
    position: Point2f,
    /// Recent motion against the background.
    travel: Point2f,
    age: u32,
    member: bool,
    disagreements: u32,
}

impl Tracked {
    fn new(position: Point2f, member: bool) -> Self {
        Self { position, travel: Point2f::default(), age: 0, member, disagreements: 0 }
    }
}

/// The target's motion from one frame to the next, as its points agree on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Consensus {
    /// Frame pixels, camera motion included.
    pub motion: Point2f,
    /// Share of the target's points that were found again and agree.
    pub share: f32,
}

/// All points of one target.
#[derive(Debug, Clone, Default)]
pub(super) struct Points {
    points: Vec<Tracked>,
    /// The target's own recent motion against the background.
    travel: Point2f,
    rejected: Vec<Point2f>,
    /// Memory for the next picture.
    moves: Vec<Move>,
    values: Vec<(f32, f32)>,
}

/// A point, where it was found, and how likely it lay on the figure.
type Move = (Tracked, Point2f, f32);

impl Points {
    /// Points that are known to lie on the target.
    pub fn on_target(positions: impl IntoIterator<Item = Point2f>) -> Self {
        let points = positions.into_iter().map(|position| Tracked::new(position, true)).collect();
        Self { points, ..Self::default() }
    }

    /// Where all points are.
    pub fn positions(&self) -> impl Iterator<Item = Point2f> {
        self.points.iter().map(|point| point.position)
    }

    /// Where the points are that count.
    pub fn members(&self) -> impl Iterator<Item = Point2f> {
        self.points.iter().filter(|point| point.member).map(|point| point.position)
    }

    /// The points that were given up in the last frame, to be shown.
    pub fn rejected(&self) -> &[Point2f] {
        &self.rejected
    }

    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Shows these as rejected too.
    pub fn reject(&mut self, positions: Vec<Point2f>) {
        self.rejected.extend(positions);
    }

    /// Adds points that may lie on the target; they count only after they moved with it.
    pub fn propose(&mut self, positions: impl IntoIterator<Item = Point2f>) {
        self.points.extend(positions.into_iter().map(|position| Tracked::new(position, false)));
    }

    /// Gives up the points for which `keep` is false.
    pub fn retain(&mut self, keep: impl Fn(Point2f) -> bool) {
        let rejected = &mut self.rejected;
        self.points.retain(|point| {
            let kept = keep(point.position);
            if !kept {
                rejected.push(point.position);
            }
            kept
        });
    }

    /// Moves every point to where it was found (`None`: lost), while the background moves as `ego`.
    ///
    /// A point counts by how likely it lies on the figure. Where some move with the background and others against it,
    /// as the target was `expected` to (pixels against the background), those are the target's. `height` is the
    /// target's: its limbs move against it by a share of that. `None` where too few points are left to tell how the
    /// target moved.
    pub fn advance(
        &mut self,
        found: &[Option<Point2f>],
        ego: EgoMotion,
        expected: Point2f,
        height: f32,
        figure: impl Fn(Point2f) -> f32,
    ) -> Option<Consensus> {
        self.rejected.clear();
        let before: f32 =
            self.points.iter().filter(|point| point.member).map(|point| figure(point.position)).sum();
        let mut moves = std::mem::take(&mut self.moves);
        moves.clear();
        for (point, place) in self.points.drain(..).zip(found) {
            match place {
                Some(place) => moves.push((point, *place, figure(point.position))),
                None => self.rejected.push(point.position),
            }
        }
        let consensus = self.agree(&moves, ego, expected, height, before);
        self.moves = moves;
        consensus
    }

    /// Takes up the points that moved, and tells how the target did; `before` is what its points weighed.
    fn agree(
        &mut self,
        moves: &[Move],
        ego: EgoMotion,
        expected: Point2f,
        height: f32,
        before: f32,
    ) -> Option<Consensus> {
        let members = moves.iter().filter(|(point, ..)| point.member);
        let first = members.clone().next().filter(|_| members.clone().count() >= MIN_CONSENSUS);
        let Some((first, ..)) = first else {
            self.rejected.extend(moves.iter().map(|(_, place, _)| *place));
            return None;
        };
        let tolerance = 1.5 + 0.02 * height + 0.25 * length(expected);
        let moves_on = |(point, place, _): &Move| {
            let own = *place - ego.apply(point.position);
            length(own - expected) <= tolerance && length(own) > BACKGROUND_SHARE * length(expected)
        };
        let movers = members.clone().filter(|point| moves_on(point)).count();
        let only_movers = length(expected) > MEASURABLE_STEP && movers >= MIN_CONSENSUS;
        let voters = members.filter(|point| !only_movers || moves_on(point));
        let shifts = voters.clone().map(|(point, place, weight)| (*place - point.position, *weight));
        let middle = weighted_median(shifts, &mut self.values);
        let tolerance = 1.5 + 0.02 * height + 0.25 * length(middle - ego.at(first.position));
        let agrees = |point: &Tracked, place: Point2f| length(place - point.position - middle) <= tolerance;
        let agreeing = voters.filter(|(point, place, _)| agrees(point, *place));
        let weight: f32 = agreeing.clone().map(|(.., weight)| weight).sum();
        if agreeing.clone().count() < MIN_CONSENSUS || weight <= f32::EPSILON {
            return None;
        }
        let sum = agreeing.clone().fold(Point2f::default(), |sum, (point, place, weight)| {
            sum + (*place - point.position) * *weight
        });
        let motion = sum / weight;
        let anchor = mean(agreeing.map(|(point, ..)| point.position))?;
        self.travel = self.travel * MEMORY + (motion - ego.at(anchor));
        for &(point, place, weight) in moves {
            let disagrees = !agrees(&point, place) || weight < GROUND_WEIGHT;
            let disagreements = if disagrees { point.disagreements + 1 } else { 0 };
            let travel = point.travel * MEMORY + (place - ego.apply(point.position));
            let point = Tracked { position: place, travel, age: point.age + 1, disagreements, ..point };
            self.settle(point, tolerance);
        }
        Some(Consensus { motion, share: weight / before.max(f32::EPSILON) })
    }

    /// The thesis: all points that are found again count, and their mean is the motion. `None` once none is left.
    pub fn average(&mut self, found: &[Option<Point2f>]) -> Option<Consensus> {
        self.rejected.clear();
        let before = std::mem::take(&mut self.points);
        let mut motions = Vec::new();
        for (point, place) in before.iter().zip(found) {
            match place {
                Some(place) => {
                    motions.push(*place - point.position);
                    self.points.push(Tracked { position: *place, ..*point });
                }
                None => self.rejected.push(point.position),
            }
        }
        let share = motions.len() as f32 / before.len().max(1) as f32;
        Some(Consensus { motion: mean(motions.into_iter())?, share })
    }

    /// Keeps, promotes or rejects one point.
    fn settle(&mut self, mut point: Tracked, tolerance: f32) {
        // What a point of the point's age would have travelled with the target: young ones saw less.
        let seen = 1.0 - MEMORY.powi(point.age.min(100) as i32);
        let expected = self.travel * seen;
        let measurable = length(expected) > MEASURABLE;
        let with_background = measurable && length(point.travel) < BACKGROUND_SHARE * length(expected);
        let astray = length(point.travel - expected) > 2.0 * tolerance + 0.5 * length(expected);
        if point.disagreements >= PATIENCE || with_background || astray {
            self.rejected.push(point.position);
            return;
        }
        point.member |= point.age >= PROBATION && point.disagreements == 0;
        self.points.push(point);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn still() -> EgoMotion {
        EgoMotion::translation(Point2f::default())
    }

    fn body() -> Vec<Point2f> {
        (0..20).map(|n| Point2f::new(100.0 + 10.0 * (n % 4) as f32, 80.0 + 15.0 * (n / 4) as f32)).collect()
    }

    /// Moves every point by what `motion` says of its index, for some frames.
    fn walk(
        points: &mut Points,
        frames: usize,
        ego: EgoMotion,
        motion: impl Fn(Point2f) -> Point2f,
    ) -> Option<Consensus> {
        let mut last = None;
        for _ in 0..frames {
            let found: Vec<_> = points.positions().map(|point| Some(point + motion(point))).collect();
            last = points.advance(&found, ego, Point2f::default(), 75.0, |_| 1.0);
        }
        last
    }

    #[test]
    fn agreeing_points_tell_the_motion() {
        let mut points = Points::on_target(body());
        let consensus = walk(&mut points, 1, still(), |_| Point2f::new(3.0, -1.0)).expect("agree");
        assert!(length(consensus.motion - Point2f::new(3.0, -1.0)) < 1e-3);
        assert_eq!((consensus.share, points.len()), (1.0, 20));
    }

    #[test]
    fn the_thesis_takes_the_mean_until_no_point_is_left() {
        let mut points = Points::on_target(body());
        let found: Vec<_> =
            (0..20).map(|n| (n < 2).then(|| body()[n] + Point2f::new(n as f32, 4.0))).collect();
        let mean = points.average(&found).expect("two points");
        assert_eq!((mean.motion, mean.share, points.len()), (Point2f::new(0.5, 4.0), 0.1, 2));
        assert_eq!(points.rejected().len(), 18);
        assert_eq!(points.average(&[None, None]), None);
    }

    #[test]
    fn points_on_the_wall_do_not_count() {
        let mut points = Points::on_target(body());
        // Three of four columns lie on the wall, which the map knows; the fourth walks.
        let figure = |point: Point2f| if point.x > 125.0 { 0.9 } else { 0.05 };
        let mut last = None;
        for step in 0..3 {
            let walks = |point: Point2f| point.x > 125.0 + 3.0 * step as f32;
            let found: Vec<_> = points
                .positions()
                .map(|point| Some(point + Point2f::new(if walks(point) { 3.0 } else { 0.0 }, 0.0)))
                .collect();
            last = points.advance(&found, still(), Point2f::default(), 75.0, |point| {
                figure(point - Point2f::new(3.0 * step as f32, 0.0))
            });
        }
        assert!((last.expect("agree").motion.x - 3.0).abs() < 0.1, "{last:?}");
        assert_eq!(points.len(), 5);
    }

    #[test]
    fn a_mover_wins_over_the_wall_where_it_goes_on_as_expected() {
        let mut points = Points::on_target(body());
        let found: Vec<_> = points
            .positions()
            .map(|point| Some(point + Point2f::new(if point.x > 125.0 { 4.0 } else { 0.0 }, 0.0)))
            .collect();
        let consensus =
            points.advance(&found, still(), Point2f::new(4.0, 0.0), 75.0, |_| 0.5).expect("agree");
        assert!((consensus.motion.x - 4.0).abs() < 0.1, "{consensus:?}");
    }

    #[test]
    fn points_that_stay_with_the_panning_background_are_dropped() {
        let mut points = Points::on_target(body());
        let ego = EgoMotion::translation(Point2f::new(-6.0, 0.0));
        // The left column lies on the wall behind; the person walks right by 2 pixels against it.
        for frame in 0..6 {
            let wall_edge = 105.0 - 6.0 * frame as f32;
            walk(&mut points, 1, ego, |p| Point2f::new(if p.x < wall_edge { -6.0 } else { -4.0 }, 0.0))
                .expect("agree");
        }
        assert_eq!(points.len(), 15);
    }

    #[test]
    fn a_standing_target_keeps_its_points_under_a_panning_camera() {
        let mut points = Points::on_target(body());
        let ego = EgoMotion::translation(Point2f::new(-6.0, 2.0));
        walk(&mut points, 30, ego, |_| Point2f::new(-6.0, 2.0)).expect("agree");
        assert_eq!(points.len(), 20);
    }

    #[test]
    fn points_carried_off_by_a_passer_by_are_dropped() {
        let mut points = Points::on_target(body());
        let count = points.len();
        let mut found: Vec<_> = points.positions().map(|p| Some(p + Point2f::new(3.0, 0.0))).collect();
        found[0] = found[0].map(|p| p + Point2f::new(-12.0, 0.0));
        let consensus = points.advance(&found, still(), Point2f::default(), 75.0, |_| 1.0).expect("agree");
        assert!((consensus.motion.x - 3.0).abs() < 1e-3);
        assert!(points.len() < count);
    }

    #[test]
    fn new_points_count_only_after_probation() {
        let mut points = Points::on_target(body());
        points.propose([Point2f::new(120.0, 100.0)]);
        assert_eq!((points.len(), points.members().count()), (21, 20));
        walk(&mut points, PROBATION as usize, still(), |_| Point2f::new(2.0, 0.0)).expect("agree");
        assert_eq!(points.members().count(), 21);
    }

    #[test]
    fn too_few_points_tell_nothing() {
        let mut points = Points::on_target(body());
        let found: Vec<_> = (0..20).map(|n| (n < 2).then_some(Point2f::new(1.0, 1.0))).collect();
        assert_eq!(points.advance(&found, still(), Point2f::default(), 75.0, |_| 1.0), None);
        assert_eq!(points.rejected().len(), 20);
    }
}
