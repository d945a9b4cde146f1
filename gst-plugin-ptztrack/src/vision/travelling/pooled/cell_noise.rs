// SPDX-License-Identifier: MPL-2.0

//! What cells of the background differ by, each alone and together with those around it.

use multiversion::multiversion;

use super::Cells;
use crate::vision::travelling::noise::PER_MEAN_DEVIATION;

/// Grey levels of texture (range within a pixel, averaged over the cell) that a bin of the noise spans, and how many there are.
pub(super) const BIN: f32 = 6.0;
pub(super) const BINS: usize = 8;
/// Deviation that is believed before any was seen: grey levels, and that much more for each grey level of texture.
const START: f32 = 0.8;
const START_OF_TEXTURE: f32 = 0.1;
/// Deviations are at least those of rounding, grey levels.
const FLOOR: f32 = 0.25;
/// Weight of a picture in what is believed, and cells without which it says nothing.
const RATE: f32 = 0.05;
const MIN_CELLS: f32 = 20.0;
/// Deviations that a cell counts for at most where the noise is learned (Huber's winsorised scale, 1981): it may be somebody. If
/// such cells were left out, noise of long tails would be believed to be ever less.
const NOISE_REACH: f32 = 3.0;
/// A spread that is so many times that of others tells that somebody was there while the background was learned. What is beyond is by how
/// much its mean may be wrong, all over a cell alike.
const UNUSUAL: f32 = 1.25;
/// What a cell must say by itself, in deviations, for what it says together with those around it to count there: who is seen so is no
/// broader than they are.
const BORNE_OUT: f32 = 2.0;
/// Deviation that is believed of what they say together before any was seen, in deviations of cells that know nothing of each other;
/// those have 1.
const START_TOGETHER: f32 = 1.5;

/// Deviations of cells of the background.
#[derive(Debug)]
pub(super) struct CellNoise {
    /// By texture, grey levels.
    alone: [f32; BINS],
    /// The spread of their pixels, by texture, grey levels.
    spread: [f32; BINS],
    /// Of what a cell and those around it say together, in deviations of cells that know nothing of each other.
    together: f32,
}

impl Default for CellNoise {
    fn default() -> Self {
        let alone = std::array::from_fn(|bin| START + START_OF_TEXTURE * BIN * (bin as f32 + 0.5));
        Self { alone, spread: [START; BINS], together: START_TOGETHER }
    }
}

impl CellNoise {
    /// Tells by how many deviations the cells differ from the background, and learns from them.
    pub fn weigh(&mut self, cells: &mut Cells) {
        let mut sums = [[0.0_f32; 3]; BINS];
        let Cells { off, spread, bin, z, .. } = cells;
        for ((z, bin), (off, spread)) in z.iter_mut().zip(bin).zip(off.iter().zip(spread)) {
            if off.is_nan() {
                *z = 0.0;
                continue;
            }
            let bin = usize::from(*bin);
            let (believed, usual) = (self.alone[bin], self.spread[bin]);
            let doubt = (*spread - UNUSUAL * usual).max(0.0);
            *z = off / (believed * believed + doubt * doubt).sqrt();
            let [offs, spreads, count] = &mut sums[bin];
            *offs += off.abs().min(NOISE_REACH * believed);
            *spreads += spread.min(NOISE_REACH * usual);
            *count += 1.0;
        }
        let believed = self.alone.iter_mut().zip(&mut self.spread);
        for ((alone, spread), [offs, spreads, count]) in believed.zip(sums) {
            if count >= MIN_CELLS {
                *alone += RATE * ((PER_MEAN_DEVIATION * offs / count).max(FLOOR) - *alone);
                *spread += RATE * (spreads / count - *spread);
            }
        }
    }

    /// Lets cells say what they say together with those around them, where they bear it out and it is more, and learns from that.
    /// `together` is memory.
    pub fn weigh_together(&mut self, cells: &mut Cells, together: &mut Vec<f32>, across: usize) {
        let count = cells.z.len();
        together.clear();
        together.resize(count, 0.0);
        // Beyond the outermost nothing is known.
        for first in (0..count.saturating_sub(2 * across)).step_by(across.max(1)) {
            sum_around(&mut together[first + across..][..across], &cells.z[first..][..3 * across]);
        }
        self.learn_together(&cells.off, together);
        let scale = 1.0 / self.together;
        for (z, together) in cells.z.iter_mut().zip(&*together) {
            let together = scale * together;
            let is_more = together * *z > *z * *z;
            *z = if z.abs() >= BORNE_OUT && is_more { together } else { *z };
        }
    }

    fn learn_together(&mut self, off: &[f32], together: &[f32]) {
        let most = NOISE_REACH * self.together;
        let known = together.iter().zip(off).filter(|(_, off)| !off.is_nan());
        let (sum, count) = known.fold((0.0, 0.0_f32), |(sum, count), (together, _)| {
            (sum + together.abs().min(most), count + 1.0)
        });
        if count >= MIN_CELLS {
            self.together += RATE * ((PER_MEAN_DEVIATION * sum / count).max(1.0) - self.together);
        }
    }
}

/// What the cells of the middle of three `rows` say together with those around them, in deviations of cells that know nothing of each
/// other. What is not known says nothing.
#[multiversion(targets("x86_64+avx2"))]
fn sum_around(out: &mut [f32], rows: &[f32]) {
    let width = out.len();
    let Some(inner) = width.checked_sub(2) else { return };
    let rows = [0, 1, 2].map(|row| &rows[row * width..][..width]);
    // All of one length, which the compiler needs to know for vector code.
    let [left, middle, right] = [0, 1, 2].map(|first| rows.map(|row| &row[first..][..inner]));
    let column = |[above, here, below]: [&[f32]; 3], x: usize| above[x] + here[x] + below[x];
    for (x, sum) in out[1..=inner].iter_mut().enumerate() {
        *sum = (column(left, x) + column(middle, x) + column(right, x)) / 3.0;
    }
}

#[cfg(test)]
mod tests {
    use super::super::EVEN;
    use super::*;

    /// Cells without texture that differ by these grey levels.
    fn cells(offs: &[f32]) -> Cells {
        let mut cells = Cells { off: offs.to_vec(), ..Cells::default() };
        cells.resize(offs.len());
        cells
    }

    /// Learned from these cells in many pictures.
    fn learned(cells: &mut Cells) -> CellNoise {
        let mut noise = CellNoise::default();
        (0..1000).for_each(|_| noise.weigh(cells));
        noise
    }

    #[test]
    fn noise_of_long_tails_is_not_believed_to_be_its_core_alone() {
        let offs: Vec<f32> = (0..100).map(|cell| if cell % 5 == 0 { 2.0 } else { 0.1 }).collect();
        let believed = learned(&mut cells(&offs)).alone[0];
        // Where 1.25 (0.8 * 0.1 + 0.2 * 3 s) = s.
        assert!((believed - 0.4).abs() < 0.01, "{believed}");
    }

    #[test]
    fn somebody_in_the_picture_makes_the_noise_hardly_larger() {
        let offs: Vec<f32> = (0..100).map(|cell| if cell % 20 == 0 { 40.0 } else { 1.0 }).collect();
        let believed = learned(&mut cells(&offs)).alone[0];
        assert!((1.1..1.6).contains(&believed), "{believed}");
    }

    #[test]
    fn what_was_learned_while_somebody_was_there_is_doubted() {
        let noise: Vec<f32> = (0..100).map(|cell| if cell % 2 == 0 { 0.5 } else { -0.5 }).collect();
        let mut seen = cells(&noise);
        seen.spread.fill(2.0);
        let mut believed = learned(&mut seen);
        seen.off[..2].fill(10.0);
        seen.spread[1] = 10.0;
        believed.weigh(&mut seen);
        assert!(seen.z[0] > 10.0 && seen.z[1] < 2.0, "{:?}", &seen.z[..3]);
    }

    /// Noise, and in the middle somebody of 4 x 3 cells who differ by that many deviations: what cells say when those around were asked.
    fn beside_others(somebody: f32) -> Vec<f32> {
        let is_theirs = |at: usize| (4..8).contains(&(at / 12)) && (4..7).contains(&(at % 12));
        let noise_of = |at: usize| if (at + at / 12).is_multiple_of(2) { 0.8 } else { -0.8 };
        let z: Vec<f32> = (0..144).map(|at| if is_theirs(at) { somebody } else { noise_of(at) }).collect();
        let mut seen = cells(&z);
        seen.z = z;
        CellNoise::default().weigh_together(&mut seen, &mut Vec::new(), 12);
        seen.z
    }

    #[test]
    fn who_says_too_little_in_each_cell_is_seen_in_all_of_them_and_is_no_broader() {
        let seen = beside_others(4.0);
        assert!((5..7).all(|y| seen[12 * y + 5] >= EVEN), "{seen:?}");
        assert!((0..144).filter(|at| seen[*at] >= EVEN).all(|at| (4..7).contains(&(at % 12))), "{seen:?}");
        assert!(beside_others(2.0).iter().all(|z| z.abs() < EVEN), "two deviations are nobody");
    }

    #[test]
    fn cells_that_always_differ_together_are_noise() {
        let mut noise = CellNoise::default();
        let mut seen = cells(&[0.0; 144]);
        let mut tells = (0..200).map(|picture| {
            let is_lighter = |at: usize| (at / 36 + at % 12 / 3 + picture).is_multiple_of(2);
            seen.z.iter_mut().enumerate().for_each(|(at, z)| *z = if is_lighter(at) { 3.5 } else { -3.5 });
            noise.weigh_together(&mut seen, &mut Vec::new(), 12);
            seen.z.iter().any(|z| z.abs() >= EVEN)
        });
        assert_eq!((tells.next(), tells.last()), (Some(true), Some(false)));
    }
}
