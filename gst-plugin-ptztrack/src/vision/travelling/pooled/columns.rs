// SPDX-License-Identifier: MPL-2.0

//! What cells of pixels show, from the sums of their columns.

use multiversion::multiversion;

use super::cell_noise::{BIN, BINS};
use super::{CELL, Row, UNKNOWN};
use crate::vision::travelling::rows::whole_part;

/// Pixels of a cell that must be known, and say nothing by themselves.
const LEAST_KNOWN: u16 = 8;

/// Differences and spreads (8.8), textures and counts of what is known, in each column of pixels.
#[derive(Debug, Default)]
pub(super) struct Columns {
    off: Vec<i32>,
    spread: Vec<i32>,
    texture: Vec<u16>,
    known: Vec<u16>,
    /// How many are foreground by themselves.
    plain: Vec<u16>,
}

impl Columns {
    pub fn clear(&mut self, width: usize) {
        for plane in [&mut self.off, &mut self.spread] {
            plane.clear();
            plane.resize(width, 0);
        }
        for plane in [&mut self.texture, &mut self.known, &mut self.plain] {
            plane.clear();
            plane.resize(width, 0);
        }
    }

    /// Adds a part of a row of pixels that begins at `start`.
    pub fn add(&mut self, background: Row, seen: &[u8], start: usize) {
        let part = start..start + seen.len();
        let (texture, known) = (&mut self.texture[part.clone()], &mut self.known[part.clone()]);
        add_plain(&mut self.plain[part.clone()], background.likelihood);
        add_spread(&mut self.spread[part.clone()], background.spread, background.likelihood);
        add_row(
            (&mut self.off[part], texture, known),
            seen,
            background.mean,
            background.range,
            background.likelihood,
        );
    }
}

/// Leaves a row of cells from the one `left` on, from the sums of the columns. What a cell differs by is the mean of its columns but for the
/// least and the greatest: a streak of rain, or an upright edge that lies a little off, is one column.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn pool(
    columns: &Columns,
    left: usize,
    off: &mut [f32],
    spread: &mut [f32],
    bin: &mut [u8],
    is_plain: &mut [bool],
) {
    let count = off.len();
    let (spread, bin, is_plain) = (&mut spread[..count], &mut bin[..count], &mut is_plain[..count]);
    let [differences, spreads] =
        [&columns.off, &columns.spread].map(|plane| &plane.as_chunks::<CELL>().0[left..][..count]);
    let [textures, knowns, plains] = [&columns.texture, &columns.known, &columns.plain]
        .map(|plane| &plane.as_chunks::<CELL>().0[left..][..count]);
    for cell in 0..count {
        let sum = |columns: &[[u16; CELL]]| columns[cell].iter().sum::<u16>();
        let (texture, known, plain) = (sum(textures), sum(knowns), sum(plains));
        let is_known = known >= LEAST_KNOWN;
        let known = f32::from(known);
        let mean = |columns: &[[i32; CELL]]| columns[cell].iter().sum::<i32>() as f32 / (256.0 * known);
        let whole = mean(differences);
        let of_columns = differences[cell]
            .iter()
            .zip(&knowns[cell])
            .map(|(&sum, &known)| if known > 0 { sum as f32 / (256.0 * f32::from(known)) } else { whole });
        off[cell] = if is_known { trimmed_mean(of_columns) } else { f32::NAN };
        spread[cell] = if is_known { mean(spreads) } else { 0.0 };
        let texture = (f32::from(texture) / known / BIN).min((BINS - 1) as f32);
        bin[cell] = if is_known { whole_part(texture) as u8 } else { 0 };
        is_plain[cell] = !is_known && plain >= LEAST_KNOWN;
    }
}

/// The mean without the least and the greatest of the means of a cell's columns (Tukey's trimmed mean).
#[inline(always)]
fn trimmed_mean(columns: impl Iterator<Item = f32>) -> f32 {
    let extremes = (f32::INFINITY, f32::NEG_INFINITY);
    let (sum, (least, most)) = columns
        .fold((0.0, extremes), |(sum, (least, most)), mean| (sum + mean, (mean.min(least), mean.max(most))));
    (sum - least - most) / (CELL - 2) as f32
}

/// Adds what is known of a row of pixels, and says nothing by itself, to the sums of the columns.
#[multiversion(targets("x86_64+avx2"))]
fn add_row(
    (off, texture, known): (&mut [i32], &mut [u16], &mut [u16]),
    seen: &[u8],
    mean: &[u16],
    range: &[u8],
    likelihood: &[u8],
) {
    let count = seen.len();
    let (off, texture, known) = (&mut off[..count], &mut texture[..count], &mut known[..count]);
    let (mean, range, likelihood) = (&mean[..count], &range[..count], &likelihood[..count]);
    for index in 0..count {
        let counts = u16::from(likelihood[index] < UNKNOWN);
        let difference = (i32::from(seen[index]) << 8) - i32::from(mean[index]);
        off[index] += difference * i32::from(counts);
        texture[index] += u16::from(range[index]) * counts;
        known[index] += counts;
    }
}

/// Counts the foreground of a row of pixels in each column.
#[multiversion(targets("x86_64+avx2"))]
fn add_plain(plain: &mut [u16], likelihood: &[u8]) {
    for (plain, &likely) in plain.iter_mut().zip(likelihood) {
        *plain += u16::from(likely > UNKNOWN);
    }
}

/// Adds the spread of what is known of a row of pixels, and says nothing by itself, to the sums of the columns.
#[multiversion(targets("x86_64+avx2"))]
fn add_spread(sums: &mut [i32], spread: &[u16], likelihood: &[u8]) {
    for (sum, (&spread, &likely)) in sums.iter_mut().zip(spread.iter().zip(likelihood)) {
        *sum += i32::from(spread) * i32::from(likely < UNKNOWN);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a cell differs by whose columns of known pixels do, before a background of 100.
    fn off(columns: [u8; CELL], likelihood: [u8; CELL]) -> f32 {
        let mean = [100 << 8; CELL];
        let background = Row { mean: &mean, spread: &[0; CELL], range: &[0; CELL], likelihood: &likelihood };
        let mut sums = Columns::default();
        sums.clear(CELL);
        (0..CELL).for_each(|_| sums.add(background, &columns, 0));
        let (mut off, mut spread, mut bin, mut is_plain) = ([0.0], [0.0], [0], [false]);
        pool(&sums, 0, &mut off, &mut spread, &mut bin, &mut is_plain);
        off[0]
    }

    #[test]
    fn a_streak_of_rain_says_nothing_and_somebody_does() {
        assert_eq!(off([100, 140, 100, 100], [0; CELL]), 0.0, "a streak");
        assert_eq!(off([94; CELL], [0; CELL]), -6.0, "somebody");
        assert_eq!(off([92, 94, 96, 94], [0; CELL]), -6.0);
    }

    #[test]
    fn columns_of_which_nothing_is_known_stand_for_the_others() {
        assert_eq!(off([104, 104, 200, 200], [0, 0, 255, 255]), 4.0);
        assert!(off([104, 200, 200, 200], [0, 255, 255, 255]).is_nan(), "too few are known");
    }
}
