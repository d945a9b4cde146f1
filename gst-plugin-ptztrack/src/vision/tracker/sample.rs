// SPDX-License-Identifier: MPL-2.0

//! A part of a picture at another size.

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

/// Samples parts of pictures, and keeps its memory for the next one.
#[derive(Debug, Clone, Default)]
pub(super) struct Sampler {
    across: Vec<Column>,
    down: Vec<Tap>,
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
        // Taking one pixel of many would see patterns that are not there: take up to 3x3 and average them.
        match (area.width / width as f32).round().clamp(1.0, 3.0) as usize {
            1 => self.average::<1>(luma, area, width, height, pixels),
            2 => self.average::<2>(luma, area, width, height, pixels),
            _ => self.average::<3>(luma, area, width, height, pixels),
        }
    }

    /// The same with `FINE` x `FINE` samples for each pixel.
    fn average<const FINE: usize>(
        &mut self,
        luma: &Luma,
        area: Rect2f,
        width: usize,
        height: usize,
        pixels: &mut [u8],
    ) {
        let Self { across, down, sums, pairs } = self;
        let taps = |start: f32, length: f32, count: usize, size: usize| {
            let step = length / (count * FINE) as f32;
            (0..count * FINE).map(move |index| Tap::at(index, start, step, size))
        };
        let columns = taps(area.x, area.width, width, luma.width());
        let (Some(first), Some(last)) = (columns.clone().next(), columns.clone().next_back()) else { return };
        if luma.width() * luma.height() == 0 {
            return;
        }
        let (left, right) = (first.before, last.after(luma.width()) + 1);
        across.clear();
        across.extend(columns.map(|tap| Column::of(tap, left)));
        down.clear();
        down.extend(taps(area.y, area.height, height, luma.height()));
        // One more, of which nothing is taken, beyond the border.
        sums.resize(right - left + 1, 0);
        pairs.resize(right - left, 0);
        for (row, taps) in pixels.chunks_exact_mut(width).zip(down.as_chunks::<FINE>().0) {
            sums.fill(0);
            for tap in taps {
                let (upper, lower) = (luma.row(tap.before), luma.row(tap.after(luma.height())));
                add(sums, &upper[left..right], &lower[left..right], tap.part);
            }
            pair(sums, pairs);
            average::<FINE>(row, pairs, across);
        }
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
