// SPDX-License-Identifier: MPL-2.0

//! The silhouette of a target, and how well it fits what is seen.

use multiversion::multiversion;

use super::{CONTEXT, Evidence, FigureMap, Grid, LANES, LARGEST};

/// Silhouettes are compared in this surrounding of the box, in widths and heights of it.
const COMPARED: (f32, f32) = (1.3, 1.15);

/// What is seen of the upper and the lower half of a body: a table may hide one of them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in super::super) struct Halves {
    pub upper: f32,
    pub lower: f32,
}

impl Halves {
    /// Mean of both.
    pub fn mean(self) -> f32 {
        0.5 * (self.upper + self.lower)
    }

    /// Each by itself with that of `other`.
    pub fn with(self, other: Self, combine: impl Fn(f32, f32) -> f32) -> Self {
        Self { upper: combine(self.upper, other.upper), lower: combine(self.lower, other.lower) }
    }
}

/// The silhouette that the target had until now: how likely each cell around the box belongs to it.
#[derive(Debug, Clone)]
pub(in super::super) struct Shape {
    grid: Grid,
    share: Vec<f32>,
    /// Logarithms of the odds that these shares are.
    log_odds: Vec<f32>,
}

impl Shape {
    /// An upright person fills the ellipse in the box.
    pub fn upright(grid: Grid) -> Self {
        let share = (0..grid.columns * grid.rows).map(|index| {
            let (x, y) = normalised(index, grid);
            let radius = x.hypot(y);
            (0.9 - 0.8 * ((radius - 0.85) / 0.3).clamp(0.0, 1.0)).max(0.05)
        });
        let share: Vec<f32> = share.collect();
        Self { grid, log_odds: share.iter().copied().map(log_odds).collect(), share }
    }

    /// Learns the figure of `map`, which lies around the box.
    pub fn learn(&mut self, map: &FigureMap, rate: f32) {
        for ((share, odds), new) in self.share.iter_mut().zip(&mut self.log_odds).zip(&map.probability) {
            *share += (*new - *share) * rate;
            *odds = log_odds(*share);
        }
    }

    /// The silhouette, to be held against evidence.
    pub fn template(&self) -> Template {
        let mut template = Template::default();
        self.cut(&mut template);
        template
    }

    /// The same in the memory of another template.
    pub fn cut(&self, template: &mut Template) {
        let Grid { columns, rows } = self.grid;
        let window = |compared: f32, context: f32, count: usize| {
            let half = 0.5 * compared / context * count as f32;
            let first = (count as f32 / 2.0 - half).round().max(0.0) as usize;
            first..count - first
        };
        let window_x = window(COMPARED.0, CONTEXT.0, columns);
        let window_y = window(COMPARED.1, CONTEXT.1, rows);
        let at = |x: usize, y: usize| self.share[y * columns + x];
        let row = |y: usize| window_x.clone().map(move |x| (x, y));
        let count = (window_x.len() * window_y.len()).max(1) as f32;
        let mean = window_y.clone().map(|y| row(y).map(|(x, y)| at(x, y)).sum::<f32>()).sum::<f32>() / count;
        let mut weights = std::mem::take(&mut template.weights);
        weights.clear();
        let stride = window_x.len().next_multiple_of(LANES);
        for y in window_y.clone() {
            weights.extend(row(y).map(|(x, y)| at(x, y) - mean));
            weights.resize(weights.len().next_multiple_of(stride.max(1)), 0.0);
        }
        let first = (window_x.start as i32, window_y.start as i32);
        let upper_rows = window_y.filter(|y| 2 * y < rows).count();
        let (upper, lower) = weights.split_at(upper_rows * stride);
        let norm = |weights: &[f32]| weights.iter().map(|weight| weight.abs()).sum::<f32>();
        let norm = Halves { upper: norm(upper), lower: norm(lower) };
        *template = Template { first, columns: window_x.len(), stride, upper_rows, weights, norm };
    }

    /// Logarithm of the odds that each cell belongs to the target by its place alone.
    pub(super) fn log_odds(&self) -> &[f32] {
        &self.log_odds
    }
}

/// Logarithm of the odds; nothing is certain.
fn log_odds(share: f32) -> f32 {
    let share = share.clamp(0.05, 0.95);
    (share / (1.0 - share)).ln()
}

/// A silhouette less its mean: made once, and held against the evidence at many places.
#[derive(Debug, Default)]
pub(in super::super) struct Template {
    /// Column and row of its first cell.
    first: (i32, i32),
    columns: usize,
    /// Rows that belong to the upper half of the body.
    upper_rows: usize,
    /// Row after row, each filled up to `stride`.
    weights: Vec<f32>,
    stride: usize,
    /// Sum of the weights' magnitudes.
    norm: Halves,
}

impl Template {
    /// How well the silhouette, moved by so many cells, fits the evidence: -1 to 1, near 0 before a wall of one colour.
    pub fn fit(&self, evidence: &Evidence, moved: (i32, i32)) -> Halves {
        let first = (self.first.0 + moved.0, self.first.1 + moved.1);
        let sums = match evidence.whole(first, (self.columns, self.weights.len() / self.stride.max(1))) {
            Some(odds) => self.sums(odds, evidence.grid.columns),
            None => self.sums_within(evidence, first),
        };
        sums.with(self.norm, |sum, norm| sum / (norm * LARGEST).max(f32::EPSILON))
    }

    /// Sums of weighted evidence, of which all is there.
    fn sums(&self, odds: &[f32], across: usize) -> Halves {
        let (upper, lower) = self.weights.split_at(self.upper_rows * self.stride);
        Halves {
            upper: sum_of_rows(upper, self.stride, odds, across),
            lower: sum_of_rows(lower, self.stride, &odds[self.upper_rows * across..], across),
        }
    }

    /// The same of what is there.
    fn sums_within(&self, evidence: &Evidence, (left, top): (i32, i32)) -> Halves {
        let mut sums = Halves::default();
        for (y, weights) in self.weights.chunks_exact(self.stride).enumerate() {
            let (odds, skipped) = evidence.row(left, top + y as i32);
            let seen = weights[..self.columns].iter().skip(skipped).zip(odds);
            let sum = if y < self.upper_rows { &mut sums.upper } else { &mut sums.lower };
            *sum += seen.map(|(weight, odds)| weight * odds).sum::<f32>();
        }
        sums
    }
}

/// The sum of weighted odds, over rows of so many `columns` of weights and such that are `across` apart of odds.
#[multiversion(targets("x86_64+avx2"))]
fn sum_of_rows(weights: &[f32], columns: usize, odds: &[f32], across: usize) -> f32 {
    let mut sums = [0.0; LANES];
    for (y, weights) in weights.chunks_exact(columns.max(1)).enumerate() {
        let odds = &odds[y * across..][..columns];
        for (weights, odds) in weights.as_chunks::<LANES>().0.iter().zip(odds.as_chunks::<LANES>().0) {
            for lane in 0..LANES {
                sums[lane] += weights[lane] * odds[lane];
            }
        }
    }
    sums.iter().sum()
}

/// Place of a cell in half sizes of the box from its middle: -1 to 1 inside.
fn normalised(index: usize, grid: Grid) -> (f32, f32) {
    let (column, row) = (index % grid.columns, index / grid.columns);
    let at = |place: usize, count: usize, context: f32| {
        ((place as f32 + 0.5) / count as f32 - 0.5) * 2.0 * context
    };
    (at(column, grid.columns, CONTEXT.0), at(row, grid.rows, CONTEXT.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_fits_as_its_definition_says_wherever_it_is_moved() {
        let grid = Grid { columns: 36, rows: 60 };
        let template = Shape::upright(grid).template();
        // What is kept beyond the last cell weighs nothing.
        let cells = (0..grid.columns * grid.rows).map(|index| (index * 37 % 97) as f32 / 48.0 - 1.0);
        let evidence = Evidence { grid, odds: cells.chain([9.0; LANES]).collect() };
        for moved in [(0, 0), (8, -8), (-8, 8), (9, 0), (-9, 3), (3, 9), (0, 20), (-30, -50), (40, 0)] {
            let mut sums = Halves::default();
            for (y, weights) in template.weights.chunks_exact(template.stride).enumerate() {
                for (x, weight) in weights[..template.columns].iter().enumerate() {
                    let column = template.first.0 + moved.0 + x as i32;
                    let row = template.first.1 + moved.1 + y as i32;
                    if (0..grid.columns as i32).contains(&column) && (0..grid.rows as i32).contains(&row) {
                        let sum = if y < template.upper_rows { &mut sums.upper } else { &mut sums.lower };
                        *sum += weight * evidence.odds[row as usize * grid.columns + column as usize];
                    }
                }
            }
            let fit = template.fit(&evidence, moved);
            let found = fit.with(template.norm, |fit, norm| fit * norm * LARGEST);
            let off = (found.upper - sums.upper).abs().max((found.lower - sums.lower).abs());
            assert!(off < 1e-2, "{moved:?}: {found:?}, {sums:?}");
        }
    }
}
