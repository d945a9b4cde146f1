// SPDX-License-Identifier: MPL-2.0

//! Chance spread over a tile so that its edges meet.

use crate::seeded::Seeded;

const SIDE: usize = 128;

/// Random values on a lattice, smooth between them.
#[derive(Debug, Clone)]
pub(crate) struct Pattern(Vec<f32>);

impl Pattern {
    pub fn new(seed: u64) -> Self {
        let mut chance = Seeded::new(seed);
        Self((0..SIDE * SIDE).map(|_| chance.unit() as f32).collect())
    }

    /// From 0 to 1, `cells` values along each side of the tile (coordinates 0 to 1); at most 128.
    pub fn smooth(&self, u: f64, v: f64, cells: usize) -> f64 {
        self.stretched(u, v, cells, cells)
    }

    /// The same anywhere, the tile repeated, with different numbers of values along the sides.
    pub fn stretched(&self, u: f64, v: f64, columns: usize, rows: usize) -> f64 {
        let split = |place: f64, cells: usize| {
            let place = place * cells as f64;
            let before = place as i32 - i32::from(place < 0.0);
            let share = place - f64::from(before);
            let cell = before.rem_euclid(cells as i32) as usize;
            (cell, (cell + 1) % cells, share * share * (3.0 - 2.0 * share))
        };
        let (left, right, across) = split(u, columns);
        let (top, bottom, down) = split(v, rows);
        let at = |column: usize, row: usize| f64::from(self.0[(row * SIDE + column) % self.0.len()]);
        let above = at(left, top) + (at(right, top) - at(left, top)) * across;
        let below = at(left, bottom) + (at(right, bottom) - at(left, bottom)) * across;
        above + (below - above) * down
    }
}
