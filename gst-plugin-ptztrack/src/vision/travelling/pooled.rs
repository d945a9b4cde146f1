// SPDX-License-Identifier: MPL-2.0

//! Who differs from the wall by less than the noise of a pixel: the signed differences of a cell of pixels are averaged, in which
//! noise cancels and clothes do not, and held against what cells of the background differ by, which is measured.

use multiversion::multiversion;

use super::model::{Model, Row, Sampled, UNKNOWN};
use super::noise::PER_MEAN_DEVIATION;

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

/// What one cell of the canvas shows.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    /// How much lighter it is than the background, grey levels; NaN where that is not known.
    off: f32,
    /// The bin of its texture.
    bin: usize,
    /// `off` beside that of the light, in deviations of the noise; 0 where it is not known.
    z: f32,
    /// Whether most of its pixels are foreground by themselves.
    is_plain: bool,
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
    fn learn(&mut self, cells: &[Cell]) {
        let mut sums = [(0.0_f32, 0.0_f32); BINS];
        for cell in cells.iter().filter(|cell| !cell.off.is_nan()) {
            let (sum, count) = &mut sums[cell.bin];
            (*sum, *count) = (*sum + cell.z.abs().min(NOISE_REACH) * self.0[cell.bin], *count + 1.0);
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
    cells: Vec<Cell>,
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
        for (y, row) in self.cells.chunks_exact_mut(across.max(1)).enumerate() {
            let light = &self.light[y / TILE * across.div_ceil(TILE)..];
            for (cells, light) in row.chunks_mut(TILE).zip(light) {
                for cell in cells {
                    cell.z = if cell.off.is_nan() { 0.0 } else { (cell.off - light) / noise.0[cell.bin] };
                }
            }
        }
        noise.learn(&self.cells);
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
        self.cells.clear();
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
            self.cells.extend(self.columns.cells().take(across));
        }
    }

    /// How much lighter each tile is as a whole: the median of its cells, and of the tiles around it.
    fn find_light(&mut self, across: usize, down: usize) {
        let (wide, high) = (across.div_ceil(TILE), down.div_ceil(TILE));
        let known = &mut self.known;
        self.tiles.clear();
        for tile in 0..wide * high {
            let (left, top) = (tile % wide * TILE, tile / wide * TILE);
            let rows = self.cells.chunks_exact(across).skip(top).take(TILE);
            known.clear();
            let offs = rows.flat_map(|row| row[left..(left + TILE).min(across)].iter().map(|cell| cell.off));
            known.extend(offs.filter(|off| !off.is_nan()));
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
        let limit = EVEN.sqrt();
        self.looked_at.clear();
        self.looked_at.resize(self.cells.len(), false);
        for first in 0..self.cells.len() {
            if self.looked_at[first] || self.cells[first].z.abs() < limit {
                continue;
            }
            self.component.clear();
            self.component.push(first);
            self.looked_at[first] = true;
            let (mut next, mut plain) = (0, 0);
            while let Some(&at) = self.component.get(next) {
                next += 1;
                plain += usize::from(self.cells[at].is_plain);
                for near in neighbours(at, across, self.cells.len()) {
                    let cell = self.cells[near];
                    if !self.looked_at[near] && (cell.is_plain || cell.z.abs() >= limit) {
                        self.looked_at[near] = true;
                        self.component.push(near);
                    }
                }
            }
            if plain as f32 >= PLAIN * self.component.len() as f32 {
                self.component.iter().for_each(|&at| self.cells[at].z = 0.0);
            }
        }
    }

    /// Raises the likelihood of the pixels, between the middles of four cells each.
    fn mark(&self, model: &mut Model, across: usize) {
        let limit = EVEN.sqrt();
        let tells = |cell: &Cell| cell.z.abs() >= limit;
        let rows = || self.cells.chunks_exact(across.max(1));
        for (y, (upper, lower)) in rows().zip(rows().skip(1)).enumerate() {
            // Most rows tell of nobody.
            if !upper.iter().chain(lower).any(tells) {
                continue;
            }
            for x in (0..across.saturating_sub(1))
                .filter(|&x| upper[x..x + 2].iter().chain(&lower[x..x + 2]).any(tells))
            {
                let corners = [upper[x].z, upper[x + 1].z, lower[x].z, lower[x + 1].z];
                blend(model, corners, (x * CELL + CELL / 2, y * CELL + CELL / 2));
            }
        }
    }
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

    /// The cells of the row.
    fn cells(&self) -> impl Iterator<Item = Cell> {
        let off = self.off.as_chunks::<CELL>().0.iter();
        let counts =
            [&self.texture, &self.known, &self.plain].map(|plane| plane.as_chunks::<CELL>().0.iter());
        let [texture, known, plain] = counts.map(|plane| plane.map(|cell| cell.iter().sum::<u16>()));
        let sums = off.map(|cell| cell.iter().sum::<i32>()).zip(texture).zip(known.zip(plain));
        sums.map(|((off, texture), (known, plain))| Cell::of(off, texture, known, plain))
    }
}

impl Cell {
    /// From the sums of differences (8.8) and textures of its `known` pixels, and how many there are, and how many are `plain` foreground.
    fn of(off: i32, texture: u16, known: u16, plain: u16) -> Self {
        if known < LEAST_KNOWN {
            return Self { off: f32::NAN, is_plain: plain >= LEAST_KNOWN, ..Self::default() };
        }
        let texture = f32::from(texture) / f32::from(known);
        let bin = ((texture / BIN) as usize).min(BINS - 1);
        Self { off: off as f32 / (256.0 * f32::from(known)), bin, z: 0.0, is_plain: false }
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
        for _ in 0..1000 {
            let cell = |&off: &f32| Cell { off, z: off / noise.0[0], ..Cell::default() };
            let cells: Vec<Cell> = offs.iter().map(cell).collect();
            noise.learn(&cells);
        }
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
