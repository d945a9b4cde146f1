// SPDX-License-Identifier: MPL-2.0

//! The least or the most of all bytes within a rectangle: erosion and dilation (thesis 3.3.1), a row at a time, so that
//! the compiler makes vector code of it.

use std::iter;
use std::mem;

use multiversion::multiversion;

/// Width and height in bytes.
type Size = (usize, usize);

/// Erosion and dilation of a plane of bytes by rectangles with odd sides. Keeps its memory for the next plane.
#[derive(Debug, Default)]
pub(super) struct Extremes {
    padded: Vec<u8>,
    closing: Vec<u8>,
    row: Vec<u8>,
}

impl Extremes {
    /// Each byte of `plane`, whose rows are `width` bytes, becomes the least around it; beyond the border there is nothing.
    pub fn erode(&mut self, plane: &mut [u8], width: usize, side: Size) {
        self.pad(plane, width, (side.0 / 2, side.1 / 2), u8::MAX);
        self.reduce(plane, width, side, least);
    }

    /// The same, the most.
    pub fn dilate(&mut self, plane: &mut [u8], width: usize, side: Size) {
        self.pad(plane, width, (side.0 / 2, side.1 / 2), u8::MIN);
        self.reduce(plane, width, side, most);
    }

    /// Dilates, then erodes, the plane on endless black: otherwise, whatever lies within half a rectangle of the border
    /// would grow to the border.
    pub fn close(&mut self, plane: &mut [u8], width: usize, side: Size) {
        let (across, down) = (2 * (side.0 / 2), 2 * (side.1 / 2));
        let rows = plane.len().checked_div(width).unwrap_or(0);
        let mut dilated = mem::take(&mut self.closing);
        dilated.clear();
        dilated.resize((width + across) * (rows + down), 0);
        self.pad(plane, width, (across, down), u8::MIN);
        self.reduce(&mut dilated, width + across, side, most);
        self.closing = mem::replace(&mut self.padded, dilated);
        self.reduce(plane, width, side, least);
    }

    /// Keeps the plane with columns and rows of `value` on all sides of it.
    fn pad(&mut self, plane: &[u8], width: usize, (across, down): Size, value: u8) {
        let rows = plane.len().checked_div(width).unwrap_or(0);
        let wide = (width + 2 * across).max(1);
        self.padded.clear();
        self.padded.resize(wide * (rows + 2 * down), value);
        let padded = self.padded.chunks_exact_mut(wide).skip(down);
        for (padded, row) in padded.zip(plane.chunks_exact(width.max(1))) {
            padded[across..across + width].copy_from_slice(row);
        }
    }

    /// Leaves in `out`, whose rows are `width` bytes, what the rectangles come to that lie wholly in what was padded.
    fn reduce(&mut self, out: &mut [u8], width: usize, side: Size, combine: fn(&mut [u8], &[u8])) {
        let wide = width + side.0 - 1;
        let rows = self.padded.len() / wide.max(1);
        for distance in distances(side.1) {
            for y in 0..rows.saturating_sub(distance) {
                let (before, after) = self.padded.split_at_mut((y + distance) * wide);
                combine(&mut before[y * wide..][..wide], &after[..wide]);
            }
        }
        for (out, row) in out.chunks_exact_mut(width.max(1)).zip(self.padded.chunks_exact_mut(wide.max(1))) {
            for distance in distances(side.0) {
                self.row.clear();
                self.row.extend_from_slice(&row[distance..]);
                combine(row, &self.row);
            }
            out.copy_from_slice(&row[..width]);
        }
    }
}

/// From where, one after the other, a line is to be combined with itself, so that each byte stands for `side` bytes: for two,
/// four, eight ... of them, then for all.
fn distances(side: usize) -> impl Iterator<Item = usize> {
    let mut combined = 1;
    iter::from_fn(move || {
        let distance = combined.min(side.saturating_sub(combined));
        combined += distance;
        (distance > 0).then_some(distance)
    })
}

/// Each byte becomes the lesser of it and its counterpart.
#[multiversion(targets("x86_64+avx2"))]
fn least(bytes: &mut [u8], others: &[u8]) {
    bytes.iter_mut().zip(others).for_each(|(byte, other)| *byte = (*byte).min(*other));
}

/// Each byte becomes the greater of it and its counterpart.
#[multiversion(targets("x86_64+avx2"))]
fn most(bytes: &mut [u8], others: &[u8]) {
    bytes.iter_mut().zip(others).for_each(|(byte, other)| *byte = (*byte).max(*other));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const WIDTH: usize = 13;

    /// By its definition, with `beyond` around the plane.
    fn extreme(plane: &[u8], side: Size, beyond: u8, extreme: fn(u8, u8) -> u8) -> Vec<u8> {
        let rows = (plane.len() / WIDTH) as isize;
        let at = |x: isize, y: isize| {
            let inside = (0..WIDTH as isize).contains(&x) && (0..rows).contains(&y);
            if inside { plane[y as usize * WIDTH + x as usize] } else { beyond }
        };
        let (across, down) = ((side.0 / 2) as isize, (side.1 / 2) as isize);
        (0..plane.len() as isize)
            .map(|index| {
                let (x, y) = (index % WIDTH as isize, index / WIDTH as isize);
                let around =
                    (y - down..=y + down).flat_map(|v| (x - across..=x + across).map(move |u| (u, v)));
                around.map(|(u, v)| at(u, v)).reduce(extreme).unwrap()
            })
            .collect()
    }

    proptest! {
        #[test]
        fn they_are_what_their_definition_says(
            plane in proptest::collection::vec(any::<u8>(), 7 * WIDTH), across in 0usize..5, down in 0usize..7,
        ) {
            let side = (2 * across + 1, 2 * down + 1);
            let (mut extremes, mut eroded, mut dilated) = (Extremes::default(), plane.clone(), plane.clone());
            extremes.erode(&mut eroded, WIDTH, side);
            extremes.dilate(&mut dilated, WIDTH, side);
            prop_assert_eq!(eroded, extreme(&plane, side, u8::MAX, u8::min));
            prop_assert_eq!(dilated, extreme(&plane, side, u8::MIN, u8::max));
        }
    }

    #[test]
    fn nothing_is_nothing() {
        let mut extremes = Extremes::default();
        extremes.erode(&mut [], 0, (3, 3));
        extremes.close(&mut [], 5, (3, 3));
    }
}
