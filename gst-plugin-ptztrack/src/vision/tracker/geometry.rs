// SPDX-License-Identifier: MPL-2.0

//! Pixel geometry on OpenCV's own types, and the way between pixels and the normalised contract.

use opencv::core::{Point2f, Rect2f};
use ptztrack_contract::{Point, Rect, Vector};

/// Width of an upright person as a share of their height.
pub(super) const ASPECT: f32 = 0.4;

/// Width of one body as a share of its height, at most: arms and strides included.
const BODY_ASPECT: f32 = 0.6;

/// Whether a box is no broader than one body that stands or walks.
pub(super) fn is_upright(bounds: Rect2f) -> bool {
    bounds.width <= BODY_ASPECT * bounds.height
}

/// How broad somebody of this box is: of a body half hidden, or of a door that begins to open, a strip is all that shows.
pub(in super::super) fn breadth(bounds: Rect2f) -> f32 {
    bounds.width.max(ASPECT * bounds.height)
}

/// The middle of a box.
pub(super) fn centre(bounds: Rect2f) -> Point2f {
    Point2f::new(bounds.x + bounds.width / 2.0, bounds.y + bounds.height / 2.0)
}

/// The box of that size around a point.
pub(super) fn around(centre: Point2f, width: f32, height: f32) -> Rect2f {
    Rect2f::new(centre.x - width / 2.0, centre.y - height / 2.0, width, height)
}

/// The box with its sides multiplied, around its own middle.
pub(super) fn scaled(bounds: Rect2f, horizontal: f32, vertical: f32) -> Rect2f {
    around(centre(bounds), bounds.width * horizontal, bounds.height * vertical)
}

/// The box grown by `margin` on all sides.
pub(super) fn grown(bounds: Rect2f, margin: f32) -> Rect2f {
    around(centre(bounds), bounds.width + 2.0 * margin, bounds.height + 2.0 * margin)
}

/// Width and height that two boxes share; less than nothing by how far they are apart.
pub(super) fn shared_sides(a: Rect2f, b: Rect2f) -> (f32, f32) {
    let (a_end, b_end) = (a.br(), b.br());
    (a_end.x.min(b_end.x) - a.x.max(b.x), a_end.y.min(b_end.y) - a.y.max(b.y))
}

/// The area that two boxes share.
fn shared(a: Rect2f, b: Rect2f) -> f32 {
    let (width, height) = shared_sides(a, b);
    width.max(0.0) * height.max(0.0)
}

/// Intersection over union, 0 to 1.
pub(super) fn overlap(a: Rect2f, b: Rect2f) -> f32 {
    let both = shared(a, b);
    let either = a.area() + b.area() - both;
    if either > 0.0 { both / either } else { 0.0 }
}

/// The part of `bounds` that lies inside `frame`, 0 to 1.
pub(super) fn share_inside(bounds: Rect2f, frame: Rect2f) -> f32 {
    if bounds.area() > 0.0 { shared(bounds, frame) / bounds.area() } else { 0.0 }
}

/// Whether a point lies in the ellipse inscribed in the box. People fill an ellipse better than a box.
pub(super) fn in_ellipse(bounds: Rect2f, point: Point2f) -> bool {
    let offset = point - centre(bounds);
    let (x, y) = (2.0 * offset.x / bounds.width.max(1.0), 2.0 * offset.y / bounds.height.max(1.0));
    x * x + y * y <= 1.0
}

/// Length of a vector.
pub(super) fn length(vector: Point2f) -> f32 {
    vector.x.hypot(vector.y)
}

/// The median of each coordinate by weight: half of the weight lies on either side. `values` is memory.
pub(super) fn weighted_median(
    vectors: impl Iterator<Item = (Point2f, f32)> + Clone,
    values: &mut Vec<(f32, f32)>,
) -> Point2f {
    let mut of = |part: fn(Point2f) -> f32| {
        values.clear();
        values.extend(vectors.clone().map(|(vector, weight)| (part(vector), weight)));
        values.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let half = values.iter().map(|(_, weight)| weight).sum::<f32>() / 2.0;
        let mut sum = 0.0;
        let middle = values.iter().find(|(_, weight)| {
            sum += weight;
            sum >= half
        });
        middle.map_or(0.0, |(value, _)| *value)
    };
    Point2f::new(of(|vector| vector.x), of(|vector| vector.y))
}

/// The mean of some vectors: `None` of nothing.
pub(super) fn mean(vectors: impl Iterator<Item = Point2f>) -> Option<Point2f> {
    let (sum, count) = vectors.fold((Point2f::default(), 0_u16), |(sum, n), v| (sum + v, n + 1));
    (count > 0).then(|| sum / f32::from(count))
}

/// The size of the frame, which is all that is needed between pixels and normalised coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub width: f32,
    pub height: f32,
}

impl Frame {
    pub fn bounds(self) -> Rect2f {
        Rect2f::new(0.0, 0.0, self.width, self.height)
    }

    /// Which sides of a box (left, top, right, bottom) the frame cuts off.
    pub fn cut_sides(self, bounds: Rect2f) -> [bool; 4] {
        const EDGE: f32 = 2.0;
        let end = bounds.br();
        [bounds.x < EDGE, bounds.y < EDGE, end.x > self.width - EDGE, end.y > self.height - EDGE]
    }

    pub fn point_to_pixels(self, point: Point) -> Point2f {
        Point2f::new(point.x as f32 * self.width, point.y as f32 * self.height)
    }

    pub fn rect_to_pixels(self, rect: Rect) -> Rect2f {
        let corner = self.point_to_pixels(Point { x: rect.x, y: rect.y });
        Rect2f::new(corner.x, corner.y, rect.width as f32 * self.width, rect.height as f32 * self.height)
    }

    pub fn point(self, pixels: Point2f) -> Point {
        Point { x: f64::from(pixels.x / self.width), y: f64::from(pixels.y / self.height) }
    }

    pub fn vector(self, pixels: Point2f) -> Vector {
        Vector { x: f64::from(pixels.x / self.width), y: f64::from(pixels.y / self.height) }
    }

    pub fn rect(self, pixels: Rect2f) -> Rect {
        let corner = self.point(pixels.tl());
        let size = self.vector(pixels.br() - pixels.tl());
        Rect { x: corner.x, y: corner.y, width: size.x, height: size.y }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlap_of_boxes() {
        let a = Rect2f::new(0.0, 0.0, 10.0, 10.0);
        assert_eq!(overlap(a, a), 1.0);
        assert!((overlap(a, Rect2f::new(5.0, 0.0, 10.0, 10.0)) - 1.0 / 3.0).abs() < 1e-6);
        assert_eq!(overlap(a, Rect2f::new(20.0, 0.0, 10.0, 10.0)), 0.0);
        assert_eq!(overlap(Rect2f::default(), Rect2f::default()), 0.0);
        assert_eq!(share_inside(Rect2f::new(-5.0, 0.0, 10.0, 10.0), a), 0.5);
    }

    #[test]
    fn the_weight_decides_the_median() {
        let vectors = [(1.0, 0.1), (1.0, 0.1), (1.0, 0.1), (5.0, 0.9)];
        let vectors = vectors.into_iter().map(|(x, weight)| (Point2f::new(x, -x), weight));
        let median = weighted_median(vectors, &mut Vec::new());
        assert_eq!(median, Point2f::new(5.0, -5.0));
        assert_eq!(weighted_median([].into_iter(), &mut Vec::new()), Point2f::default());
    }

    #[test]
    fn pixels_and_back() {
        let frame = Frame { width: 640.0, height: 480.0 };
        let rect = Rect { x: 0.25, y: 0.5, width: 0.125, height: 0.25 };
        assert_eq!(frame.rect_to_pixels(rect), Rect2f::new(160.0, 240.0, 80.0, 120.0));
        assert_eq!(frame.rect(frame.rect_to_pixels(rect)), rect);
    }
}
