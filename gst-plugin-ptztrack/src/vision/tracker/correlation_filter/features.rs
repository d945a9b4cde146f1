// SPDX-License-Identifier: MPL-2.0

//! What a correlation filter sees of a picture: histograms of oriented gradients, and the grey of each cell.

use multiversion::multiversion;
use opencv::core::{Mat, Rect2f, Size};
use opencv::imgproc;
use opencv::prelude::*;

use crate::vision::Luma;
use crate::vision::tracker::sample::Sampler;

/// Side of a cell in pixels of the template.
const CELL: usize = 4;
/// Orientations told apart, without sign: a dark coat before a bright wall may pass a dark one.
const ORIENTATIONS: usize = 8;
/// They, and the grey.
const CHANNELS: usize = ORIENTATIONS + 1;
/// How much the grey of a cell counts against its gradients.
const GREY_WEIGHT: f32 = 0.35;

/// Normalised histograms of oriented gradients of each cell, and its grey: one plane for each.
#[derive(Clone, Default)]
pub(super) struct Features {
    pub channels: Vec<Vec<f32>>,
    /// Memory for the next picture.
    sampler: Sampler,
    pixels: Vec<u8>,
    gradients: [Vec<f32>; 2],
    votes: Votes,
    /// Energy of the cells and of a border around them, and the norms of a row of cells.
    energy: Vec<f32>,
    norms: Vec<f32>,
    strength: Mat,
    angle: Mat,
    cells: Mat,
}

impl Features {
    /// Of `area` of the picture, which is cut into cells.
    pub fn describe(&mut self, luma: &Luma, area: Rect2f, columns: usize, rows: usize) -> opencv::Result<()> {
        let width = columns * CELL;
        self.sampler.sample(luma, area, (width, rows * CELL), &mut self.pixels);
        let grey = Luma::packed(&self.pixels, width);
        gradients(&grey, &mut self.gradients);
        let [dx, dy] = &self.gradients;
        let (strength, angle) = (&mut self.strength, &mut self.angle);
        opencv::core::cart_to_polar(&Mat::from_slice(dx)?, &Mat::from_slice(dy)?, strength, angle, false)?;
        let (strength, angle) = (strength.data_typed::<f32>()?, angle.data_typed::<f32>()?);
        for channel in all_of(&mut self.channels) {
            channel.resize(columns * rows, 0.0);
        }
        let [oriented @ .., tone] = self.channels.as_mut_slice() else { return Ok(()) };
        self.votes.count(strength, angle);
        for cell in 0..columns * rows {
            let first = cell / columns * CELL * width + cell % columns * CELL;
            let histogram = self.votes.histogram(first, width);
            for (channel, value) in oriented.iter_mut().zip(histogram) {
                channel[cell] = value;
            }
        }
        normalise(oriented, (columns, rows), &mut self.energy, &mut self.norms);
        grey_cells(&grey, columns, rows, &mut self.cells, tone)
    }
}

/// What each pixel adds to the two orientations that its gradient lies between.
#[derive(Clone, Default)]
struct Votes {
    /// The lower one, not wrapped around.
    orientations: Vec<u8>,
    lower: Vec<f32>,
    upper: Vec<f32>,
}

impl Votes {
    /// Of gradients of that strength and angle.
    fn count(&mut self, strength: &[f32], angle: &[f32]) {
        self.orientations.resize(strength.len(), 0);
        self.lower.resize(strength.len(), 0.0);
        self.upper.resize(strength.len(), 0.0);
        vote(strength, angle, &mut self.orientations, &mut self.lower, &mut self.upper);
    }

    /// Of the cell whose first pixel is `first`, rows `width` pixels apart; one more than there are orientations.
    fn histogram(&self, first: usize, width: usize) -> [f32; ORIENTATIONS + 1] {
        // The last wraps around to the first.
        let mut histogram = [0.0; ORIENTATIONS + 1];
        for row in (0..CELL).map(|y| first + y * width).map(|start| start..start + CELL) {
            let shares = self.lower[row.clone()].iter().zip(&self.upper[row.clone()]);
            for (orientation, (lower, upper)) in self.orientations[row].iter().zip(shares) {
                let orientation = usize::from(*orientation) % ORIENTATIONS;
                histogram[orientation] += lower;
                histogram[orientation + 1] += upper;
            }
        }
        histogram[0] += histogram[ORIENTATIONS];
        histogram
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn vote(strength: &[f32], angle: &[f32], orientations: &mut [u8], lower: &mut [f32], upper: &mut [f32]) {
    let votes = orientations.iter_mut().zip(lower.iter_mut().zip(upper));
    for ((orientation, (lower, upper)), (strength, angle)) in votes.zip(strength.iter().zip(angle)) {
        let turn = angle * (ORIENTATIONS as f32 / std::f32::consts::PI);
        *orientation = turn as u8;
        let share = turn - f32::from(*orientation);
        *lower = strength * (1.0 - share);
        *upper = strength * share;
    }
}

/// Leaves central differences `across` and `down`, the border repeated, rows packed.
fn gradients(grey: &Luma, [across, down]: &mut [Vec<f32>; 2]) {
    let (width, height) = (grey.width(), grey.height());
    // What is left of the picture before is written over.
    for plane in [&mut *across, &mut *down] {
        plane.resize(width * height, 0.0);
    }
    let rows = across.chunks_exact_mut(width.max(1)).zip(down.chunks_exact_mut(width.max(1)));
    for (y, (across, down)) in rows.enumerate() {
        let row = grey.row(y);
        let (above, below) = (grey.row(y.saturating_sub(1)), grey.row((y + 1).min(height - 1)));
        for (out, (above, below)) in down.iter_mut().zip(above.iter().zip(below)) {
            *out = f32::from(*below) - f32::from(*above);
        }
        let inner = &mut across[1.min(width)..];
        for (out, (left, right)) in inner.iter_mut().zip(row.iter().zip(row.iter().skip(2))) {
            *out = f32::from(*right) - f32::from(*left);
        }
        if let ([first, second, ..], [.., before, last]) = (row, row) {
            across[0] = f32::from(*second) - f32::from(*first);
            across[width - 1] = f32::from(*last) - f32::from(*before);
        }
    }
}

/// Divides by the gradient energy of the 3x3 cells around, so that shade and contrast do not count. `energy` and `norms` are
/// memory.
fn normalise(
    channels: &mut [Vec<f32>],
    (columns, rows): (usize, usize),
    energy: &mut Vec<f32>,
    norms: &mut Vec<f32>,
) {
    const FAINT: f32 = 200.0;
    const BRIGHTEST: f32 = 0.6;
    // There is nothing in the border around the cells.
    let wide = columns + 2;
    energy.clear();
    energy.resize(wide * (rows + 2), 0.0);
    for channel in &*channels {
        for (energy, cells) in energy.chunks_exact_mut(wide).skip(1).zip(channel.chunks_exact(columns)) {
            energy[1..].iter_mut().zip(cells).for_each(|(energy, cell)| *energy += cell * cell);
        }
    }
    let neighbours = |place: usize, count: usize| (place + 2).min(count) - place.saturating_sub(1);
    for y in 0..rows {
        norms.clear();
        norms.resize(columns, 0.0);
        for row in energy.chunks_exact(wide).skip(y).take(3) {
            for first in 0..3 {
                norms.iter_mut().zip(&row[first..]).for_each(|(norm, energy)| *norm += energy);
            }
        }
        for (x, norm) in norms.iter_mut().enumerate() {
            let count = (neighbours(x, columns) * neighbours(y, rows)) as f32;
            *norm = (*norm / count + FAINT).sqrt();
        }
        for channel in channels.iter_mut() {
            let cells = channel[y * columns..][..columns].iter_mut().zip(&*norms);
            cells.for_each(|(value, norm)| *value = (*value / norm).min(BRIGHTEST));
        }
    }
}

/// Leaves the grey of each cell in `out`; `memory` is OpenCV's.
fn grey_cells(
    grey: &Luma,
    columns: usize,
    rows: usize,
    memory: &mut Mat,
    out: &mut Vec<f32>,
) -> opencv::Result<()> {
    let size = Size::new(columns as i32, rows as i32);
    grey.with_mat(|grey| imgproc::resize(grey, memory, size, 0.0, 0.0, imgproc::INTER_AREA))?;
    out.clear();
    out.extend(memory.data_typed::<u8>()?.iter().map(|cell| f32::from(*cell)));
    let count = out.len().max(1) as f32;
    let mean = out.iter().sum::<f32>() / count;
    let deviation = (out.iter().map(|cell| (cell - mean).powi(2)).sum::<f32>() / count).sqrt().max(8.0);
    out.iter_mut().for_each(|cell| *cell = GREY_WEIGHT * (*cell - mean) / deviation);
    Ok(())
}

/// A plane for each channel, made where there is none yet.
pub(super) fn all_of<T: Clone + Default>(planes: &mut Vec<T>) -> impl Iterator<Item = &mut T> {
    planes.resize(CHANNELS, T::default());
    planes.iter_mut()
}
