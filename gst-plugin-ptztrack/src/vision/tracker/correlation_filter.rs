// SPDX-License-Identifier: MPL-2.0

//! What the target looks like: a correlation filter that says where it is near a place, and how surely.
//!
//! Lucas-Kanade follows points from one frame to the next and forgets; small errors add up, and points
//! slide onto whoever passes in front. A filter trained on the whole body since the beginning does not
//! drift and answers with a low peak when the target is hidden. It is the dual correlation filter of
//! Henriques et al., "High-Speed Tracking with Kernelized Correlation Filters" (2015), over histograms of
//! oriented gradients in cells of 4x4 pixels. All of it happens on a grid of some 500 cells, whatever the size
//! of the target.

use opencv::core::{DFT_COMPLEX_OUTPUT, DFT_INVERSE, DFT_REAL_OUTPUT, DFT_SCALE, Mat, Rect2f, Size, Vec2f};
use opencv::imgproc;
use opencv::prelude::*;

use super::figure::{CONTEXT, Grid, Halves};
use super::geometry::scaled;
use super::sample::sample;
use crate::vision::Luma;

/// Side of a cell in pixels of the template.
const CELL: usize = 4;
/// Cells of the grid, more or less: 64x128 pixels of template.
const CELLS: f32 = 512.0;
/// Orientations told apart, without sign: a dark coat before a bright wall may pass a dark one.
const ORIENTATIONS: usize = 8;
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
#[derive(Debug, Clone, PartialEq)]
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
        };
        filter.label = filter.spectrum(&label(columns, rows))?;
        Ok(filter)
    }

    /// Cells across and down.
    pub fn grid(&self) -> Grid {
        Grid { columns: self.columns, rows: self.rows }
    }

    /// Looks for the target around `bounds`, at its size.
    pub fn respond(&self, luma: &Luma, bounds: Rect2f) -> opencv::Result<Response> {
        let seen = self.spectra(&self.describe(luma, bounds)?)?;
        let answer = |template: &[Spectrum]| {
            let mut response = correlate(&seen, template);
            response
                .iter_mut()
                .zip(&self.filter)
                .for_each(|(value, filter)| *value = product(*value, *filter));
            self.inverse(&response)
        };
        let values = [answer(&self.template[0])?, answer(&self.template[1])?];
        Ok(Response { columns: self.columns, rows: self.rows, values })
    }

    /// Learns what is in `bounds` now, as far as `figure` (a share for each cell) belongs to the target: so the filter
    /// knows the person and not the wall (after CSR-DCF, Lukežič et al., "Discriminative Correlation Filter with Channel
    /// and Spatial Reliability", CVPR 2017, whose solver is left out). `rate` 0 to 1 is the weight against all that was
    /// seen before.
    pub fn learn(&mut self, luma: &Luma, bounds: Rect2f, figure: &[f32], rate: f32) -> opencv::Result<()> {
        let channels = self.describe(luma, bounds)?;
        let template = [self.masked(&channels, figure, 0)?, self.masked(&channels, figure, 1)?];
        let whole: Vec<Spectrum> = template[0].iter().zip(&template[1]).map(|(a, b)| sum(a, b)).collect();
        let power = correlate(&whole, &whole);
        let filter: Spectrum =
            self.label.iter().zip(power).map(|(label, power)| *label / (power[0] + RIDGE)).collect();
        if self.filter.is_empty() {
            (self.template, self.filter) = (template, filter);
            return Ok(());
        }
        for (old, new) in self.template.iter_mut().flatten().zip(template.iter().flatten()) {
            blend(old, new, rate);
        }
        blend(&mut self.filter, &filter, rate);
        Ok(())
    }

    /// Spectra of the upper (0) or lower (1) half of the figure in `channels`.
    fn masked(&self, channels: &[Vec<f32>], figure: &[f32], half: usize) -> opencv::Result<Vec<Spectrum>> {
        let masked = channels.iter().map(|channel| {
            let cells = channel.iter().zip(figure).enumerate();
            let value = |(index, (value, share)): (usize, (&f32, &f32))| {
                let here = usize::from(2 * (index / self.columns) >= self.rows) == half;
                let weight = GROUND_SHARE + (1.0 - GROUND_SHARE) * share;
                if here { value * weight } else { 0.0 }
            };
            cells.map(value).collect::<Vec<f32>>()
        });
        self.spectra(&masked.collect::<Vec<_>>())
    }

    fn spectra(&self, channels: &[Vec<f32>]) -> opencv::Result<Vec<Spectrum>> {
        channels.iter().map(|channel| self.spectrum(channel)).collect()
    }

    /// The features around `bounds`, one plane each.
    fn describe(&self, luma: &Luma, bounds: Rect2f) -> opencv::Result<Vec<Vec<f32>>> {
        let (width, height) = (self.columns * CELL, self.rows * CELL);
        let pixels = sample(luma, scaled(bounds, CONTEXT.0, CONTEXT.1), width, height);
        let mut channels = features(&Luma::packed(&pixels, width), self.columns, self.rows)?;
        for channel in &mut channels {
            channel.iter_mut().zip(&self.window).for_each(|(value, weight)| *value *= weight);
        }
        Ok(channels)
    }

    fn spectrum(&self, values: &[f32]) -> opencv::Result<Spectrum> {
        let plane = Mat::from_slice(values)?;
        let plane = plane.reshape(1, self.rows as i32)?;
        let mut spectrum = Mat::default();
        opencv::core::dft(&plane, &mut spectrum, DFT_COMPLEX_OUTPUT, 0)?;
        Ok(spectrum.data_typed::<Complex>()?.to_vec())
    }

    fn inverse(&self, spectrum: &[Complex]) -> opencv::Result<Vec<f32>> {
        let plane = Mat::from_slice(spectrum)?;
        let plane = plane.reshape(2, self.rows as i32)?;
        let mut values = Mat::default();
        opencv::core::dft(&plane, &mut values, DFT_INVERSE | DFT_SCALE | DFT_REAL_OUTPUT, 0)?;
        Ok(values.data_typed::<f32>()?.to_vec())
    }
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
fn features(grey: &Luma, columns: usize, rows: usize) -> opencv::Result<Vec<Vec<f32>>> {
    let [dx, dy] = gradients(grey);
    let (mut strength, mut angle) = (Mat::default(), Mat::default());
    opencv::core::cart_to_polar(
        &Mat::from_slice(&dx)?,
        &Mat::from_slice(&dy)?,
        &mut strength,
        &mut angle,
        false,
    )?;
    let (strength, angle) = (strength.data_typed::<f32>()?, angle.data_typed::<f32>()?);
    let mut channels = vec![vec![0.0; columns * rows]; ORIENTATIONS];
    let width = columns * CELL;
    for cell in 0..columns * rows {
        let first = cell / columns * CELL * width + cell % columns * CELL;
        // One more than there are orientations: the last wraps around to the first.
        let mut histogram = [0.0; ORIENTATIONS + 1];
        for row in (0..CELL).map(|y| first + y * width) {
            for (strength, angle) in strength[row..row + CELL].iter().zip(&angle[row..row + CELL]) {
                let turn = angle * (ORIENTATIONS as f32 / std::f32::consts::PI);
                let lower = turn as usize;
                let share = turn - lower as f32;
                histogram[lower % ORIENTATIONS] += strength * (1.0 - share);
                histogram[lower % ORIENTATIONS + 1] += strength * share;
            }
        }
        histogram[0] += histogram[ORIENTATIONS];
        for (channel, value) in channels.iter_mut().zip(histogram) {
            channel[cell] = value;
        }
    }
    normalise(&mut channels, columns, rows);
    channels.push(grey_cells(grey, columns, rows)?);
    Ok(channels)
}

/// Central differences across and down, the border repeated, rows packed.
fn gradients(grey: &Luma) -> [Vec<f32>; 2] {
    let (width, height) = (grey.width(), grey.height());
    let [mut across, mut down] = [0, 1].map(|_| vec![0.0; width * height]);
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
    [across, down]
}

/// Divides by the gradient energy of the 3x3 cells around, so that shade and contrast do not count.
fn normalise(channels: &mut [Vec<f32>], columns: usize, rows: usize) {
    const FAINT: f32 = 200.0;
    const BRIGHTEST: f32 = 0.6;
    let energy: Vec<f32> = (0..columns * rows)
        .map(|cell| channels.iter().map(|channel| channel[cell] * channel[cell]).sum())
        .collect();
    for y in 0..rows {
        for x in 0..columns {
            let mut sum = 0.0;
            let mut count = 0.0;
            for v in y.saturating_sub(1)..(y + 2).min(rows) {
                for u in x.saturating_sub(1)..(x + 2).min(columns) {
                    sum += energy[v * columns + u];
                    count += 1.0;
                }
            }
            let norm = (sum / count + FAINT).sqrt();
            for channel in channels.iter_mut() {
                let value = &mut channel[y * columns + x];
                *value = (*value / norm).min(BRIGHTEST);
            }
        }
    }
}

fn grey_cells(grey: &Luma, columns: usize, rows: usize) -> opencv::Result<Vec<f32>> {
    let mut cells = Mat::default();
    let size = Size::new(columns as i32, rows as i32);
    grey.with_mat(|grey| imgproc::resize(grey, &mut cells, size, 0.0, 0.0, imgproc::INTER_AREA))?;
    let cells: Vec<f32> = cells.data_typed::<u8>()?.iter().map(|cell| f32::from(*cell)).collect();
    let count = cells.len().max(1) as f32;
    let mean = cells.iter().sum::<f32>() / count;
    let deviation = (cells.iter().map(|cell| (cell - mean).powi(2)).sum::<f32>() / count).sqrt().max(8.0);
    Ok(cells.into_iter().map(|cell| GREY_WEIGHT * (cell - mean) / deviation).collect())
}

/// The correlation of two descriptions in the frequency domain, summed over the channels.
fn correlate(a: &[Spectrum], b: &[Spectrum]) -> Spectrum {
    let size = a.first().map_or(0, Vec::len);
    let mut sum = vec![Complex::default(); size];
    for (a, b) in a.iter().zip(b) {
        for (sum, (a, b)) in sum.iter_mut().zip(a.iter().zip(b)) {
            sum[0] += a[0] * b[0] + a[1] * b[1];
            sum[1] += a[1] * b[0] - a[0] * b[1];
        }
    }
    let scale = 1.0 / (size * a.len()).max(1) as f32;
    sum.into_iter().map(|value| value * scale).collect()
}

fn product(a: Complex, b: Complex) -> Complex {
    Complex::from([a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]])
}

fn sum(a: &[Complex], b: &[Complex]) -> Spectrum {
    a.iter().zip(b).map(|(a, b)| *a + *b).collect()
}

fn blend(old: &mut [Complex], new: &[Complex], rate: f32) {
    for (old, new) in old.iter_mut().zip(new) {
        *old = *old * (1.0 - rate) + *new * rate;
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
            let filter = trained(&person_at(PERSON.x, PERSON.y).luma());
            let moved = person_at(PERSON.x + dx, PERSON.y + dy);
            let ((x, y), value) = peak(&filter.respond(&moved.luma(), PERSON).expect("respond"));
            let grid = filter.grid();
            let cell = (PERSON.width * CONTEXT.0 / grid.columns as f32, PERSON.height * CONTEXT.1 / grid.rows as f32);
            prop_assert!((x as f32 * cell.0 - dx).abs() < cell.0 && (y as f32 * cell.1 - dy).abs() < cell.1, "{x} {y}");
            prop_assert!(value > 0.2, "{value}");
        }
    }

    #[test]
    fn knows_the_person_from_another() {
        let filter = trained(&person_at(PERSON.x, PERSON.y).luma());
        let same = peak(&filter.respond(&person_at(PERSON.x, PERSON.y).luma(), PERSON).expect("respond")).1;
        let mut other = Scene::new(320, 240).background((33.0, 57.0));
        other.paint(PERSON, 1234);
        let other = peak(&filter.respond(&other.luma(), PERSON).expect("respond")).1;
        assert!(same > 0.6 && other < 0.5 * same, "{same} {other}");
    }

    #[test]
    fn the_wall_behind_is_not_learned() {
        // Trained on the person; then the same wall with nobody before it.
        let filter = trained(&person_at(PERSON.x, PERSON.y).luma());
        let same = peak(&filter.respond(&person_at(PERSON.x, PERSON.y).luma(), PERSON).expect("respond")).1;
        let wall = Scene::new(320, 240).background((0.0, 0.0));
        let alone = peak(&filter.respond(&wall.luma(), PERSON).expect("respond")).1;
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
        assert!(peak(&filter.respond(&other.luma(), PERSON).expect("respond")).1 > 0.5);
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
            assert!(filter.respond(&picture.luma(), bounds).expect("respond").at((0, 0)).sum().is_finite());
        }
    }
}
