// SPDX-License-Identifier: MPL-2.0

//! Who differs from the wall by less than the noise of a pixel: the signed differences of a cell of pixels are averaged, in which
//! noise cancels and clothes do not, and held against what cells of the background differ by, which is measured.

mod cell_noise;
mod columns;

use multiversion::multiversion;

use self::cell_noise::CellNoise;
use self::columns::{Columns, pool};
use super::model::{Model, Row, Sampled, UNKNOWN};

/// Pixels of a side of a cell: two blocks of coding side by side in a picture that was reduced by two.
const CELL: usize = 4;
/// Cells of a side of a tile, over which light may have changed.
const TILE: usize = 8;
/// Squared deviations at which foreground is as likely as background: there are thousands of cells in a picture.
const EVEN: f32 = 36.0;
/// Where so many cells of those that hang together are foreground by themselves, as a share, the pixels know better what is: what is
/// faint beside them is a shadow.
const PLAIN: f32 = 0.3;

/// What the cells of the canvas show, row after row.
#[derive(Debug, Default)]
struct Cells {
    /// How much lighter each is than the background, but for the light, grey levels; NaN where that is not known.
    off: Vec<f32>,
    /// The same in deviations of the background; 0 where that is not known.
    z: Vec<f32>,
    /// How much the pixels of each have differed from their means so far, grey levels.
    spread: Vec<f32>,
    /// The bin of its texture.
    bin: Vec<u8>,
    /// Whether most of its pixels are foreground by themselves.
    is_plain: Vec<bool>,
}

impl Cells {
    fn resize(&mut self, count: usize) {
        self.off.resize(count, f32::NAN);
        self.spread.resize(count, 0.0);
        self.bin.resize(count, 0);
        self.z.resize(count, 0.0);
        self.is_plain.resize(count, false);
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

impl Pooled {
    /// Raises the likelihood of foreground in the `model`, which the picture was compared with, where cells say so; learns their
    /// noise, apart for a camera that `rests` and one that turns.
    pub fn raise(&mut self, model: &mut Model, picture: &Sampled, spans: &[(usize, usize)], rests: bool) {
        let (across, down) = (model.size.0 / CELL, model.size.1 / CELL);
        self.gather(model, picture, spans, (across, down));
        self.subtract_light(across, down);
        let noise = if rests { &mut self.at_rest } else { &mut self.turning };
        noise.weigh(&mut self.cells);
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
            let Cells { off, spread, bin, is_plain, .. } = &mut self.cells;
            let [off, spread] = [off, spread].map(|plane| &mut plane[row.clone()]);
            pool(&self.columns, off, spread, &mut bin[row.clone()], &mut is_plain[row]);
        }
    }

    /// Takes from each cell how much lighter its tile is as a whole: the median of its cells, and of the tiles around it.
    fn subtract_light(&mut self, across: usize, down: usize) {
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
        for (y, row) in self.cells.off.chunks_exact_mut(across).enumerate() {
            for (tile, light) in row.chunks_mut(TILE).zip(&self.light[y / TILE * wide..]) {
                tile.iter_mut().for_each(|off| *off -= light);
            }
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

/// The middle of some values, which are sorted in part for it.
fn median(values: &mut [f32]) -> Option<f32> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f32::total_cmp).1)
}
