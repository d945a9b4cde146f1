//! The feature points of a target: who belongs to it, who left it, who may join.

use opencv::core::Point2f;

use super::ego_motion::EgoMotion;
use super::geometry::{length, mean, median, median_vector};

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
/// A target comes nearer or goes away by less than this from one frame to the next.
const MAX_GROWTH: f32 = 0.03;

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
    /// Growth of the distances between the points.
    pub growth: f32,
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
}

impl Points {
    /// Points that are known to lie on the target.
    pub fn on_target(positions: impl IntoIterator<Item = Point2f>) -> Self {
        let points = positions.into_iter().map(|position| Tracked::new(position, true)).collect();
        Self { points, ..Self::default() }
    }

    /// Where all points are.
    pub fn positions(&self) -> Vec<Point2f> {
        self.points.iter().map(|point| point.position).collect()
    }

    /// Where the points are that count.
    pub fn members(&self) -> Vec<Point2f> {
        self.points.iter().filter(|point| point.member).map(|point| point.position).collect()
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
    /// `height` is the target's: its limbs move against it by a share of that. `None` where too few points
    /// are left to tell how the target moved.
    pub fn advance(&mut self, found: &[Option<Point2f>], ego: EgoMotion, height: f32) -> Option<Consensus> {
        self.rejected.clear();
        let before = self.points.iter().filter(|point| point.member).count();
        let old: Vec<Tracked> = std::mem::take(&mut self.points);
        let mut moves = Vec::new();
        for (point, place) in old.into_iter().zip(found) {
            match place {
                Some(place) => moves.push((point, *place)),
                None => self.rejected.push(point.position),
            }
        }
        let members = || moves.iter().filter(|(point, _)| point.member);
        if members().count() < MIN_CONSENSUS {
            self.rejected.extend(moves.iter().map(|(_, place)| *place));
            return None;
        }
        let middle = median_vector(members().map(|(point, place)| *place - point.position));
        let own = middle - ego.at(median_vector(members().map(|(point, _)| point.position)));
        let tolerance = 1.5 + 0.02 * height + 0.25 * length(own);
        let agrees = |point: &Tracked, place: Point2f| length(place - point.position - middle) <= tolerance;
        let agreeing: Vec<(Point2f, Point2f)> = members()
            .filter(|(point, place)| agrees(point, *place))
            .map(|(point, place)| (point.position, *place))
            .collect();
        if agreeing.len() < MIN_CONSENSUS {
            return None;
        }
        let motion = mean(agreeing.iter().map(|(from, to)| *to - *from))?;
        self.travel = self.travel * MEMORY + own;
        for (point, place) in moves {
            let disagreements = if agrees(&point, place) { 0 } else { point.disagreements + 1 };
            let travel = point.travel * MEMORY + (place - point.position - ego.at(point.position));
            let point = Tracked { position: place, travel, age: point.age + 1, disagreements, ..point };
            self.settle(point, tolerance);
        }
        let share = agreeing.len() as f32 / before.max(1) as f32;
        Some(Consensus { motion, growth: growth(&agreeing), share })
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
        Some(Consensus { motion: mean(motions.into_iter())?, growth: 1.0, share })
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

/// The median growth of the distances between points: blind to the odd point that slides.
fn growth(pairs: &[(Point2f, Point2f)]) -> f32 {
    const MIN_PAIRS: usize = 10;
    // Points close together say more about noise than about size.
    const MIN_DISTANCE: f32 = 8.0;
    let mut ratios = Vec::new();
    for (index, (from, to)) in pairs.iter().enumerate() {
        for (other_from, other_to) in &pairs[..index] {
            let before = length(*from - *other_from);
            if before > MIN_DISTANCE {
                ratios.push(length(*to - *other_to) / before);
            }
        }
    }
    if ratios.len() < MIN_PAIRS {
        return 1.0;
    }
    median(&mut ratios).clamp(1.0 - MAX_GROWTH, 1.0 + MAX_GROWTH)
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
            let found: Vec<_> =
                points.positions().into_iter().map(|point| Some(point + motion(point))).collect();
            last = points.advance(&found, ego, 75.0);
        }
        last
    }

    #[test]
    fn agreeing_points_tell_the_motion() {
        let mut points = Points::on_target(body());
        let consensus = walk(&mut points, 1, still(), |_| Point2f::new(3.0, -1.0)).expect("agree");
        assert!(length(consensus.motion - Point2f::new(3.0, -1.0)) < 1e-3);
        assert_eq!((consensus.share, points.len()), (1.0, 20));
        assert!((consensus.growth - 1.0).abs() < 1e-3);
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
    fn growth_is_measured_and_limited() {
        let mut points = Points::on_target(body());
        let middle = Point2f::new(115.0, 110.0);
        let consensus = walk(&mut points, 1, still(), |p| (p - middle) * 0.02).expect("agree");
        assert!((consensus.growth - 1.02).abs() < 1e-3);
        let consensus = walk(&mut points, 1, still(), |p| (p - middle) * 0.04).expect("agree");
        assert!(consensus.growth <= 1.0 + MAX_GROWTH);
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
        let mut found: Vec<_> =
            points.positions().into_iter().map(|p| Some(p + Point2f::new(3.0, 0.0))).collect();
        found[0] = found[0].map(|p| p + Point2f::new(-12.0, 0.0));
        let consensus = points.advance(&found, still(), 75.0).expect("agree");
        assert!((consensus.motion.x - 3.0).abs() < 1e-3);
        assert!(points.len() < count);
    }

    #[test]
    fn new_points_count_only_after_probation() {
        let mut points = Points::on_target(body());
        points.propose([Point2f::new(120.0, 100.0)]);
        assert_eq!((points.len(), points.members().len()), (21, 20));
        walk(&mut points, PROBATION as usize, still(), |_| Point2f::new(2.0, 0.0)).expect("agree");
        assert_eq!(points.members().len(), 21);
    }

    #[test]
    fn too_few_points_tell_nothing() {
        let mut points = Points::on_target(body());
        let found: Vec<_> = (0..20).map(|n| (n < 2).then_some(Point2f::new(1.0, 1.0))).collect();
        assert_eq!(points.advance(&found, still(), 75.0), None);
        assert_eq!(points.rejected().len(), 20);
    }
}
