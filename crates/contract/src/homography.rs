// SPDX-License-Identifier: MPL-2.0

use crate::Point;

/// How a static world moves in the picture of a camera that turns or zooms: a projective map of normalised
/// coordinates, row by row. Without parallax, which a turning camera does not make, it is exact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Homography(pub [[f64; 3]; 3]);

impl Default for Homography {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Homography {
    /// The camera rests.
    pub const IDENTITY: Self = Self([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);

    /// The picture moves as a whole, by frame widths and heights.
    pub const fn translation(x: f64, y: f64) -> Self {
        Self([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])
    }

    /// Where `point` goes. A point on the horizon of the map goes to infinity.
    pub fn apply(&self, point: Point) -> Point {
        let [x, y, w] = self.0.map(|row| row[0] * point.x + row[1] * point.y + row[2]);
        Point { x: x / w, y: y / w }
    }

    /// This map and then `next`.
    pub fn then(&self, next: &Self) -> Self {
        let column = |row: &[f64; 3], at: usize| (0..3).map(|k| row[k] * self.0[k][at]).sum();
        Self(next.0.map(|row| [column(&row, 0), column(&row, 1), column(&row, 2)])).normalised()
    }

    /// The way back; `None` where there is none.
    pub fn inverse(&self) -> Option<Self> {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.0;
        let adjugate = [
            [e * i - f * h, c * h - b * i, b * f - c * e],
            [f * g - d * i, a * i - c * g, c * d - a * f],
            [d * h - e * g, b * g - a * h, a * e - b * d],
        ];
        let determinant = a * adjugate[0][0] + b * adjugate[1][0] + c * adjugate[2][0];
        (determinant.abs() > 1e-9).then(|| Self(adjugate).normalised())
    }

    /// The same map of coordinates that are `width` and `height` times as large: pixels, counted from the
    /// top left corner of the frame.
    pub fn scaled(&self, width: f64, height: f64) -> Self {
        let size = [width, height, 1.0];
        let mut scaled = self.0;
        for (row, to) in scaled.iter_mut().zip(size) {
            for (value, from) in row.iter_mut().zip(size) {
                *value *= to / from;
            }
        }
        Self(scaled)
    }

    /// The similarity that is nearest to it in the middle of a frame of that size in pixels, `(a, b, x, y)`: from
    /// (x, y) to (ax − by + x, bx + ay + y). Perspective is left out.
    pub fn similarity(&self, width: f64, height: f64) -> [f64; 4] {
        let map = self.scaled(width, height);
        let (middle, reach) = (Point { x: width / 2.0, y: height / 2.0 }, width / 4.0);
        let at = |dx: f64, dy: f64| map.apply(Point { x: middle.x + dx, y: middle.y + dy });
        let (right, left, below, above) = (at(reach, 0.0), at(-reach, 0.0), at(0.0, reach), at(0.0, -reach));
        let a = (right.x - left.x + below.y - above.y) / (4.0 * reach);
        let b = (right.y - left.y - below.x + above.x) / (4.0 * reach);
        let to = at(0.0, 0.0);
        [a, b, to.x - a * middle.x + b * middle.y, to.y - b * middle.x - a * middle.y]
    }

    /// With 1 in the last place, as all that is drawn from it here assumes no picture turned inside out.
    fn normalised(self) -> Self {
        let last = self.0[2][2];
        if last.abs() > 1e-12 { Self(self.0.map(|row| row.map(|value| value / last))) } else { self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_map() -> impl Strategy<Value = Homography> {
        let linear = -0.3..0.3;
        (linear.clone(), linear.clone(), linear.clone(), linear, -0.5..0.5, -0.5..0.5, -0.2..0.2, -0.2..0.2)
            .prop_map(|(a, b, c, d, x, y, g, h)| Homography([[1.0 + a, b, x], [c, 1.0 + d, y], [g, h, 1.0]]))
    }

    fn near(a: Point, b: Point) -> bool {
        (a.x - b.x).abs() < 1e-9 && (a.y - b.y).abs() < 1e-9
    }

    proptest! {
        #[test]
        fn the_way_back_leads_back(map in any_map(), x in 0.0..1.0, y in 0.0..1.0) {
            let point = Point { x, y };
            let back = map.inverse().expect("near the identity").apply(map.apply(point));
            prop_assert!(near(back, point), "{:?}", back);
        }

        #[test]
        fn one_after_the_other(first in any_map(), second in any_map(), x in 0.0..1.0, y in 0.0..1.0) {
            let point = Point { x, y };
            prop_assert!(near(first.then(&second).apply(point), second.apply(first.apply(point))));
        }

        #[test]
        fn pixels_move_as_their_places_do(map in any_map(), x in 0.0..1.0, y in 0.0..1.0) {
            let pixel = map.scaled(320.0, 180.0).apply(Point { x: x * 320.0, y: y * 180.0 });
            let place = map.apply(Point { x, y });
            let moved = Point { x: pixel.x / 320.0, y: pixel.y / 180.0 };
            prop_assert!(near(moved, place));
        }
    }

    #[test]
    fn a_similarity_is_its_own_nearest_one() {
        let [a, b, x, y] = [1.02, 0.03, 14.0, -5.0];
        let pixels = Homography([[a, -b, x], [b, a, y], [0.0, 0.0, 1.0]]);
        let found = pixels.scaled(1.0 / 640.0, 1.0 / 360.0).similarity(640.0, 360.0);
        assert!(
            found.iter().zip([a, b, x, y]).all(|(found, value)| (found - value).abs() < 1e-9),
            "{found:?}"
        );
    }

    #[test]
    fn what_squeezes_the_picture_to_a_line_has_no_way_back() {
        assert_eq!(Homography([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).inverse(), None);
    }
}
