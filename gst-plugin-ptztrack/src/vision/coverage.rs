// SPDX-License-Identifier: MPL-2.0

//! How much of each pixel a shape covers: strokes, discs and letters before they have a colour.

use multiversion::multiversion;
use opencv::core::Rect;

use super::Spot;

/// Most of an area is empty: blocks that are passed over together.
const REDUCED_TOGETHER: usize = 16;

/// How much of each pixel of an area is covered: 0 to 255.
#[derive(Debug, Default)]
pub(super) struct Coverage {
    area: Rect,
    pixels: Vec<u8>,
}

impl Coverage {
    /// Nothing of `area` is covered.
    pub fn clear(&mut self, area: Rect) {
        self.area = area;
        self.pixels.clear();
        self.pixels.resize(area.width.max(0) as usize * area.height.max(0) as usize, 0);
    }

    /// Covers `area`.
    pub fn fill(&mut self, area: Rect) {
        let (inside, width) = (area & self.area, self.area.width.max(1) as usize);
        for y in inside.y - self.area.y..inside.y - self.area.y + inside.height {
            let start = y as usize * width + (inside.x - self.area.x) as usize;
            self.pixels[start..start + inside.width as usize].fill(u8::MAX);
        }
    }

    /// The pixels that it is about.
    pub fn area(&self) -> Rect {
        self.area
    }

    /// Rows of the means of blocks of pixels, `across` and `down` times halved, into `out`.
    pub fn reduce(&self, (across, down): (u32, u32), out: &mut Vec<u8>) {
        let width = self.area.width.max(1) as usize;
        out.clear();
        let mut sums = [0_u16; REDUCED_TOGETHER];
        for rows in self.pixels.chunks(width << down) {
            for left in (0..width).step_by(REDUCED_TOGETHER << across) {
                let right = width.min(left + (REDUCED_TOGETHER << across));
                let sums = &mut sums[..(right - left).div_ceil(1 << across)];
                sums.fill(0);
                for row in rows.chunks_exact(width) {
                    let row = &row[left..right];
                    if row.iter().fold(0, |all, covered| all | covered) == 0 {
                        continue;
                    }
                    for (sum, block) in sums.iter_mut().zip(row.chunks(1 << across)) {
                        *sum += block.iter().map(|covered| u16::from(*covered)).sum::<u16>();
                    }
                }
                out.extend(sums.iter().map(|sum| (sum >> (across + down)) as u8));
            }
        }
    }

    /// Its rows from the top.
    pub fn rows(&self) -> impl Iterator<Item = &[u8]> {
        self.pixels.chunks_exact(self.area.width.max(1) as usize)
    }

    /// Covers what is at most `radius` from the line between two places, `strength` (0 to 1) of it. What is covered already
    /// stays covered as much: strokes that meet in a corner do not show there twice.
    pub fn add_stroke(&mut self, from: Spot, to: Spot, radius: f64, strength: f64) {
        let reach = radius + 0.5;
        let (dx, dy) = (to.x - from.x, to.y - from.y);
        let stroke = Stroke::new((dx, dy), reach, strength);
        let (left, right) =
            limits(from.x.min(to.x) - reach, from.x.max(to.x) + reach, self.area.x, self.area.width);
        let (top, bottom) =
            limits(from.y.min(to.y) - reach, from.y.max(to.y) + reach, self.area.y, self.area.height);
        // A slanting stroke crosses a small part of each row.
        let half = if dy == 0.0 { f64::INFINITY } else { reach * dx.hypot(dy) / dy.abs() };
        let width = self.area.width.max(1) as usize;
        for y in top..bottom {
            let down = f64::from(self.area.y) + y as f64 + 0.5 - from.y;
            let crossing = if dy == 0.0 { 0.0 } else { from.x + down * dx / dy };
            let (near, far) =
                limits(crossing - half - 1.0, crossing + half + 1.0, self.area.x, self.area.width);
            let columns = near.max(left)..far.min(right);
            if columns.is_empty() {
                continue;
            }
            let first = f64::from(self.area.x) + columns.start as f64 + 0.5 - from.x;
            let row = &mut self.pixels[y * width..][columns];
            stroke_row(row, stroke, first as f32, down as f32);
        }
    }

    /// Covers what `mask`, of which a row has `width` pixels, covers when its top left pixel lies at (`x`, `y`).
    pub fn add_mask(&mut self, mask: &[u8], width: usize, (x, y): (i32, i32)) {
        let own = self.area.width.max(1) as usize;
        for (line, row) in mask.chunks_exact(width.max(1)).zip(y..) {
            if row < self.area.y || row >= self.area.y + self.area.height {
                continue;
            }
            let start = (row - self.area.y) as usize * own;
            let pixels = &mut self.pixels[start..start + own];
            let (skipped, offset) = ((self.area.x - x).max(0) as usize, (x - self.area.x).max(0) as usize);
            let pairs = pixels.iter_mut().skip(offset).zip(line.iter().skip(skipped));
            pairs.for_each(|(pixel, covered)| *pixel = (*pixel).max(*covered));
        }
    }
}

/// From `low` to `high`, in pixels from `start` on, of which there are `size`.
fn limits(low: f64, high: f64, start: i32, size: i32) -> (usize, usize) {
    let limit = |value: f64| (value - f64::from(start)).clamp(0.0, f64::from(size.max(0))) as usize;
    (limit(low.floor()), limit(high.ceil()))
}

/// From a place, to `(dx, dy)` beside it.
#[derive(Debug, Clone, Copy)]
struct Stroke {
    dx: f32,
    dy: f32,
    /// One by the square of its length; 0 for a dot.
    inverse: f32,
    reach: f32,
    strength: f32,
}

impl Stroke {
    fn new((dx, dy): (f64, f64), reach: f64, strength: f64) -> Self {
        let square = dx * dx + dy * dy;
        let inverse = if square > 0.0 { 1.0 / square } else { 0.0 };
        let strength = (255.0 * strength) as f32;
        Self { dx: dx as f32, dy: dy as f32, inverse: inverse as f32, reach: reach as f32, strength }
    }
}

/// A row of pixels, the first of which is `x` beside and `y` below the stroke's start.
#[multiversion(targets("x86_64+avx2"))]
fn stroke_row(pixels: &mut [u8], stroke: Stroke, x: f32, y: f32) {
    let Stroke { dx, dy, inverse, reach, strength } = stroke;
    for (index, pixel) in pixels.iter_mut().enumerate() {
        let x = x + index as u16 as f32;
        let along = ((x * dx + y * dy) * inverse).clamp(0.0, 1.0);
        let (aside, below) = (x - along * dx, y - along * dy);
        let distance = (aside * aside + below * below).sqrt();
        let covered = (strength * (reach - distance).clamp(0.0, 1.0) + 0.5) as u8;
        *pixel = (*pixel).max(covered);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn covered(area: Rect, strokes: &[(Spot, Spot, f64)]) -> Vec<Vec<u8>> {
        let mut coverage = Coverage::default();
        coverage.clear(area);
        strokes.iter().for_each(|(from, to, radius)| coverage.add_stroke(*from, *to, *radius, 1.0));
        coverage.rows().map(<[u8]>::to_vec).collect()
    }

    #[test]
    fn a_stroke_along_pixels_fills_them_and_no_others() {
        let rows =
            covered(Rect::new(10, 20, 8, 4), &[(Spot { x: 12.5, y: 21.5 }, Spot { x: 15.5, y: 21.5 }, 0.5)]);
        assert_eq!(rows[1], [0, 0, 255, 255, 255, 255, 0, 0]);
        assert!(rows[0].iter().chain(&rows[2]).all(|covered| *covered == 0));
    }

    #[test]
    fn strokes_that_meet_cover_no_more_than_one() {
        let (start, middle, end) =
            (Spot { x: 1.0, y: 4.0 }, Spot { x: 5.0, y: 4.0 }, Spot { x: 9.0, y: 4.0 });
        let area = Rect::new(0, 0, 10, 8);
        assert_eq!(
            covered(area, &[(start, middle, 0.8), (middle, end, 0.8)]),
            covered(area, &[(start, end, 0.8)])
        );
    }

    #[test]
    fn a_mask_is_cut_to_the_area() {
        let mut coverage = Coverage::default();
        coverage.clear(Rect::new(5, 5, 2, 2));
        coverage.add_mask(&[1, 2, 3, 4, 5, 6, 7, 8, 9], 3, (4, 4));
        assert_eq!(coverage.rows().flatten().copied().collect::<Vec<_>>(), [5, 6, 8, 9]);
        coverage.add_mask(&[200; 9], 3, (6, 6));
        assert_eq!(coverage.rows().flatten().copied().collect::<Vec<_>>(), [5, 6, 8, 200]);
        coverage.add_mask(&[255; 9], 3, (20, -9));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn as_much_is_covered_as_the_stroke_is_large(
            (x, y) in (20.0..40.0, 20.0..40.0), (dx, dy) in (-15.0..15.0f64, -15.0..15.0f64), radius in 0.5..4.0f64,
        ) {
            let (from, to) = (Spot { x, y }, Spot { x: x + dx, y: y + dy });
            let rows = covered(Rect::new(0, 0, 60, 60), &[(from, to, radius)]);
            let area: f64 = rows.iter().flatten().map(|covered| f64::from(*covered) / 255.0).sum();
            let exact = 2.0 * radius * dx.hypot(dy) + std::f64::consts::PI * radius * radius;
            prop_assert!((area - exact).abs() < 0.12 * exact + 1.0, "{} for {}", area, exact);
        }

        #[test]
        fn any_stroke_may_leave_any_area(
            (left, top) in (-9..9, -9..9), (width, height) in (0..20, 0..20),
            ends in [-300.0..300.0, -300.0..300.0, -300.0..300.0, -300.0..300.0f64], radius in 0.0..9.0,
        ) {
            let stroke = (Spot { x: ends[0], y: ends[1] }, Spot { x: ends[2], y: ends[3] }, radius);
            let rows = covered(Rect::new(left, top, width, height), &[stroke]);
            prop_assert_eq!(rows.len(), if width == 0 { 0 } else { height as usize });
        }
    }
}
