// SPDX-License-Identifier: MPL-2.0

//! What the figure looks like in grey, the wall left out: template matching by normalised cross-correlation (Lewis, "Fast Normalized
//! Cross-Correlation", 1995), weighted by how likely each cell is figure.

use super::{Cells, FigureMap};

/// Variance of greys below which there is nothing to correlate with.
const FLAT: f32 = 4.0;

/// Greys of the cells around a target.
#[derive(Debug, Clone, Default)]
pub(in super::super) struct GreyTemplate {
    columns: usize,
    greys: Vec<f32>,
    /// Of the cells that are figure: index, weight, and grey less the mean of all; the weights sum to 1.
    figure: Vec<(usize, f32, f32)>,
    /// Weighted variance of the greys.
    variance: f32,
}

impl GreyTemplate {
    /// Learns the greys of `cells`, of which `map` says what is figure, at that rate from 0 to 1.
    pub fn learn(&mut self, cells: &Cells, map: &FigureMap, rate: f32) {
        let grid = cells.lattice.grid;
        let greys = cells.colours.iter().map(|(grey, _)| f32::from(*grey));
        if self.greys.len() == cells.colours.len() {
            self.greys.iter_mut().zip(greys).for_each(|(old, new)| *old += (new - *old) * rate);
        } else {
            self.greys = greys.collect();
        }
        self.columns = grid.columns;
        let figure = || map.probability.iter().enumerate().filter(|(_, share)| **share >= 0.5);
        let total = figure().map(|(_, share)| share).sum::<f32>().max(f32::EPSILON);
        let mean = figure().map(|(index, share)| share / total * self.greys[index]).sum::<f32>();
        self.figure.clear();
        self.figure.extend(figure().map(|(index, share)| (index, share / total, self.greys[index] - mean)));
        self.variance = self.figure.iter().map(|(_, weight, grey)| weight * grey * grey).sum();
    }

    /// How well the greys of `cells`, from cells so many columns right and rows down on, correlate with the figure's: -1 to 1; 0 where there
    /// is nothing to correlate.
    pub fn correlation(&self, cells: &Cells, (right, down): (i32, i32)) -> f32 {
        let columns = self.columns as i32;
        let (mut sum, mut squares, mut product) = (0.0, 0.0, 0.0);
        for (index, weight, grey) in &self.figure {
            let column = *index as i32 % columns + right;
            let moved = *index as i32 + down * columns + right;
            let inside = (0..columns).contains(&column);
            let seen =
                usize::try_from(moved).ok().filter(|_| inside).and_then(|moved| cells.colours.get(moved));
            let Some((seen, _)) = seen else { continue };
            let seen = f32::from(*seen);
            sum += weight * seen;
            squares += weight * seen * seen;
            product += weight * grey * seen;
        }
        let variance = squares - sum * sum;
        if variance.min(self.variance) < FLAT { 0.0 } else { product / (variance * self.variance).sqrt() }
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
            let correlation = |place| template.correlation(&darker, place);
            correlation(*a).total_cmp(&correlation(*b))
        });
        assert_eq!(best, Some((3, -2)));
        assert!(template.correlation(&darker, (3, -2)) > 0.98);
        assert!(template.correlation(&darker, (0, 0)).abs() < 0.3);
    }

    #[test]
    fn what_is_even_correlates_with_nothing() {
        let even = cells(|_, _| 90);
        assert_eq!(learned(&even).correlation(&cells(textured), (0, 0)), 0.0);
        assert_eq!(learned(&cells(textured)).correlation(&even, (0, 0)), 0.0);
        assert_eq!(GreyTemplate::default().correlation(&even, (0, 0)), 0.0);
    }
}
