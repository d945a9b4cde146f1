//! How the background moves in the picture while the camera turns.

use opencv::core::Point2f;

use super::geometry::{length, mean, median_vector};

/// A camera turning or zooming between two frames scales and turns the picture less than this.
const MAX_SCALE_CHANGE: f32 = 0.12;
const MAX_TURN: f32 = 0.12;
/// Fewer points, or a smaller share of them agreeing, say nothing about the background.
const MIN_POINTS: usize = 6;
const MIN_AGREEMENT: f32 = 0.35;
/// Pixels that a background point may deviate, at least; more where the picture moves much.
const TOLERANCE: f32 = 1.0;
const RELATIVE_TOLERANCE: f32 = 0.06;

/// A similarity of the picture: `to = linear * from + shift` with `linear = (a, -b; b, a)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EgoMotion {
    a: f32,
    b: f32,
    shift: Point2f,
}

impl Default for EgoMotion {
    /// The picture rests.
    fn default() -> Self {
        Self::translation(Point2f::default())
    }
}

impl EgoMotion {
    /// The picture moves as a whole.
    pub fn translation(shift: Point2f) -> Self {
        Self { a: 1.0, b: 0.0, shift }
    }

    /// Where a background point of the last frame is now.
    pub fn apply(&self, point: Point2f) -> Point2f {
        let x = self.a * point.x - self.b * point.y;
        let y = self.b * point.x + self.a * point.y;
        Point2f::new(x, y) + self.shift
    }

    /// How far a background point moved that was at `point` in the last frame.
    pub fn at(&self, point: Point2f) -> Point2f {
        self.apply(point) - point
    }

    /// How the size of things changed.
    pub fn scale(&self) -> f32 {
        self.a.hypot(self.b)
    }
}

/// The motion that most of the `(from, to)` pairs share; `None` where too few do.
///
/// The median is blind to up to half of the points lying on other moving people; least squares over
/// those near it then finds the slight scale and rotation that a turning or zooming camera adds.
pub(super) fn estimate(pairs: &[(Point2f, Point2f)]) -> Option<EgoMotion> {
    if pairs.len() < MIN_POINTS {
        return None;
    }
    let mut motion = EgoMotion::translation(median_vector(pairs.iter().map(|(from, to)| *to - *from)));
    // Scale and rotation show at the edges only: the first fit may be wide, the next is strict.
    for widening in [3.0, 1.0, 1.0] {
        let limit = widening * (TOLERANCE + RELATIVE_TOLERANCE * length(motion.shift));
        let agreeing: Vec<_> =
            pairs.iter().copied().filter(|(from, to)| length(*to - motion.apply(*from)) <= limit).collect();
        if agreeing.len() < MIN_POINTS || (agreeing.len() as f32) < MIN_AGREEMENT * pairs.len() as f32 {
            return None;
        }
        motion = fit(&agreeing)?;
    }
    Some(motion)
}

/// Least squares over all pairs; only a translation where more cannot be told or makes no sense.
fn fit(pairs: &[(Point2f, Point2f)]) -> Option<EgoMotion> {
    let from_middle = mean(pairs.iter().map(|(from, _)| *from))?;
    let to_middle = mean(pairs.iter().map(|(_, to)| *to))?;
    let (mut dot, mut cross, mut square) = (0.0, 0.0, 0.0);
    for (from, to) in pairs {
        let (p, q) = (*from - from_middle, *to - to_middle);
        dot += p.dot(q);
        cross += p.x * q.y - p.y * q.x;
        square += p.dot(p);
    }
    let (a, b) = if square > 1.0 { (dot / square, cross / square) } else { (1.0, 0.0) };
    let plausible = (a.hypot(b) - 1.0).abs() <= MAX_SCALE_CHANGE && b.abs() <= MAX_TURN;
    let linear = if plausible {
        EgoMotion { a, b, shift: Point2f::default() }
    } else {
        EgoMotion::translation(Point2f::default())
    };
    Some(EgoMotion { shift: to_middle - linear.apply(from_middle), ..linear })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn grid() -> impl Iterator<Item = Point2f> {
        (0..36).map(|n| Point2f::new(40.0 + 100.0 * (n % 6) as f32, 30.0 + 80.0 * (n / 6) as f32))
    }

    proptest! {
        #[test]
        fn recovers_motion_among_other_movers(dx in -60.0_f32..60.0, dy in -60.0_f32..60.0,
                                              scale in 0.97_f32..1.03, turn in -0.02_f32..0.02) {
            let truth = EgoMotion { a: scale * turn.cos(), b: scale * turn.sin(), shift: Point2f::new(dx, dy) };
            let around_middle = EgoMotion {
                shift: truth.shift + Point2f::new(290.0, 230.0) - EgoMotion { shift: Point2f::default(), ..truth }
                    .apply(Point2f::new(290.0, 230.0)),
                ..truth
            };
            // Every fourth point lies on something that walks.
            let pairs: Vec<_> = grid().enumerate().map(|(index, from)| {
                let walk = if index % 4 == 0 { Point2f::new(11.0, 3.0) } else { Point2f::default() };
                (from, around_middle.apply(from) + walk)
            }).collect();
            if let Some(found) = estimate(&pairs) {
                let error = grid().map(|point| length(found.apply(point) - around_middle.apply(point)));
                prop_assert!(error.fold(0.0, f32::max) < 1.0);
                prop_assert!((found.scale() - scale).abs() < 0.005);
            } else {
                prop_assert!((scale - 1.0).abs() > 0.01 || turn.abs() > 0.005, "a plain shift was not found");
            }
        }
    }

    #[test]
    fn a_still_camera_is_still() {
        let pairs: Vec<_> = grid().map(|point| (point, point)).collect();
        let motion = estimate(&pairs).expect("plenty of points");
        assert!(length(motion.at(Point2f::new(300.0, 200.0))) < 1e-3);
    }

    #[test]
    fn too_few_or_disagreeing_points_say_nothing() {
        let few: Vec<_> = grid().take(4).map(|point| (point, point)).collect();
        assert_eq!(estimate(&few), None);
        let chaos: Vec<_> = grid()
            .enumerate()
            .map(|(n, point)| (point, point + Point2f::new((n * 37 % 101) as f32, (n * 53 % 97) as f32)))
            .collect();
        assert_eq!(estimate(&chaos), None);
    }
}
