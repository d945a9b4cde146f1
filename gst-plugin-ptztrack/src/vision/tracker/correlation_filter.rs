// SPDX-License-Identifier: MPL-2.0

//! What the target looks like: a correlation filter that says where it is near a place, and how surely.
//!
//! Lucas-Kanade follows points from one frame to the next and forgets; small errors add up, and points
//! slide onto whoever passes in front. A filter trained on the whole body since the beginning does not
//! drift and answers with a low peak when the target is hidden. It is the dual correlation filter of
//! Henriques et al., "High-Speed Tracking with Kernelized Correlation Filters" (2015), over histograms of
//! oriented gradients in cells of 4x4 pixels. All of it happens on a grid of some 500 cells, whatever the size
//! of the target.

mod features;

use opencv::core::{DFT_COMPLEX_OUTPUT, DFT_INVERSE, DFT_REAL_OUTPUT, DFT_SCALE, Mat, Rect2f, Vec2f};
use opencv::prelude::*;

use features::{Features, all_of};

use super::figure::{CONTEXT, Grid, Halves};
use super::geometry::scaled;
use crate::vision::Luma;

/// Cells of the grid, more or less: 64x128 pixels of template.
const CELLS: f32 = 512.0;
/// Width of the desired answer, as a share of the target's size.
const SHARPNESS: f32 = 0.1;
/// Regularisation of the ridge regression.
const RIDGE: f32 = 1e-4;

type Complex = Vec2f;
type Spectrum = Vec<Complex>;

/// How much of the ground is learned beside the figure: edges against it help to find the place, but must not decide.
const GROUND_SHARE: f32 = 0.15;

/// What the filter answers: one value for each displacement in whole cells, about 1 where the picture is the one that it
/// was trained on, about 0 where it is another. The filter is linear, so the two halves of the body answer apart.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Response {
    columns: usize,
    rows: usize,
    values: [Vec<f32>; 2],
}

impl Response {
    /// The answers of upper and lower body for a target that is so many cells right of and below the middle of the box.
    pub fn at(&self, (x, y): (i32, i32)) -> Halves {
        let wrap = |place: i32, size: usize| place.rem_euclid(size as i32) as usize;
        let index = wrap(y, self.rows) * self.columns + wrap(x, self.columns);
        Halves { upper: self.values[0][index], lower: self.values[1][index] }
    }
}

/// A trained filter.
#[derive(Clone)]
pub(super) struct CorrelationFilter {
    columns: usize,
    rows: usize,
    window: Vec<f32>,
    label: Spectrum,
    /// Of upper and lower body, a spectrum a channel.
    template: [Vec<Spectrum>; 2],
    filter: Spectrum,
    features: Features,
    memory: Memory,
}

/// What is worked out of one picture, kept as memory for the next.
#[derive(Clone, Default)]
struct Memory {
    /// A channel of one half of the body.
    masked: Vec<f32>,
    /// Of the whole body, a spectrum a channel.
    whole: Vec<Spectrum>,
    /// The same of its halves.
    halves: [Vec<Spectrum>; 2],
    product: Spectrum,
    /// What OpenCV leaves of a transform, forth and back.
    spectrum: Mat,
    values: Mat,
}

impl CorrelationFilter {
    /// A filter for a target of that shape, which has learned nothing yet.
    pub fn new(bounds: Rect2f) -> opencv::Result<Self> {
        let (columns, rows) = grid(bounds);
        let mut filter = Self {
            columns,
            rows,
            window: hann(columns, rows),
            label: Vec::new(),
            template: Default::default(),
            filter: Vec::new(),
            features: Features::default(),
            memory: Memory::default(),
        };
        transform(&label(columns, rows), rows, &mut filter.memory.spectrum, &mut filter.label)?;
        Ok(filter)
    }

    /// Cells across and down.
    pub fn grid(&self) -> Grid {
        Grid { columns: self.columns, rows: self.rows }
    }

    /// Works out the features around `bounds`, one plane each: where to look for the target, or where it is learned.
    pub fn describe(&mut self, luma: &Luma, bounds: Rect2f) -> opencv::Result<()> {
        let area = scaled(bounds, CONTEXT.0, CONTEXT.1);
        self.features.describe(luma, area, self.columns, self.rows)?;
        for channel in &mut self.features.channels {
            channel.iter_mut().zip(&self.window).for_each(|(value, weight)| *value *= weight);
        }
        Ok(())
    }

    /// Looks for the target around what was described, at its size, and leaves the answer in `response`.
    pub fn respond(&mut self, response: &mut Response) -> opencv::Result<()> {
        let Memory { whole, product, spectrum, values: answer, .. } = &mut self.memory;
        for (channel, whole) in self.features.channels.iter().zip(all_of(whole)) {
            transform(channel, self.rows, spectrum, whole)?;
        }
        (response.columns, response.rows) = (self.columns, self.rows);
        for (template, values) in self.template.iter().zip(&mut response.values) {
            correlate(whole, template, product);
            for (value, filter) in product.iter_mut().zip(&self.filter) {
                *value = multiply(*value, *filter);
            }
            transform_back(product, self.rows, answer, values)?;
        }
        Ok(())
    }

    /// Learns what was described, as far as `figure` (a share for each cell) belongs to the target: so the filter
    /// knows the person and not the wall (after CSR-DCF, Lukežič et al., "Discriminative Correlation Filter with Channel
    /// and Spatial Reliability", CVPR 2017, whose solver is left out). `rate` 0 to 1 is the weight against all that was
    /// seen before.
    pub fn learn(&mut self, figure: &[f32], rate: f32) -> opencv::Result<()> {
        self.transform_halves(figure)?;
        let Memory { whole, halves, product, .. } = &mut self.memory;
        let [upper, lower] = &*halves;
        for (whole, (upper, lower)) in all_of(whole).zip(upper.iter().zip(lower)) {
            whole.clear();
            whole.extend(upper.iter().zip(lower).map(|(a, b)| *a + *b));
        }
        correlate(whole, whole, product);
        let filter = self.label.iter().zip(&*product).map(|(label, power)| *label / (power[0] + RIDGE));
        if self.filter.is_empty() {
            self.filter = filter.collect();
            self.template.clone_from(halves);
            return Ok(());
        }
        blend(&mut self.filter, filter, rate);
        for (old, new) in self.template.iter_mut().flatten().zip(halves.iter().flatten()) {
            blend(old, new.iter().copied(), rate);
        }
        Ok(())
    }

    /// Works out the spectra of upper and lower half of the figure in the features.
    fn transform_halves(&mut self, figure: &[f32]) -> opencv::Result<()> {
        let Memory { masked, halves, spectrum: plane, .. } = &mut self.memory;
        for (half, spectra) in halves.iter_mut().enumerate() {
            for (channel, spectrum) in self.features.channels.iter().zip(all_of(spectra)) {
                let cells = channel.iter().zip(figure).enumerate();
                masked.clear();
                masked.extend(cells.map(|(index, (value, share))| {
                    let here = usize::from(2 * (index / self.columns) >= self.rows) == half;
                    let weight = GROUND_SHARE + (1.0 - GROUND_SHARE) * share;
                    if here { value * weight } else { 0.0 }
                }));
                transform(masked, self.rows, plane, spectrum)?;
            }
        }
        Ok(())
    }
}

/// Leaves the spectrum of a plane in `spectrum`; `memory` is OpenCV's.
fn transform(values: &[f32], rows: usize, memory: &mut Mat, spectrum: &mut Spectrum) -> opencv::Result<()> {
    let plane = Mat::from_slice(values)?;
    let plane = plane.reshape(1, rows as i32)?;
    opencv::core::dft(&plane, memory, DFT_COMPLEX_OUTPUT, 0)?;
    spectrum.clear();
    spectrum.extend_from_slice(memory.data_typed::<Complex>()?);
    Ok(())
}

/// The way back.
fn transform_back(
    spectrum: &[Complex],
    rows: usize,
    memory: &mut Mat,
    values: &mut Vec<f32>,
) -> opencv::Result<()> {
    let plane = Mat::from_slice(spectrum)?;
    let plane = plane.reshape(2, rows as i32)?;
    opencv::core::dft(&plane, memory, DFT_INVERSE | DFT_SCALE | DFT_REAL_OUTPUT, 0)?;
    values.clear();
    values.extend_from_slice(memory.data_typed::<f32>()?);
    Ok(())
}

/// Columns and rows of cells for a target of that shape; even, and never too few to correlate.
fn grid(bounds: Rect2f) -> (usize, usize) {
    let aspect = (bounds.width * CONTEXT.0 / (bounds.height * CONTEXT.1).max(1.0)).clamp(0.2, 5.0);
    let even = |cells: f32| 2 * (cells / 2.0).round() as usize;
    (even((CELLS * aspect).sqrt()), even((CELLS / aspect).sqrt()))
}

/// Where the parabola through three neighbouring values peaks, -0.5 to 0.5 from the middle one.
pub(super) fn vertex(before: f32, middle: f32, after: f32) -> f32 {
    let curvature = before - 2.0 * middle + after;
    if curvature < -1e-6 { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
}

/// Falls to 0 towards the border, where the transform wraps around.
fn hann(columns: usize, rows: usize) -> Vec<f32> {
    let weight = |index: usize, size: usize| {
        let phase = std::f32::consts::TAU * (index as f32 + 0.5) / size as f32;
        0.5 * (1.0 - phase.cos())
    };
    (0..rows).flat_map(|y| (0..columns).map(move |x| weight(x, columns) * weight(y, rows))).collect()
}

/// The desired answer: a Gaussian around cell (0, 0), wrapped.
fn label(columns: usize, rows: usize) -> Vec<f32> {
    let target = (columns as f32 / CONTEXT.0) * (rows as f32 / CONTEXT.1);
    let sigma = SHARPNESS * target.sqrt();
    let square = |index: usize, size: usize| (index.min(size - index) as f32).powi(2);
    let value = |x, y| (-0.5 * (square(x, columns) + square(y, rows)) / (sigma * sigma)).exp();
    (0..rows).flat_map(|y| (0..columns).map(move |x| value(x, y))).collect()
}

/// The correlation of two descriptions in the frequency domain, summed over the channels.
fn correlate(a: &[Spectrum], b: &[Spectrum], sum: &mut Spectrum) {
    let size = a.first().map_or(0, Vec::len);
    sum.clear();
    sum.resize(size, Complex::default());
    for (a, b) in a.iter().zip(b) {
        for (sum, (a, b)) in sum.iter_mut().zip(a.iter().zip(b)) {
            sum[0] += a[0] * b[0] + a[1] * b[1];
            sum[1] += a[1] * b[0] - a[0] * b[1];
        }
    }
    let scale = 1.0 / (size * a.len()).max(1) as f32;
    sum.iter_mut().for_each(|value| *value *= scale);
}

fn multiply(a: Complex, b: Complex) -> Complex {
    Complex::from([a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]])
}

fn blend(old: &mut [Complex], new: impl Iterator<Item = Complex>, rate: f32) {
    for (old, new) in old.iter_mut().zip(new) {
        *old = *old * (1.0 - rate) + new * rate;
    }
}

#[cfg(test)]
mod tests;
