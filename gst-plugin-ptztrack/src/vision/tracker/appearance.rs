//! What the target looks like: a correlation filter that says where it is near a place, and how surely.
//!
//! Lucas-Kanade follows points from one frame to the next and forgets; small errors add up, and points
//! slide onto whoever passes in front. A filter trained on the whole body since the beginning does not
//! drift and answers with a low peak when the target is hidden. It is the dual correlation filter of
//! Henriques et al., "High-Speed Tracking with Kernelized Correlation Filters" (2015), over histograms of
//! oriented gradients in cells of 4x4 pixels. All of it happens on a grid of some 500 cells, whatever the size
//! of the target.

use opencv::core::{
    BORDER_REPLICATE, CV_32F, DFT_COMPLEX_OUTPUT, DFT_INVERSE, DFT_REAL_OUTPUT, DFT_SCALE, Mat, Point2f,
    Rect2f, Size, Vec2f,
};
use opencv::imgproc;
use opencv::prelude::*;

use super::geometry::{centre, scaled};
use crate::vision::Luma;

/// Side of a cell in pixels of the template.
const CELL: usize = 4;
/// Cells of the grid, more or less: 64x128 pixels of template.
const CELLS: f32 = 512.0;
/// Orientations told apart, without sign: a dark coat before a bright wall may pass a dark one.
const ORIENTATIONS: usize = 8;
/// What is seen around the target, in widths and heights of it: also how far it is looked for.
const CONTEXT: (f32, f32) = (2.4, 1.6);
/// Width of the desired answer, as a share of the target's size.
const SHARPNESS: f32 = 0.1;
/// Regularisation of the ridge regression.
const RIDGE: f32 = 1e-4;
/// How much the grey of a cell counts against its gradients.
const GREY_WEIGHT: f32 = 0.35;

type Complex = Vec2f;
type Spectrum = Vec<Complex>;

/// What the filter answers.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Answer {
    /// From the middle of the box to where the target is, frame pixels.
    pub offset: Point2f,
    /// About 1 for the picture it was trained on, about 0 for another.
    pub peak: f32,
}

/// A trained filter.
#[derive(Clone)]
pub(super) struct Appearance {
    columns: usize,
    rows: usize,
    window: Vec<f32>,
    label: Spectrum,
    template: Vec<Spectrum>,
    filter: Spectrum,
}

impl Appearance {
    /// Learns what is in `bounds`.
    pub fn new(luma: &Luma, bounds: Rect2f) -> opencv::Result<Self> {
        let (columns, rows) = grid(bounds);
        let mut appearance = Self {
            columns,
            rows,
            window: hann(columns, rows),
            label: Vec::new(),
            template: Vec::new(),
            filter: Vec::new(),
        };
        appearance.label = appearance.spectrum(&label(columns, rows))?;
        let (template, filter) = appearance.train(luma, bounds)?;
        Ok(Self { template, filter, ..appearance })
    }

    /// Looks for the target around `bounds`, at its size. It is expected in the middle, with a deviation of
    /// `spread` times its sides: of two that look alike the nearer one is meant.
    pub fn look(&self, luma: &Luma, bounds: Rect2f, spread: f32) -> opencv::Result<Answer> {
        let seen = self.describe(luma, bounds)?;
        let mut response = correlate(&seen, &self.template);
        response.iter_mut().zip(&self.filter).for_each(|(value, filter)| *value = product(*value, *filter));
        let response = self.inverse(&response)?;
        let (offset, peak) = self.peak(&response, spread);
        let cell = CELL as f32;
        let across = bounds.width * CONTEXT.0 / (self.columns as f32 * cell);
        let down = bounds.height * CONTEXT.1 / (self.rows as f32 * cell);
        let offset = Point2f::new(offset.x * cell * across, offset.y * cell * down);
        Ok(Answer { offset, peak })
    }

    /// Learns what is in `bounds` now; `rate` 0 to 1 is the weight against all that was seen before.
    pub fn learn(&mut self, luma: &Luma, bounds: Rect2f, rate: f32) -> opencv::Result<()> {
        let (template, filter) = self.train(luma, bounds)?;
        for (old, new) in self.template.iter_mut().zip(&template) {
            blend(old, new, rate);
        }
        blend(&mut self.filter, &filter, rate);
        Ok(())
    }

    fn train(&self, luma: &Luma, bounds: Rect2f) -> opencv::Result<(Vec<Spectrum>, Spectrum)> {
        let template = self.describe(luma, bounds)?;
        let power = correlate(&template, &template);
        let filter = self.label.iter().zip(power).map(|(label, power)| *label / (power[0] + RIDGE));
        Ok((template, filter.collect()))
    }

    /// Spectra of the features around `bounds`.
    fn describe(&self, luma: &Luma, bounds: Rect2f) -> opencv::Result<Vec<Spectrum>> {
        let (width, height) = (self.columns * CELL, self.rows * CELL);
        let grey = sample(luma, scaled(bounds, CONTEXT.0, CONTEXT.1), width, height)?;
        let mut channels = features(&grey, self.columns, self.rows)?;
        for channel in &mut channels {
            channel.iter_mut().zip(&self.window).for_each(|(value, weight)| *value *= weight);
        }
        channels.iter().map(|channel| self.spectrum(channel)).collect()
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

    /// Place (in cells, wrapped around 0) and height of the response's peak, finer than a cell.
    fn peak(&self, response: &[f32], spread: f32) -> (Point2f, f32) {
        let wrap = |cell: usize, size: usize| {
            if cell > size / 2 { cell as f32 - size as f32 } else { cell as f32 }
        };
        let (across, down) =
            (spread * self.columns as f32 / CONTEXT.0, spread * self.rows as f32 / CONTEXT.1);
        let expected = |cell: usize| {
            let x = wrap(cell % self.columns, self.columns) / across;
            let y = wrap(cell / self.columns, self.rows) / down;
            response[cell] * (-0.5 * (x * x + y * y)).exp()
        };
        let best = (0..response.len()).max_by(|&a, &b| expected(a).total_cmp(&expected(b))).unwrap_or(0);
        let (x, y) = (best % self.columns, best / self.columns);
        let at = |x: usize, y: usize| response[(y % self.rows) * self.columns + x % self.columns];
        let (left, right) = (at(x + self.columns - 1, y), at(x + 1, y));
        let (above, below) = (at(x, y + self.rows - 1), at(x, y + 1));
        let place = Point2f::new(
            wrap(x, self.columns) + vertex(left, response[best], right),
            wrap(y, self.rows) + vertex(above, response[best], below),
        );
        (place, response[best])
    }
}

/// Columns and rows of cells for a target of that shape; even, and never too few to correlate.
fn grid(bounds: Rect2f) -> (usize, usize) {
    let aspect = (bounds.width * CONTEXT.0 / (bounds.height * CONTEXT.1).max(1.0)).clamp(0.2, 5.0);
    let even = |cells: f32| 2 * (cells / 2.0).round() as usize;
    (even((CELLS * aspect).sqrt()), even((CELLS / aspect).sqrt()))
}

/// Where the parabola through three neighbouring values peaks, -0.5 to 0.5 from the middle one.
fn vertex(before: f32, middle: f32, after: f32) -> f32 {
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

/// `area` of the frame at `width` x `height`, the border repeated where it leaves the frame.
fn sample(luma: &Luma, area: Rect2f, width: usize, height: usize) -> opencv::Result<Mat> {
    // Taking one pixel of many would see patterns that are not there: take up to 3x3 and average them.
    let fine = (area.width / width as f32).round().clamp(1.0, 3.0);
    let size = Size::new((width as f32 * fine) as i32, (height as f32 * fine) as i32);
    let (across, down) = (area.width / size.width as f32, area.height / size.height as f32);
    let middle = centre(area);
    let corner =
        middle - Point2f::new(area.width - across, area.height - down) / 2.0 - Point2f::new(0.5, 0.5);
    let matrix = Mat::from_slice_2d(&[[across, 0.0, corner.x], [0.0, down, corner.y]])?;
    let flags = imgproc::INTER_LINEAR | imgproc::WARP_INVERSE_MAP;
    let mut grey = Mat::default();
    luma.with_mat(|mat| {
        imgproc::warp_affine(mat, &mut grey, &matrix, size, flags, BORDER_REPLICATE, Default::default())
    })?;
    let mut coarse = Mat::default();
    let size = Size::new(width as i32, height as i32);
    imgproc::resize(&grey, &mut coarse, size, 0.0, 0.0, imgproc::INTER_AREA)?;
    Ok(coarse)
}

/// Normalised histograms of oriented gradients of each cell, and its grey: one plane for each.
fn features(grey: &Mat, columns: usize, rows: usize) -> opencv::Result<Vec<Vec<f32>>> {
    let (mut dx, mut dy) = (Mat::default(), Mat::default());
    imgproc::sobel(grey, &mut dx, CV_32F, 1, 0, 1, 1.0, 0.0, BORDER_REPLICATE)?;
    imgproc::sobel(grey, &mut dy, CV_32F, 0, 1, 1, 1.0, 0.0, BORDER_REPLICATE)?;
    let (mut strength, mut angle) = (Mat::default(), Mat::default());
    opencv::core::cart_to_polar(&dx, &dy, &mut strength, &mut angle, false)?;
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

fn grey_cells(grey: &Mat, columns: usize, rows: usize) -> opencv::Result<Vec<f32>> {
    let mut cells = Mat::default();
    let size = Size::new(columns as i32, rows as i32);
    imgproc::resize(grey, &mut cells, size, 0.0, 0.0, imgproc::INTER_AREA)?;
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

fn blend(old: &mut [Complex], new: &[Complex], rate: f32) {
    for (old, new) in old.iter_mut().zip(new) {
        *old = *old * (1.0 - rate) + *new * rate;
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::Scene;
    use super::*;
    use proptest::prelude::*;

    const PERSON: Rect2f = Rect2f { x: 120.0, y: 70.0, width: 40.0, height: 90.0 };

    fn person_at(x: f32, y: f32) -> super::super::synthetic::Picture {
        let mut picture = Scene::new(320, 240).background((0.0, 0.0));
        picture.paint(Rect2f { x, y, ..PERSON }, 7);
        picture
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]
        #[test]
        fn finds_the_person_nearby(dx in -16.0_f32..16.0, dy in -16.0_f32..16.0) {
            let appearance = Appearance::new(&person_at(PERSON.x, PERSON.y).luma(), PERSON).expect("learn");
            let moved = person_at(PERSON.x + dx, PERSON.y + dy);
            let answer = appearance.look(&moved.luma(), PERSON, 1.0).expect("look");
            prop_assert!((answer.offset.x - dx).abs() < 2.0 && (answer.offset.y - dy).abs() < 2.0, "{answer:?}");
            prop_assert!(answer.peak > 0.25, "{answer:?}");
        }
    }

    #[test]
    fn knows_the_person_from_another() {
        let appearance = Appearance::new(&person_at(PERSON.x, PERSON.y).luma(), PERSON).expect("learn");
        let same = appearance.look(&person_at(PERSON.x, PERSON.y).luma(), PERSON, 1.0).expect("look");
        let mut other = Scene::new(320, 240).background((33.0, 57.0));
        other.paint(PERSON, 1234);
        let other = appearance.look(&other.luma(), PERSON, 1.0).expect("look");
        assert!(same.peak > 0.9, "{same:?}");
        assert!(other.peak < 0.3, "{other:?}");
    }

    #[test]
    fn learning_takes_over() {
        let mut appearance = Appearance::new(&person_at(PERSON.x, PERSON.y).luma(), PERSON).expect("learn");
        let mut other = Scene::new(320, 240).background((33.0, 57.0));
        other.paint(PERSON, 1234);
        for _ in 0..10 {
            appearance.learn(&other.luma(), PERSON, 0.5).expect("learn");
        }
        assert!(appearance.look(&other.luma(), PERSON, 1.0).expect("look").peak > 0.8);
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
            let appearance = Appearance::new(&picture.luma(), bounds).expect("learn");
            assert!(appearance.look(&picture.luma(), bounds, 1.0).expect("look").peak.is_finite());
        }
    }
}
