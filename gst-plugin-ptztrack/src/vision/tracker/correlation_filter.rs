// SPDX-License-Identifier: MPL-2.0

//! What the target looks like: a correlation filter that says where it is near a place, and how surely.
//!
//! Lucas-Kanade follows points from one frame to the next and forgets; small errors add up, and points
//! slide onto whoever passes in front. A filter trained on the whole body since the beginning does not
//! drift and answers with a low peak when the target is hidden. It is the dual correlation filter of
//! Henriques et al., "High-Speed Tracking with Kernelized Correlation Filters" (2015), over histograms of
//! oriented gradients in cells of 4x4 pixels. All of it happens on a grid of some 500 cells, whatever the size
//! of the target.

use multiversion::multiversion;
use opencv::core::{DFT_COMPLEX_OUTPUT, DFT_INVERSE, DFT_REAL_OUTPUT, DFT_SCALE, Mat, Rect2f, Size, Vec2f};
use opencv::imgproc;
use opencv::prelude::*;

use super::figure::{CONTEXT, Grid, Halves};
use super::geometry::scaled;
use super::sample::Sampler;
use crate::vision::Luma;

/// Side of a cell in pixels of the template.
const CELL: usize = 4;
/// Cells of the grid, more or less: 64x128 pixels of template.
const CELLS: f32 = 512.0;
/// Orientations told apart, without sign: a dark coat before a bright wall may pass a dark one.
const ORIENTATIONS: usize = 8;
/// They, and the grey.
const CHANNELS: usize = ORIENTATIONS + 1;
/// Width of the desired answer, as a share of the target's size.
const SHARPNESS: f32 = 0.1;
/// Regularisation of the ridge regression.
const RIDGE: f32 = 1e-4;
/// How much the grey of a cell counts against its gradients.
const GREY_WEIGHT: f32 = 0.35;

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

    /// Looks for the target around `bounds`, at its size, and leaves the answer in `response`.
    pub fn respond(&mut self, luma: &Luma, bounds: Rect2f, response: &mut Response) -> opencv::Result<()> {
        self.describe(luma, bounds)?;
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

    /// Learns what is in `bounds` now, as far as `figure` (a share for each cell) belongs to the target: so the filter
    /// knows the person and not the wall (after CSR-DCF, Lukežič et al., "Discriminative Correlation Filter with Channel
    /// and Spatial Reliability", CVPR 2017, whose solver is left out). `rate` 0 to 1 is the weight against all that was
    /// seen before.
    pub fn learn(&mut self, luma: &Luma, bounds: Rect2f, figure: &[f32], rate: f32) -> opencv::Result<()> {
        self.describe(luma, bounds)?;
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

    /// Works out the features around `bounds`, one plane each.
    fn describe(&mut self, luma: &Luma, bounds: Rect2f) -> opencv::Result<()> {
        let area = scaled(bounds, CONTEXT.0, CONTEXT.1);
        self.features.describe(luma, area, self.columns, self.rows)?;
        for channel in &mut self.features.channels {
            channel.iter_mut().zip(&self.window).for_each(|(value, weight)| *value *= weight);
        }
        Ok(())
    }
}

/// A plane for each channel, made where there is none yet.
fn all_of<T: Clone + Default>(planes: &mut Vec<T>) -> impl Iterator<Item = &mut T> {
    planes.resize(CHANNELS, T::default());
    planes.iter_mut()
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

/// Normalised histograms of oriented gradients of each cell, and its grey: one plane for each.
#[derive(Clone, Default)]
struct Features {
    channels: Vec<Vec<f32>>,
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
    fn describe(&mut self, luma: &Luma, area: Rect2f, columns: usize, rows: usize) -> opencv::Result<()> {
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
mod tests {
    use super::super::synthetic::{Picture, Scene};
    use super::*;
    use proptest::prelude::*;

    const PERSON: Rect2f = Rect2f { x: 120.0, y: 70.0, width: 40.0, height: 90.0 };

    fn person_at(x: f32, y: f32) -> Picture {
        let mut picture = Scene::new(320, 240).background((0.0, 0.0));
        picture.paint(Rect2f { x, y, ..PERSON }, 7);
        picture
    }

    /// The figure fills the box.
    fn figure(grid: Grid) -> Vec<f32> {
        let inside = |place: usize, count: usize, context: f32| {
            (((place as f32 + 0.5) / count as f32 - 0.5) * context).abs() < 0.5
        };
        (0..grid.columns * grid.rows)
            .map(|index| {
                let (x, y) = (index % grid.columns, index / grid.columns);
                if inside(x, grid.columns, CONTEXT.0) && inside(y, grid.rows, CONTEXT.1) { 1.0 } else { 0.0 }
            })
            .collect()
    }

    fn trained(luma: &Luma) -> CorrelationFilter {
        let mut filter = CorrelationFilter::new(PERSON).expect("filter");
        let figure = figure(filter.grid());
        filter.learn(luma, PERSON, &figure, 1.0).expect("learn");
        filter
    }

    fn respond(filter: &mut CorrelationFilter, luma: &Luma, bounds: Rect2f) -> Response {
        let mut response = Response::default();
        filter.respond(luma, bounds, &mut response).expect("respond");
        response
    }

    /// Cells from the middle, and value, of the best answer within reach.
    fn peak(response: &Response) -> ((i32, i32), f32) {
        let places = (-7..=7).flat_map(|x| (-7..=7).map(move |y| (x, y)));
        places
            .map(|place| (place, response.at(place).sum()))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .expect("some")
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]
        #[test]
        fn finds_the_person_nearby(dx in -16.0_f32..16.0, dy in -16.0_f32..16.0) {
            let mut filter = trained(&person_at(PERSON.x, PERSON.y).luma());
            let moved = person_at(PERSON.x + dx, PERSON.y + dy);
            let ((x, y), value) = peak(&respond(&mut filter, &moved.luma(), PERSON));
            let grid = filter.grid();
            let cell = (PERSON.width * CONTEXT.0 / grid.columns as f32, PERSON.height * CONTEXT.1 / grid.rows as f32);
            prop_assert!((x as f32 * cell.0 - dx).abs() < cell.0 && (y as f32 * cell.1 - dy).abs() < cell.1, "{x} {y}");
            prop_assert!(value > 0.2, "{value}");
        }
    }

    #[test]
    fn knows_the_person_from_another() {
        let mut filter = trained(&person_at(PERSON.x, PERSON.y).luma());
        let same = peak(&respond(&mut filter, &person_at(PERSON.x, PERSON.y).luma(), PERSON)).1;
        let mut other = Scene::new(320, 240).background((33.0, 57.0));
        other.paint(PERSON, 1234);
        let other = peak(&respond(&mut filter, &other.luma(), PERSON)).1;
        assert!(same > 0.6 && other < 0.5 * same, "{same} {other}");
    }

    #[test]
    fn the_wall_behind_is_not_learned() {
        // Trained on the person; then the same wall with nobody before it.
        let mut filter = trained(&person_at(PERSON.x, PERSON.y).luma());
        let same = peak(&respond(&mut filter, &person_at(PERSON.x, PERSON.y).luma(), PERSON)).1;
        let wall = Scene::new(320, 240).background((0.0, 0.0));
        let alone = peak(&respond(&mut filter, &wall.luma(), PERSON)).1;
        assert!(alone < 0.4 * same, "{same} {alone}");
    }

    #[test]
    fn learning_takes_over() {
        let mut filter = trained(&person_at(PERSON.x, PERSON.y).luma());
        let mut other = Scene::new(320, 240).background((33.0, 57.0));
        other.paint(PERSON, 1234);
        let figure = figure(filter.grid());
        for _ in 0..10 {
            filter.learn(&other.luma(), PERSON, &figure, 0.5).expect("learn");
        }
        assert!(peak(&respond(&mut filter, &other.luma(), PERSON)).1 > 0.5);
    }

    #[test]
    fn any_shape_and_place_is_survived() {
        let picture = Scene::new(16, 16).background((0.0, 0.0));
        for bounds in [
            Rect2f::new(0.0, 0.0, 16.0, 16.0),
            Rect2f::new(-50.0, 3.0, 2.0, 400.0),
            Rect2f::new(5.0, 5.0, 1.0, 1.0),
            Rect2f::new(0.0, 0.0, 900.0, 3.0),
        ] {
            let mut filter = CorrelationFilter::new(bounds).expect("filter");
            let figure = figure(filter.grid());
            filter.learn(&picture.luma(), bounds, &figure, 1.0).expect("learn");
            assert!(respond(&mut filter, &picture.luma(), bounds).at((0, 0)).sum().is_finite());
        }
    }
}
