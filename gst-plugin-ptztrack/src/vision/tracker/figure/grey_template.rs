// SPDX-License-Identifier: MPL-2.0

//! What the figure looks like in grey, the wall left out: template matching by normalised cross-correlation (Lewis, "Fast Normalized
//! Cross-Correlation", 1995), weighted by how likely each cell is figure.

use super::{Cells, FigureMap};

/// Variance of greys below which there is nothing to correlate.
const FLAT: f32 = 4.0;
/// How likely a cell must be figure to count.
const FIGURE: f32 = 0.5;

/// A cell that is figure.
#[derive(Debug, Clone, Copy)]
struct Cell {
    column: i32,
    row: i32,
    index: i32,
    /// Those of all cells sum to 1.
    weight: f32,
    /// Less the mean of all.
    grey: f32,
    /// The product of both.
    weighted_grey: f32,
}

/// Greys of the cells around a target.
#[derive(Debug, Clone, Default)]
pub(in super::super) struct GreyTemplate {
    greys: Vec<f32>,
    figure: Vec<Cell>,
    /// The first and the last column and row of the figure.
    corners: [(i32, i32); 2],
    /// Weighted variance of the figure's greys.
    variance: f32,
}

impl GreyTemplate {
    /// Learns the greys of `cells`, of which `map` says what is figure, at that rate from 0 to 1.
    pub fn learn(&mut self, cells: &Cells, map: &FigureMap, rate: f32) {
        let greys = cells.colours.iter().map(|(grey, _)| f32::from(*grey));
        if self.greys.len() == cells.colours.len() {
            self.greys.iter_mut().zip(greys).for_each(|(old, new)| *old += (new - *old) * rate);
        } else {
            self.greys = greys.collect();
        }
        let figure = || map.probability.iter().enumerate().filter(|(_, share)| **share >= FIGURE);
        let total = figure().map(|(_, share)| share).sum::<f32>().max(f32::EPSILON);
        let mean = figure().map(|(index, share)| share / total * self.greys[index]).sum::<f32>();
        let columns = cells.lattice.grid.columns;
        self.figure.clear();
        self.figure.extend(figure().map(|(index, share)| {
            let (weight, grey) = (share / total, self.greys[index] - mean);
            let (column, row) = ((index % columns) as i32, (index / columns) as i32);
            Cell { column, row, index: index as i32, weight, grey, weighted_grey: weight * grey }
        }));
        self.variance = self.figure.iter().map(|cell| cell.weighted_grey * cell.grey).sum();
        let extremes = |pick: fn(&Cell) -> i32| {
            let places = || self.figure.iter().map(pick);
            [places().min(), places().max()].map(Option::unwrap_or_default)
        };
        let ([left, right], [top, bottom]) = (extremes(|cell| cell.column), extremes(|cell| cell.row));
        self.corners = [(left, top), (right, bottom)];
    }

    /// How well the greys of `cells`, from cells so many columns right and rows down on, correlate with the figure's: -1 to 1, and the nearer
    /// to 0 the less of it lies in the picture. `None` where there is nothing to correlate.
    pub fn correlation(&self, cells: &Cells, (right, down): (i32, i32)) -> Option<f32> {
        let is_inside = |column: i32, row: i32| cells.is_inside(column + right, row + down);
        let offset = down * cells.lattice.grid.columns as i32 + right;
        // The picture has no holes.
        let [covered, own, sum, squares, product] =
            if self.corners.iter().all(|(column, row)| is_inside(*column, *row)) {
                self.sums(cells, offset, |_| true)
            } else {
                self.sums(cells, offset, |cell| is_inside(cell.column, cell.row))
            };
        if covered <= f32::EPSILON {
            return None;
        }
        let variance = squares - sum * sum / covered;
        (variance.min(self.variance) >= FLAT)
            .then(|| (product - own * sum / covered) / (variance * self.variance).sqrt())
    }

    /// Sums over the figure, moved by so many cells, of what is inside: of weights, of the figure's greys, of the greys that are seen, of
    /// their squares and of the products of both.
    #[inline(always)]
    fn sums(&self, cells: &Cells, offset: i32, is_inside: impl Fn(&Cell) -> bool) -> [f32; 5] {
        let (mut covered, mut own, mut sum, mut squares, mut product) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for cell in self.figure.iter().filter(|cell| is_inside(cell)) {
            let (seen, _) = cells.colours[(cell.index + offset) as usize];
            let seen = f32::from(seen);
            covered += cell.weight;
            own += cell.weighted_grey;
            sum += cell.weight * seen;
            squares += cell.weight * seen * seen;
            product += cell.weighted_grey * seen;
        }
        [covered, own, sum, squares, product]
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Grid, Lattice, Shape};
    use super::*;
    use opencv::core::Rect2f;

    const GRID: Grid = Grid { columns: 36, rows: 56 };

    /// Cells that look like this.
    fn cells(grey: impl Fn(i32, i32) -> u8) -> Cells {
        let place = |index: usize| ((index % GRID.columns) as i32, (index / GRID.columns) as i32);
        let count = GRID.columns * GRID.rows;
        let area = Rect2f::new(0.0, 0.0, GRID.columns as f32, GRID.rows as f32);
        Cells {
            lattice: Lattice { area, grid: GRID },
            colours: (0..count).map(|index| (grey(place(index).0, place(index).1), None)).collect(),
            motion: vec![0.0; count],
            inside: vec![true; count],
            ..Cells::default()
        }
    }

    fn textured(x: i32, y: i32) -> u8 {
        let hash = (x as u32).wrapping_mul(0x9e37_79b1) ^ (y as u32).wrapping_mul(0x85eb_ca6b);
        (hash.wrapping_mul(0xc2b2_ae35) >> 24) as u8
    }

    fn learned(cells: &Cells) -> GreyTemplate {
        let map = FigureMap::new(cells, &cells.evidence(None), &Shape::upright(GRID));
        let mut template = GreyTemplate::default();
        template.learn(cells, &map, 1.0);
        template
    }

    #[test]
    fn it_is_found_where_it_went_in_any_light() {
        let template = learned(&cells(textured));
        let darker = cells(|x, y| textured(x - 3, y + 2) / 2 + 20);
        let best = (-8..=8).flat_map(|y| (-8..=8).map(move |x| (x, y))).max_by(|a, b| {
            let correlation = |place| template.correlation(&darker, place).expect("textured");
            correlation(*a).total_cmp(&correlation(*b))
        });
        assert_eq!(best, Some((3, -2)));
        assert!(template.correlation(&darker, (3, -2)).is_some_and(|correlation| correlation > 0.98));
        assert!(template.correlation(&darker, (0, 0)).is_some_and(|correlation| correlation.abs() < 0.3));
    }

    #[test]
    fn what_is_even_correlates_with_nothing() {
        let even = cells(|_, _| 90);
        assert_eq!(learned(&even).correlation(&cells(textured), (0, 0)), None);
        assert_eq!(learned(&cells(textured)).correlation(&even, (0, 0)), None);
        assert_eq!(GreyTemplate::default().correlation(&even, (0, 0)), None);
    }

    #[test]
    fn it_is_what_its_definition_says_of_the_cells_that_are_inside() {
        let template = learned(&cells(textured));
        let mut seen = cells(|x, y| textured(x - 3, y + 2));
        let is_inside = |x: i32, y: i32| (3..33).contains(&x) && (6..50).contains(&y);
        for (index, inside) in seen.inside.iter_mut().enumerate() {
            *inside = is_inside((index % GRID.columns) as i32, (index / GRID.columns) as i32);
        }
        for (right, down) in [(0, 0), (3, -2), (-12, 9), (20, -30)] {
            let cells = template.figure.iter().filter(|cell| is_inside(cell.column + right, cell.row + down));
            let pairs = cells.map(|cell| {
                let at = (cell.row + down) as usize * GRID.columns + (cell.column + right) as usize;
                [cell.weight, cell.grey, f32::from(seen.colours[at].0)].map(f64::from)
            });
            let pairs: Vec<[f64; 3]> = pairs.collect();
            let sum = |of: fn(&[f64; 3]) -> f64| pairs.iter().map(of).sum::<f64>();
            let (covered, grey) = (sum(|[weight, ..]| *weight), sum(|[weight, _, grey]| weight * grey));
            let product = sum(|[weight, own, grey]| weight * own * grey)
                - sum(|[weight, own, _]| weight * own) * grey / covered;
            let variance = sum(|[weight, _, grey]| weight * grey * grey) - grey * grey / covered;
            let expected = product / (variance * f64::from(template.variance)).sqrt();
            let found = template.correlation(&seen, (right, down)).expect("textured");
            assert!((f64::from(found) - expected).abs() < 1e-3, "{right}, {down}: {found}, {expected}");
        }
    }

    /// Dark trousers and a bright coat before an even wall, of which no more is seen: what is not seen says nothing.
    #[test]
    fn what_lies_beyond_the_picture_says_nothing() {
        let template = learned(&cells(|x, y| if y < 28 { 200 } else { textured(x, y) / 8 }));
        let noise = |x, y| 90 + textured(x, y) / 32;
        let mut edge = cells(noise);
        for (index, inside) in edge.inside.iter_mut().enumerate() {
            *inside = index / GRID.columns < 30;
        }
        for place in [(0, 0), (0, 8), (20, 0), (-20, 26)] {
            let correlation = template.correlation(&edge, place).unwrap_or_default();
            assert!(correlation.abs() < 0.3, "{place:?}: {correlation}");
        }
        assert_eq!(template.correlation(&edge, (0, 100)), None);
    }

    #[test]
    fn what_is_learned_slowly_takes_over() {
        let mut template = learned(&cells(textured));
        let other = |x, y| textured(y, x + 50);
        let (before, after) = (cells(textured), cells(other));
        let map = FigureMap::new(&after, &after.evidence(None), &Shape::upright(GRID));
        template.learn(&after, &map, 0.1);
        let correlation =
            |template: &GreyTemplate, cells| template.correlation(cells, (0, 0)).expect("textured");
        assert!(correlation(&template, &before) > 0.95);
        (0..40).for_each(|_| template.learn(&after, &map, 0.1));
        assert!(correlation(&template, &after) > 0.95 && correlation(&template, &before) < 0.3);
    }
}
