// SPDX-License-Identifier: MPL-2.0

//! Which pixels a convex polygon covers, and how much of those at its edge.

use std::ops::Range;

/// Lines per row on which the polygon's extent is taken: exact sideways, quarters of a pixel upright.
const LINES: usize = 4;

/// A row of a polygon.
pub(in super::super) struct Covered<'a> {
    /// Row of the picture.
    pub row: usize,
    /// Columns the polygon touches.
    pub columns: Range<usize>,
    /// Those it covers wholly.
    pub whole: Range<usize>,
    /// Part of each touched column that it covers, 0 to 256; meaningless where it covers all.
    parts: &'a [u16],
}

impl Covered<'_> {
    /// The columns at the edge, with the part that is covered, 0 to 256.
    pub fn edges(&self) -> impl Iterator<Item = (usize, u16)> {
        let left = self.columns.start..self.whole.start;
        let right = self.whole.end..self.columns.end;
        left.chain(right).map(|column| (column, self.parts[column - self.columns.start]))
    }
}

/// An edge of the polygon, from its upper to its lower end.
struct Edge {
    top: f64,
    bottom: f64,
    x: f64,
    slope: f64,
}

/// Calls `each` with every row of a picture of `size` that the convex `polygon` touches, from the top down.
///
/// Corners in pixels whose centres are at whole numbers, either way round.
pub(in super::super) fn cover(polygon: &[(f64, f64)], size: (usize, usize), mut each: impl FnMut(Covered)) {
    let edges: Vec<Edge> = (0..polygon.len()).filter_map(|i| edge(polygon, i)).collect();
    let top = edges.iter().map(|edge| edge.top).fold(f64::INFINITY, f64::min);
    let bottom = edges.iter().map(|edge| edge.bottom).fold(f64::NEG_INFINITY, f64::max);
    let rows =
        top.floor().clamp(0.0, size.1 as f64) as usize..bottom.ceil().clamp(0.0, size.1 as f64) as usize;
    let mut parts = Vec::with_capacity(size.0);
    for row in rows {
        let extents: [(f64, f64); LINES] = std::array::from_fn(|line| {
            extent(&edges, row as f64 + (line as f64 + 0.5) / LINES as f64, size.0)
        });
        let touched = extents.iter().filter(|(left, right)| left < right);
        let (left, right) = touched.fold((f64::INFINITY, 0.0f64), |(l, r), e| (l.min(e.0), r.max(e.1)));
        if left >= right {
            continue;
        }
        let columns = left as usize..right.ceil() as usize;
        let (start, end) = extents.iter().fold((0.0f64, f64::INFINITY), |(l, r), e| (l.max(e.0), r.min(e.1)));
        let (start, end) = (start.ceil() as usize, end.floor() as usize);
        let whole = if start < end { start..end } else { columns.end..columns.end };
        parts.clear();
        parts.resize(columns.len(), 0);
        for column in (columns.start..whole.start).chain(whole.end..columns.end) {
            let x = column as f64;
            let sum: f64 = extents.iter().map(|(l, r)| (r.min(x + 1.0) - l.max(x)).max(0.0)).sum();
            parts[column - columns.start] = (sum * (256 / LINES) as f64 + 0.5) as u16;
        }
        each(Covered { row, columns, whole, parts: &parts });
    }
}

/// The edge from corner `i` to the next, with pixel `n` reaching from n to n + 1; none where it is level.
fn edge(polygon: &[(f64, f64)], i: usize) -> Option<Edge> {
    let (a, b) = (polygon[i], polygon[(i + 1) % polygon.len()]);
    let (upper, lower) = if a.1 < b.1 { (a, b) } else { (b, a) };
    let (top, bottom, x) = (upper.1 + 0.5, lower.1 + 0.5, upper.0 + 0.5);
    (bottom > top).then(|| Edge { top, bottom, x, slope: (lower.0 - upper.0) / (bottom - top) })
}

/// From where to where the line at height `y` lies inside, within 0 to `width`; the wrong way round where it does not.
fn extent(edges: &[Edge], y: f64, width: usize) -> (f64, f64) {
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    for edge in edges {
        if y >= edge.top && y < edge.bottom {
            let x = edge.x + (y - edge.top) * edge.slope;
            left = left.min(x);
            right = right.max(x);
        }
    }
    (left.max(0.0), right.min(width as f64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Parts covered of a 20 x 10 picture, and their sum in pixels.
    fn parts(polygon: &[(f64, f64)]) -> (Vec<u16>, f64) {
        let mut picture = vec![0; 200];
        cover(polygon, (20, 10), |covered| {
            picture[covered.row * 20..][covered.whole.clone()].fill(256);
            covered.edges().for_each(|(column, part)| picture[covered.row * 20 + column] = part);
        });
        let sum = picture.iter().map(|&part| f64::from(part)).sum::<f64>() / 256.0;
        (picture, sum)
    }

    #[test]
    fn a_pixel_reaches_half_a_pixel_around_its_centre() {
        let (picture, sum) = parts(&[(2.5, 3.5), (4.5, 3.5), (4.5, 4.5), (2.5, 4.5)]);
        assert_eq!((picture[4 * 20 + 3], picture[4 * 20 + 4], sum), (256, 256, 2.0));
        let (picture, sum) = parts(&[(3.0, 3.5), (4.0, 3.5), (4.0, 4.0), (3.0, 4.0)]);
        assert_eq!((picture[4 * 20 + 3], picture[4 * 20 + 4], sum), (64, 64, 0.5));
    }

    #[test]
    fn what_lies_outside_is_not_drawn() {
        assert_eq!(parts(&[(-9.0, 2.0), (-3.0, 2.0), (-3.0, 7.0)]).1, 0.0);
        assert_eq!(parts(&[(3.0, 12.0), (9.0, 12.0), (9.0, 70.0)]).1, 0.0);
        assert_eq!(parts(&[(-99.0, -99.0), (99.0, -99.0), (99.0, 99.0), (-99.0, 99.0)]).1, 200.0);
    }

    proptest! {
        #[test]
        fn as_much_is_covered_as_the_triangle_is_large(
            a in (1.0f64..18.0, 1.0f64..8.0), b in (1.0f64..18.0, 1.0f64..8.0), c in (1.0f64..18.0, 1.0f64..8.0),
        ) {
            let area = ((b.0 - a.0) * (c.1 - a.1) - (c.0 - a.0) * (b.1 - a.1)).abs() / 2.0;
            let (picture, sum) = parts(&[a, b, c]);
            // From nothing to its widest and back: to half a line's height exact, and each part to half a 256th.
            let height = a.1.max(b.1).max(c.1) - a.1.min(b.1).min(c.1);
            let widest = 2.0 * area / height.max(1e-9);
            let error = widest / LINES as f64 + 0.3;
            prop_assert!((sum - area).abs() <= error, "{sum} instead of {area} to {error}");
            prop_assert!(picture.iter().all(|&part| part <= 256));
        }
    }
}
