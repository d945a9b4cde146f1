//! Pictures sampled through a projective map.

use multiversion::multiversion;
use ptztrack_contract::{Homography, Point};

/// Side of the squares that move as a whole: within one, a camera's map is a displacement. Small enough that
/// this holds to a third of a pixel, large enough that the compiler makes vector code of a row of it.
const BLOCK: usize = 8;
/// Displacements are rounded to this part of a pixel, which also keeps a camera at rest from being resampled.
const PARTS: i32 = 16;

/// Where a block's pixels come from: whole pixels and sixteenths.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Shift {
    x: i32,
    y: i32,
    part_x: u16,
    part_y: u16,
}

/// A map worked out for every block, to be applied to several planes of one size.
#[derive(Debug, Default)]
pub(super) struct Warp {
    size: (usize, usize),
    source: (usize, usize),
    shifts: Vec<Shift>,
    /// For every row, from where to where it is covered by the source.
    spans: Vec<(usize, usize)>,
}

impl Warp {
    /// Prepares a picture of `size` whose pixels lie in one of size `source` where `to_source` (of pixels) says.
    pub fn prepare(&mut self, size: (usize, usize), source: (usize, usize), to_source: &Homography) {
        (self.size, self.source) = (size, source);
        let columns = size.0.div_ceil(BLOCK);
        let middle = |index: usize| (index * BLOCK) as f64 + (BLOCK as f64 - 1.0) / 2.0;
        self.shifts.clear();
        self.shifts.extend((0..columns * size.1.div_ceil(BLOCK)).map(|index| {
            let (x, y) = (middle(index % columns), middle(index / columns));
            let to = to_source.apply(Point { x, y });
            // `as` saturates: what goes to infinity is outside.
            let parts = |d: f64| ((d * f64::from(PARTS)).round() as i32).clamp(-1 << 24, 1 << 24);
            let (x, y) = (parts(to.x - x), parts(to.y - y));
            let part = |parts: i32| parts.rem_euclid(PARTS) as u16;
            Shift { x: x.div_euclid(PARTS), y: y.div_euclid(PARTS), part_x: part(x), part_y: part(y) }
        }));
        let spans = (0..size.1).map(|y| self.span(y)).collect();
        self.spans = spans;
    }

    /// For every row, from where to where the source covers it; outside, planes hold what they are filled with.
    pub fn spans(&self) -> &[(usize, usize)] {
        &self.spans
    }

    fn span(&self, y: usize) -> (usize, usize) {
        let mut span = (0, 0);
        for (start, end) in self.pieces(y).map(|(piece, _)| piece).filter(|piece| piece.0 < piece.1) {
            if span.0 == span.1 {
                span = (start, end);
            } else if span.1 == start {
                span.1 = end;
            }
        }
        span
    }

    /// The blocks of a row, those beside each other that move alike as one: from where to where each is covered, and its
    /// shift.
    fn pieces(&self, y: usize) -> impl Iterator<Item = ((usize, usize), Shift)> + '_ {
        let columns = self.size.0.div_ceil(BLOCK);
        let shifts = &self.shifts[y / BLOCK * columns..][..columns];
        let mut next = 0;
        shifts.chunk_by(|a, b| a == b).map(move |alike| {
            let (start, shift) = (next, alike[0]);
            let end = (start + alike.len() * BLOCK).min(self.size.0);
            next = end;
            let (width, height) = (self.source.0 as i32, self.source.1 as i32);
            let row = y as i32 + shift.y;
            if row < 0 || row + i32::from(shift.part_y > 0) >= height {
                return ((start, start), shift);
            }
            let first = (-shift.x).clamp(start as i32, end as i32);
            let last = (width - shift.x - i32::from(shift.part_x > 0)).clamp(first, end as i32);
            ((first as usize, last as usize), shift)
        })
    }

    /// Samples `source` (rows packed) bilinearly; what it does not cover becomes `fill`.
    pub fn sample(&self, source: &[u8], fill: u8, out: &mut Vec<u8>) {
        self.rows(source, fill, out, |source, shift, out| blend(source, self.source.0, shift, out));
    }

    /// The same of 16-bit numbers.
    pub fn sample_wide(&self, source: &[u16], fill: u16, out: &mut Vec<u16>) {
        self.each(source, fill, out, |source, shift| {
            let at = |index: usize| u32::from(source.get(index).copied().unwrap_or(fill));
            let (x, y) = (u32::from(shift.part_x), u32::from(shift.part_y));
            let width = self.source.0;
            let upper = at(0) * (16 - x) + if x > 0 { at(1) * x } else { 0 };
            let lower =
                if y > 0 { at(width) * (16 - x) + if x > 0 { at(width + 1) * x } else { 0 } } else { 0 };
            ((upper * (16 - y) + lower * y + 128) >> 8) as u16
        });
    }

    /// The nearest ones of numbers that cannot be mixed.
    pub fn sample_nearest(&self, source: &[u8], fill: u8, out: &mut Vec<u8>) {
        let width = self.source.0;
        self.each(source, fill, out, |source, shift| {
            let nearest = usize::from(shift.part_x >= 8) + width * usize::from(shift.part_y >= 8);
            source.get(nearest).copied().unwrap_or(fill)
        });
    }

    /// The least of all those that are mixed.
    pub fn sample_least(&self, source: &[u8], fill: u8, out: &mut Vec<u8>) {
        let width = self.source.0;
        self.each(source, fill, out, |source, shift| {
            let (right, below) = (usize::from(shift.part_x > 0), if shift.part_y > 0 { width } else { 0 });
            let mixed = [0, right, below, below + right].into_iter();
            mixed.map(|index| source.get(index).copied().unwrap_or(fill)).min().unwrap_or(fill)
        });
    }

    fn each<T: Copy>(&self, source: &[T], fill: T, out: &mut Vec<T>, pick: impl Fn(&[T], Shift) -> T) {
        self.rows(source, fill, out, |source, shift, out| {
            for (index, out) in out.iter_mut().enumerate() {
                *out = pick(&source[index..], shift);
            }
        });
    }

    /// Fills rows of pieces by `mix`, which is given the source from their first pixel on; whole pixels are only copied.
    fn rows<T: Copy>(&self, source: &[T], fill: T, out: &mut Vec<T>, mix: impl Fn(&[T], Shift, &mut [T])) {
        out.clear();
        out.resize(self.size.0 * self.size.1, fill);
        for (y, out) in out.chunks_exact_mut(self.size.0).enumerate() {
            for ((first, last), shift) in self.pieces(y).filter(|(piece, _)| piece.0 < piece.1) {
                let start = (y as i32 + shift.y) as usize * self.source.0 + (first as i32 + shift.x) as usize;
                let (source, out) = (&source[start..], &mut out[first..last]);
                if shift.part_x == 0 && shift.part_y == 0 {
                    out.copy_from_slice(&source[..out.len()]);
                } else {
                    mix(source, shift, out);
                }
            }
        }
    }
}

/// One row of a block: the weights are the same for all of it.
#[multiversion(targets("x86_64+avx2"))]
fn blend(source: &[u8], width: usize, shift: Shift, out: &mut [u8]) {
    let count = out.len();
    let (x, y) = (shift.part_x, shift.part_y);
    let weights = [(16 - x) * (16 - y), x * (16 - y), (16 - x) * y, x * y];
    // Where a weight is nothing, its row or column may lie outside.
    let (right, below) = (usize::from(x > 0), if y > 0 { width } else { 0 });
    let upper = source[..count].iter().zip(&source[right..right + count]);
    let lower = source[below..below + count].iter().zip(&source[below + right..below + right + count]);
    for (out, ((a, b), (c, d))) in out.iter_mut().zip(upper.zip(lower)) {
        let sum =
            [a, b, c, d].into_iter().zip(weights).map(|(&p, weight)| u16::from(p) * weight).sum::<u16>();
        *out = ((sum + 128) >> 8) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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
