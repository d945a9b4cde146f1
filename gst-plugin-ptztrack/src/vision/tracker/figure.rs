// SPDX-License-Identifier: MPL-2.0

//! Figure and ground: which cells around the target are person, and which are wall.
//!
//! Motion against the background and colour each give the odds of every cell; the silhouette that the target had until
//! now says where to expect it. The map that comes of it tells where corners are taken, what the correlation filter
//! learns, where box and centre of mass lie, and whether the target is there at all.

use opencv::core::{Point2f, Rect2f};

use super::colour::{Colour, ColourModel, Histogram};
use super::geometry::{centre, scaled};
use super::sample::Sampler;
use crate::vision::{Luma, Observation};

/// What is looked at around the target, in widths and heights of it.
pub(super) const CONTEXT: (f32, f32) = (2.4, 1.6);
/// Logarithm of the odds where a cell is surely not the known background, and where it surely is: dark clothes before a
/// dark wall look like the wall, a wall never looks like somebody.
const MOVES: f32 = 2.5;
const RESTS: f32 = -1.2;
/// One cue says no more than this of a cell: a few bright cells are not worth the whole body.
const LARGEST: f32 = 2.0;
/// Silhouettes are compared in this surrounding of the box, in widths and heights of it.
const COMPARED: (f32, f32) = (1.3, 1.15);
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
        inside.clear();
        inside.extend((0..count).map(|index| frame.contains(lattice.place(index))));
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
        let odds = (0..self.colours.len()).map(|index| {
            let both = looks.map_or(self.motion[index], |Looks { colours, alone }| {
                let (colour, lower) = (self.colours[index], self.lattice.lower(index));
                let not_ground = self.motion[index] + colours.log_odds(colour, lower);
                // Somebody else moves against the background as well: only colours tell who it is. The larger of both
                // doubts counts.
                if alone.is_finite() {
                    not_ground.min(alone + colours.log_odds_against_anyone(colour, lower))
                } else {
                    not_ground
                }
            });
            if self.inside[index] { both.clamp(-LARGEST, LARGEST) } else { 0.0 }
        });
        evidence.grid = self.lattice.grid;
        evidence.odds.clear();
        evidence.odds.extend(odds);
        evidence.motion.clone_from(&self.motion);
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
    odds: Vec<f32>,
    /// The same by motion alone; 0 where nothing is known of the background.
    motion: Vec<f32>,
}

impl Evidence {
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

/// What is seen of the upper and the lower half of a body: a table may hide one of them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Halves {
    pub upper: f32,
    pub lower: f32,
}

impl Halves {
    /// Both together.
    pub fn sum(self) -> f32 {
        self.upper + self.lower
    }

    /// Their mean.
    pub fn mean(self) -> f32 {
        0.5 * self.sum()
    }

    /// Each by itself with that of `other`.
    pub fn with(self, other: Self, combine: impl Fn(f32, f32) -> f32) -> Self {
        Self { upper: combine(self.upper, other.upper), lower: combine(self.lower, other.lower) }
    }
}

/// The silhouette that the target had until now: how likely each cell around the box belongs to it.
#[derive(Debug, Clone)]
pub(super) struct Shape {
    grid: Grid,
    share: Vec<f32>,
}

impl Shape {
    /// An upright person fills the ellipse in the box.
    pub fn upright(grid: Grid) -> Self {
        let share = (0..grid.columns * grid.rows).map(|index| {
            let (x, y) = normalised(index, grid);
            let radius = x.hypot(y);
            (0.9 - 0.8 * ((radius - 0.85) / 0.3).clamp(0.0, 1.0)).max(0.05)
        });
        Self { grid, share: share.collect() }
    }

    /// Learns the figure of `map`, which lies around the box.
    pub fn learn(&mut self, map: &FigureMap, rate: f32) {
        for (share, new) in self.share.iter_mut().zip(&map.probability) {
            *share += (*new - *share) * rate;
        }
    }

    /// The silhouette, larger by `scale`, to be held against evidence.
    pub fn template(&self, scale: f32) -> Template {
        let mut template = Template::default();
        self.cut(scale, &mut template);
        template
    }

    /// The same in the memory of another template.
    pub fn cut(&self, scale: f32, template: &mut Template) {
        let Grid { columns, rows } = self.grid;
        let middle = (columns as f32 / 2.0, rows as f32 / 2.0);
        let window = |compared: f32, context: f32, count: usize| {
            let half = 0.5 * compared / context * count as f32;
            let first = (count as f32 / 2.0 - half).round().max(0.0) as usize;
            first..count - first
        };
        let window_x = window(COMPARED.0, CONTEXT.0, columns);
        let window_y = window(COMPARED.1, CONTEXT.1, rows);
        let at = |x: usize, y: usize| {
            if scale == 1.0 {
                return self.share[y * columns + x];
            }
            let from = |place: usize, middle: f32| (place as f32 + 0.5 - middle) / scale + middle - 0.5;
            let (x, y) = (from(x, middle.0).round(), from(y, middle.1).round());
            let inside = x >= 0.0 && y >= 0.0 && (x as usize) < columns && (y as usize) < rows;
            if inside { self.share[y as usize * columns + x as usize] } else { 0.05 }
        };
        let row = |y: usize| window_x.clone().map(move |x| (x, y));
        let count = (window_x.len() * window_y.len()).max(1) as f32;
        let mean = window_y.clone().map(|y| row(y).map(|(x, y)| at(x, y)).sum::<f32>()).sum::<f32>() / count;
        let mut weights = std::mem::take(&mut template.weights);
        weights.clear();
        weights.extend(window_y.clone().flat_map(row).map(|(x, y)| at(x, y) - mean));
        let first = (window_x.start as i32, window_y.start as i32);
        let upper_rows = window_y.filter(|y| (*y as f32) < middle.1).count();
        let (upper, lower) = weights.split_at(upper_rows * window_x.len());
        let norm = |weights: &[f32]| weights.iter().map(|weight| weight.abs()).sum::<f32>();
        let norm = Halves { upper: norm(upper), lower: norm(lower) };
        *template = Template { first, columns: window_x.len(), upper_rows, weights, norm };
    }

    /// Logarithm of the odds that a cell belongs to the target by its place alone.
    fn log_odds(&self, index: usize) -> f32 {
        let share = self.share[index].clamp(0.05, 0.95);
        (share / (1.0 - share)).ln()
    }
}

/// A silhouette of some size, less its mean: made once, and held against the evidence at many places.
#[derive(Debug, Default)]
pub(super) struct Template {
    /// Column and row of its first cell.
    first: (i32, i32),
    columns: usize,
    /// Rows that belong to the upper half of the body.
    upper_rows: usize,
    weights: Vec<f32>,
    /// Sum of the weights' magnitudes.
    norm: Halves,
}

impl Template {
    /// How well the silhouette, moved by so many cells, fits the evidence: -1 to 1, near 0 before a wall of one colour.
    pub fn fit(&self, evidence: &Evidence, moved: (i32, i32)) -> Halves {
        let (left, top) = (self.first.0 + moved.0, self.first.1 + moved.1);
        let mut sums = Halves::default();
        for (y, weights) in self.weights.chunks_exact(self.columns).enumerate() {
            let (odds, skipped) = evidence.row(left, top + y as i32);
            let seen = weights.iter().skip(skipped).zip(odds);
            let sum = if y < self.upper_rows { &mut sums.upper } else { &mut sums.lower };
            *sum += seen.map(|(weight, odds)| weight * odds).sum::<f32>();
        }
        sums.with(self.norm, |sum, norm| sum / (norm * LARGEST).max(f32::EPSILON))
    }
}

/// Place of a cell in half sizes of the box from its middle: -1 to 1 inside.
fn normalised(index: usize, grid: Grid) -> (f32, f32) {
    let (column, row) = (index % grid.columns, index / grid.columns);
    let at = |place: usize, count: usize, context: f32| {
        ((place as f32 + 0.5) / count as f32 - 0.5) * 2.0 * context
    };
    (at(column, grid.columns, CONTEXT.0), at(row, grid.rows, CONTEXT.1))
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
        let odds = evidence.odds.iter().enumerate().map(|(index, odds)| odds + shape.log_odds(index));
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

    /// Leaves the mean over blocks of `side` x `side` cells, row after row, in `means`.
    pub fn reduce(&self, side: usize, means: &mut Vec<f32>) {
        let whole = self.lattice.grid;
        let (columns, rows) = (whole.columns / side, whole.rows / side);
        let mean = |x: usize, y: usize| {
            let rows = y * side..(y + 1) * side;
            let sum: f32 = rows
                .map(|row| {
                    let start = row * whole.columns + x * side;
                    self.probability[start..start + side].iter().sum::<f32>()
                })
                .sum();
            sum / (side * side) as f32
        };
        means.clear();
        means.extend((0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))).map(|(x, y)| mean(x, y)));
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
mod tests {
    use super::*;
    use crate::vision::SceneView;

    const GRID: Grid = Grid { columns: 36, rows: 60 };
    const BOX: Rect2f = Rect2f { x: 100.0, y: 60.0, width: 40.0, height: 100.0 };

    /// A person of one grey before a wall of another, and what the background says of it.
    struct Scene {
        luma: Vec<u8>,
        foreground: Vec<u8>,
    }

    impl Scene {
        const SIZE: (usize, usize) = (320, 240);

        fn new(person: Rect2f, grey: u8, seen_to_move: u8) -> Self {
            let pixels = || {
                (0..Self::SIZE.0 * Self::SIZE.1)
                    .map(|i| Point2f::new((i % Self::SIZE.0) as f32 + 0.5, (i / Self::SIZE.0) as f32 + 0.5))
            };
            let of = |here: u8, else_: u8| {
                pixels().map(|p| if person.contains(p) { here } else { else_ }).collect()
            };
            Self { luma: of(grey, 150), foreground: of(seen_to_move, 0) }
        }

        fn cells(&self, bounds: Rect2f) -> Cells {
            let plane = |data| Luma::new(data, Self::SIZE.0, Self::SIZE.1, Self::SIZE.0).expect("whole");
            let luma = plane(&self.luma);
            let scene = SceneView {
                camera_motion: None,
                luma,
                chroma: None,
                foreground: plane(&self.foreground),
                background: luma,
            };
            let seen = Observation { luma, scene: Some(scene) };
            Cells::observe(&seen, bounds, GRID)
        }
    }

    #[test]
    fn what_moves_is_figure_and_the_wall_is_ground() {
        let cells = Scene::new(BOX, 60, 255).cells(BOX);
        let map = FigureMap::new(&cells, &cells.evidence(None), &Shape::upright(GRID));
        assert!(map.at(centre(BOX)) > 0.95);
        assert!(map.at(Point2f::new(BOX.x - 15.0, 110.0)) < 0.1);
        assert_eq!(map.at(Point2f::new(0.0, 0.0)), 0.0, "beyond the map");
    }

    #[test]
    fn the_silhouette_fits_best_where_the_person_is() {
        let moved = BOX + Point2f::new(8.0, 0.0);
        let cells = Scene::new(moved, 60, 255).cells(BOX);
        let evidence = cells.evidence(None);
        let template = Shape::upright(GRID).template(1.0);
        let best = (-6..=6)
            .flat_map(|x| (-6..=6).map(move |y| (x, y)))
            .max_by(|a, b| {
                let fit = |moved| template.fit(&evidence, moved).mean();
                fit(*a).total_cmp(&fit(*b))
            })
            .expect("some");
        // A cell is 2.67 pixels wide.
        assert!((best.0 - 3).abs() <= 1 && best.1.abs() <= 1, "{best:?}");
    }

    #[test]
    fn a_known_wall_fits_nobody() {
        let cells = Scene::new(Rect2f::default(), 60, 255).cells(BOX);
        let fit = Shape::upright(GRID).template(1.0).fit(&cells.evidence(None), (0, 0));
        assert!(fit.mean().abs() < 0.05, "{fit:?}");
    }

    #[test]
    fn behind_a_table_the_upper_half_still_fits() {
        let upper = Rect2f { height: 50.0, ..BOX };
        let cells = Scene::new(upper, 60, 255).cells(BOX);
        let fit = Shape::upright(GRID).template(1.0).fit(&cells.evidence(None), (0, 0));
        assert!(fit.upper > 0.4 && fit.lower < 0.1, "{fit:?}");
    }

    /// Of somebody of that grey who moves.
    fn colours_of(grey: u8) -> ColourModel {
        let cells = Scene::new(BOX, grey, 255).cells(BOX);
        let map = FigureMap::new(&cells, &cells.evidence(None), &Shape::upright(GRID));
        let ([upper, lower], ground) = cells.histograms(&map);
        ColourModel::new([upper.expect("seen"), lower.expect("seen")], ground.expect("seen"))
    }

    /// How well an upright silhouette of these colours fits the scene.
    fn fit(scene: &Scene, colours: &ColourModel, alone: f32) -> f32 {
        let evidence = scene.cells(BOX).evidence(Some(Looks { colours, alone }));
        Shape::upright(GRID).template(1.0).fit(&evidence, (0, 0)).mean()
    }

    #[test]
    fn colours_find_who_stands_still_again() {
        // Seen to move first, then nothing moves any more.
        let colours = colours_of(60);
        let still = fit(&Scene::new(BOX, 60, 128), &colours, f32::INFINITY);
        assert!(still > 0.4, "{still}");
        let gone = fit(&Scene::new(Rect2f::default(), 60, 128), &colours, f32::INFINITY);
        assert!(gone.abs() < 0.05, "{gone}");
    }

    #[test]
    fn beside_others_who_moves_in_other_colours_is_not_the_target() {
        let colours = colours_of(60);
        let fit = |grey, alone| fit(&Scene::new(BOX, grey, 255), &colours, alone);
        let (own, other) = (fit(60, 0.5), fit(220, 0.5));
        assert!(own > 0.4 && other < 0.5 * own, "{own} {other}");
        assert!(fit(220, f32::INFINITY) > 0.4, "alone, whoever moves is the target");
    }

    #[test]
    fn the_centre_of_mass_is_that_of_the_figure() {
        let cells = Scene::new(BOX, 60, 255).cells(BOX);
        let map = FigureMap::new(&cells, &cells.evidence(None), &Shape::upright(GRID));
        let mass = map.centre_of_mass(BOX).expect("seen");
        assert!((mass - centre(BOX)).norm() < 2.0, "{mass:?}");
        assert_eq!(map.centre_of_mass(BOX + Point2f::new(900.0, 0.0)), None);
    }
}
