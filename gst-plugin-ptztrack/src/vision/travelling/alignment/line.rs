// SPDX-License-Identifier: MPL-2.0

//! What each pixel of a row says of where the picture lies, in whole numbers, many at a time.

use std::ops::Range;

use multiversion::multiversion;

use super::super::model::{KNOWN, UNKNOWN};

/// Differences are taken in so many parts of a grey level, 4 bits behind the point, as whole numbers.
const PARTS: i16 = 16;
/// Grey levels beyond which a difference counts for no more than that (Huber, 1964): it may be somebody.
const MOST_OFF: f32 = 20.0;

/// Three rows of what is known and of the picture, from the one above on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rows<'a> {
    pub mean: [&'a [u16]; 3],
    pub age: [&'a [u8]; 3],
    pub seen: [&'a [u8]; 3],
    /// Of foreground, in the middle row, as the picture before told.
    pub likelihood: &'a [u8],
}

/// Numbers for each pixel of a row, each times the root of the pixel's weight, so that products of two are weighted; nought where nothing
/// is known.
#[derive(Debug, Default)]
pub(super) struct Line {
    /// One.
    root: Vec<f32>,
    /// Mean gradient of both pictures, grey levels a pixel.
    across: Vec<f32>,
    down: Vec<f32>,
    /// Grey levels by which the background is lighter than the picture.
    off: Vec<f32>,
}

impl Line {
    pub fn resize(&mut self, width: usize) {
        for plane in self.planes() {
            plane.resize(width, 0.0);
        }
    }

    /// Reads these columns, of which neither the first nor the last of a picture is one. Of all others nothing is known then.
    pub fn read(&mut self, rows: Rows, columns: Range<usize>) {
        self.forget(0..columns.start);
        self.forget(columns.end..self.root.len());
        read(self.planes().map(|plane| &mut plane[columns.clone()]), rows, columns.start);
    }

    /// Nothing is known of these columns.
    pub fn forget(&mut self, columns: Range<usize>) {
        for plane in self.planes() {
            plane[columns.clone()].fill(0.0);
        }
    }

    fn planes(&mut self) -> [&mut Vec<f32>; 4] {
        [&mut self.root, &mut self.across, &mut self.down, &mut self.off]
    }

    /// What `N` pixels say: the root of their weight, across, down and off.
    #[inline(always)]
    pub fn lanes<const N: usize>(&self, first: usize) -> Option<[&[f32; N]; 4]> {
        Some([
            self.root.get(first..)?.first_chunk()?,
            self.across.get(first..)?.first_chunk()?,
            self.down.get(first..)?.first_chunk()?,
            self.off.get(first..)?.first_chunk()?,
        ])
    }
}

/// Reads columns from `first` on.
#[multiversion(targets("x86_64+avx2"))]
fn read(line: [&mut [f32]; 4], Rows { mean, age, seen, likelihood }: Rows, first: usize) {
    let [root, across, down, off] = line;
    let count = root.len();
    let (across, down, off) = (&mut across[..count], &mut down[..count], &mut off[..count]);
    let [mean_above, mean_left, mean, mean_right, mean_below] = with_neighbours(mean, first, count);
    let [seen_above, seen_left, seen, seen_right, seen_below] = with_neighbours(seen, first, count);
    let [age_above, age_left, age, age_right, age_below] = with_neighbours(age, first, count);
    let [before, there, after] = [first - 1, first, first + 1].map(|first| &likelihood[first..][..count]);
    for i in 0..count {
        // Who was there has gone a little farther by now.
        let most = before[i].max(there[i]).max(after[i]);
        let least = age_above[i].min(age_left[i]).min(age[i]).min(age_right[i]).min(age_below[i]);
        let differs = levels(of_mean(mean[i]) - of_pixel(seen[i]));
        let weight =
            if (least >= KNOWN) & (most < UNKNOWN) { MOST_OFF / differs.abs().max(MOST_OFF) } else { 0.0 };
        root[i] = weight.sqrt();
        off[i] = root[i] * differs;
        let of_mean_across = of_mean(mean_right[i]) - of_mean(mean_left[i]);
        let of_mean_down = of_mean(mean_below[i]) - of_mean(mean_above[i]);
        // From one neighbour to the other, of both pictures.
        let gradient = 0.25 * root[i];
        across[i] = gradient * levels(of_mean_across + of_pixel(seen_right[i]) - of_pixel(seen_left[i]));
        down[i] = gradient * levels(of_mean_down + of_pixel(seen_below[i]) - of_pixel(seen_above[i]));
    }
}

/// So many of the middle row, from `first` on, with those above, to the left, to the right and below: above, left, itself, right, below.
#[inline(always)]
fn with_neighbours<T>([above, here, below]: [&[T]; 3], first: usize, count: usize) -> [&[T]; 5] {
    [
        &above[first..][..count],
        &here[first - 1..][..count],
        &here[first..][..count],
        &here[first + 1..][..count],
        &below[first..][..count],
    ]
}

#[inline(always)]
fn levels(parts: i16) -> f32 {
    f32::from(parts) * (1.0 / PARTS as f32)
}

/// Parts of a grey level.
#[inline(always)]
fn of_mean(mean: u16) -> i16 {
    (mean / (256 / PARTS as u16)) as i16
}

#[inline(always)]
fn of_pixel(seen: u8) -> i16 {
    i16::from(seen) * PARTS
}

#[cfg(test)]
mod tests {
    use proptest::array::uniform3;
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    const WIDTH: usize = 40;

    fn row<T: Clone + std::fmt::Debug>(
        value: impl Strategy<Value = T> + Clone,
    ) -> impl Strategy<Value = Vec<T>> + Clone {
        vec(value, WIDTH)
    }

    /// Means, pixels, ages and likelihoods.
    type Known = ([Vec<u16>; 3], [Vec<u8>; 3], [Vec<u8>; 3], Vec<u8>);

    /// Mostly known, and mostly background.
    fn three_rows() -> impl Strategy<Value = Known> {
        let age = prop_oneof![1 => 0..KNOWN, 19 => KNOWN..250];
        let likelihood = prop_oneof![9 => 0..UNKNOWN, 1 => UNKNOWN..=255];
        let (mean, seen) = (row(any::<u16>()), row(any::<u8>()));
        (uniform3(mean), uniform3(seen), uniform3(row(age)), row(likelihood))
    }

    proptest! {
        #[test]
        fn a_row_says_what_its_definition_says(
            before in three_rows(), now in three_rows(), start in 1..20_usize, end in 20..WIDTH, nobody in 0..WIDTH,
        ) {
            let mut line = Line::default();
            line.resize(WIDTH);
            for ((mean, seen, age, likelihood), columns) in [(&before, 1..WIDTH - 1), (&now, start..end - 1)] {
                let rows = Rows {
                    mean: mean.each_ref().map(|row| &row[..]),
                    age: age.each_ref().map(|row| &row[..]),
                    seen: seen.each_ref().map(|row| &row[..]),
                    likelihood,
                };
                line.read(rows, columns);
            }
            line.forget(nobody..nobody + 1);
            let (mean, seen, age, likelihood) = now;
            let level = |row: usize, x: usize| (f32::from(mean[row][x]) / 256.0, f32::from(seen[row][x]));
            let both = |row: usize, x: usize| level(row, x).0 + level(row, x).1;
            for x in 0..WIDTH {
                let mut said = [0.0; 4];
                if (start..end - 1).contains(&x) && x != nobody {
                    let ages = [age[0][x], age[1][x - 1], age[1][x], age[1][x + 1], age[2][x]];
                    let is_known = ages.iter().all(|age| *age >= KNOWN)
                        && likelihood[x - 1..=x + 1].iter().all(|likelihood| *likelihood < UNKNOWN);
                    let off = level(1, x).0 - level(1, x).1;
                    let weight = if is_known { 20.0 / off.abs().max(20.0) } else { 0.0 };
                    let (across, down) = (both(1, x + 1) - both(1, x - 1), both(2, x) - both(0, x));
                    said = [1.0, across / 4.0, down / 4.0, off].map(|value| weight.sqrt() * value);
                }
                let found = line.lanes::<1>(x).map(|lanes| lanes.map(|[value]| *value)).unwrap_or_default();
                // A sixteenth of a grey level tells on the weight, too.
                let is_close = found.iter().zip(said).all(|(found, said)| (found - said).abs() < 0.07 + 0.002 * said.abs());
                prop_assert!(is_close, "{:?} in place of {:?} at {}", found, said, x);
            }
        }
    }
}
