// SPDX-License-Identifier: MPL-2.0

//! How much of each pixel a shape covers: strokes, discs and letters before they have a colour.

use std::ops::Range;

use multiversion::multiversion;
use opencv::core::Rect;

use super::Spot;

/// Pixels of a row that are passed over together: most of an area is empty.
pub(super) const TOGETHER: usize = 16;
/// Rows have room for so many blocks times that: then blocks of reduced ones are whole, too.
const ROOM: usize = 4;

/// How much of each of some pixels side by side is covered: 0 to 255.
pub(super) type Block = [u8; TOGETHER];

/// A rim, and what lies on it.
pub(super) const LAYERS: usize = 2;
/// What has no rim lies here.
pub(super) const BARE: usize = 0;

/// How much of each pixel of an area each of two layers covers, which cover much the same blocks of pixels. Only blocks that something may
/// cover are ever looked at: the outline of a box covers few of those that lie within it.
#[derive(Debug, Default)]
pub(super) struct Coverage {
    area: Rect,
    /// Blocks from a row to the next.
    stride: usize,
    blocks: Vec<[Block; LAYERS]>,
    is_touched: Vec<bool>,
    /// Those that may cover something: the others are nought.
    touched: Vec<Place>,
}

/// Which block of which row, and which of all.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub y: usize,
    pub block: usize,
    index: usize,
}

impl Coverage {
    /// Nothing of `area` is covered.
    pub fn clear(&mut self, area: Rect) {
        for &Place { index, .. } in &self.touched {
            (self.blocks[index], self.is_touched[index]) = ([[0; TOGETHER]; LAYERS], false);
        }
        self.touched.clear();
        (self.area, self.stride) = (area, 0);
        self.stride = self.width().div_ceil(TOGETHER).next_multiple_of(ROOM);
        let needed = self.blocks.len().max(self.stride * self.height());
        self.blocks.resize(needed, [[0; TOGETHER]; LAYERS]);
        self.is_touched.resize(needed, false);
    }

    /// Covers `area` in one layer.
    pub fn fill(&mut self, area: Rect, layer: usize) {
        let inside = area & self.area;
        if inside.empty() {
            return;
        }
        let (left, top) = ((inside.x - self.area.x) as usize, (inside.y - self.area.y) as usize);
        let columns = left..left + inside.width as usize;
        for block in blocks_of(&columns) {
            let covered: Block =
                std::array::from_fn(
                    |index| {
                        if columns.contains(&(block * TOGETHER + index)) { u8::MAX } else { 0 }
                    },
                );
            for y in top..top + inside.height as usize {
                let pixels = &mut self.touch(y, block)[layer];
                pixels.iter_mut().zip(covered).for_each(|(pixel, covered)| *pixel |= covered);
            }
        }
    }

    /// The pixels that it is about.
    pub fn area(&self) -> Rect {
        self.area
    }

    fn width(&self) -> usize {
        self.area.width.max(0) as usize
    }

    fn height(&self) -> usize {
        self.area.height.max(0) as usize
    }

    /// All of the pixels of a layer, row after row.
    #[cfg(test)]
    pub fn bytes(&self, layer: usize) -> Vec<u8> {
        let row = |y: usize| &self.blocks[y * self.stride..][..self.stride];
        let pixels = |y| row(y).iter().flat_map(|block| block[layer]).take(self.width());
        (0..self.height()).flat_map(pixels).collect()
    }

    /// A block, to be covered.
    #[inline(always)]
    fn touch(&mut self, y: usize, block: usize) -> &mut [Block; LAYERS] {
        let index = y * self.stride + block;
        if !std::mem::replace(&mut self.is_touched[index], true) {
            self.touched.push(Place { y, block, index });
        }
        &mut self.blocks[index]
    }

    /// The blocks of which anything may be covered. The last of a row may reach beyond the area, where nothing is.
    pub fn touched(&self) -> impl Iterator<Item = (Place, &[Block; LAYERS])> {
        self.touched.iter().map(|place| (*place, &self.blocks[place.index]))
    }

    /// The means of blocks of pixels, `across` and `down` times halved, into `out`.
    pub fn reduce(&self, (across, down): (u32, u32), out: &mut Self) {
        match across {
            0 => reduce::<1>(self, down, out),
            1 => reduce::<2>(self, down, out),
            _ => reduce::<4>(self, down, out),
        }
    }

    /// Covers what `mask`, of which a row has `width` pixels, covers when its top left pixel lies at (`x`, `y`). It has no rim.
    pub fn add_mask(&mut self, mask: &[u8], width: usize, (x, y): (i32, i32)) {
        let (skipped, first) = ((self.area.x - x).max(0) as usize, (x - self.area.x).max(0) as usize);
        for (line, row) in mask.chunks_exact(width.max(1)).zip(y..) {
            let line = line.get(skipped..).unwrap_or_default();
            let columns = first..self.width().min(first + line.len());
            if row < self.area.y || row >= self.area.y + self.area.height || columns.is_empty() {
                continue;
            }
            let y = (row - self.area.y) as usize;
            for block in blocks_of(&columns) {
                let left = block * TOGETHER;
                let inside = columns.start.max(left)..columns.end.min(left + TOGETHER);
                let covered = &line[inside.start - first..];
                let pixels = &mut self.touch(y, block)[BARE][inside.start - left..inside.end - left];
                pixels.iter_mut().zip(covered).for_each(|(pixel, covered)| *pixel = (*pixel).max(*covered));
            }
        }
    }
}

/// The blocks that hold columns of a row.
fn blocks_of(columns: &Range<usize>) -> Range<usize> {
    columns.start / TOGETHER..columns.end.div_ceil(TOGETHER)
}

/// The means of blocks of pixels that are `SIDE` wide, and high as `down` says, into `out`.
#[multiversion(targets("x86_64+avx2"))]
fn reduce<const SIDE: usize>(coverage: &Coverage, down: u32, out: &mut Coverage) {
    let (width, height) = (coverage.width().div_ceil(SIDE), coverage.height().div_ceil(1 << down));
    out.clear(Rect::new(0, 0, width as i32, height as i32));
    for Place { y, block, .. } in &coverage.touched {
        out.touch(y >> down, block / SIDE);
    }
    let shift = SIDE.ilog2() + down;
    for &Place { y, block, index } in &out.touched {
        // Of columns first: side by side they are added once, not in each row. Below the last row nothing is covered.
        let mut sums = [[[0; TOGETHER]; LAYERS]; SIDE];
        let first = (y << down) * coverage.stride + block * SIDE;
        let rows = coverage.blocks[first..].chunks(coverage.stride).take(1 << down);
        // Copied, so that the compiler knows that the sums do not lie on them.
        for blocks in rows.map_while(|row| row.first_chunk::<SIDE>().copied()) {
            let pixels = blocks.as_flattened().as_flattened();
            for (sum, &pixel) in sums.as_flattened_mut().as_flattened_mut().iter_mut().zip(pixels) {
                *sum += u16::from(pixel);
            }
        }
        for layer in 0..LAYERS {
            let columns = sums.map(|sums| sums[layer]);
            out.blocks[index][layer] = means::<SIDE>(columns.as_flattened().as_chunks().0, shift);
        }
    }
}

/// Sums of columns, so many side by side of 2 to the power of `shift` pixels.
#[inline(always)]
fn means<const SIDE: usize>(columns: &[[u16; SIDE]], shift: u32) -> Block {
    let mut means = [0; TOGETHER];
    for (mean, columns) in means.iter_mut().zip(columns) {
        *mean = (columns.iter().sum::<u16>() >> shift) as u8;
    }
    means
}

/// The pixels that `low` to `high` touch, and at most one more, counted from `start` on, of which there are `size`.
fn limits(low: f64, high: f64, start: i32, size: usize) -> (usize, usize) {
    let limit = |value: f64| (value - f64::from(start)).clamp(0.0, size as f64) as usize;
    (limit(low), size.min(limit(high) + 1))
}

/// From a place, to `(dx, dy)` beside it.
#[derive(Debug, Clone, Copy)]
struct Stroke {
    dx: f32,
    dy: f32,
    /// One by the square of its length; 0 for a dot.
    inverse: f32,
    strength: f32,
}

impl Stroke {
    fn new((dx, dy): (f64, f64), strength: f64) -> Self {
        let square = dx * dx + dy * dy;
        let inverse = if square > 0.0 { 1.0 / square } else { 0.0 };
        Self { dx: dx as f32, dy: dy as f32, inverse: inverse as f32, strength: (255.0 * strength) as f32 }
    }

    /// How far the pixels of a block are from it, of which the first is `x` beside and `y` below its start.
    #[inline(always)]
    fn distances(self, x: f32, y: f32) -> [f32; TOGETHER] {
        let Self { dx, dy, inverse, .. } = self;
        let mut distances = [0.0; TOGETHER];
        for (index, distance) in distances.iter_mut().enumerate() {
            let x = x + index as u8 as f32;
            let along = ((x * dx + y * dy) * inverse).clamp(0.0, 1.0);
            let (aside, below) = (x - along * dx, y - along * dy);
            *distance = (aside * aside + below * below).sqrt();
        }
        distances
    }

    /// How much of the pixels is covered by what reaches so far.
    #[inline(always)]
    fn covered(self, distances: &[f32; TOGETHER], reach: f32) -> Block {
        let mut block = [0; TOGETHER];
        for (pixel, distance) in block.iter_mut().zip(distances) {
            let covered = self.strength * (reach - distance).clamp(0.0, 1.0);
            // Its lowest bits are the rounded number: a cast, which saturates, is not made into vector code.
            *pixel = (covered + 2.0_f32.powi(23)).to_bits() as u8;
        }
        block
    }
}

/// Covers in both layers what is at most so many `radii`, the larger first, from the line between two places,
/// `strength` (0 to 1) of it. What is covered already stays covered as much: strokes that meet in a corner do not show there twice.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn add_stroke(
    coverage: &mut Coverage,
    (from, to): (Spot, Spot),
    radii: [f64; LAYERS],
    strength: f64,
) {
    let (area, width, height) = (coverage.area, coverage.width(), coverage.height());
    let [reach, inner_reach] = radii.map(|radius| radius + 0.5);
    let (dx, dy) = (to.x - from.x, to.y - from.y);
    let stroke = Stroke::new((dx, dy), strength);
    let (left, right) = limits(from.x.min(to.x) - reach, from.x.max(to.x) + reach, area.x, width);
    let (top, bottom) = limits(from.y.min(to.y) - reach, from.y.max(to.y) + reach, area.y, height);
    // A slanting stroke crosses a small part of each row.
    let half = if dy == 0.0 { f64::INFINITY } else { reach * dx.hypot(dy) / dy.abs() + 1.0 };
    let slope = if dy == 0.0 { 0.0 } else { dx / dy };
    let origin = f64::from(area.x) + 0.5 - from.x;
    for y in top..bottom {
        let down = f64::from(area.y) + y as f64 + 0.5 - from.y;
        let crossing = down * slope - origin;
        let near = left.max((crossing - half) as usize);
        let far = right.min((crossing + half).min(width as f64) as usize + 1);
        for block in blocks_of(&(near..far)) {
            let first = block * TOGETHER;
            let mut distances = stroke.distances((origin + first as f64) as f32, down as f32);
            // Nothing is covered beyond the area.
            if let Some(beyond) = distances.get_mut(width - first..) {
                beyond.fill(f32::INFINITY);
            }
            let covered =
                [stroke.covered(&distances, reach as f32), stroke.covered(&distances, inner_reach as f32)];
            // What reaches less far covers nothing either.
            if covered[0].iter().fold(0, |any, covered| any | covered) == 0 {
                continue;
            }
            let pixels = coverage.touch(y, block).as_flattened_mut();
            pixels
                .iter_mut()
                .zip(covered.as_flattened())
                .for_each(|(pixel, covered)| *pixel = (*pixel).max(*covered));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn covered(area: Rect, strokes: &[(Spot, Spot, f64)]) -> Vec<Vec<u8>> {
        let mut coverage = Coverage::default();
        coverage.clear(area);
        for (from, to, radius) in strokes {
            add_stroke(&mut coverage, (*from, *to), [radius + 2.0, *radius], 1.0);
        }
        let [rim, inner] = [0, 1].map(|layer| coverage.bytes(layer));
        assert!(rim.iter().zip(&inner).all(|(rim, inner)| rim >= inner));
        inner.chunks_exact(area.width.max(1) as usize).map(<[u8]>::to_vec).collect()
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
    fn nothing_is_left_of_what_was_covered_before() {
        let (mut coverage, mut reduced) = (Coverage::default(), Coverage::default());
        for (area, fill) in [((40, 9), (3, 2, 30, 5)), ((11, 20), (0, 0, 11, 1)), ((90, 4), (70, 3, 1, 1))] {
            let (x, y, width, height) = fill;
            coverage.clear(Rect::new(0, 0, area.0, area.1));
            for layer in 0..LAYERS {
                let sum = |coverage: &Coverage| {
                    coverage.bytes(layer).iter().map(|pixel| u32::from(*pixel)).sum::<u32>()
                };
                assert_eq!(sum(&coverage), 0);
                coverage.fill(Rect::new(x, y, width, height), layer);
                coverage.reduce((1, 1), &mut reduced);
                assert_eq!(sum(&coverage), 255 * (width * height) as u32);
                assert!((4 * sum(&reduced)).abs_diff(sum(&coverage)) <= 4 * reduced.bytes(0).len() as u32);
            }
        }
        coverage.clear(Rect::new(0, 0, 90, 4));
        assert_eq!(coverage.touched().count(), 0);
    }

    #[test]
    fn a_mask_is_cut_to_the_area() {
        let mut coverage = Coverage::default();
        coverage.clear(Rect::new(5, 5, 2, 2));
        coverage.add_mask(&[1, 2, 3, 4, 5, 6, 7, 8, 9], 3, (4, 4));
        assert_eq!(coverage.bytes(BARE), [5, 6, 8, 9]);
        coverage.add_mask(&[200; 9], 3, (6, 6));
        assert_eq!(coverage.bytes(BARE), [5, 6, 8, 200]);
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
