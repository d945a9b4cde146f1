// SPDX-License-Identifier: MPL-2.0

//! Erosion and dilation (thesis 3.3.1) of a mask by rectangles: a pixel of it is white or black, so that 64 of them are one word.

use std::iter;
use std::ops::{BitAnd, BitOr};

/// Pixels of a word.
const WORD: usize = u64::BITS as usize;
/// The lowest bit of each of eight bytes.
const LOWEST: u64 = 0x0101_0101_0101_0101;

/// Width and height in pixels.
type Size = (usize, usize);

/// A mask on a canvas that is larger to its left and above it. Keeps its memory for the next mask.
#[derive(Debug, Default)]
pub(super) struct Bits {
    /// Words from a row to the next.
    stride: usize,
    words: Vec<u64>,
    size: Size,
    /// Column and row of the canvas in which the mask begins.
    origin: Size,
    /// Memory: where the mask is in a row.
    inside: Vec<u64>,
}

impl Bits {
    /// Takes a mask of 255 and 0, whose rows are `width` pixels, with room for rectangles that are so large in all.
    pub fn load(&mut self, mask: &[u8], width: usize, room: Size) {
        let height = mask.len().checked_div(width).unwrap_or(0);
        // From a whole word on.
        let before = room.0.div_ceil(WORD);
        (self.size, self.origin) = ((width, height), (before * WORD, room.1));
        self.stride = before + width.div_ceil(WORD);
        self.words.clear();
        self.words.resize(self.stride * (room.1 + height), 0);
        let rows = self.words.chunks_exact_mut(self.stride.max(1)).skip(room.1);
        for (words, row) in rows.zip(mask.chunks_exact(width.max(1))) {
            words[before..]
                .iter_mut()
                .zip(row.chunks(WORD))
                .for_each(|(word, pixels)| *word = packed(pixels));
        }
    }

    /// Leaves the mask as 255 and 0 in `mask`, which has its size.
    pub fn store(&self, mask: &mut [u8]) {
        let rows = self.words.chunks_exact(self.stride.max(1)).skip(self.origin.1);
        for (words, row) in rows.zip(mask.chunks_exact_mut(self.size.0.max(1))) {
            if is_black(words) {
                row.fill(0);
                continue;
            }
            for (index, pixels) in row.chunks_mut(WORD).enumerate() {
                unpack(farther(words, index, self.origin.0, 0), pixels);
            }
        }
    }

    /// Each pixel is white where all around it are, of which there are none beyond the border.
    pub fn erode(&mut self, side: Size) {
        self.surround(u64::MAX);
        self.reduce(side, u64::MAX, u64::bitand);
    }

    /// Each pixel is white where any around it is.
    pub fn dilate(&mut self, side: Size) {
        self.surround(0);
        self.reduce(side, 0, u64::bitor);
    }

    /// Dilates, then erodes, the mask on endless black: otherwise, whatever lies within half a rectangle of the border
    /// would grow to the border.
    pub fn close(&mut self, side: Size) {
        self.dilate(side);
        self.reduce(side, u64::MAX, u64::bitand);
    }

    /// Makes everything beyond the border white or black.
    fn surround(&mut self, colour: u64) {
        let ((left, top), (width, height)) = (self.origin, self.size);
        self.inside.clear();
        self.inside.extend((0..self.stride).map(|index| {
            let below = |column: usize| low_bits(column.saturating_sub(index * WORD));
            below(left + width) & !below(left)
        }));
        for (y, row) in self.words.chunks_exact_mut(self.stride.max(1)).enumerate() {
            let is_inside = (top..top + height).contains(&y);
            for (word, inside) in row.iter_mut().zip(&self.inside) {
                let inside = if is_inside { *inside } else { 0 };
                *word = (*word & inside) | (colour & !inside);
            }
        }
    }

    /// Combines all pixels of a rectangle in its first one; beyond the canvas all are of that `colour`.
    fn reduce(&mut self, side: Size, colour: u64, combine: fn(u64, u64) -> u64) {
        let stride = self.stride.max(1);
        for row in self.words.chunks_exact_mut(stride) {
            // Nothing in it can become white, whatever lies beyond.
            if is_black(row) {
                continue;
            }
            for distance in distances(side.0) {
                for index in 0..row.len() {
                    row[index] = combine(row[index], farther(row, index, distance, colour));
                }
            }
        }
        for distance in distances(side.1) {
            for first in 0..self.words.len().saturating_sub(distance * stride) {
                self.words[first] = combine(self.words[first], self.words[first + distance * stride]);
            }
        }
        // The first pixel of a rectangle stands for its middle.
        self.origin = (self.origin.0 - side.0 / 2, self.origin.1 - side.1 / 2);
    }
}

/// From where, one after the other, a line is to be combined with itself, so that each pixel stands for `side` of them: for two,
/// four, eight ... of them, then for all.
fn distances(side: usize) -> impl Iterator<Item = usize> {
    let mut combined = 1;
    iter::from_fn(move || {
        let distance = combined.min(side.saturating_sub(combined));
        combined += distance;
        (distance > 0).then_some(distance)
    })
}

fn is_black(words: &[u64]) -> bool {
    words.iter().all(|word| *word == 0)
}

/// The word of pixels that lie `distance` to the right of those of a word.
fn farther(row: &[u64], index: usize, distance: usize, beyond: u64) -> u64 {
    let word = |index: usize| row.get(index).copied().unwrap_or(beyond);
    let (first, shift) = (index + distance / WORD, distance % WORD);
    if shift == 0 { word(first) } else { word(first) >> shift | word(first + 1) << (WORD - shift) }
}

/// A word of which so many bits are set.
fn low_bits(count: usize) -> u64 {
    if count < WORD { (1 << count) - 1 } else { u64::MAX }
}

/// A bit for each of at most 64 pixels, the first one the lowest.
fn packed(pixels: &[u8]) -> u64 {
    let (eights, rest) = pixels.as_chunks::<8>();
    // Most of a mask is black.
    if eights.iter().fold(0, |any, eight| any | u64::from_le_bytes(*eight)) == 0
        && rest.iter().all(|pixel| *pixel == 0)
    {
        return 0;
    }
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    // The product has the lowest bit of each byte side by side at its top.
    let byte =
        |eight: &[u8; 8]| (u64::from_le_bytes(*eight) & LOWEST).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    let bytes = eights.iter().chain((!rest.is_empty()).then_some(&last));
    bytes.enumerate().fold(0, |word, (index, eight)| word | byte(eight) << (8 * index))
}

/// The way back, to as many pixels as there are.
fn unpack(word: u64, pixels: &mut [u8]) {
    if word == 0 {
        return pixels.fill(0);
    }
    for (index, pixels) in pixels.chunks_mut(8).enumerate() {
        // Of eight copies of a byte, each with another bit of it, those become 255 that are not 0.
        let bits = (((word >> (8 * index)) & 0xff) * LOWEST) & 0x8040_2010_0804_0201;
        let set = ((bits + 0x7f * LOWEST) >> 7) & LOWEST;
        pixels.copy_from_slice(&(set * 0xff).to_le_bytes()[..pixels.len()]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// By definition, in a mask with that beyond its border; `None` is what lies there.
    fn around(mask: &[u8], width: usize, side: Size, beyond: u8, pick: fn(u8, u8) -> u8) -> Vec<u8> {
        let height = mask.len() / width;
        let at = |x: isize, y: isize| {
            let inside = (0..width as isize).contains(&x) && (0..height as isize).contains(&y);
            if inside { mask[y as usize * width + x as usize] } else { beyond }
        };
        let (across, down) = ((side.0 / 2) as isize, (side.1 / 2) as isize);
        let pixel = |index: usize| {
            let (x, y) = ((index % width) as isize, (index / width) as isize);
            let near = (y - down..=y + down).flat_map(|v| (x - across..=x + across).map(move |u| (u, v)));
            near.map(|(u, v)| at(u, v)).reduce(pick).unwrap()
        };
        (0..mask.len()).map(pixel).collect()
    }

    fn after(mask: &[u8], width: usize, side: Size, what: fn(&mut Bits, Size)) -> Vec<u8> {
        let (mut bits, mut out) = (Bits::default(), vec![7; mask.len()]);
        bits.load(mask, width, (2 * (side.0 / 2), 2 * (side.1 / 2)));
        what(&mut bits, side);
        bits.store(&mut out);
        out
    }

    proptest! {
        #[test]
        fn they_are_what_their_definition_says(
            width in 1usize..150, pixels in prop::collection::vec(prop::bool::weighted(0.8), 750),
            across in 0usize..40, down in 0usize..4, is_inverted in any::<bool>(),
        ) {
            let pixels = &pixels[..pixels.len() / width * width];
            let mask: Vec<u8> = pixels.iter().map(|set| if *set != is_inverted { 255 } else { 0 }).collect();
            let side = (2 * across + 1, 2 * down + 1);
            prop_assert_eq!(after(&mask, width, (1, 1), Bits::close), mask.clone());
            prop_assert_eq!(after(&mask, width, side, Bits::erode), around(&mask, width, side, 255, u8::min));
            prop_assert_eq!(after(&mask, width, side, Bits::dilate), around(&mask, width, side, 0, u8::max));
            // On a mask with so much black around it that nothing reaches its border.
            let (wide, high) = (width + 4 * across, mask.len() / width + 4 * down);
            let mut large = vec![0; wide * high];
            let inside = |large: &[u8], y: usize| {
                large[(2 * down + y) * wide + 2 * across..][..width].to_vec()
            };
            for (y, row) in mask.chunks(width).enumerate() {
                large[(2 * down + y) * wide + 2 * across..][..width].copy_from_slice(row);
            }
            let closed = around(&around(&large, wide, side, 0, u8::max), wide, side, 0, u8::min);
            let expected: Vec<u8> = (0..mask.len() / width).flat_map(|y| inside(&closed, y)).collect();
            prop_assert_eq!(after(&mask, width, side, Bits::close), expected);
        }
    }

    #[test]
    fn nothing_is_nothing() {
        for width in [0, 5] {
            assert!(after(&[], width, (3, 3), Bits::close).is_empty());
        }
    }
}
