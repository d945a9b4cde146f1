// SPDX-License-Identifier: MPL-2.0

//! Figure and ground: which cells around the target are person, and which are wall.
//!
//! Motion against the background and colour each give the odds of every cell; the silhouette that the target had until
//! now says where to expect it. The map that comes of it tells where corners are taken, where box and centre of mass lie, and
//! whether the target is there at all.

mod grey_template;
mod silhouette;

use opencv::core::{Point2f, Rect2f};

pub(super) use grey_template::GreyTemplate;
pub(super) use silhouette::{Halves, Shape, Template};

use super::colour::{Colour, ColourModel, Histogram};
use super::geometry::{centre, scaled};
use super::sample::Sampler;
use crate::vision::{Luma, Observation};

/// Cells that are worked on at once: a row of cells that are weighed is filled up to a multiple of that with some that weigh nothing.
const LANES: usize = 8;
/// What is looked at around the target, in widths and heights of it.
pub(super) const CONTEXT: (f32, f32) = (2.4, 1.6);
/// Logarithm of the odds where a cell is surely not the known background, and where it surely is: dark clothes before a
/// dark wall look like the wall, a wall never looks like somebody.
const MOVES: f32 = 2.5;
const RESTS: f32 = -1.2;
/// One cue says no more than this of a cell: a few bright cells are not worth the whole body.
const LARGEST: f32 = 2.0;
/// Odds that a cell belongs to the target from which it is counted as figure, and below which as ground.
const FIGURE: f32 = 0.6;
const GROUND: f32 = 0.3;

/// The cells around a target: what they look like and how they move.
#[derive(Debug, Clone, Default)]
pub(super) struct Cells {
    lattice: Lattice,
    colours: Vec<Colour>,
    /// Logarithm of the odds by motion against the background.
    motion: Vec<f32>,
    /// Whether the cell lies in the picture.
    inside: Vec<bool>,
    sampler: Sampler,
    /// Memory: planes of the cells.
    planes: [Vec<u8>; 3],
}

/// What tells the target by its looks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Looks<'a> {
    pub colours: &'a ColourModel,
    /// Logarithm of the odds that what moves here is the target and nobody else, before its colours are seen: infinite where
    /// nobody else is near.
    pub alone: f32,
}

/// A number of cells across and down.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Grid {
    pub columns: usize,
    pub rows: usize,
}

/// Where the cells around a target lie.
#[derive(Debug, Clone, Copy, Default)]
struct Lattice {
    area: Rect2f,
    grid: Grid,
}

impl Lattice {
    /// Size of a cell, pixels of the picture.
    fn cell(&self) -> Point2f {
        Point2f::new(self.area.width / self.grid.columns as f32, self.area.height / self.grid.rows as f32)
    }

    /// Middle of a cell, pixels of the picture.
    fn place(&self, index: usize) -> Point2f {
        let cell = self.cell();
        let (x, y) = (index % self.grid.columns, index / self.grid.columns);
        self.area.tl() + Point2f::new((x as f32 + 0.5) * cell.x, (y as f32 + 0.5) * cell.y)
    }

    /// How far down the box the row of a cell lies, 0 to 1.
    fn lower(&self, index: usize) -> f32 {
        let place = ((index / self.grid.columns) as f32 + 0.5) / self.grid.rows as f32;
        ((place - 0.5) * CONTEXT.1 * 4.0 + 0.5).clamp(0.0, 1.0)
    }
}

impl Cells {
    /// Looks around `bounds` (pixels of the picture).
    pub fn observe(seen: &Observation, bounds: Rect2f, grid: Grid) -> Self {
        let mut cells = Self::default();
        cells.look(seen, bounds, grid);
        cells
    }

    /// Looks around other bounds, in the same memory.
    pub fn look(&mut self, seen: &Observation, bounds: Rect2f, grid: Grid) {
        let area = scaled(bounds, CONTEXT.0, CONTEXT.1);
        let frame = Rect2f::new(0.0, 0.0, seen.luma.width() as f32, seen.luma.height() as f32);
        let Self { lattice, colours, motion, inside, sampler, planes } = self;
        let mut sample = |plane: &Luma, out: &mut Vec<u8>| {
            let (across, down) = (plane.width() as f32 / frame.width, plane.height() as f32 / frame.height);
            let part = Rect2f::new(area.x * across, area.y * down, area.width * across, area.height * down);
            sampler.sample(plane, part, (grid.columns, grid.rows), out);
        };
        let count = grid.columns * grid.rows;
        *lattice = Lattice { area, grid };
        let [first, second, third] = planes;
        motion.clear();
        match seen.scene {
            Some(scene) => {
                sample(&scene.foreground, first);
                motion.extend(first.iter().map(|likelihood| motion_log_odds(*likelihood)));
            }
            None => motion.resize(count, 0.0),
        }
        sample(&seen.scene.map_or(seen.luma, |scene| scene.luma), first);
        colours.clear();
        match seen.scene.and_then(|scene| scene.chroma) {
            Some([u, v]) => {
                sample(&u, second);
                sample(&v, third);
                let tints = second.iter().zip(&*third).map(|(u, v)| Some([*u, *v]));
                colours.extend(first.iter().copied().zip(tints));
            }
            None => colours.extend(first.iter().map(|grey| (*grey, None))),
        }
        // Columns and rows each by themselves: there are thousands of cells.
        let is_within = |place: f32, size: f32| place >= 0.0 && place < size;
        let column_is_within = |column: &usize| is_within(lattice.place(*column).x, frame.width);
        let first = (0..grid.columns).take_while(|column| !column_is_within(column)).count();
        let columns = first..first + (first..grid.columns).take_while(column_is_within).count();
        inside.clear();
        inside.resize(count, false);
        for (row, cells) in inside.chunks_exact_mut(grid.columns.max(1)).enumerate() {
            let is_row_within = is_within(lattice.place(row * grid.columns).y, frame.height);
            cells[columns.clone()].fill(is_row_within);
        }
    }

    /// Whether there is a cell in that column and row, and it lies in the picture.
    fn is_inside(&self, column: i32, row: i32) -> bool {
        let Grid { columns, rows } = self.lattice.grid;
        let is_there = (0..columns as i32).contains(&column) && (0..rows as i32).contains(&row);
        is_there && self.inside[row as usize * columns + column as usize]
    }

    /// Size of a cell, pixels of the picture.
    pub fn cell(&self) -> Point2f {
        self.lattice.cell()
    }

    /// Logarithm of the odds of each cell, by motion and, where they are known, by colours.
    pub fn evidence(&self, looks: Option<Looks>) -> Evidence {
        let mut evidence = Evidence::default();
        self.weigh(looks, &mut evidence);
        evidence
    }

    /// The same in the memory of other evidence.
    pub fn weigh(&self, looks: Option<Looks>, evidence: &mut Evidence) {
        evidence.grid = self.lattice.grid;
        evidence.odds.clear();
        let columns = self.lattice.grid.columns.max(1);
        let rows = self.colours.chunks_exact(columns).zip(self.motion.chunks_exact(columns));
        for (row, ((colours, motion), inside)) in rows.zip(self.inside.chunks_exact(columns)).enumerate() {
            let limited =
                |(odds, inside): (f32, &bool)| if *inside { odds.clamp(-LARGEST, LARGEST) } else { 0.0 };
            let Some(Looks { colours: model, alone }) = looks else {
                evidence.odds.extend(motion.iter().copied().zip(inside).map(limited));
                continue;
            };
            let lower = self.lattice.lower(row * columns);
            let (against_ground, against_anyone) =
                (model.log_odds(lower), alone.is_finite().then(|| model.log_odds_against_anyone(lower)));
            let both = colours.iter().zip(motion).map(|(colour, motion)| {
                let not_ground = motion + against_ground(*colour);
                // Somebody else moves against the background as well: only colours tell who it is. The larger of both
                // doubts counts.
                match &against_anyone {
                    Some(against_anyone) => not_ground.min(alone + against_anyone(*colour)),
                    None => not_ground,
                }
            });
            evidence.odds.extend(both.zip(inside).map(limited));
        }
        evidence.odds.extend([0.0; LANES]);
    }

    /// Figure (upper and lower half) and ground by their colours, as `map` has them.
    pub fn histograms(&self, map: &FigureMap) -> ([Option<Histogram>; 2], Option<Histogram>) {
        let chosen = |weight: &dyn Fn(usize) -> f32| {
            Histogram::of(
                (0..self.colours.len())
                    .filter(|&index| self.inside[index])
                    .map(|index| (self.colours[index], weight(index)))
                    .filter(|(_, weight)| *weight > 0.0),
            )
        };
        let figure = |half: f32| {
            chosen(&|index| {
                let lower = self.lattice.lower(index);
                let share = if half > 0.5 { lower } else { 1.0 - lower };
                if map.probability[index] >= FIGURE { map.probability[index] * share } else { 0.0 }
            })
        };
        // What moves beside the target is no ground: more of the same person, where only a part of them was seen at first.
        let ground = chosen(&|index| {
            if map.probability[index] <= GROUND && self.motion[index] <= 0.0 { 1.0 } else { 0.0 }
        });
        ([figure(0.0), figure(1.0)], ground)
    }
}

fn motion_log_odds(likelihood: u8) -> f32 {
    let share = (f32::from(likelihood) - 128.0) / 127.0;
    if share > 0.0 { MOVES * share } else { -RESTS * share }
}

/// Logarithm of the odds of each cell that it is figure.
#[derive(Debug, Clone, Default)]
pub(super) struct Evidence {
    grid: Grid,
    /// And some room beyond the last of them.
    odds: Vec<f32>,
}

impl Evidence {
    /// The cells from that place on, row after row, where all of so many columns and rows are there.
    fn whole(&self, (column, row): (i32, i32), (columns, rows): (usize, usize)) -> Option<&[f32]> {
        let (column, row) = (usize::try_from(column).ok()?, usize::try_from(row).ok()?);
        let is_there = column + columns <= self.grid.columns && row + rows <= self.grid.rows;
        is_there.then(|| &self.odds[row * self.grid.columns + column..])
    }

    /// The cells of a row from a column on, and how many columns before the first cell there are.
    fn row(&self, column: i32, row: i32) -> (&[f32], usize) {
        let Some(cells) =
            usize::try_from(row).ok().and_then(|row| self.odds.chunks_exact(self.grid.columns).nth(row))
        else {
            return (&[], 0);
        };
        let first = usize::try_from(column).unwrap_or(0).min(cells.len());
        (&cells[first..], usize::try_from(-column).unwrap_or(0))
    }
}

/// How likely each cell around the box is part of the target.
#[derive(Debug, Clone)]
pub(super) struct FigureMap {
    lattice: Lattice,
    probability: Vec<f32>,
}

impl FigureMap {
    /// What the evidence and the shape say together of the cells around the box.
    pub fn new(cells: &Cells, evidence: &Evidence, shape: &Shape) -> Self {
        let mut map = Self { lattice: cells.lattice, probability: Vec::new() };
        map.draw(cells, evidence, shape);
        map
    }

    /// The same in the memory of another map.
    pub fn draw(&mut self, cells: &Cells, evidence: &Evidence, shape: &Shape) {
        let odds = evidence.odds.iter().zip(shape.log_odds()).map(|(odds, by_place)| odds + by_place);
        let probability = odds
            .zip(&cells.inside)
            .map(|(odds, inside)| if *inside { 1.0 / (1.0 + (-odds).exp()) } else { 0.0 });
        self.lattice = cells.lattice;
        self.probability.clear();
        self.probability.extend(probability);
    }

    /// How likely a place of the picture belongs to the target; 0 where the map does not reach.
    pub fn at(&self, place: Point2f) -> f32 {
        let Lattice { area, grid: Grid { columns, rows } } = self.lattice;
        let offset = place - area.tl();
        let (x, y) = (offset.x / area.width * columns as f32, offset.y / area.height * rows as f32);
        let inside = x >= 0.0 && y >= 0.0 && x < columns as f32 && y < rows as f32;
        if inside { self.probability[y as usize * columns + x as usize] } else { 0.0 }
    }

    /// The centre of mass (3.13 to 3.15) of the figure inside `bounds`; `None` where there is none.
    pub fn centre_of_mass(&self, bounds: Rect2f) -> Option<Point2f> {
        let (mut sum, mut mass) = (Point2f::default(), 0.0);
        for (index, share) in self.probability.iter().enumerate() {
            let place = self.lattice.place(index);
            if *share >= 0.5 && bounds.contains(place) {
                sum += (place - centre(bounds)) * *share;
                mass += share;
            }
        }
        (mass > 0.0).then(|| centre(bounds) + sum / mass)
    }
}

#[cfg(test)]
mod tests;
