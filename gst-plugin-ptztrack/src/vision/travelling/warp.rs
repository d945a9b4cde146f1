// SPDX-License-Identifier: MPL-2.0

//! Pictures sampled through a projective map.

mod lanczos;

use std::ops::Range;

use multiversion::multiversion;
use ptztrack_contract::Homography;

pub(super) use self::lanczos::Lanczos;

/// Side of the squares that move as a whole: within one, a camera's map is a displacement. Small enough that
/// this holds to a third of a pixel, large enough that the compiler makes vector code of a row of it.
const BLOCK: usize = 8;
/// Displacements are rounded to 1/16 of a pixel, 4 bits, which also keeps a camera at rest from being resampled.
const PART_BITS: u32 = 4;
const PARTS: i32 = 1 << PART_BITS;

/// Where a block's pixels come from: whole pixels and sixteenths.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Shift {
    x: i32,
    y: i32,
    part_x: u16,
    part_y: u16,
}

/// A shift across and down in sixteenths of a pixel.
type Parts = [i32; 2];

impl From<Parts> for Shift {
    fn from([x, y]: Parts) -> Self {
        let part = |parts: i32| (parts & (PARTS - 1)) as u16;
        Self { x: x >> PART_BITS, y: y >> PART_BITS, part_x: part(x), part_y: part(y) }
    }
}

/// Blocks beside each other that move alike.
#[derive(Debug, Clone)]
struct Run {
    shift: Shift,
    /// Columns and rows of them that the source covers.
    columns: Range<usize>,
    rows: Range<usize>,
}

/// A map worked out for every block, to be applied to several planes of one size.
#[derive(Debug, Default)]
pub(super) struct Warp {
    size: (usize, usize),
    source: (usize, usize),
    /// Of one row of blocks, kept as memory.
    shifts: Vec<Parts>,
    runs: Vec<Run>,
    /// For every row, from where to where it is covered by the source.
    spans: Vec<(usize, usize)>,
}

impl Warp {
    /// Prepares a picture of `size` whose pixels lie in one of size `source` where `to_source` (of pixels) says.
    pub fn prepare(&mut self, size: (usize, usize), source: (usize, usize), to_source: &Homography) {
        (self.size, self.source) = (size, source);
        self.runs.clear();
        self.spans.clear();
        self.spans.resize(size.1, (0, 0));
        for top in (0..size.1).step_by(BLOCK) {
            self.shifts.resize(size.0.div_ceil(BLOCK), [0; 2]);
            shifts(top, to_source, &mut self.shifts);
            let mut next = 0;
            for alike in self.shifts.chunk_by(|a, b| a == b) {
                let start = next;
                next = (start + alike.len() * BLOCK).min(size.0);
                let run = covered(alike[0].into(), start..next, top..(top + BLOCK).min(size.1), source);
                if !run.columns.is_empty() && !run.rows.is_empty() {
                    self.spans[run.rows.clone()].iter_mut().for_each(|span| widen(span, &run.columns));
                    self.runs.push(run);
                }
            }
        }
    }

    /// Whether all moves by the same whole pixels, and nothing is mixed.
    pub fn is_copy(&self) -> bool {
        self.runs.iter().all(|run| run.shift == self.runs[0].shift && run.shift.is_whole())
    }

    /// For every row, from where to where the source covers it; outside, planes hold what they are filled with.
    pub fn spans(&self) -> &[(usize, usize)] {
        &self.spans
    }

    /// Samples `source` (rows packed) bilinearly; what it does not cover becomes `fill`.
    pub fn sample(&self, source: &[u8], fill: u8, out: &mut Vec<u8>) {
        self.begin(fill, out);
        blend(self, source, out);
    }

    /// The same of 16-bit numbers.
    pub fn sample_wide(&self, source: &[u16], fill: u16, out: &mut Vec<u16>) {
        self.begin(fill, out);
        blend_wide(self, source, out);
    }

    /// The nearest ones of numbers that cannot be mixed.
    pub fn sample_nearest(&self, source: &[u8], fill: u8, out: &mut Vec<u8>) {
        self.begin(fill, out);
        self.each_row(source, out, |source, shift, out| {
            let nearest = usize::from(shift.part_x >= 8) + self.source.0 * usize::from(shift.part_y >= 8);
            out.copy_from_slice(&source[nearest..][..out.len()]);
        });
    }

    /// The least of all those that are mixed.
    pub fn sample_least(&self, source: &[u8], fill: u8, out: &mut Vec<u8>) {
        self.begin(fill, out);
        self.each_row(source, out, |source, shift, out| {
            let (right, below) =
                (usize::from(shift.part_x > 0), self.source.0 * usize::from(shift.part_y > 0));
            let [a, b, c, d] = [0, right, below, below + right].map(|first| &source[first..][..out.len()]);
            for (out, ((a, b), (c, d))) in out.iter_mut().zip(a.iter().zip(b).zip(c.iter().zip(d))) {
                *out = (*a).min(*b).min(*c).min(*d);
            }
        });
    }

    /// Fills what is not covered; the rest is still to be written over.
    fn begin<T: Copy>(&self, fill: T, out: &mut Vec<T>) {
        out.resize(self.size.0 * self.size.1, fill);
        for (row, &(start, end)) in out.chunks_exact_mut(self.size.0.max(1)).zip(&self.spans) {
            row[..start].fill(fill);
            row[end..].fill(fill);
        }
    }

    /// Calls `pick` for the rows of each run, with the source from the pixel on that a shift of whole pixels leads to; where there
    /// is nothing else to a shift, pixels are only copied.
    fn each_row(&self, source: &[u8], out: &mut [u8], pick: impl Fn(&[u8], Shift, &mut [u8])) {
        for run in &self.runs {
            for y in run.rows.clone() {
                let source = &source[self.source_index(run, y)..];
                let out = &mut out[y * self.size.0..][run.columns.clone()];
                if run.shift.is_whole() {
                    out.copy_from_slice(&source[..out.len()]);
                } else {
                    pick(source, run.shift, out);
                }
            }
        }
    }

    /// Where the first pixel of a run's row lies in the source.
    #[inline(always)]
    fn source_index(&self, run: &Run, y: usize) -> usize {
        (y as i32 + run.shift.y) as usize * self.source.0 + (run.columns.start as i32 + run.shift.x) as usize
    }
}

impl Shift {
    #[inline(always)]
    fn is_whole(self) -> bool {
        self.part_x == 0 && self.part_y == 0
    }
}

/// The shifts of the blocks from row `top` on.
#[multiversion(targets("x86_64+avx2"))]
fn shifts(top: usize, to_source: &Homography, out: &mut [Parts]) {
    let middle = |first: usize| first as f64 + (BLOCK as f64 - 1.0) / 2.0;
    let y = middle(top);
    let [across, down, depth] = to_source.0.map(|[a, b, c]| (a, b * y + c));
    for (column, out) in out.iter_mut().enumerate() {
        let x = middle(column * BLOCK);
        let at = |(slope, start): (f64, f64)| slope * x + start;
        let depth = at(depth);
        *out = [parts(at(across) / depth - x), parts(at(down) / depth - y)];
    }
}

/// The nearest whole number of parts; what goes to infinity is outside. A cast, which saturates, is not made into vector code.
#[allow(clippy::manual_clamp, reason = "which lets through what is no number")]
#[inline(always)]
fn parts(pixels: f64) -> i32 {
    // So large that a number with it added has no room for fractions, and the nearest whole one in its lowest bits.
    const NO_ROOM: f64 = 1.5 * (1_u64 << 52) as f64;
    const MOST: f64 = (1 << 24) as f64;
    let parts = (pixels * f64::from(PARTS)).max(-MOST).min(MOST);
    (parts + NO_ROOM).to_bits() as i32
}

/// What of these columns and rows a source of that size covers.
fn covered(shift: Shift, columns: Range<usize>, rows: Range<usize>, source: (usize, usize)) -> Run {
    let within = |places: Range<usize>, shift: i32, part: u16, size: usize| {
        let (start, end) = (places.start as i32, places.end as i32);
        let first = (-shift).clamp(start, end);
        let last = (size as i32 - shift - i32::from(part > 0)).clamp(first, end);
        first as usize..last as usize
    };
    Run {
        shift,
        columns: within(columns, shift.x, shift.part_x, source.0),
        rows: within(rows, shift.y, shift.part_y, source.1),
    }
}

/// Takes columns into a span that they follow on.
fn widen(span: &mut (usize, usize), columns: &Range<usize>) {
    if span.0 == span.1 {
        *span = (columns.start, columns.end);
    } else if span.1 == columns.start {
        span.1 = columns.end;
    }
}

/// What can be mixed, in sixteenths of it.
trait Mixed: Copy {
    /// Holds 256 times as much.
    type Sum: Copy + Default;

    /// Sixteen times what lies `part` sixteenths of the way to `right`.
    fn across(self, right: Self, part: u16) -> Self::Sum;

    /// What lies `part` sixteenths of the way from one of those to the next.
    fn down(upper: Self::Sum, lower: Self::Sum, part: u16) -> Self;
}

impl Mixed for u8 {
    type Sum = u16;

    #[inline(always)]
    fn across(self, right: Self, part: u16) -> u16 {
        u16::from(self) * (16 - part) + u16::from(right) * part
    }

    #[inline(always)]
    fn down(upper: u16, lower: u16, part: u16) -> Self {
        ((upper * (16 - part) + lower * part + 128) >> 8) as Self
    }
}

impl Mixed for u16 {
    type Sum = u32;

    #[inline(always)]
    fn across(self, right: Self, part: u16) -> u32 {
        u32::from(self) * u32::from(16 - part) + u32::from(right) * u32::from(part)
    }

    #[inline(always)]
    fn down(upper: u32, lower: u32, part: u16) -> Self {
        ((upper * u32::from(16 - part) + lower * u32::from(part) + 128) >> 8) as Self
    }
}

/// Fills what is covered bilinearly.
#[multiversion(targets("x86_64+avx2"))]
fn blend(warp: &Warp, source: &[u8], out: &mut [u8]) {
    blend_runs(warp, source, out);
}

/// The same of 16-bit numbers.
#[multiversion(targets("x86_64+avx2"))]
fn blend_wide(warp: &Warp, source: &[u16], out: &mut [u16]) {
    blend_runs(warp, source, out);
}

#[inline(always)]
fn blend_runs<T: Mixed>(warp: &Warp, source: &[T], out: &mut [T]) {
    for run in &warp.runs {
        let Range { start, end } = run.columns;
        if run.shift.is_whole() {
            for y in run.rows.clone() {
                let first = warp.source_index(run, y);
                out[y * warp.size.0..][start..end].copy_from_slice(&source[first..first + end - start]);
            }
            continue;
        }
        let mut x = start;
        while x + 2 * BLOCK <= end {
            blend_columns::<T, { 2 * BLOCK }>(warp, run, x, source, out);
            x += 2 * BLOCK;
        }
        while x + BLOCK <= end {
            blend_columns::<T, BLOCK>(warp, run, x, source, out);
            x += BLOCK;
        }
        while x < end {
            blend_columns::<T, 1>(warp, run, x, source, out);
            x += 1;
        }
    }
}

/// `N` columns of a run, from column `x` on.
#[inline(always)]
fn blend_columns<T: Mixed, const N: usize>(warp: &Warp, run: &Run, x: usize, source: &[T], out: &mut [T]) {
    let Shift { part_x, part_y, .. } = run.shift;
    // Where a weight is nothing, its column may lie outside.
    let length = N + usize::from(part_x > 0);
    let mixed = |first: usize| across::<T, N>(source.get(first..first + length)?, part_x);
    let mut from = warp.source_index(run, run.rows.start) + (x - run.columns.start);
    let mut to = run.rows.start * warp.size.0 + x;
    let Some(mut upper) = mixed(from) else { return };
    for _ in run.rows.clone() {
        from += warp.source.0;
        // Where a weight is nothing, its row may as well.
        let lower = mixed(from).unwrap_or(upper);
        for (i, out) in out[to..to + N].iter_mut().enumerate() {
            *out = T::down(upper[i], lower[i], part_y);
        }
        (upper, to) = (lower, to + warp.size.0);
    }
}

/// Sixteen times what lies `part` sixteenths of the way from the first `N` pixels to the last.
#[inline(always)]
fn across<T: Mixed, const N: usize>(pixels: &[T], part: u16) -> Option<[T::Sum; N]> {
    let (left, right) = (pixels.first_chunk::<N>()?, pixels.last_chunk::<N>()?);
    let mut mixed = [T::Sum::default(); N];
    for (mixed, (&left, &right)) in mixed.iter_mut().zip(left.iter().zip(right)) {
        *mixed = left.across(right, part);
    }
    Some(mixed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use ptztrack_contract::Point;

    const SIZE: (usize, usize) = (37, 21);

    fn warped(map: &Homography, source: &[u8]) -> (Vec<u8>, Vec<(usize, usize)>) {
        let (mut warp, mut out) = (Warp::default(), Vec::new());
        warp.prepare(SIZE, SIZE, map);
        warp.sample(source, 9, &mut out);
        (out, warp.spans().to_vec())
    }

    #[test]
    fn at_rest_nothing_changes() {
        let source: Vec<u8> = (0..SIZE.0 * SIZE.1).map(|index| index as u8).collect();
        let (out, spans) = warped(&Homography::translation(0.02, -0.02), &source);
        assert_eq!(out, source);
        assert!(spans.iter().all(|span| *span == (0, SIZE.0)));
    }

    proptest! {
        #[test]
        fn what_moves_as_a_whole_is_mixed_as_its_definition_says(
            source in proptest::collection::vec(any::<u8>(), SIZE.0 * SIZE.1), x in -90..90i32, y in -90..90i32,
        ) {
            let parts = f64::from(PARTS);
            let map = Homography::translation(f64::from(x) / parts, f64::from(y) / parts);
            let (out, spans) = warped(&map, &source);
            let at = |x: i32, y: i32, weight: i32| {
                // What weighs nothing may lie outside.
                if weight == 0 { 0 } else { weight * i32::from(source[y as usize * SIZE.0 + x as usize]) }
            };
            let (part_x, part_y) = (x & (PARTS - 1), y & (PARTS - 1));
            for (row, (start, end)) in spans.into_iter().enumerate() {
                for column in start..end {
                    let (x, y) = (column as i32 + (x >> PART_BITS), row as i32 + (y >> PART_BITS));
                    let line = |y: i32, part: i32| at(x, y, part * (PARTS - part_x)) + at(x + 1, y, part * part_x);
                    let mixed = line(y, PARTS - part_y) + line(y + 1, part_y);
                    prop_assert_eq!(i32::from(out[row * SIZE.0 + column]), (mixed + 128) >> (2 * PART_BITS));
                }
            }
        }

        #[test]
        fn a_slope_is_sampled_between_its_pixels(x in -9.0..9.0f64, y in -9.0..9.0f64, zoom in 0.98..1.02f64) {
            let slope = |x: f64, y: f64| 60.0 + 3.0 * x + 2.0 * y;
            let source: Vec<u8> =
                (0..SIZE.0 * SIZE.1).map(|i| slope((i % SIZE.0) as f64, (i / SIZE.0) as f64) as u8).collect();
            let map = Homography([[zoom, 0.0, x], [0.0, zoom, y], [0.0, 0.0, 1.0]]);
            let (out, spans) = warped(&map, &source);
            for (row, (start, end)) in spans.into_iter().enumerate() {
                for column in 0..SIZE.0 {
                    let found = f64::from(out[row * SIZE.0 + column]);
                    if (start..end).contains(&column) {
                        let at = map.apply(Point { x: column as f64, y: row as f64 });
                        prop_assert!((found - slope(at.x, at.y)).abs() < 2.5, "{} at {},{}", found, column, row);
                    }
                }
            }
        }

        #[test]
        fn wild_maps_do_no_harm(values in proptest::array::uniform9(-1e3..1e3f64)) {
            let [a, b, c, d, e, f, g, h, i] = values;
            let map = Homography([[a, b, c], [d, e, f], [g, h, i]]);
            let (out, _) = warped(&map, &[100; SIZE.0 * SIZE.1]);
            prop_assert!(out.iter().all(|pixel| [9, 100].contains(pixel)));
        }
    }
}
