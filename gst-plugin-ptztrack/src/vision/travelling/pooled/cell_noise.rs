// SPDX-License-Identifier: MPL-2.0

//! What cells of the background differ by.

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
/// Deviations of cells of the background.
#[derive(Debug)]
pub(super) struct CellNoise {
    /// By texture, grey levels.
    alone: [f32; BINS],
    /// The spread of their pixels, by texture, grey levels.
    spread: [f32; BINS],
}

impl Default for CellNoise {
    fn default() -> Self {
        let alone = std::array::from_fn(|bin| START + START_OF_TEXTURE * BIN * (bin as f32 + 0.5));
        Self { alone, spread: [START; BINS] }
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
}

#[cfg(test)]
mod tests {
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
}
