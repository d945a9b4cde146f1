// SPDX-License-Identifier: MPL-2.0

use opencv::core::Point2f;

use super::kernels;
use super::pyramid::{Level, Pyramid};

/// Steps closer together than this, there and back, are one place, pixels.
const TO_AND_FRO: f32 = 0.01;
/// Smaller eigenvalue of the gradient matrix below which (3.11) is not worth solving, squared grey levels per pixel: OpenCV's 1e-4.
const MIN_EIGENVALUE: f32 = 0.1;

/// When a level is left for the next finer one.
#[derive(Debug, Clone, Copy)]
pub struct Precision {
    /// Steps at most, ...
    pub steps: usize,
    /// ... or when one is no longer than so many pixels.
    pub step: f32,
}

impl Precision {
    /// Of a level: one that is coarser has but to lead to the next.
    fn at(self, level: usize) -> Self {
        Self { step: self.step / scale(level), ..self }
    }
}

/// Where a point was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    pub place: Point2f,
    /// Mean absolute difference of both windows, grey levels.
    pub residual: f32,
}

/// What is around a point, at every level of a pyramid; kept as memory for another.
#[derive(Debug, Default)]
pub struct Template {
    /// Inverse of the gradient matrix G at each level, per pixel (3.11): its upper triangle; `None` where that is not worth solving, or
    /// the point lies outside.
    inverses: Vec<Option<[f32; 3]>>,
    /// Rows of all windows: what is known, and its gradients; see [`kernels`].
    rows: Vec<i16>,
    side: usize,
}

impl Template {
    /// Of a window of `side` pixels (odd, at most 31) around `point`, in the picture and so many halvings of it.
    pub fn take(&mut self, from: &Pyramid, point: Point2f, side: usize, halvings: usize) {
        self.side = side;
        let length = side * kernels::row_length(side);
        let levels = from.levels().iter().take(halvings + 1);
        self.rows.resize(levels.len() * length, 0);
        self.inverses.clear();
        for ((index, level), rows) in levels.enumerate().zip(self.rows.chunks_exact_mut(length)) {
            let first = first_pixel(point * scale(index), side);
            let matrix = start(first, level, side).map(|(x, y, part)| {
                let inside = (inside(x, level.width), inside(y, level.height));
                kernels::take(level.from(x - 1, y - 1), level.stride(), part, inside, side, rows)
            });
            self.inverses.push(matrix.and_then(inverse));
        }
    }

    /// Looks for it in a picture, from `guess` on; `None` where it is lost.
    pub fn follow(&self, to: &Pyramid, guess: Point2f, precision: Precision) -> Option<Found> {
        let length = self.side * kernels::row_length(self.side);
        let levels =
            self.inverses.iter().zip(to.levels()).zip(self.rows.chunks_exact(length)).enumerate().rev();
        let mut place: Option<Point2f> = None;
        for (index, ((inverse, level), rows)) in levels {
            let begin = place.map_or(guess * scale(index), |coarser| coarser * 2.0);
            let settled =
                inverse.and_then(|inverse| self.settle(rows, level, begin, inverse, precision.at(index)));
            if index == 0 {
                let place = settled?;
                return self.residual(rows, level, place).map(|residual| Found { place, residual });
            }
            // A finer level may see what this one does not.
            place = Some(settled.unwrap_or(begin));
        }
        None
    }

    /// Steps from `place` on to where the window fits, at one level; `None` where it leaves the picture.
    fn settle(
        &self,
        rows: &[i16],
        level: &Level,
        place: Point2f,
        inverse: [f32; 3],
        precision: Precision,
    ) -> Option<Point2f> {
        let mut first = first_pixel(place, self.side);
        let mut before = Point2f::default();
        for count in 0..precision.steps {
            let (x, y, part) = start(first, level, self.side)?;
            let [u, v] = kernels::mismatch(rows, level.from(x, y), level.stride(), part, self.side);
            let step = Point2f::new(-(inverse[0] * u + inverse[1] * v), -(inverse[1] * u + inverse[2] * v));
            first += step;
            if step.x * step.x + step.y * step.y <= precision.step * precision.step {
                break;
            }
            let back = step + before;
            if count > 0 && back.x.abs() < TO_AND_FRO && back.y.abs() < TO_AND_FRO {
                first -= step * 0.5;
                break;
            }
            before = step;
        }
        Some(first + half(self.side))
    }

    fn residual(&self, rows: &[i16], level: &Level, place: Point2f) -> Option<f32> {
        let (x, y, part) = start(first_pixel(place, self.side), level, self.side)?;
        Some(kernels::residual(rows, level.from(x, y), level.stride(), part, self.side))
    }
}

/// The inverse of a gradient matrix, if that is worth anything.
fn inverse([xx, xy, yy]: [f32; 3]) -> Option<[f32; 3]> {
    let smaller = 0.5 * (xx + yy - ((xx - yy).powi(2) + 4.0 * xy * xy).sqrt());
    let determinant = xx * yy - xy * xy;
    (smaller >= MIN_EIGENVALUE && determinant > f32::EPSILON)
        .then(|| [yy / determinant, -xy / determinant, xx / determinant])
}

/// Of a level.
fn scale(level: usize) -> f32 {
    1.0 / (1 << level) as f32
}

/// From the first pixel of a window to its middle.
fn half(side: usize) -> Point2f {
    let half = (side as f32 - 1.0) / 2.0;
    Point2f::new(half, half)
}

fn first_pixel(middle: Point2f, side: usize) -> Point2f {
    middle - half(side)
}

/// The whole pixel at which a window starts, and the parts of pixels beyond it; `None` where all of it lies outside.
fn start(first: Point2f, level: &Level, side: usize) -> Option<(isize, isize, (f32, f32))> {
    let (x, y) = (first.x.floor(), first.y.floor());
    let is_near = |at: f32, size: usize| at >= -(side as f32) && at < size as f32;
    (is_near(x, level.width) && is_near(y, level.height)).then_some((
        x as isize,
        y as isize,
        (first.x - x, first.y - y),
    ))
}

/// Which pixels of a row that starts there lie in a picture of that size.
fn inside(start: isize, size: usize) -> std::ops::Range<usize> {
    let first = (-start).max(0) as usize;
    first..((size as isize - start).max(0) as usize).max(first)
}
