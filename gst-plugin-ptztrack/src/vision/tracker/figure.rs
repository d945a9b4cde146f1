//! Figure and ground: which cells around the target are person, and which are wall.
//!
//! Motion against the background and colour each give the odds of every cell; the silhouette that the target had until
//! now says where to expect it. The map that comes of it tells where corners are taken, what the correlation filter
//! learns, where box and centre of mass lie, and whether the target is there at all.

use opencv::core::{Point2f, Rect2f};

use super::colour::{Colour, ColourModel, Histogram};
use super::geometry::{centre, scaled};
use super::sample::sample;
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
#[derive(Debug, Clone)]
pub(super) struct Cells {
    area: Rect2f,
    columns: usize,
    rows: usize,
    colours: Vec<Colour>,
    /// Logarithm of the odds by motion against the background.
    motion: Vec<f32>,
    /// Whether the cell lies in the picture.
    inside: Vec<bool>,
}

/// A number of cells across and down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Grid {
    pub columns: usize,
    pub rows: usize,
}

impl Cells {
    /// Looks around `bounds` (pixels of the picture).
    pub fn observe(seen: &Observation, bounds: Rect2f, grid: Grid) -> opencv::Result<Self> {
        let area = scaled(bounds, CONTEXT.0, CONTEXT.1);
        let frame = Rect2f::new(0.0, 0.0, seen.luma.width() as f32, seen.luma.height() as f32);
        let plane = |plane: &Luma| -> opencv::Result<Vec<u8>> {
            let (across, down) = (plane.width() as f32 / frame.width, plane.height() as f32 / frame.height);
            let part = Rect2f::new(area.x * across, area.y * down, area.width * across, area.height * down);
            Ok(opencv::prelude::MatTraitConstManual::data_bytes(&sample(
                plane,
                part,
                grid.columns,
                grid.rows,
            )?)?
            .to_vec())
        };
        let count = grid.columns * grid.rows;
        let luma = plane(&seen.scene.map_or(seen.luma, |scene| scene.luma))?;
        let tints = match seen.scene.and_then(|scene| scene.chroma) {
            Some([u, v]) => plane(&u)?.into_iter().zip(plane(&v)?).map(|(u, v)| Some([u, v])).collect(),
            None => vec![None; count],
        };
        let motion = match seen.scene {
            Some(scene) => plane(&scene.foreground)?.into_iter().map(motion_log_odds).collect(),
            None => vec![0.0; count],
        };
        let mut cells = Self {
            area,
            columns: grid.columns,
            rows: grid.rows,
            colours: luma.into_iter().zip(tints).collect(),
            motion,
            inside: vec![true; count],
        };
        cells.inside = (0..count).map(|index| frame.contains(cells.place(index))).collect();
        Ok(cells)
    }

    /// Middle of a cell, pixels of the picture.
    fn place(&self, index: usize) -> Point2f {
        let cell = self.cell();
        let (x, y) = (index % self.columns, index / self.columns);
        self.area.tl() + Point2f::new((x as f32 + 0.5) * cell.x, (y as f32 + 0.5) * cell.y)
    }

    /// Size of a cell, pixels of the picture.
    pub fn cell(&self) -> Point2f {
        Point2f::new(self.area.width / self.columns as f32, self.area.height / self.rows as f32)
    }

    /// How far down the box a row lies, 0 to 1.
    fn lower(&self, row: usize) -> f32 {
        let place = (row as f32 + 0.5) / self.rows as f32;
        ((place - 0.5) * CONTEXT.1 * 4.0 + 0.5).clamp(0.0, 1.0)
    }

    /// Logarithm of the odds of each cell, by motion and colour.
    pub fn evidence(&self, colours: Option<&ColourModel>) -> Evidence {
        let odds = (0..self.colours.len()).map(|index| {
            let colour =
                |model: &ColourModel| model.log_odds(self.colours[index], self.lower(index / self.columns));
            let both = self.motion[index] + colours.map_or(0.0, colour);
            if self.inside[index] { both.clamp(-LARGEST, LARGEST) } else { 0.0 }
        });
        Evidence(odds.collect())
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
                let lower = self.lower(index / self.columns);
                let share = if half > 0.5 { lower } else { 1.0 - lower };
                if map.probability[index] >= FIGURE { map.probability[index] * share } else { 0.0 }
            })
        };
        let ground = chosen(&|index| if map.probability[index] <= GROUND { 1.0 } else { 0.0 });
        ([figure(0.0), figure(1.0)], ground)
    }
}

fn motion_log_odds(likelihood: u8) -> f32 {
    let share = (f32::from(likelihood) - 128.0) / 127.0;
    if share > 0.0 { MOVES * share } else { -RESTS * share }
}

/// Logarithm of the odds of each cell that it is figure.
#[derive(Debug, Clone)]
pub(super) struct Evidence(Vec<f32>);

impl Evidence {
    /// How likely the strips just beyond the left, upper, right and lower side of the box are figure, by motion and
    /// colour alone.
    pub fn beyond(&self, grid: Grid) -> [f32; 4] {
        // In half sizes of the box from its middle, along the side and away from it.
        const ALONG: f32 = 0.6;
        const AWAY: std::ops::Range<f32> = 1.05..1.3;
        let mut sums = [(0.0_f32, 0.0_f32); 4];
        for (index, odds) in self.0.iter().enumerate() {
            let (x, y) = normalised(index % grid.columns, index / grid.columns, grid);
            let strips = [(-x, y), (-y, x), (x, y), (y, x)];
            for ((sum, count), (away, along)) in sums.iter_mut().zip(strips) {
                if AWAY.contains(&away) && along.abs() <= ALONG {
                    *sum += 1.0 / (1.0 + (-odds).exp());
                    *count += 1.0;
                }
            }
        }
        sums.map(|(sum, count)| sum / count.max(1.0))
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
            let (x, y) = normalised(index % grid.columns, index / grid.columns, grid);
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

    /// How well the silhouette, larger by `scale` and moved by so many cells, fits the evidence: -1 to 1, near 0 before a
    /// wall of one colour.
    pub fn fit(&self, evidence: &Evidence, moved: (i32, i32), scale: f32) -> Halves {
        let Grid { columns, rows } = self.grid;
        let half =
            (0.5 * COMPARED.0 / CONTEXT.0 * columns as f32, 0.5 * COMPARED.1 / CONTEXT.1 * rows as f32);
        let middle = (columns as f32 / 2.0, rows as f32 / 2.0);
        let first = |middle: f32, half: f32| (middle - half).round().max(0.0) as usize;
        let window_x = first(middle.0, half.0)..columns - first(middle.0, half.0);
        let window_y = first(middle.1, half.1)..rows - first(middle.1, half.1);
        let count = (window_x.len() * window_y.len()).max(1) as f32;
        let at = |x: usize, y: usize| {
            if scale == 1.0 {
                return self.share[y * columns + x];
            }
            let from = |place: usize, middle: f32| (place as f32 + 0.5 - middle) / scale + middle - 0.5;
            let (x, y) = (from(x, middle.0).round(), from(y, middle.1).round());
            let inside = x >= 0.0 && y >= 0.0 && (x as usize) < columns && (y as usize) < rows;
            if inside { self.share[y as usize * columns + x as usize] } else { 0.05 }
        };
        let mut mean = 0.0;
        for y in window_y.clone() {
            mean += window_x.clone().map(|x| at(x, y)).sum::<f32>();
        }
        mean /= count;
        let mut sums = [(0.0_f32, 0.0_f32); 2];
        for y in window_y {
            let (sum, norm) = &mut sums[usize::from(y as f32 >= middle.1)];
            let row = y as i32 + moved.1;
            for x in window_x.clone() {
                let weight = at(x, y) - mean;
                *norm += weight.abs();
                let column = x as i32 + moved.0;
                if (0..rows as i32).contains(&row) && (0..columns as i32).contains(&column) {
                    *sum += weight * evidence.0[row as usize * columns + column as usize];
                }
            }
        }
        let fit = |(sum, norm): (f32, f32)| sum / (norm * LARGEST).max(f32::EPSILON);
        Halves { upper: fit(sums[0]), lower: fit(sums[1]) }
    }

    /// How likely the silhouette, moved by so many cells, is figure by motion and colour alone: 0 to 1.
    pub fn level(&self, evidence: &Evidence, moved: (i32, i32)) -> Halves {
        let Grid { columns, rows } = self.grid;
        let mut sums = [(0.0_f32, 0.0_f32); 2];
        for (index, share) in self.share.iter().enumerate().filter(|(_, share)| **share > 0.5) {
            let (x, y) = ((index % columns) as i32 + moved.0, (index / columns) as i32 + moved.1);
            if (0..rows as i32).contains(&y) && (0..columns as i32).contains(&x) {
                let (sum, weight) = &mut sums[usize::from(2 * (index / columns) >= rows)];
                *sum += share / (1.0 + (-evidence.0[y as usize * columns + x as usize]).exp());
                *weight += share;
            }
        }
        let mean = |(sum, weight): (f32, f32)| sum / weight.max(f32::EPSILON);
        Halves { upper: mean(sums[0]), lower: mean(sums[1]) }
    }

    /// Logarithm of the odds that a cell belongs to the target by its place alone.
    fn log_odds(&self, index: usize) -> f32 {
        let share = self.share[index].clamp(0.05, 0.95);
        (share / (1.0 - share)).ln()
    }
}

/// Place of a cell in half sizes of the box from its middle: -1 to 1 inside.
fn normalised(column: usize, row: usize, grid: Grid) -> (f32, f32) {
    let at = |place: usize, count: usize, context: f32| {
        ((place as f32 + 0.5) / count as f32 - 0.5) * 2.0 * context
    };
    (at(column, grid.columns, CONTEXT.0), at(row, grid.rows, CONTEXT.1))
}

/// How likely each cell around the box is part of the target.
#[derive(Debug, Clone)]
pub(super) struct FigureMap {
    area: Rect2f,
    grid: Grid,
    probability: Vec<f32>,
}

impl FigureMap {
    /// What the evidence and the shape say together of the cells around the box.
    pub fn new(cells: &Cells, evidence: &Evidence, shape: &Shape) -> Self {
        let odds = evidence.0.iter().enumerate().map(|(index, odds)| odds + shape.log_odds(index));
        let probability = odds
            .zip(&cells.inside)
            .map(|(odds, inside)| if *inside { 1.0 / (1.0 + (-odds).exp()) } else { 0.0 });
        Self {
            area: cells.area,
            grid: Grid { columns: cells.columns, rows: cells.rows },
            probability: probability.collect(),
        }
    }

    /// How likely a place of the picture belongs to the target; 0 where the map does not reach.
    pub fn at(&self, place: Point2f) -> f32 {
        let offset = place - self.area.tl();
        let (x, y) = (
            offset.x / self.area.width * self.grid.columns as f32,
            offset.y / self.area.height * self.grid.rows as f32,
        );
        let inside = x >= 0.0 && y >= 0.0 && x < self.grid.columns as f32 && y < self.grid.rows as f32;
        if inside { self.probability[y as usize * self.grid.columns + x as usize] } else { 0.0 }
    }

    /// The mean over blocks of `side` x `side` cells, row after row.
    pub fn reduced(&self, side: usize) -> Vec<f32> {
        let (columns, rows) = (self.grid.columns / side, self.grid.rows / side);
        let mean = |x: usize, y: usize| {
            let rows = y * side..(y + 1) * side;
            let sum: f32 = rows
                .map(|row| {
                    let start = row * self.grid.columns + x * side;
                    self.probability[start..start + side].iter().sum::<f32>()
                })
                .sum();
            sum / (side * side) as f32
        };
        (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))).map(|(x, y)| mean(x, y)).collect()
    }

    /// The centre of mass (3.13 to 3.15) of the figure inside `bounds`; `None` where there is none.
    pub fn centre_of_mass(&self, bounds: Rect2f) -> Option<Point2f> {
        let (mut sum, mut mass) = (Point2f::default(), 0.0);
        let cell = (self.area.width / self.grid.columns as f32, self.area.height / self.grid.rows as f32);
        for (index, share) in self.probability.iter().enumerate() {
            let (x, y) = (index % self.grid.columns, index / self.grid.columns);
            let place = self.area.tl() + Point2f::new((x as f32 + 0.5) * cell.0, (y as f32 + 0.5) * cell.1);
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
            Cells::observe(&seen, bounds, GRID).expect("observe")
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
        let shape = Shape::upright(GRID);
        let best = (-6..=6)
            .flat_map(|x| (-6..=6).map(move |y| (x, y)))
            .max_by(|a, b| {
                let fit = |moved| shape.fit(&evidence, moved, 1.0).mean();
                fit(*a).total_cmp(&fit(*b))
            })
            .expect("some");
        // A cell is 2.67 pixels wide.
        assert!((best.0 - 3).abs() <= 1 && best.1.abs() <= 1, "{best:?}");
    }

    #[test]
    fn a_known_wall_fits_nobody() {
        let cells = Scene::new(Rect2f::default(), 60, 255).cells(BOX);
        let fit = Shape::upright(GRID).fit(&cells.evidence(None), (0, 0), 1.0);
        assert!(fit.mean().abs() < 0.05, "{fit:?}");
    }

    #[test]
    fn behind_a_table_the_upper_half_still_fits() {
        let upper = Rect2f { height: 50.0, ..BOX };
        let cells = Scene::new(upper, 60, 255).cells(BOX);
        let fit = Shape::upright(GRID).fit(&cells.evidence(None), (0, 0), 1.0);
        assert!(fit.upper > 0.4 && fit.lower < 0.1, "{fit:?}");
    }

    #[test]
    fn colours_find_who_stands_still_again() {
        // Seen to move first, then nothing moves any more.
        let cells = Scene::new(BOX, 60, 255).cells(BOX);
        let map = FigureMap::new(&cells, &cells.evidence(None), &Shape::upright(GRID));
        let ([upper, lower], ground) = cells.histograms(&map);
        let model = ColourModel::new([upper.expect("seen"), lower.expect("seen")], ground.expect("seen"));
        let still = Scene::new(BOX, 60, 128).cells(BOX);
        let fit = Shape::upright(GRID).fit(&still.evidence(Some(&model)), (0, 0), 1.0);
        assert!(fit.mean() > 0.4, "{fit:?}");
        let gone = Scene::new(Rect2f::default(), 60, 128).cells(BOX);
        let fit = Shape::upright(GRID).fit(&gone.evidence(Some(&model)), (0, 0), 1.0);
        assert!(fit.mean().abs() < 0.05, "{fit:?}");
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
