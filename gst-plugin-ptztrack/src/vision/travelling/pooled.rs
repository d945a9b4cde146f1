// SPDX-License-Identifier: MPL-2.0

//! Who differs from the wall by less than the noise of a pixel: the signed differences of a cell of pixels are averaged, in which
//! noise cancels and clothes do not, and held against what cells of the background differ by, which is measured.

use multiversion::multiversion;

use super::model::{Model, Row, Sampled, UNKNOWN};
use super::noise::PER_MEAN_DEVIATION;
use super::rows::whole_part;

/// Pixels of a side of a cell: two blocks of coding side by side in a picture that was reduced by two.
const CELL: usize = 4;
/// Cells of a side of a tile, over which light may have changed.
const TILE: usize = 8;
/// Squared deviations at which foreground is as likely as background: there are thousands of cells in a picture.
const EVEN: f32 = 36.0;
/// Pixels of a cell that must be known, and say nothing by themselves.
const LEAST_KNOWN: u16 = 8;
/// Grey levels of texture (range within a pixel, averaged over the cell) that a bin of the noise spans, and how many there are.
const BIN: f32 = 6.0;
const BINS: usize = 8;
/// Deviation that is believed before any was seen: grey levels, and that much more for each grey level of texture.
const START: f32 = 0.8;
const START_OF_TEXTURE: f32 = 0.1;
/// Deviations are at least those of rounding, grey levels.
const FLOOR: f32 = 0.25;
/// Weight of a picture in what is believed, and cells without which it says nothing.
const RATE: f32 = 0.05;
const MIN_CELLS: f32 = 20.0;
/// Where so many cells of those that hang together are foreground by themselves, as a share, the pixels know better what is: what is
/// faint beside them is a shadow.
const PLAIN: f32 = 0.3;
/// Deviations that a cell counts for at most where the noise is learned (Huber's winsorised scale, 1981): it may be somebody. If
/// such cells were left out, noise of long tails would be believed to be ever less.
const NOISE_REACH: f32 = 3.0;

/// What the cells of the canvas show, row after row.
#[derive(Debug, Default)]
struct Cells {
    /// How much lighter each is than the background, grey levels; NaN where that is not known.
    off: Vec<f32>,
    /// The bin of its texture.
    bin: Vec<u8>,
    /// `off` beside that of the light, in deviations of the noise; 0 where it is not known.
    z: Vec<f32>,
    /// Whether most of its pixels are foreground by themselves.
    is_plain: Vec<bool>,
}

impl Cells {
    fn resize(&mut self, count: usize) {
        self.off.resize(count, f32::NAN);
        self.bin.resize(count, 0);
        self.z.resize(count, 0.0);
        self.is_plain.resize(count, false);
    }
}

/// Deviations of cells of the background by texture, grey levels.
#[derive(Debug)]
struct CellNoise([f32; BINS]);

impl Default for CellNoise {
    fn default() -> Self {
        Self(std::array::from_fn(|bin| START + START_OF_TEXTURE * BIN * (bin as f32 + 0.5)))
    }
}

impl CellNoise {
    /// Tells by how many deviations the cells, so many `across`, differ from the `light` of their tiles, and learns from them.
    fn weigh(&mut self, cells: &mut Cells, light: &[f32], across: usize) {
        let mut sums = [(0.0_f32, 0.0_f32); BINS];
        let rows = cells.z.chunks_exact_mut(across.max(1)).zip(cells.off.chunks_exact(across.max(1)));
        for ((y, (z, off)), bin) in rows.enumerate().zip(cells.bin.chunks_exact(across.max(1))) {
            let light = &light[y / TILE * across.div_ceil(TILE)..];
            let tiles = z.chunks_mut(TILE).zip(off.chunks(TILE)).zip(bin.chunks(TILE));
            for (((z, off), bin), light) in tiles.zip(light) {
                for ((z, off), bin) in z.iter_mut().zip(off).zip(bin) {
                    *z = 0.0;
                    if !off.is_nan() {
                        let believed = self.0[usize::from(*bin)];
                        *z = (off - light) / believed;
                        let (sum, count) = &mut sums[usize::from(*bin)];
                        (*sum, *count) = (*sum + z.abs().min(NOISE_REACH) * believed, *count + 1.0);
                    }
                }
            }
        }
        for (believed, (sum, count)) in self.0.iter_mut().zip(sums) {
            if count >= MIN_CELLS {
                *believed += RATE * ((PER_MEAN_DEVIATION * sum / count).max(FLOOR) - *believed);
            }
        }
    }
}

/// Holds cells of the picture against the background.
#[derive(Debug, Default)]
pub(super) struct Pooled {
    at_rest: CellNoise,
    turning: CellNoise,
    cells: Cells,
    /// Memory: sums over a row of cells, by columns of pixels; what is known of a tile and around it; medians of tiles, and the light
    /// of each.
    columns: Columns,
    known: Vec<f32>,
    tiles: Vec<f32>,
    light: Vec<f32>,
    /// Cells that hang together, and which have been looked at.
    component: Vec<usize>,
    looked_at: Vec<bool>,
}

/// Differences (8.8), textures and counts of what is known, in each column of pixels.
#[derive(Debug, Default)]
struct Columns {
    off: Vec<i32>,
    texture: Vec<u16>,
    known: Vec<u16>,
    /// How many are foreground by themselves.
    plain: Vec<u16>,
}

impl Pooled {
    /// Raises the likelihood of foreground in the `model`, which the picture was compared with, where cells say so; learns their
    /// noise, apart for a camera that `rests` and one that turns.
    pub fn raise(&mut self, model: &mut Model, picture: &Sampled, spans: &[(usize, usize)], rests: bool) {
        let (across, down) = (model.size.0 / CELL, model.size.1 / CELL);
        self.gather(model, picture, spans, (across, down));
        self.find_light(across, down);
        let noise = if rests { &mut self.at_rest } else { &mut self.turning };
        noise.weigh(&mut self.cells, &self.light, across);
        self.forget_shadows(across);
        self.mark(model, across);
    }

    /// What each cell shows, where it is known and its pixels say nothing by themselves.
    fn gather(
        &mut self,
        model: &Model,
        picture: &Sampled,
        spans: &[(usize, usize)],
        (across, down): (usize, usize),
    ) {
        let width = model.size.0;
        self.cells.resize(across * down);
        for y in 0..down {
            self.columns.clear(width);
            for (row, &(start, end)) in spans.iter().enumerate().skip(y * CELL).take(CELL) {
                if start < end {
                    self.columns.add(
                        model.row(row, start..end),
                        &picture.luma[row * width..][start..end],
                        start,
                    );
                }
            }
            let row = y * across..(y + 1) * across;
            let Cells { off, bin, is_plain, .. } = &mut self.cells;
            pool(&self.columns, &mut off[row.clone()], &mut bin[row.clone()], &mut is_plain[row]);
        }
    }

    /// How much lighter each tile is as a whole: the median of its cells, and of the tiles around it.
    fn find_light(&mut self, across: usize, down: usize) {
        let (wide, high) = (across.div_ceil(TILE), down.div_ceil(TILE));
        let known = &mut self.known;
        self.tiles.clear();
        for tile in 0..wide * high {
            let (left, top) = (tile % wide * TILE, tile / wide * TILE);
            known.clear();
            for row in self.cells.off.chunks_exact(across).skip(top).take(TILE) {
                let tile = &row[left..(left + TILE).min(across)];
                tile.iter().filter(|off| !off.is_nan()).for_each(|off| known.push(*off));
            }
            self.tiles.push(median(known).unwrap_or(f32::NAN));
        }
        self.light.clear();
        for tile in 0..wide * high {
            let (x, y) = (tile % wide, tile / wide);
            known.clear();
            for row in y.saturating_sub(1)..(y + 2).min(high) {
                let near = &self.tiles[row * wide..][x.saturating_sub(1)..(x + 2).min(wide)];
                known.extend(near.iter().filter(|off| !off.is_nan()));
            }
            self.light.push(median(known).unwrap_or(0.0));
        }
    }

    /// Forgets cells that hang together with plain foreground.
    fn forget_shadows(&mut self, across: usize) {
        let Cells { z, is_plain, .. } = &mut self.cells;
        self.looked_at.clear();
        self.looked_at.resize(z.len(), false);
        for first in 0..z.len() {
            if !tells(z[first]) || self.looked_at[first] {
                continue;
            }
            self.component.clear();
            self.component.push(first);
            self.looked_at[first] = true;
            let (mut next, mut plain) = (0, 0);
            while let Some(&at) = self.component.get(next) {
                next += 1;
                plain += usize::from(is_plain[at]);
                for near in neighbours(at, across, z.len()) {
                    if !self.looked_at[near] && (is_plain[near] || tells(z[near])) {
                        self.looked_at[near] = true;
                        self.component.push(near);
                    }
                }
            }
            if plain as f32 >= PLAIN * self.component.len() as f32 {
                self.component.iter().for_each(|&at| z[at] = 0.0);
            }
        }
    }

    /// Raises the likelihood of the pixels, between the middles of four cells each.
    fn mark(&self, model: &mut Model, across: usize) {
        let rows = || self.cells.z.chunks_exact(across.max(1));
        let mut lower_tells = rows().next().is_some_and(any_tells);
        for (y, (upper, lower)) in rows().zip(rows().skip(1)).enumerate() {
            // Most rows tell of nobody.
            let upper_tells = std::mem::replace(&mut lower_tells, any_tells(lower));
            if !upper_tells && !lower_tells {
                continue;
            }
            for (x, (upper, lower)) in upper.windows(2).zip(lower.windows(2)).enumerate() {
                if upper.iter().chain(lower).any(|z| tells(*z)) {
                    let corners = [upper[0], upper[1], lower[0], lower[1]];
                    blend(model, corners, (x * CELL + CELL / 2, y * CELL + CELL / 2));
                }
            }
        }
    }
}

/// Whether so many deviations tell of somebody.
#[inline(always)]
fn tells(z: f32) -> bool {
    z * z >= EVEN
}

/// Whether any of a row does.
#[multiversion(targets("x86_64+avx2"))]
fn any_tells(row: &[f32]) -> bool {
    row.iter().fold(false, |any, z| any | tells(*z))
}

/// The cells around one of a grid that is so many `across` and holds `count`.
fn neighbours(at: usize, across: usize, count: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (at % across, at / across);
    let columns = x.saturating_sub(1)..(x + 2).min(across);
    let rows = y.saturating_sub(1)..(y + 2).min(count / across);
    rows.flat_map(move |row| columns.clone().map(move |column| row * across + column))
}

/// Raises the likelihood of the pixels between four cells, of which the first ones' middle is at `(left, top)`.
fn blend(model: &mut Model, corners: [f32; 4], (left, top): (usize, usize)) {
    for row in 0..CELL {
        let v = (row as f32 + 0.5) / CELL as f32;
        let [from, to] = [0, 1].map(|side| corners[side] + (corners[2 + side] - corners[side]) * v);
        for column in 0..CELL {
            let z = from + (to - from) * (column as f32 + 0.5) / CELL as f32;
            let likelihood = &mut model.likelihood[(top + row) * model.size.0 + left + column];
            *likelihood = (*likelihood).max((z * z * (f32::from(UNKNOWN) / EVEN)).min(255.0) as u8);
        }
    }
}

impl Columns {
    fn clear(&mut self, width: usize) {
        self.off.clear();
        self.off.resize(width, 0);
        for plane in [&mut self.texture, &mut self.known, &mut self.plain] {
            plane.clear();
            plane.resize(width, 0);
        }
    }

    /// Adds a part of a row of pixels that begins at `start`.
    fn add(&mut self, background: Row, seen: &[u8], start: usize) {
        let part = start..start + seen.len();
        let (texture, known) = (&mut self.texture[part.clone()], &mut self.known[part.clone()]);
        add_plain(&mut self.plain[part.clone()], background.likelihood);
        add_row(
            (&mut self.off[part], texture, known),
            seen,
            background.mean,
            background.range,
            background.likelihood,
        );
    }
}

/// Leaves a row of cells, from the sums of the columns.
#[multiversion(targets("x86_64+avx2"))]
fn pool(columns: &Columns, off: &mut [f32], bin: &mut [u8], is_plain: &mut [bool]) {
    let count = off.len();
    let (bin, is_plain) = (&mut bin[..count], &mut is_plain[..count]);
    let differences = &columns.off.as_chunks::<CELL>().0[..count];
    let [textures, knowns, plains] =
        [&columns.texture, &columns.known, &columns.plain].map(|plane| &plane.as_chunks::<CELL>().0[..count]);
    for cell in 0..count {
        let sum = |columns: &[[u16; CELL]]| columns[cell].iter().sum::<u16>();
        let (texture, known, plain) = (sum(textures), sum(knowns), sum(plains));
        let is_known = known >= LEAST_KNOWN;
        let known = f32::from(known);
        let difference: i32 = differences[cell].iter().sum();
        off[cell] = if is_known { difference as f32 / (256.0 * known) } else { f32::NAN };
        let texture = (f32::from(texture) / known / BIN).min((BINS - 1) as f32);
        bin[cell] = if is_known { whole_part(texture) as u8 } else { 0 };
        is_plain[cell] = !is_known && plain >= LEAST_KNOWN;
    }
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

/// The middle of some values, which are sorted in part for it.
fn median(values: &mut [f32]) -> Option<f32> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is believed of cells without texture that differ by these grey levels in every picture.
    fn learned(offs: &[f32]) -> f32 {
        let mut noise = CellNoise::default();
        let mut cells = Cells { off: offs.to_vec(), ..Cells::default() };
        cells.resize(offs.len());
        let light = vec![0.0; offs.len().div_ceil(TILE)];
        (0..1000).for_each(|_| noise.weigh(&mut cells, &light, offs.len()));
        noise.0[0]
    }

    #[test]
    fn noise_of_long_tails_is_not_believed_to_be_its_core_alone() {
        let offs: Vec<f32> = (0..100).map(|cell| if cell % 5 == 0 { 2.0 } else { 0.1 }).collect();
        // Where 1.25 (0.8 * 0.1 + 0.2 * 3 s) = s.
        assert!((learned(&offs) - 0.4).abs() < 0.01, "{}", learned(&offs));
    }

    #[test]
    fn somebody_in_the_picture_makes_the_noise_hardly_larger() {
        let offs: Vec<f32> = (0..100).map(|cell| if cell % 20 == 0 { 40.0 } else { 1.0 }).collect();
        let believed = learned(&offs);
        assert!((1.1..1.6).contains(&believed), "{believed}");
    }
}
