// SPDX-License-Identifier: MPL-2.0

//! Where there is something to hold on to.

use opencv::core::{self, Mat, Point2f, Rect};
use opencv::imgproc;
use opencv::prelude::*;

use crate::vision::Luma;

/// Cells of the grid along the longer side of the picture.
const CELLS: i32 = 10;
/// Side of the window that the gradients are summed over.
const BLOCK: i32 = 5;
/// A corner's eigenvalue is so many times the mean one of the quietest quarter of the cells, which is that of
/// sensor noise: a point on noise stays wherever it is expected, and would confirm any motion.
const ABOVE_NOISE: f64 = 5.0;
/// This much is a corner even where the whole picture is textured: a gradient of 4 grey levels a pixel.
const SURE: f64 = 1e-3;
/// Pixels that a corner keeps from the edge of the picture, where its window would be cut.
const MARGIN: i32 = 4;

/// Cells of equal size that cover the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Grid {
    width: i32,
    height: i32,
    side: i32,
}

impl Grid {
    pub fn of(luma: &Luma) -> Self {
        let (width, height) = (luma.width() as i32, luma.height() as i32);
        Self { width, height, side: (width.max(height) + CELLS - 1) / CELLS }
    }

    /// Of the picture, pixels.
    pub fn size(self) -> (f64, f64) {
        (f64::from(self.width), f64::from(self.height))
    }

    fn columns(self) -> i32 {
        (self.width + self.side - 1) / self.side
    }

    fn rows(self) -> i32 {
        (self.height + self.side - 1) / self.side
    }

    pub fn cells(self) -> usize {
        (self.columns() * self.rows()) as usize
    }

    /// The cell that holds `point`; `None` where it lies outside or too near the edge.
    pub fn cell(self, point: Point2f) -> Option<usize> {
        let (x, y) = (point.x.floor() as i32, point.y.floor() as i32);
        let inside = |at: i32, size: i32| (MARGIN..size - MARGIN).contains(&at);
        (inside(x, self.width) && inside(y, self.height))
            .then(|| (y / self.side * self.columns() + x / self.side) as usize)
    }

    fn bounds(self, cell: usize) -> Rect {
        let (column, row) = (cell as i32 % self.columns(), cell as i32 / self.columns());
        let whole = Rect::new(MARGIN, MARGIN, self.width - 2 * MARGIN, self.height - 2 * MARGIN);
        Rect::new(column * self.side, row * self.side, self.side, self.side) & whole
    }
}

/// The corner of a cell with the largest smaller eigenvalue (Shi and Tomasi).
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    pub place: Point2f,
    eigenvalue: f64,
    /// Mean over the cell.
    mean: f64,
}

impl Corner {
    /// Whether there is more to it than noise that gives corners up to `noise`.
    pub fn stands_out(&self, noise: f64) -> bool {
        self.eigenvalue > noise
    }
}

/// The eigenvalue up to which a corner may be noise, from one of each cell.
pub(super) fn noise(corners: &[Corner]) -> f64 {
    let mut means: Vec<f64> = corners.iter().map(|corner| corner.mean).collect();
    means.sort_by(f64::total_cmp);
    means.truncate(means.len().div_ceil(4));
    let quiet = means.iter().sum::<f64>() / means.len().max(1) as f64;
    (ABOVE_NOISE * quiet).min(SURE)
}

/// The best corner of a cell; `None` where the cell is too small for one.
pub(super) fn best(luma: &Luma, grid: Grid, cell: usize) -> opencv::Result<Option<Corner>> {
    let bounds = grid.bounds(cell);
    if bounds.width < BLOCK || bounds.height < BLOCK {
        return Ok(None);
    }
    let mut eigenvalues = Mat::default();
    luma.with_mat(|picture| {
        imgproc::corner_min_eigen_val(&picture.roi(bounds)?, &mut eigenvalues, BLOCK, 3, core::BORDER_DEFAULT)
    })?;
    let (mut eigenvalue, mut place) = (0.0, core::Point::default());
    core::min_max_loc(&eigenvalues, None, Some(&mut eigenvalue), None, Some(&mut place), &core::no_array())?;
    let mean = core::mean_def(&eigenvalues)?[0];
    let place = place + bounds.tl();
    Ok(Some(Corner { place: Point2f::new(place.x as f32, place.y as f32), eigenvalue, mean }))
}
