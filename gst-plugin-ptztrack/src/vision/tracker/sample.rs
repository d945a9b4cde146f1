// SPDX-License-Identifier: MPL-2.0

//! A part of a picture at another size.

use std::ops::Range;

use multiversion::multiversion;
use opencv::core::Rect2f;

use crate::vision::Luma;

/// Parts of a pixel that samples are taken at.
const PARTS: u16 = 64;

/// Where a sample lies: from the middle of pixel `before`, `part` sixty-fourths of the way to that of the next.
#[derive(Debug, Clone, Copy)]
struct Tap {
    before: usize,
    part: u16,
}

impl Tap {
    /// The `index`th of samples that are `step` pixels apart, the first of which lies `step / 2` after `start`. The border
    /// of the picture, of `size` pixels, is repeated: then nothing is taken of the next pixel.
    fn at(index: usize, start: f32, step: f32, size: usize) -> Self {
        let last = size.saturating_sub(1);
        let place = (start + (index as f32 + 0.5) * step - 0.5).clamp(0.0, last as f32);
        let before = (place as usize).min(last);
        let part = ((place - before as f32) * f32::from(PARTS)).round() as u16;
        Self { before, part }
    }

    fn after(self, size: usize) -> usize {
        (self.before + 1).min(size.saturating_sub(1))
    }
}

/// A sample between two columns: the number of their pair, and by how much each of both counts, in one word.
#[derive(Debug, Clone, Copy)]
struct Column {
    pair: usize,
    weights: u64,
}

impl Column {
    /// The weights stand the other way round than what they are multiplied with: the upper half of the product of two such
    /// words is then what the sample comes to, and the lower half too small to reach there, even of a few of them.
    fn of(tap: Tap, left: usize) -> Self {
        let weights = u64::from(PARTS - tap.part) << 32 | u64::from(tap.part);
        Self { pair: tap.before - left, weights }
    }

    fn sample(self, pairs: &[u64]) -> u64 {
        pairs[self.pair].wrapping_mul(self.weights)
    }
}

/// Which part of a picture of that size is sampled, and so many samples across and down.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Part {
    area: Rect2f,
    samples: (usize, usize),
    size: (usize, usize),
}

/// Samples parts of pictures, and keeps its memory for the next one.
#[derive(Debug, Clone, Default)]
pub(super) struct Sampler {
    /// Where samples lie: mostly the same part of a few planes is sampled.
    part: Option<Part>,
    across: Vec<Column>,
    down: Vec<Tap>,
    /// The columns of pixels that samples lie between.
    columns: Range<usize>,
    sums: Vec<u16>,
    /// Each sum with the next one.
    pairs: Vec<u64>,
}

impl Sampler {
    /// Leaves in `pixels` `area` of the picture at `width` x `height`, rows packed, bilinear, the border repeated where it leaves
    /// the picture.
    pub fn sample(
        &mut self,
        luma: &Luma,
        area: Rect2f,
        (width, height): (usize, usize),
        pixels: &mut Vec<u8>,
    ) {
        pixels.clear();
        pixels.resize(width * height, 0);
        let size = (luma.width(), luma.height());
        if size.0 * size.1 * pixels.len() == 0 {
            return;
        }
        let part = Part { area, samples: (width, height), size };
        // Taking one pixel of many would see patterns that are not there: take up to 3x3 and average them.
        match (area.width / width as f32).round().clamp(1.0, 3.0) as usize {
            1 => self.average::<1>(luma, part, pixels),
            2 => self.average::<2>(luma, part, pixels),
            _ => self.average::<3>(luma, part, pixels),
        }
    }

    /// The same with `FINE` x `FINE` samples for each pixel.
    fn average<const FINE: usize>(&mut self, luma: &Luma, part: Part, pixels: &mut [u8]) {
        if self.part.replace(part) != Some(part) {
            self.place::<FINE>(part);
        }
        let Self { across, down, columns, sums, pairs, .. } = self;
        for (row, taps) in pixels.chunks_exact_mut(part.samples.0).zip(down.as_chunks::<FINE>().0) {
            sums.fill(0);
            for tap in taps {
                let (upper, lower) = (luma.row(tap.before), luma.row(tap.after(luma.height())));
                add(sums, &upper[columns.clone()], &lower[columns.clone()], tap.part);
            }
            pair(sums, pairs);
            average::<FINE>(row, pairs, across);
        }
    }

    /// Finds where the samples of a part lie.
    fn place<const FINE: usize>(&mut self, Part { area, samples, size }: Part) {
        let taps = |start: f32, length: f32, count: usize, size: usize| {
            let step = length / (count * FINE) as f32;
            (0..count * FINE).map(move |index| Tap::at(index, start, step, size))
        };
        let columns = taps(area.x, area.width, samples.0, size.0);
        let (first, last) = (columns.clone().next(), columns.clone().next_back());
        let left = first.map_or(0, |tap| tap.before);
        self.columns = left..last.map_or(left, |tap| tap.after(size.0) + 1);
        self.across.clear();
        self.across.extend(columns.map(|tap| Column::of(tap, left)));
        self.down.clear();
        self.down.extend(taps(area.y, area.height, samples.1, size.1));
        // One more, of which nothing is taken, beyond the border.
        self.sums.resize(self.columns.len() + 1, 0);
        self.pairs.resize(self.columns.len(), 0);
    }
}

/// Averages the samples of a row of pixels, from the sums of their columns.
fn average<const FINE: usize>(row: &mut [u8], pairs: &[u64], across: &[Column]) {
    let scale = (FINE * FINE) as u32 * u32::from(PARTS) * u32::from(PARTS);
    for (pixel, columns) in row.iter_mut().zip(across.as_chunks::<FINE>().0) {
        let sum = columns.iter().fold(0, |sum, column| column.sample(pairs).wrapping_add(sum));
        *pixel = (((sum >> 32) as u32 + scale / 2) / scale) as u8;
    }
}

/// Takes each sum and the next one into one word.
#[multiversion(targets("x86_64+avx2"))]
fn pair(sums: &[u16], pairs: &mut [u64]) {
    for (pair, (&sum, &next)) in pairs.iter_mut().zip(sums.iter().zip(sums.iter().skip(1))) {
        *pair = u64::from(next) << 32 | u64::from(sum);
    }
}

/// Adds what lies `part` of the way from one row to the next.
#[multiversion(targets("x86_64+avx2"))]
fn add(sums: &mut [u16], upper: &[u8], lower: &[u8], part: u16) {
    for (sum, (&upper, &lower)) in sums.iter_mut().zip(upper.iter().zip(lower)) {
        *sum += u16::from(upper) * (PARTS - part) + u16::from(lower) * part;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIZE: (usize, usize) = (60, 40);

    fn sample(luma: &Luma, area: Rect2f, width: usize, height: usize) -> Vec<u8> {
        let mut pixels = Vec::new();
        Sampler::default().sample(luma, area, (width, height), &mut pixels);
        pixels
    }

    proptest! {
        #[test]
        fn a_slope_stays_one_at_any_size(
            x in 0.5..20.0f32, y in 0.5..15.0f32, across in 0.3..2.9f32, down in 0.3..2.9f32,
        ) {
            let slope = |x: f32, y: f32| 20.0 + 2.0 * x + 1.5 * y;
            let pixels: Vec<u8> = (0..SIZE.0 * SIZE.1)
                .map(|index| slope((index % SIZE.0) as f32 + 0.5, (index / SIZE.0) as f32 + 0.5) as u8)
                .collect();
            let (width, height) = (12, 8);
            let area = Rect2f::new(x, y, across * width as f32, down * height as f32);
            let sampled = sample(&Luma::packed(&pixels, SIZE.0), area, width, height);
            for (index, pixel) in sampled.into_iter().enumerate() {
                let middle = ((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
                let expected = slope(x + middle.0 * across, y + middle.1 * down);
                prop_assert!((f32::from(pixel) - expected).abs() < 2.0, "{pixel} for {expected}");
            }
        }

        #[test]
        fn beyond_the_border_it_is_repeated(x in -90.0..90.0f32, y in -90.0..90.0f32, side in 0.1..200.0f32) {
            let pixels = [77; SIZE.0 * SIZE.1];
            let sampled = sample(&Luma::packed(&pixels, SIZE.0), Rect2f::new(x, y, side, side), 5, 7);
            prop_assert_eq!(sampled, vec![77; 35]);
        }
    }
}
