// SPDX-License-Identifier: MPL-2.0

use multiversion::multiversion;

use super::{Luma, LumaError};

/// One component of a picture as it lies in memory: bytes that are `step` apart.
#[derive(Debug, Clone, Copy)]
pub struct Samples<'a> {
    bytes: Luma<'a>,
    first: usize,
    step: usize,
    width: usize,
}

impl<'a> Samples<'a> {
    /// Looks at `height` rows of `width` samples; the first one of a row is byte `first`, each next one `step`
    /// bytes (at least 1) on. Rows are `stride` bytes apart.
    pub fn new(
        data: &'a [u8],
        (width, height): (usize, usize),
        stride: usize,
        first: usize,
        step: usize,
    ) -> Result<Self, LumaError> {
        let bytes = width.saturating_sub(1) * step + first + usize::from(width > 0);
        Ok(Self { bytes: Luma::new(data, bytes, height, stride)?, first, step: step.max(1), width })
    }
}

impl<'a> From<Luma<'a>> for Samples<'a> {
    fn from(luma: Luma<'a>) -> Self {
        Self { bytes: luma, first: 0, step: 1, width: luma.width() }
    }
}

/// The colours of a picture, of any size beside its luma.
#[derive(Debug, Clone, Copy)]
pub enum Chroma<'a> {
    /// U (B−Y) and V (R−Y).
    Yuv([Samples<'a>; 2]),
    /// Red, green and blue.
    Rgb([Samples<'a>; 3]),
}

/// A picture as it lies in memory.
#[derive(Debug, Clone, Copy)]
pub struct Picture<'a> {
    /// Its luma.
    pub luma: Luma<'a>,
    /// Its colours; `None` where it has none.
    pub chroma: Option<Chroma<'a>>,
}

/// A picture made smaller: each pixel is the mean of a square of the whole one, which also averages out noise.
/// All planes are of the luma's size, rows packed.
#[derive(Debug, Default)]
pub struct Reduced {
    width: usize,
    height: usize,
    luma: Vec<u8>,
    chroma: [Vec<u8>; 2],
    /// Whether `chroma` tells anything.
    has_chroma: bool,
    /// Sums of columns.
    sums: Vec<u16>,
}

impl Reduced {
    /// The picture in the size (`width`, `height`), which is at most its own.
    pub fn fill(&mut self, picture: &Picture, (width, height): (usize, usize)) {
        (self.width, self.height) = (width, height);
        self.reduce_into(picture.luma.into(), |reduced| &mut reduced.luma);
        match picture.chroma {
            None => {}
            Some(Chroma::Yuv(planes)) => {
                for (plane, out) in planes.into_iter().zip(&mut self.chroma) {
                    reduce(plane, (width, height), &mut self.sums, out);
                }
            }
            Some(Chroma::Rgb([red, _, blue])) => {
                // Luma holds what green says: U and V of BT.601, as for the luma.
                for ((plane, weight), out) in [(blue, 0.564), (red, 0.713)].into_iter().zip(&mut self.chroma)
                {
                    reduce(plane, (width, height), &mut self.sums, out);
                    for (value, &luma) in out.iter_mut().zip(&self.luma) {
                        let difference = f32::from(*value) - f32::from(luma);
                        *value = (128.0 + weight * difference) as u8;
                    }
                }
            }
        }
        self.has_chroma = picture.chroma.is_some() && self.chroma.iter().any(|plane| has_colour(plane));
    }

    fn reduce_into(&mut self, samples: Samples, out: impl FnOnce(&mut Self) -> &mut Vec<u8>) {
        let (size, mut sums) = ((self.width, self.height), std::mem::take(&mut self.sums));
        reduce(samples, size, &mut sums, out(self));
        self.sums = sums;
    }

    /// Width and height, pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Its luma.
    pub fn luma(&self) -> Luma<'_> {
        self.plane(&self.luma)
    }

    /// Its U and V; `None` where it is grey, as a camera's pictures are by night: grey says nothing of clothes.
    pub fn chroma(&self) -> Option<[Luma<'_>; 2]> {
        let [u, v] = &self.chroma;
        self.has_chroma.then(|| [self.plane(u), self.plane(v)])
    }

    fn plane<'a>(&self, pixels: &'a [u8]) -> Luma<'a> {
        Luma::packed(pixels, self.width)
    }
}

/// How far from grey noise gets, and the least part of a picture that has a colour in a room that has any.
const GREY: u8 = 3;
const MIN_COLOURED: f64 = 0.001;

/// Whether a plane of U or V has any colour.
fn has_colour(plane: &[u8]) -> bool {
    f64::from(count_coloured(plane)) > MIN_COLOURED * plane.len() as f64
}

#[multiversion(targets("x86_64+avx2"))]
fn count_coloured(plane: &[u8]) -> u32 {
    // In each chunk the number stays below 2^16.
    let count = |chunk: &[u8]| -> u16 { chunk.iter().map(|v| u16::from(v.abs_diff(128) > GREY)).sum() };
    plane.chunks(1 << 15).map(|chunk| u32::from(count(chunk))).sum()
}

/// Means of rectangles of `samples`, `size` of them; where that is more than there are, the nearest sample.
fn reduce(samples: Samples, (width, height): (usize, usize), sums: &mut Vec<u16>, out: &mut Vec<u8>) {
    let (columns, rows) = (samples.width, samples.bytes.height());
    if columns == 0 || rows == 0 || width == 0 {
        out.clear();
    }
    // What is left of the picture before is written over.
    out.resize(width * height, 0);
    if columns == 0 || rows == 0 || width == 0 {
        return;
    }
    if samples.step == 1 && (width, height) == (columns, rows) {
        for (y, out) in out.chunks_exact_mut(width).enumerate() {
            out.copy_from_slice(samples.bytes.row(y));
        }
        return;
    }
    if (width, height) == (2 * columns, 2 * rows) {
        for (y, out) in out.chunks_exact_mut(2 * width).enumerate() {
            let (upper, lower) = out.split_at_mut(width);
            let values = samples.bytes.row(y).iter().skip(samples.first).step_by(samples.step);
            for (pair, &value) in upper.as_chunks_mut::<2>().0.iter_mut().zip(values) {
                *pair = [value; 2];
            }
            lower.copy_from_slice(upper);
        }
        return;
    }
    let side = columns / width;
    if samples.bytes.width() == side * width && rows == side * height && [2, 4].contains(&side) {
        for (y, out) in out.chunks_exact_mut(width).enumerate() {
            let row = |index: usize| samples.bytes.row(side * y + index);
            if side == 2 { pairs([0, 1].map(row), out) } else { quads([0, 1, 2, 3].map(row), out) }
        }
        return;
    }
    let span = |at: usize, count: usize, of: usize| {
        let (first, next) = (at * of / count, (at + 1) * of / count);
        (first.min(of - 1), next.max(first + 1).min(of))
    };
    let spans: Vec<(usize, usize)> = (0..width).map(|x| span(x, width, columns)).collect();
    let uniform = (samples.step == 1 && columns % width == 0).then(|| columns / width);
    for (y, out) in out.chunks_exact_mut(width).enumerate() {
        let (top, bottom) = span(y, height, rows);
        add_rows(samples.bytes, top, bottom, sums);
        match uniform {
            Some(1) => means::<1>(sums, bottom - top, out),
            Some(3) => means::<3>(sums, bottom - top, out),
            Some(6) => means::<6>(sums, bottom - top, out),
            _ => {
                for (value, &(left, right)) in out.iter_mut().zip(&spans) {
                    let columns = (left..right).map(|x| u32::from(sums[samples.first + x * samples.step]));
                    let count = ((bottom - top) * (right - left)) as u32;
                    *value = ((columns.sum::<u32>() + count / 2) / count) as u8;
                }
            }
        }
    }
}

/// Sums of the columns of some rows: at most 257 fit.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn add_rows(bytes: Luma, top: usize, bottom: usize, sums: &mut Vec<u16>) {
    sums.clear();
    sums.extend(bytes.row(top).iter().map(|&byte| u16::from(byte)));
    for y in top + 1..bottom.min(top + 257) {
        sums.iter_mut().zip(bytes.row(y)).for_each(|(sum, &byte)| *sum += u16::from(byte));
    }
}

/// Means of squares of two a side, whose pixels lie beside each other in a word: nothing is shuffled.
#[multiversion(targets("x86_64+avx2"))]
fn pairs(rows: [&[u8]; 2], out: &mut [u8]) {
    let sum = |bytes: &[u8; 2]| {
        let word = u16::from_le_bytes(*bytes);
        (word & 0xff) + (word >> 8)
    };
    let [above, below] = rows.map(|row| row.as_chunks().0);
    for (out, (above, below)) in out.iter_mut().zip(above.iter().zip(below)) {
        *out = ((sum(above) + sum(below) + 2) >> 2) as u8;
    }
}

/// Means of squares of four a side.
#[multiversion(targets("x86_64+avx2"))]
fn quads(rows: [&[u8]; 4], out: &mut [u8]) {
    // Two sums in one word: they stay below 2^16.
    let sums = |bytes: &[u8; 4]| {
        let word = u32::from_le_bytes(*bytes);
        (word & 0x00ff_00ff) + ((word >> 8) & 0x00ff_00ff)
    };
    let [a, b, c, d] = rows.map(|row| row.as_chunks().0);
    for (out, ((a, b), (c, d))) in out.iter_mut().zip(a.iter().zip(b).zip(c.iter().zip(d))) {
        let sum = sums(a) + sums(b) + sums(c) + sums(d);
        *out = (((sum & 0xffff) + (sum >> 16) + 8) >> 4) as u8;
    }
}

/// Means of `N` columns of `rows` rows each.
#[multiversion(targets("x86_64+avx2"))]
fn means<const N: usize>(sums: &[u16], rows: usize, out: &mut [u8]) {
    let count = (N * rows) as u32;
    // Rounded up, so that the mean of equal values is exact.
    let reciprocal = (1u32 << 16).div_ceil(count);
    for (value, columns) in out.iter_mut().zip(sums.as_chunks::<N>().0) {
        let sum: u32 = columns.iter().map(|&sum| u32::from(sum)).sum();
        *value = (((sum + count / 2) * reciprocal) >> 16).min(255) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn reduced(samples: Samples, size: (usize, usize)) -> Vec<u8> {
        let (mut sums, mut out) = (Vec::new(), Vec::new());
        reduce(samples, size, &mut sums, &mut out);
        out
    }

    #[test]
    fn squares_are_averaged() {
        let data = [10, 20, 100, 100, 30, 40, 100, 104];
        let luma = Luma::new(&data, 4, 2, 4).unwrap();
        assert_eq!(reduced(luma.into(), (2, 1)), [25, 101]);
    }

    #[test]
    fn interleaved_and_small_planes_fill_the_same_size() {
        let data = [1, 200, 3, 220];
        let v = Samples::new(&data, (2, 1), 4, 1, 2).unwrap();
        assert_eq!(reduced(v, (4, 2)), [200, 200, 220, 220, 200, 200, 220, 220]);
        assert_eq!(reduced(v, (1, 1)), [210]);
    }

    #[test]
    fn colours_of_rgb_are_those_of_yuv() {
        // Red: Y 76, U 85, V 255 in full range.
        let data = [255, 0, 0].repeat(4);
        let rgb = [0, 1, 2].map(|first| Samples::new(&data, (4, 1), 12, first, 3).unwrap());
        let luma = [76; 4];
        let picture = Picture { luma: Luma::new(&luma, 4, 1, 4).unwrap(), chroma: Some(Chroma::Rgb(rgb)) };
        let mut reduced = Reduced::default();
        reduced.fill(&picture, (2, 1));
        let [u, v] = reduced.chroma().unwrap();
        assert_eq!((u.row(0), v.row(0)), (&[85, 85][..], &[255, 255][..]));
        let grey = Picture { chroma: None, ..picture };
        reduced.fill(&grey, (2, 1));
        assert!(reduced.chroma().is_none());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn means_follow_their_definition(
            data in proptest::collection::vec(any::<u8>(), 48 * 24), divisor in 1usize..9, padding in 0usize..5,
        ) {
            let luma = Luma::new(&data, 48 - padding, 24, 48).unwrap();
            let (width, height) = ((48 - padding) / divisor, 24 / divisor);
            let luma = luma.crop(0, 0, width * divisor, height * divisor);
            for (index, pixel) in reduced(luma.into(), (width, height)).into_iter().enumerate() {
                let (x, y) = (index % width * divisor, index / width * divisor);
                let sum: u32 = (y..y + divisor)
                    .map(|y| luma.row(y)[x..x + divisor].iter().map(|p| u32::from(*p)).sum::<u32>())
                    .sum();
                let mean = f64::from(sum) / (divisor * divisor) as f64;
                prop_assert!((f64::from(pixel) - mean).abs() <= 1.0);
            }
        }
    }
}
