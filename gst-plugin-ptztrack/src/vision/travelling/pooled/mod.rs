// SPDX-License-Identifier: MPL-2.0

//! Who differs from the wall by less than the noise of a pixel: the signed differences of a cell of pixels are averaged, in which
//! noise cancels and clothes do not, and held against what cells of the background differ by, which is measured. Where that is too
//! little for one cell, it may be enough for those around it together, and for all that hang together.

mod cell_noise;
mod columns;

use std::ops::Range;

use multiversion::multiversion;
use ptztrack_contract::{Point, Rect};

use self::cell_noise::CellNoise;
use self::columns::{Columns, pool};
use super::median::Median;
use super::model::{Model, Row, Sampled, UNKNOWN, around};

/// Pixels of a side of a cell: two blocks of coding side by side in a picture that was reduced by two.
const CELL: usize = 4;
/// Cells of a side of a tile, over which light may have changed.
const TILE: usize = 8;
/// Deviations at which foreground is as likely as background.
const EVEN: f32 = 6.0;
/// Deviations at which it is certain.
const CERTAIN: f32 = 8.5;
/// Deviations from which a cell may be a part of somebody ...
const PART: f32 = 5.0;
/// ... and those, as the root of the sum of squares, from which cells that hang together are somebody (hysteresis, as Canny's edges have
/// it): there are thousands of cells in a picture, and an edge of the background that lies a little off differs in a few side by side.
const SOMEBODY: f32 = 30.0;
/// Where so many rows of the cells that hang together have some that are foreground by themselves, as a share, what is faint beside those is
/// a shadow. It makes nobody taller: below a head that is plain there is a trunk that is not.
const PLAIN: f32 = 0.5;
/// A cell where somebody faint is expected says so many times as much (Senior et al., 2006).
const EXPECTED: f32 = 1.6;

/// Cells of the canvas: those that hold some of the picture, and one more on each side, of which nothing is known.
#[derive(Debug, Default)]
struct Area {
    left: usize,
    top: usize,
    across: usize,
    down: usize,
}

impl Area {
    /// Of a picture that covers these `spans` of the canvas' rows.
    fn of(spans: &[(usize, usize)], (width, height): (usize, usize)) -> Self {
        let covered = || spans.iter().enumerate().filter(|(_, (start, end))| start < end);
        let cells = |first: Option<usize>, last: Option<usize>, size: usize| -> Range<usize> {
            let (Some(first), Some(last)) = (first, last) else { return 0..0 };
            (first / CELL).saturating_sub(1)..(last / CELL + 2).min(size / CELL)
        };
        let (start, last) =
            (covered().map(|(_, span)| span.0).min(), covered().map(|(_, span)| span.1 - 1).max());
        let columns = cells(start, last, width);
        let rows = cells(covered().map(|(y, _)| y).next(), covered().map(|(y, _)| y).next_back(), height);
        Self { left: columns.start, top: rows.start, across: columns.len(), down: rows.len() }
    }

    /// Columns and rows of those cells that hold some of a box of the canvas (pixels).
    fn cells_of(&self, bounds: Rect) -> (Range<usize>, Range<usize>) {
        let range = |start: f64, length: f64, first: usize, count: usize| {
            // Casts saturate.
            let cell = |at: f64| ((at / CELL as f64).max(0.0) as usize).saturating_sub(first);
            let end = cell(start + length).saturating_add(1).min(count);
            cell(start).min(end)..end
        };
        (
            range(bounds.x, bounds.width, self.left, self.across),
            range(bounds.y, bounds.height, self.top, self.down),
        )
    }
}

/// What the cells of an area show, row after row.
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
    area: Area,
    cells: Cells,
    /// Memory: sums over a row of cells, by columns of pixels; medians of tiles, and the light of each.
    columns: Columns,
    median: Median,
    tiles: Vec<f32>,
    light: Vec<f32>,
    /// What cells say together with those around them; cells that hang together, and which have been looked at.
    together: Vec<f32>,
    component: Vec<usize>,
    looked_at: Vec<bool>,
}

impl Pooled {
    /// Looks where cells of the picture, which the `model` was compared with, tell of somebody, more so around the box `held` of the
    /// canvas, where they are, if the camera turns; learns their noise, apart for a camera that `rests` and one that turns. Returns
    /// where they are expected.
    pub fn look(
        &mut self,
        model: &Model,
        picture: &Sampled,
        spans: &[(usize, usize)],
        rests: bool,
        held: Option<Rect>,
    ) -> Option<Rect> {
        self.area = Area::of(spans, model.size);
        self.gather(model, picture, spans);
        self.subtract_light();
        let noise = if rests { &mut self.at_rest } else { &mut self.turning };
        noise.weigh(&mut self.cells);
        noise.weigh_together(&mut self.cells, &mut self.together, self.area.across);
        // Before a camera at rest there is little noise, and whoever needs that help is a shadow.
        let expected = held.map(|held| if rests { held } else { self.expect(held) });
        for sign in [1.0, -1.0] {
            self.decide(self.area.across, sign);
        }
        expected
    }

    /// What each cell shows, where it is known and its pixels say nothing by themselves.
    fn gather(&mut self, model: &Model, picture: &Sampled, spans: &[(usize, usize)]) {
        let Area { left, top, across, down } = self.area;
        let width = model.size.0;
        self.cells.resize(across * down);
        for y in 0..down {
            self.columns.clear(width);
            for (row, &(start, end)) in spans.iter().enumerate().skip((top + y) * CELL).take(CELL) {
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
            pool(&self.columns, left, off, spread, &mut bin[row.clone()], &mut is_plain[row]);
        }
    }

    /// Takes from each cell how much lighter its tile is as a whole: the median of its cells, and of the tiles around it.
    fn subtract_light(&mut self) {
        let Area { left, top, across, down } = self.area;
        // Tiles are those of the canvas: the first ones may begin before the area.
        let (left, top) = (left % TILE, top % TILE);
        let (wide, high) = ((left + across).div_ceil(TILE), (top + down).div_ceil(TILE));
        let cells = |tile: usize, before: usize, count: usize| {
            (tile * TILE).saturating_sub(before)..((tile + 1) * TILE - before).min(count)
        };
        let median = &mut self.median;
        self.tiles.clear();
        for tile in 0..wide * high {
            let (columns, rows) = (cells(tile % wide, left, across), cells(tile / wide, top, down));
            for row in rows {
                median.extend(self.cells.off[row * across..][columns.clone()].iter().copied());
            }
            self.tiles.push(median.take().unwrap_or(f32::NAN));
        }
        self.light.clear();
        for tile in 0..wide * high {
            let (x, y) = (tile % wide, tile / wide);
            for row in y.saturating_sub(1)..(y + 2).min(high) {
                let near = &self.tiles[row * wide..][x.saturating_sub(1)..(x + 2).min(wide)];
                median.extend(near.iter().copied());
            }
            self.light.push(median.take().unwrap_or(0.0));
        }
        for (y, row) in self.cells.off.chunks_exact_mut(across.max(1)).enumerate() {
            for (tile, light) in self.light[(top + y) / TILE * wide..][..wide].iter().enumerate() {
                row[cells(tile, left, across)].iter_mut().for_each(|off| *off -= light);
            }
        }
    }

    /// Lets cells around a box say more, if who is there is not plain: beside plain foreground, what is faint is a shadow. Where they are
    /// expected by that.
    fn expect(&mut self, held: Rect) -> Rect {
        let across = self.area.across;
        let (columns, rows) = self.area.cells_of(held);
        let is_plain = |row: &usize| self.cells.is_plain[row * across..][columns.clone()].contains(&true);
        if rows.clone().filter(is_plain).count() as f32 >= PLAIN * rows.len() as f32 {
            return held;
        }
        let expected = around(held);
        let (columns, rows) = self.area.cells_of(expected);
        for row in self.cells.z.chunks_exact_mut(across.max(1)).take(rows.end).skip(rows.start) {
            row[columns.clone()].iter_mut().for_each(|z| *z *= EXPECTED);
        }
        expected
    }

    /// Decides which cells that are lighter or darker, as `sign` says, and hang together are somebody. What is lighter and what is darker
    /// never hang together: a shadow beside somebody's light clothes is not theirs.
    fn decide(&mut self, across: usize, sign: f32) {
        self.looked_at.clear();
        self.looked_at.resize(self.cells.z.len(), false);
        for row in (0..self.cells.z.len()).step_by(across.max(1)) {
            // Most rows tell of nobody.
            if any_tells(&self.cells.z[row..][..across]) {
                (row..row + across).for_each(|first| self.decide_from(first, across, sign));
            }
        }
    }

    /// The same of what hangs together with one cell. Beside plain foreground it is a shadow, and what says too little is noise: both are
    /// nobody. All cells of somebody become certain.
    fn decide_from(&mut self, first: usize, across: usize, sign: f32) {
        let Cells { z, is_plain, .. } = &mut self.cells;
        if !tells(sign * z[first]) || self.looked_at[first] {
            return;
        }
        self.component.clear();
        self.component.push(first);
        self.looked_at[first] = true;
        let mut next = 0;
        while let Some(&at) = self.component.get(next) {
            next += 1;
            for near in neighbours(at, across, z.len()) {
                if !self.looked_at[near] && (is_plain[near] || tells(sign * z[near])) {
                    self.looked_at[near] = true;
                    self.component.push(near);
                }
            }
        }
        self.component.sort_unstable();
        let rows = || self.component.chunk_by(|a, b| a / across == b / across);
        let plain = rows().filter(|row| row.iter().any(|&at| is_plain[at])).count();
        let is_shadow = plain as f32 >= PLAIN * rows().count() as f32;
        let squares: f32 = self.component.iter().map(|&at| z[at] * z[at]).sum();
        let is_somebody = !is_shadow && squares >= SOMEBODY * SOMEBODY;
        for &at in &self.component {
            // What is plain is foreground without this.
            z[at] = if is_somebody && !is_plain[at] { sign * CERTAIN.max(sign * z[at]) } else { 0.0 };
        }
    }

    /// Raises the likelihood of foreground in the `model` where cells tell of somebody, between the middles of four cells each: `within` a
    /// box of the canvas, or everywhere.
    pub fn mark(&self, model: &mut Model, within: Option<Rect>) {
        let Area { left, top, across, .. } = self.area;
        let rows = || self.cells.z.chunks_exact(across.max(1));
        let mut lower_tells = rows().next().is_some_and(any_tells);
        for (y, (upper, lower)) in rows().zip(rows().skip(1)).enumerate() {
            // Most rows tell of nobody.
            let upper_tells = std::mem::replace(&mut lower_tells, any_tells(lower));
            if !upper_tells && !lower_tells {
                continue;
            }
            for (x, (upper, lower)) in upper.windows(2).zip(lower.windows(2)).enumerate() {
                let first = ((left + x) * CELL + CELL / 2, (top + y) * CELL + CELL / 2);
                let is_within = || {
                    within
                        .is_none_or(|within| within.contains(Point { x: first.0 as f64, y: first.1 as f64 }))
                };
                if upper.iter().chain(lower).any(|z| tells(z.abs())) && is_within() {
                    blend(model, [upper[0], upper[1], lower[0], lower[1]], first);
                }
            }
        }
    }
}

/// Whether so many deviations may tell of somebody; they do, once it is decided.
#[inline(always)]
fn tells(z: f32) -> bool {
    z >= PART
}

/// Whether any of a row does.
#[multiversion(targets("x86_64+avx2"))]
fn any_tells(row: &[f32]) -> bool {
    row.iter().fold(false, |any, z| any | tells(z.abs()))
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
            *likelihood = (*likelihood).max((z * z * (f32::from(UNKNOWN) / (EVEN * EVEN))).min(255.0) as u8);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ACROSS: usize = 12;

    /// What is left of six rows of somebody faint, two cells broad, where the first rows of the left one are plain.
    fn left_of_somebody(plain_rows: usize) -> usize {
        let mut pooled = Pooled::default();
        pooled.cells.resize(ACROSS * 8);
        for row in 1..7 {
            let at = ACROSS * row + 4;
            pooled.cells.is_plain[at] = row <= plain_rows;
            pooled.cells.z[at] = if row <= plain_rows { 0.0 } else { -2.0 * EVEN };
            pooled.cells.z[at + 1] = -2.0 * EVEN;
        }
        pooled.decide(ACROSS, -1.0);
        pooled.cells.z.iter().filter(|z| **z != 0.0).count()
    }

    #[test]
    fn what_is_faint_beside_somebody_is_their_shadow_and_below_their_head_it_is_they() {
        assert_eq!(left_of_somebody(6), 0, "a shadow");
        assert_eq!(left_of_somebody(1), 11, "all but the head, which is plain");
        assert_eq!(left_of_somebody(0), 12, "nothing of them is plain");
    }

    /// What is left of so many cells that hang together, each of which may only be a part of somebody.
    fn left_of_faint(cells: usize) -> Vec<f32> {
        let mut pooled = Pooled::default();
        pooled.cells.resize(ACROSS * 8);
        for cell in 0..cells {
            pooled.cells.z[ACROSS * (1 + cell / 8) + 2 + cell % 8] = PART;
        }
        pooled.decide(ACROSS, 1.0);
        pooled.cells.z.into_iter().filter(|z| *z != 0.0).collect()
    }

    #[test]
    fn who_is_faint_in_each_cell_is_certain_in_all_and_a_few_cells_are_nobody() {
        assert_eq!(left_of_faint(30), []);
        assert_eq!(left_of_faint(40), [CERTAIN; 40]);
    }

    /// How many are left of 36 cells of somebody too faint to be seen, six a row, so many of which are plain, where `expected` is the box
    /// (pixels) that they are expected in.
    fn left_of_expected(expected: Option<Rect>, plain: usize) -> usize {
        let mut pooled =
            Pooled { area: Area { across: ACROSS, down: 8, ..Area::default() }, ..Pooled::default() };
        pooled.cells.resize(ACROSS * 8);
        for cell in 0..36 {
            pooled.cells.z[ACROSS * (1 + cell / 6) + 3 + cell % 6] = 0.8 * PART;
        }
        for row in 2..2 + plain {
            (pooled.cells.is_plain[ACROSS * row + 5], pooled.cells.z[ACROSS * row + 5]) = (true, 0.0);
        }
        if let Some(held) = expected {
            pooled.expect(held);
        }
        pooled.decide(ACROSS, 1.0);
        pooled.cells.z.iter().filter(|z| **z >= CERTAIN).count()
    }

    #[test]
    fn around_the_target_less_is_enough_if_nobody_plain_is_there() {
        let square = |x: f64, y: f64, side: f64| Some(Rect { x, y, width: side, height: side });
        let within = square(16.0, 8.0, 16.0);
        assert_eq!(left_of_expected(None, 0), 0, "nobody is expected");
        assert_eq!(left_of_expected(within, 0), 36, "they reach beyond the box");
        assert_eq!(left_of_expected(within, 1), 35, "one row of five is plain");
        assert_eq!(left_of_expected(within, 4), 0, "a shadow");
        assert_eq!(left_of_expected(square(40.0, 0.0, 8.0), 0), 0, "elsewhere");
        assert_eq!(left_of_expected(square(-900.0, 900.0, 8.0), 0), 0, "beyond");
    }

    #[test]
    fn the_area_is_what_the_picture_covers_and_a_cell_around() {
        let size = (96, 64);
        let area = |spans: &[(usize, usize)]| {
            let Area { left, top, across, down } = Area::of(spans, size);
            [left, top, across, down]
        };
        let mut spans = vec![(0, 0); size.1];
        assert_eq!(area(&spans), [0; 4]);
        spans[8..40].fill((13, 50));
        assert_eq!(area(&spans), [2, 1, 12, 10]);
        assert_eq!(area(&vec![(0, size.0); size.1]), [0, 0, size.0 / CELL, size.1 / CELL]);
    }

    #[test]
    fn what_is_lighter_hangs_together_with_nothing_darker() {
        let mut pooled = Pooled::default();
        pooled.cells.resize(ACROSS * 8);
        for row in 1..7 {
            let at = ACROSS * row + 4;
            pooled.cells.is_plain[at] = row < 6;
            (pooled.cells.z[at + 1], pooled.cells.z[at + 2]) = (-2.0 * EVEN, 3.0 * EVEN);
        }
        pooled.decide(ACROSS, -1.0);
        let left: Vec<f32> = pooled.cells.z.iter().copied().filter(|z| *z != 0.0).collect();
        assert_eq!(left, [3.0 * EVEN; 6], "the shadow goes, what is lighter stays");
    }
}
